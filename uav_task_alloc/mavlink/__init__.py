# SPDX-License-Identifier: Apache-2.0
"""MAVLink without ROS: upload and readback, progress, profiles, links and simulated vehicles."""
