# SPDX-License-Identifier: Apache-2.0
"""The ROS 2 nodes: convert, call the core, convert, publish; the only room that knows rclpy."""
