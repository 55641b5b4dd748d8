# SPDX-License-Identifier: Apache-2.0
"""Zones, detours, distances, polylines, polygons and frames; no solver, no ROS."""
