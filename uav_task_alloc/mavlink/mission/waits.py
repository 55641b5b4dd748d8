# SPDX-License-Identifier: Apache-2.0
"""Where and how long a vehicle waits before its tasks, so that they begin when the plan says.

A wait is a hold at the stop before: one more item there, which belongs to the leg to the task. On
the ground the take-off is later instead. A vehicle that is already on the leg holds at the task.
Items hold for a number of seconds, while plans mean times; so a wait that has become an item stays
as it is until it is more than WAIT_TOLERANCE off. A hold that runs begins again with each upload:
where the rest of the list changes, it becomes what is left of the wait.
"""
from __future__ import annotations

import math
from collections.abc import Container
from dataclasses import dataclass, replace

from uav_task_alloc.mavlink.mission.items import Hold, Item, MissionStop, TaskList
from uav_task_alloc.model import Point

WAIT_TOLERANCE = 5.0  # [s] between a hold on board and that of the plan
SHORTEST = 1.0  # [s] of a hold; a shorter one is left out


@dataclass(frozen=True, slots=True)
class _Wait:
    """The wait before one task, as it is on board."""

    hold: Hold | None  # None: none, or the take-off is later, or it is over
    seconds: float  # [s]
    begin: float  # [s] ROS time of the service that it is for


class Waits:
    """The waits of one vehicle's list, and when it may take off.

    Arguments of methods:
        done: ids of completed tasks.
        active: the item being flown; None: not known.
    """

    def __init__(self) -> None:
        self.version = 0  # of the holds
        self.take_off: tuple[float, float, str] | None = None  # from, until [ROS s]; the task
        self._seen: float | None = None  # [ROS s] when `grounded` was first asked about it
        self._waits: dict[str, _Wait] = {}  # by task id
        self._tasks = TaskList(0)

    def assign(self, tasks: TaskList, done: Container[str], airborne: bool,
               active: Item | None) -> None:
        """Take the waits of a list.

        Args:
            tasks: as received.
            done: ids of completed tasks.
            airborne: whether the vehicle flies.
            active: the item being flown; None: not known.
        """
        waits, last = dict[str, _Wait](), None
        self.take_off = self._seen = None
        for stop in tasks.stops:
            if stop.task.id in done:
                continue
            if last is None and not airborne:
                waits[stop.task.id] = _Wait(None, stop.wait, stop.begin)
                if stop.wait > 0.0:
                    self.take_off = tasks.stamp, tasks.stamp + stop.wait, stop.task.id
            else:
                waits[stop.task.id] = self._wait(stop, last, active)
            last = stop.end
        if airborne:
            self._shorten(waits, tasks, active)
        self._tasks = tasks
        if waits != self._waits:
            self._waits, self.version = waits, self.version + 1

    def _wait(self, stop: MissionStop, last: Point | None, active: Item | None) -> _Wait:
        """The wait before a stop of a vehicle in the air; `last` is the stop before."""
        old, place = self._waits.get(stop.task.id), last or stop.start
        if last is None and old is not None:
            if _is_flown(active, stop):  # it is on the leg, or serves the task
                if stop.wait <= WAIT_TOLERANCE:
                    return replace(old, hold=old.hold if _is_at(old, stop) else None)
            else:  # it waits now, or is about to
                if abs(stop.begin - old.begin) <= WAIT_TOLERANCE:
                    return old
                place = stop.start if old.hold is None else old.hold.place
        same = old is not None and (old.hold is None or old.hold.place == place)
        if old is not None and same and abs(old.seconds - stop.wait) <= WAIT_TOLERANCE and (
                (old.hold is None) == (old.seconds < SHORTEST)):
            return old
        hold = Hold(place, stop.wait) if stop.wait >= SHORTEST else None
        return _Wait(hold, stop.wait, stop.begin)

    def _shorten(self, waits: dict[str, _Wait], tasks: TaskList, active: Item | None) -> None:
        """Give a hold that runs what is left of its wait, where the list is uploaded anyway."""
        first = next(iter(waits), '')
        old = self._waits.get(first)
        if not first or waits[first] is not old or old.hold is None or active is None or (
                active.task != first or not active.holds):
            return
        held = {name: wait.hold for name, wait in waits.items() if wait.hold}
        known = {name: wait.hold for name, wait in self._waits.items()
                 if wait.hold and name in waits}
        if held != known or _route(tasks, first) != _route(self._tasks, first):
            stop = next(stop for stop in tasks.stops if stop.task.id == first)
            left = replace(old.hold, seconds=stop.wait) if stop.wait >= SHORTEST else None
            waits[first] = _Wait(left, stop.wait, stop.begin)

    def note_active(self, tasks: TaskList, active: Item | None) -> None:
        """End the wait before the first of the remaining tasks once the vehicle is past it."""
        stop = tasks.stops[0] if tasks.stops else None
        old = None if stop is None else self._waits.get(stop.task.id)
        if stop is not None and old is not None and old.hold is not None and not _is_at(
                old, stop) and _is_flown(active, stop):
            self._waits[stop.task.id] = replace(old, hold=None)
            self.version += 1

    def with_holds(self, tasks: TaskList) -> TaskList:
        """The list with the holds of its waits."""
        stops = []
        for stop in tasks.stops:
            wait = self._waits.get(stop.task.id)
            hold = None if wait is None else wait.hold
            stops.append(stop if hold == stop.hold else replace(stop, hold=hold))
        return replace(tasks, stops=tuple(stops))

    def grounded(self, clock: float) -> str:
        """What a vehicle on the ground waits for at ROS time `clock` [s]; '': nothing.

        Where the clock of the allocator is ahead, the wait begins now.
        """
        if self.take_off is None:
            return ''
        since, until, task = self.take_off
        self._seen = clock if self._seen is None else self._seen
        if self._seen < since - WAIT_TOLERANCE:
            since, until = self._seen, self._seen + until - since
        # a clock that went back says nothing about the departure
        waits = since - WAIT_TOLERANCE <= clock < until and math.isfinite(until)
        return f'its departure: task {task} begins later' if waits else ''


def _route(tasks: TaskList, first: str) -> tuple[object, ...]:
    """What is flown from a task on, without the waits."""
    stops = list(tasks.stops)
    while stops and stops[0].task.id != first:
        del stops[0]
    return [(stop.task, stop.via, stop.reversed) for stop in stops], tasks.returns, tasks.end_via


def _is_flown(active: Item | None, stop: MissionStop) -> bool:
    """Whether the active item is one after the hold before a stop."""
    return active is not None and active.task == stop.task.id and not active.holds


def _is_at(wait: _Wait, stop: MissionStop) -> bool:
    """Whether a hold is at the task itself, which is after the leg."""
    return wait.hold is not None and wait.hold.place == stop.start
