# SPDX-License-Identifier: Apache-2.0
"""What orders make of lists: tasks in the order that was given, and lists that wait for a UAV."""
from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, replace

from uav_task_alloc.allocator.state.fleet import Fleet
from uav_task_alloc.allocator.state.flights import Flights, top_of
from uav_task_alloc.allocator.state.locked_tasks import can_fly
from uav_task_alloc.allocator.state.published_lists import PublishedLists
from uav_task_alloc.allocator.state.safe_paths import GetSafePaths, SafePaths
from uav_task_alloc.allocator.state.tasks import TaskRegistry, without_failed
from uav_task_alloc.model import Leg, Point, Task, Uav


@dataclass(frozen=True, slots=True)
class TaskSequence:
    """The tasks that a UAV flies next by an order."""

    flown: tuple[str, ...]  # open, and within its range and endurance in this order
    left_out: tuple[str, ...] = ()  # open, from the first one on that it cannot reach so
    why: str = ''  # it cannot reach that one


class OrderedTasks:
    """Follows the orders in force with the present tasks and UAVs.

    `paths()` are those around the present zones, `uav(uav_id)` is a known UAV for the solver.
    """

    def __init__(self, tasks: TaskRegistry, flights: Flights, fleet: Fleet, lists: PublishedLists,
                 paths: GetSafePaths, uav: Callable[[str], Uav]) -> None:
        self._tasks, self._flights, self._fleet, self._lists = tasks, flights, fleet, lists
        self._paths, self._uav = paths, uav

    def sequences(self, returns: bool) -> dict[str, TaskSequence]:
        """Return the ordered tasks of each usable UAV that has any.

        Args:
            returns: a UAV has to come home afterwards.
        """
        found = {}
        for uav_id in self._fleet.usable_ids():
            open_ids = self._open(uav_id)
            if open_ids:
                found[uav_id] = self._sequence(uav_id, open_ids, returns)
        return found

    def _open(self, uav_id: str) -> tuple[str, ...]:
        """The tasks of its order that are still to be flown, and that it may fly."""
        return tuple(task_id for task_id in self._fleet.orders.sequence(uav_id)
                     if can_fly(self._tasks, self._fleet, uav_id, task_id))

    def _sequence(self, uav_id: str, open_ids: tuple[str, ...], returns: bool) -> TaskSequence:
        active, paths, loads = self._active(uav_id), self._paths(), self._loads(uav_id)
        lead = active if active and active not in open_ids else ''
        tasks = [self._tasks.records[task_id].task for task_id in filter(None, (lead, *open_ids))]
        uav = self._flights.spendable(self._uav(uav_id), max(map(top_of, tasks)))
        place, metres, seconds, now = uav.position, 0.0, 0.0, self._in_air_at(uav)
        for n, task in enumerate(tasks, -1 if lead else 0):
            length, time = _costs(uav, place, task.position, paths)
            metres += length + task.path_length
            seconds = max(seconds + time, task.earliest - now, task.release - now + time)
            seconds += task.stay + self._flights.stop_time + task.path_length / uav.cruise_speed
            place = task.end
            back = _costs(uav, place, uav.base, paths) if returns else (0.0, 0.0)
            why = loads.why_not(task) or _why(uav, task.id, metres + back[0], seconds + back[1])
            if n >= 0 and why:
                return TaskSequence(open_ids[:n], open_ids[n:], why)
        return TaskSequence(open_ids)

    def _in_air_at(self, uav: Uav) -> float:
        """When a UAV was at its position [s] clock of the node; inf where waits cost nothing."""
        return math.inf if self._is_at_base(uav) else self._flights.reported_at(uav.id)

    def _is_at_base(self, uav: Uav) -> bool:
        return uav.at_base or self._flights.at_home_since(uav.id) is not None

    def _loads(self, uav_id: str) -> _Loads:
        uav = self._uav(uav_id)
        listed = self._lists.get(uav_id).task_ids
        return _Loads(uav, None if self._is_at_base(uav) else listed)

    def _active(self, uav_id: str) -> str:
        active = self._fleet.active.get(uav_id, '')
        return active if can_fly(self._tasks, self._fleet, uav_id, active) else ''

    def locked(self, locked: Mapping[str, tuple[str, ...]],
               returns: bool) -> dict[str, tuple[str, ...]]:
        """Return the locked tasks with ordered ones right after the task under way.

        Args:
            locked: task ids by UAV, in the order of flight.
            returns: see `sequences`.
        """
        ordered = dict(locked)
        for uav_id, each in self.sequences(returns).items():
            ordered[uav_id] = self._in_order(uav_id, locked.get(uav_id, ()), each.flown)
        return {uav_id: task_ids for uav_id, task_ids in ordered.items() if task_ids}

    def tasks_to_plan(self, hold: bool, returns: bool) -> tuple[Task, ...]:
        """Return the open tasks as orders allow them, less those that stay with their UAVs.

        Those of a paused UAV may wait for it. After a restart those of an unusable UAV may have
        been flown while the allocator was down; the bridge repeats the event when they are listed.

        Args:
            hold: no task changes its UAV yet, after a restart.
            returns: see `sequences`.
        """
        orders, usable = self._fleet.orders, frozenset(self._fleet.usable_ids())
        known = frozenset(self._fleet.records)
        kept = {task_id for task_ids in self.kept().values() for task_id in task_ids}
        kept.update(task_id for uav_id, each in self._lists.lists.items() if hold
                    and uav_id not in usable for task_id in each.task_ids)
        out = {task_id for each in self.sequences(returns).values() for task_id in each.left_out}
        tasks = [without_failed(record, usable) for record in self._tasks.open()
                 if record.task.id not in kept]
        return tuple(replace(task, allowed_uavs=frozenset()) if task.id in out
                     else orders.narrowed(task, known) for task in tasks)

    def _in_order(self, uav_id: str, task_ids: tuple[str, ...],
                  first: tuple[str, ...]) -> tuple[str, ...]:
        """Tasks with those of an order first, but for the task under way."""
        active = self._active(uav_id)
        lead = (active,) if active and active in task_ids[:1] and active not in first else ()
        return (*lead, *first, *(t for t in task_ids if t not in first and t not in lead))

    def kept(self) -> dict[str, tuple[str, ...]]:
        """Return the lists of paused UAVs whose tasks wait for them, as task ids by UAV."""
        fleet, found = self._fleet, {}
        for uav_id in fleet.records:
            if fleet.orders.keeps_tasks(uav_id) and fleet.ready(uav_id):
                listed = tuple(task_id for task_id in self._lists.get(uav_id).task_ids
                               if can_fly(self._tasks, fleet, uav_id, task_id))
                first = tuple(t for t in self._open(uav_id) if t in listed)
                found[uav_id] = self._in_order(uav_id, listed, first)
        return found

    def breaks(self, uav_id: str) -> bool:
        """Return whether the list in force of a UAV breaks the order of its tasks."""
        listed, ordered = self._lists.get(uav_id).task_ids, self._open(uav_id)
        if not ordered:
            return False
        active = self._active(uav_id)
        rest = listed[1:] if listed[:1] == (active,) and active not in ordered else listed
        first = tuple(t for t in ordered if t in listed)
        return rest[:len(first)] != first


class _Loads:
    """Payloads of the tasks of one trip, in their order.

    Args:
        uav: that takes them on.
        aboard: ids of tasks whose payload it has on board in the air; None: it is at its base.
    """

    def __init__(self, uav: Uav, aboard: Collection[str] | None) -> None:
        self._uav, self._aboard, self._sum = uav, aboard, 0.0

    def why_not(self, task: Task) -> str:
        """Why the payload of the next task cannot be taken along; '' where it can."""
        if task.payload <= 0.0 or (self._aboard is not None and task.id in self._aboard):
            return ''
        if self._aboard is not None:
            return f'{self._uav.id} is in the air without the payload of {task.id}'
        self._sum += task.payload
        if self._sum > self._uav.payload_capacity:
            return (f'{task.id} in this order is beyond the capacity of {self._uav.id}: payloads '
                    f'of {self._sum:g} kg, {self._uav.payload_capacity:g} kg at most')
        return ''


def _costs(uav: Uav, place: Point, goal: Point, paths: SafePaths) -> tuple[float, float]:
    """Metres and seconds from a place to another; inf where no safe path leads there."""
    leg: Leg | None = paths.leg(place, goal)
    if leg is None:
        return math.inf, math.inf
    from uav_task_alloc.geometry.flight_time import flight_time  # imports numba
    return leg.length, flight_time(uav, (place, *leg.via, goal))


def _why(uav: Uav, task_id: str, metres: float, seconds: float) -> str:
    """Why a UAV cannot fly a task after so many metres and seconds; '' where it can."""
    if metres == math.inf:
        return f'no safe path leads {uav.id} to {task_id} in this order'
    if metres > uav.range:
        return (f'{task_id} in this order is beyond the range of {uav.id}: it needs '
                f'{metres:.0f} m and has {uav.range:.0f} m left')
    if seconds > uav.endurance:
        return (f'{task_id} in this order is beyond the endurance of {uav.id}: it needs '
                f'{seconds:.0f} s and has {uav.endurance:.0f} s left for its tasks')
    return ''
