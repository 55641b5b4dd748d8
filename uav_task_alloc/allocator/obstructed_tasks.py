# SPDX-License-Identifier: Apache-2.0
"""Tasks at which a UAV hovers that the allocator does not fly: put off until it has left."""
from __future__ import annotations

import math
from collections.abc import Collection
from itertools import pairwise

from uav_task_alloc.allocator.state.world import World
from uav_task_alloc.geometry.polyline import segment_distance
from uav_task_alloc.model import Task
from uav_task_alloc.separation.rule import Separation

_SPARE = 1.5  # times the distance, as a UAV that holds goes on where its way is free by more


class ObstructedTasks:
    """Keeps `World.obstructed`: the first tasks of UAVs that have held for such a UAV for long.

    Args:
        world: of the allocator.
    """

    def __init__(self, world: World) -> None:
        self._world = world
        self._by: dict[str, str] = {}  # id of the UAV that hovers, by that of the task

    def update(self, long_waits: Collection[tuple[str, str]], standing: Collection[str],
               rule: Separation) -> bool:
        """Add the tasks that are obstructed now, and drop those that are not any more.

        Args:
            long_waits: ids of a UAV that holds, and of one of `standing` that it waits for.
            standing: ids of the UAVs that hover and that the allocator does not fly.
            rule: that is kept.

        Returns:
            Whether they have changed, so that a plan is due.
        """
        records, before = self._world.tasks.records, self._by.copy()
        self._by = {task_id: uav_id for task_id, uav_id in before.items()
                    if uav_id in standing and task_id in records
                    and self._is_at(uav_id, records[task_id].task, rule)}
        for holder, uav_id in long_waits:
            stops = self._world.list_of(holder).stops
            if stops and self._is_at(uav_id, stops[0].task, rule):
                self._by[stops[0].task.id] = uav_id
        self._world.obstructed = {
            task_id: f'{uav_id} hovers there, and is not flown by the allocator'
            for task_id, uav_id in self._by.items()}
        return self._by != before

    def _is_at(self, uav_id: str, task: Task, rule: Separation) -> bool:
        """Whether a UAV is too near to the place or the path of a task."""
        record, points = self._world.uav_records().get(uav_id), task.path or (task.position,)
        if record is None or not rule.on:
            return False
        far = min(segment_distance(record.report.position, a, b)
                  for a, b in pairwise((points[0], *points)))
        return far < _SPARE * math.hypot(rule.horizontal, rule.vertical)
