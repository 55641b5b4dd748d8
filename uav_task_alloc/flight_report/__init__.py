# SPDX-License-Identifier: Apache-2.0
"""The report of a recorded flight: data (flight_history), figures (figures), HTML (page)."""
