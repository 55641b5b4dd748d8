# SPDX-License-Identifier: Apache-2.0
"""What `plan` refuses, with value, expectation and place."""
from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from numbers import Integral
from typing import TypeVar

from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.model import Task, ThreatZone, Uav, check_number

Named = TypeVar('Named', Task, Uav, ThreatZone)
ROUTE_ENDS = ('hold', 'home')
LONGEST = 86_400.0  # [s]


def check_unique(kind: str, given: Iterable[Named], wanted: type[Named]) -> tuple[Named, ...]:
    """All of the wanted type, no id twice. Raises InvalidValue."""
    if not isinstance(given, Iterable):
        raise InvalidValue(f'{kind}s', given, f'an iterable of {wanted.__name__}')
    found = tuple(given)
    seen: set[str] = set()
    for each in found:
        if not isinstance(each, wanted):
            raise InvalidValue(f'{kind}s', each, f'a {wanted.__name__}')
        if each.id in seen:
            raise InvalidValue(f'{kind} id', each.id, 'an id used once')
        seen.add(each.id)
    return found


def check_options(budget: float, seed: int, route_end: str, threads: int,
                  max_iterations: int | None) -> None:
    """The options of `plan` that are no objects of the world. Raises InvalidValue."""
    check_number('budget', budget, 0.0, LONGEST)
    if not isinstance(seed, Integral):
        raise InvalidValue('seed', seed, 'an integer')
    if route_end not in ROUTE_ENDS:
        raise InvalidValue('route_end', route_end, f'one of {", ".join(ROUTE_ENDS)}')
    if not isinstance(threads, int) or not 1 <= threads <= 64:
        raise InvalidValue('threads', threads, 'an integer in [1, 64]')
    if max_iterations is not None and (not isinstance(max_iterations, int)
                                       or max_iterations < 0):
        raise InvalidValue('max_iterations', max_iterations, 'an integer in [0, inf) or None')


def check_locked(locked: Mapping[str, Sequence[str]] | None, uavs: Sequence[Uav],
                 tasks: Sequence[Task]) -> dict[str, tuple[Task, ...]]:
    """Locked tasks by UAV; UAVs and tasks that are gone are passed over.

    Raises InvalidValue where two UAVs hold one task.
    """
    if not locked:
        return {}
    known, holder = {task.id: task for task in tasks}, dict[str, str]()
    held: dict[str, tuple[Task, ...]] = {}
    for uav in uavs:
        wanted = locked.get(uav.id, ())
        if isinstance(wanted, str):
            raise InvalidValue(f'locked[{uav.id}]', wanted, 'a sequence of task ids')
        row = [known[task_id] for task_id in dict.fromkeys(wanted) if task_id in known]
        for task in row:
            if task.id in holder:
                raise InvalidValue(f'locked[{uav.id}]', task.id,
                                   f'a task that is not locked to {holder[task.id]}, too')
            holder[task.id] = uav.id
        held[uav.id] = tuple(row)
    return {uav_id: row for uav_id, row in held.items() if row}
