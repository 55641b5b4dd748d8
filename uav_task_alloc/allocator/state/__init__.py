# SPDX-License-Identifier: Apache-2.0
"""State of the allocator: UAVs, tasks, zones, published lists."""
