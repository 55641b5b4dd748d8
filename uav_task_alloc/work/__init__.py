# SPDX-License-Identifier: Apache-2.0
"""Work that is more than a point: lines, areas and orbits, cut into pieces that are tasks."""
