# SPDX-License-Identifier: Apache-2.0
"""Tasks, UAVs, threat zones, routes and plans: frozen, checked values in SI units and ENU."""
from uav_task_alloc.model.plan import Leg, Plan, Route
from uav_task_alloc.model.task import LONG, Point, Task, turned_tasks
from uav_task_alloc.model.uav import BASE_RADIUS, Uav
from uav_task_alloc.model.zone import Shape, ThreatZone

__all__ = ['BASE_RADIUS', 'LONG', 'Leg', 'Plan', 'Point', 'Route', 'Shape', 'Task', 'ThreatZone',
           'Uav', 'turned_tasks']
