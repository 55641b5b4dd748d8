# SPDX-License-Identifier: Apache-2.0
"""The evaluator of all solvers' routes on an instance: coordinates only, independent of them."""
from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.geometry.polyline import polyline_length
from uav_task_alloc.model import Task, Uav
from uav_task_alloc.study.instances import Instance

_TOLERANCE = 1e-9  # share of a range by which a route may exceed it: rounding

RoutesByUav = Mapping[str, Sequence[str]]  # UAV id -> task ids in order
TripsByUav = Mapping[str, Sequence[Sequence[str]]]  # UAV id -> task ids of each trip


@dataclass(frozen=True, slots=True)
class Evaluation:
    """Length and value of routes, and the faults that make them invalid."""

    length: float  # [m]
    value: float  # of the tasks served
    missing: int  # tasks that no UAV serves
    faults: tuple[str, ...]

    def is_valid(self, collects: bool) -> bool:
        """Whether they solve the instance: no fault, and no task missing unless it `collects`."""
        return not self.faults and (collects or not self.missing)


def evaluate(instance: Instance, routes: RoutesByUav) -> Evaluation:
    """Evaluate routes of straight legs.

    Args:
        instance: without zones.
        routes: of any solver; unknown or repeated ids and routes beyond range are faults.

    Raises:
        InvalidValue: the instance has zones, around which legs would bend.
    """
    if instance.zones:
        raise InvalidValue('zones', len(instance.zones), 'none: legs are straight here')
    fleet = {uav.id: uav for uav in instance.uavs}
    tasks = {task.id: task for task in instance.tasks}
    faults: list[str] = []
    served: dict[str, str] = {}  # UAV by task id
    total = 0.0
    for uav_id, row in routes.items():
        if uav_id not in fleet:
            faults.append(f'{uav_id} is no UAV')
            continue
        for task_id in row:
            if task_id not in tasks:
                faults.append(f'{uav_id} serves {task_id}, which is no task')
            elif task_id in served:
                faults.append(f'{uav_id} serves {task_id}, which {served[task_id]} serves')
            served[task_id] = uav_id
        uav = fleet[uav_id]
        length = _route_length(uav, [tasks[each] for each in row if each in tasks],
                               returns=instance.route_end == 'home' and bool(row))
        if length > uav.range * (1.0 + _TOLERANCE):
            faults.append(f'{uav_id} flies {length:.9g} m, its range is {uav.range:.9g} m')
        total += length
    known = served.keys() & tasks.keys()
    return Evaluation(total, math.fsum(tasks[each].value for each in known),
                      len(tasks) - len(known), tuple(faults))


def _route_length(uav: Uav, tasks: Sequence[Task], returns: bool) -> float:
    """[m] from the UAV over its tasks, and home where it returns."""
    stops = [uav.position, *(task.position for task in tasks)]
    return polyline_length([*stops, uav.home or uav.position] if returns else stops)
