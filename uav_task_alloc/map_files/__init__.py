# SPDX-License-Identifier: Apache-2.0
"""Files of maps and ground stations (KML, KMZ, GeoJSON, .plan, CSV), read as scenarios."""
