# SPDX-License-Identifier: Apache-2.0
"""Simulated autopilots that speak MAVLink: ArduCopter and PX4 with their known behaviour."""
