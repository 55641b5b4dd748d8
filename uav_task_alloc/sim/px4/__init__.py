# SPDX-License-Identifier: Apache-2.0
"""PX4 as a simulated autopilot."""
