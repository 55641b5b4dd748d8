# SPDX-License-Identifier: Apache-2.0
"""Where tasks will come from, and where idle UAVs wait for them; no ROS."""
