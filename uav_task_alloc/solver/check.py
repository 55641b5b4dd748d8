# SPDX-License-Identifier: Apache-2.0
"""Checks of the arguments of `plan`; errors state value, expectation and place."""
from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from numbers import Integral
from typing import TypeVar

from uav_task_alloc.checks import check_instances, check_names, check_number
from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.model import Task, ThreatZone, Uav
from uav_task_alloc.objective import MAX_TRIPS, Weights
from uav_task_alloc.separation.rule import Separation

_Named = TypeVar('_Named', Task, Uav, ThreatZone)
ROUTE_ENDS = ('hold', 'home')
MAX_BUDGET = 86_400.0  # [s]
MAX_THREADS = 64


def check_unique(kind: str, values: Iterable[_Named],
                 expected: type[_Named]) -> tuple[_Named, ...]:
    """The objects as a tuple; raises InvalidValue for a wrong type or a repeated id."""
    checked = check_instances(f'{kind}s', values, expected)
    seen: set[str] = set()
    for each in checked:
        if each.id in seen:
            raise InvalidValue(f'{kind} id', each.id, 'an id used once')
        seen.add(each.id)
    return checked


def check_options(budget: float, seed: int, route_end: str, threads: int,
                  max_iterations: int | None, trips: int = 1) -> float:
    """Check the scalar options of `plan`; raises InvalidValue. Returns the budget [s]."""
    seconds = check_number('budget', budget, 0.0, MAX_BUDGET)
    if not isinstance(seed, Integral):
        raise InvalidValue('seed', seed, 'an integer')
    if not isinstance(route_end, str) or route_end not in ROUTE_ENDS:
        raise InvalidValue('route_end', route_end, f'one of {", ".join(ROUTE_ENDS)}')
    if not _is_integer(threads) or not 1 <= threads <= MAX_THREADS:
        raise InvalidValue('threads', threads, f'an integer in [1, {MAX_THREADS}]')
    if not _is_integer(trips) or not 1 <= trips <= MAX_TRIPS:
        raise InvalidValue('trips', trips, f'an integer in [1, {MAX_TRIPS}]')
    if max_iterations is not None and (not _is_integer(max_iterations) or max_iterations < 0):
        raise InvalidValue('max_iterations', max_iterations, 'an integer in [0, inf) or None')
    return seconds


def _is_integer(value: object) -> bool:
    """Whether a value is an integer, also one of numpy; True and False are none."""
    return isinstance(value, Integral) and not isinstance(value, bool)


def check_types(hard_range: bool, weights: Weights | None, **functions: object) -> None:
    """Check the options of `plan` that are no numbers.

    Args:
        hard_range, weights: as of `plan`.
        functions: by name; None: it is not given.

    Raises:
        InvalidValue: one is of another type.
    """
    if not isinstance(hard_range, bool):
        raise InvalidValue('hard_range', hard_range, 'True or False')
    if weights is not None and not isinstance(weights, Weights):
        raise InvalidValue('weights', weights, 'Weights or None')
    for name, function in functions.items():
        if function is not None and not callable(function):
            raise InvalidValue(name, function, 'a function')


def check_locked(locked: Mapping[str, Sequence[str]] | None, uavs: Sequence[Uav],
                 tasks: Sequence[Task]) -> dict[str, tuple[Task, ...]]:
    """Locked tasks by UAV id; unknown UAVs and tasks are ignored.

    Raises:
        InvalidValue: a task is locked to two UAVs.
    """
    if locked is not None and not isinstance(locked, Mapping):
        raise InvalidValue('locked', locked, 'task ids by UAV id, or None')
    if not locked:
        return {}
    known, holder = {task.id: task for task in tasks}, dict[str, str]()
    held: dict[str, tuple[Task, ...]] = {}
    for uav in uavs:
        wanted = locked.get(uav.id, ())
        if isinstance(wanted, str) or not isinstance(wanted, Iterable):
            raise InvalidValue(f'locked[{uav.id}]', wanted, 'a sequence of task ids')
        row = [known[task_id] for task_id in dict.fromkeys(wanted) if task_id in known]
        for task in row:
            if task.id in holder:
                raise InvalidValue(f'locked[{uav.id}]', task.id,
                                   f'a task that is not locked to {holder[task.id]}, too')
            holder[task.id] = uav.id
        held[uav.id] = tuple(row)
    return {uav_id: row for uav_id, row in held.items() if row}


def check_separation(separation: Separation) -> Separation:
    """Return the rule that keeps UAVs apart as it is.

    Raises:
        InvalidValue: it is none.
    """
    if not isinstance(separation, Separation):
        raise InvalidValue('separation', separation, 'a Separation or None')
    return separation


def check_reversed(reversed: Iterable[str] | None, locked: Mapping[str, tuple[Task, ...]],
                   before: Iterable[str]) -> frozenset[str]:
    """Return which locked tasks are flown from their last points.

    Args:
        reversed: their ids; None: as in the earlier plan.
        locked: by UAV id.
        before: ids of those of the earlier plan.

    Raises:
        InvalidValue: one may not be flown so.
    """
    held = {task.id: task for row in locked.values() for task in row if task.path}
    if reversed is None:
        return frozenset(name for name in before if name in held and held[name].reversible)
    names = frozenset(name for name in check_names('reversed', reversed) if name in held)
    for name in names:
        if not held[name].reversible:
            raise InvalidValue('reversed', name, 'a task that is reversible')
    return names
