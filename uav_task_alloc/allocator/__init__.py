# SPDX-License-Identifier: Apache-2.0
"""The allocator without ROS: world state, replanning, persistence, leader election."""
from uav_task_alloc.allocator.core import Allocator

__all__ = ['Allocator']
