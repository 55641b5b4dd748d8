# SPDX-License-Identifier: Apache-2.0
"""The allocator without ROS: a world of events, a schedule of solves, lists that stay calm."""
from uav_task_alloc.allocator.core import Allocator

__all__ = ['Allocator']
