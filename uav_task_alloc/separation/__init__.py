# SPDX-License-Identifier: Apache-2.0
"""Separation of the fleet's own UAVs: volumes of plans, conflicts, resolution; no I/O, no ROS."""
