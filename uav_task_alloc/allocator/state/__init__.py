# SPDX-License-Identifier: Apache-2.0
"""What the allocator knows: UAVs, tasks, zones, published lists."""
