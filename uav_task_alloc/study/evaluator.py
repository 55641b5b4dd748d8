# SPDX-License-Identifier: Apache-2.0
"""Judges anybody's routes on an instance from coordinates alone; it knows no solver."""
from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.study.instances import Instance

_ROUNDING = 1e-9  # share of a range that floating point may add

RoutesByUav = Mapping[str, Sequence[str]]  # UAV id -> task ids in order


@dataclass(frozen=True, slots=True)
class _Judged:
    """What routes are worth, and what is wrong with them."""

    length: float  # [m]
    value: float  # of the tasks served
    missing: int  # tasks that nobody serves
    faults: tuple[str, ...]  # what makes them no answer at all

    def counts(self, collects: bool) -> bool:
        """Whether they answer: no fault, and nothing missing unless choosing is the task."""
        return not self.faults and (collects or not self.missing)


def judge(instance: Instance, routes: RoutesByUav) -> _Judged:
    """Judge routes of straight legs. Raises InvalidValue where zones would bend them."""
    if instance.zones:
        raise InvalidValue('zones', len(instance.zones), 'none: legs are straight here')
    fleet = {uav.id: uav for uav in instance.uavs}
    tasks = {task.id: task for task in instance.tasks}
    faults, seen, total = [], dict[str, str](), 0.0
    for uav_id, row in routes.items():
        if uav_id not in fleet:
            faults.append(f'{uav_id} is no UAV')
            continue
        for task_id in row:
            if task_id not in tasks:
                faults.append(f'{uav_id} serves {task_id}, which is no task')
            elif task_id in seen:
                faults.append(f'{uav_id} serves {task_id}, which {seen[task_id]} serves')
            seen[task_id] = uav_id
        uav = fleet[uav_id]
        stops = [uav.position, *(tasks[each].position for each in row if each in tasks)]
        if instance.route_end == 'home' and row:
            stops.append(uav.home or uav.position)
        length = math.fsum(math.dist(a, b) for a, b in pairwise(stops))
        if length > uav.range * (1.0 + _ROUNDING):
            faults.append(f'{uav_id} flies {length:.9g} m, its range is {uav.range:.9g} m')
        total += length
    served = seen.keys() & tasks.keys()
    return _Judged(total, math.fsum(tasks[each].value for each in served),
                  len(tasks) - len(served), tuple(faults))
