# SPDX-License-Identifier: Apache-2.0
"""Allocates tasks to UAVs as they arrive, around threat zones: a core that knows no ROS."""
from uav_task_alloc.geometry.detour import detour
from uav_task_alloc.model import Plan, Task, ThreatZone, Uav
from uav_task_alloc.solver.registry import SOLVERS
from uav_task_alloc.solver.solve import plan

__all__ = ['SOLVERS', 'Plan', 'Task', 'ThreatZone', 'Uav', 'detour', 'plan']
