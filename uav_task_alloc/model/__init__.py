# SPDX-License-Identifier: Apache-2.0
"""Tasks, UAVs, threat zones, routes and plans: frozen, checked values in SI units and ENU."""
from uav_task_alloc.model.plan import Leg, Plan, Route
from uav_task_alloc.model.task import LONG, PIECE_MARK, Point, Task, piece_id, split_piece_id
from uav_task_alloc.model.uav import BASE_RADIUS, Uav
from uav_task_alloc.model.zone import Shape, ThreatZone

__all__ = ['BASE_RADIUS', 'LONG', 'PIECE_MARK', 'Leg', 'Plan', 'Point', 'Route', 'Shape', 'Task',
           'ThreatZone', 'Uav', 'piece_id', 'split_piece_id']
