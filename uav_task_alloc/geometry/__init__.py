# SPDX-License-Identifier: Apache-2.0
"""Where things are: zones, detours, distances and frames; knows no solver, no ROS."""
