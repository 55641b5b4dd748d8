# SPDX-License-Identifier: Apache-2.0
"""ArduCopter as a simulated autopilot."""
