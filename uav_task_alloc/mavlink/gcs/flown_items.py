# SPDX-License-Identifier: Apache-2.0
"""Which items a vehicle has flown that belong to no task yet, and the tasks at their places."""
from __future__ import annotations

import math
from collections.abc import Iterable

from uav_task_alloc.geometry.frames import Origin
from uav_task_alloc.geometry.polyline import segment_distance
from uav_task_alloc.mavlink.gcs.seen_passed import SeenPassed
from uav_task_alloc.mavlink.mission.items import Item, MissionStop, alike, with_position
from uav_task_alloc.mavlink.mission.progress import ProgressTable
from uav_task_alloc.mavlink.mission.stop_items import place_of
from uav_task_alloc.mavlink.mission.task_items import TaskItems
from uav_task_alloc.model import Point, Task

_SAME_PLACE = 1.0  # [m]
_MAX_MISSIONS = 4  # that were read and are kept
MAX_AGE = 60.0  # [s] after the restart; a later task at the same position is a new one
_NAMED_AGE = 3540.0  # [s] more, where it is a task of the previous run, which recorded its id


class FlownItems:
    """The items that were flown before the bridge knew of which task they are.

    Args:
        origin: of the local ENU frame.
        progress: table of the onboard mission.
        tasks: makes the items of a task.
    """

    def __init__(self, origin: Origin, progress: ProgressTable, tasks: TaskItems) -> None:
        self._origin, self._progress, self._tasks = origin, progress, tasks
        self.unflown: dict[str, Point] = {}  # [m] ENU, by task; skipped by another station
        self.reported: set[str] = set()  # flown and reported by the previous run
        self.ahead: dict[str, Point] = {}  # [m] ENU, by id; the next tasks of the previous run
        self.seen_passed = SeenPassed()
        self._missions: tuple[tuple[Item, ...], ...] = ()  # read so far
        self.reset()

    def note_mark(self, task: str, place: Point, flown: bool) -> None:
        """Take a task that the previous run has reported as flown, or as skipped by another."""
        if flown:
            self.reported.add(task)
        else:
            self.unflown[task] = place

    def reset(self) -> None:
        """Forget the flown items: the vehicle was restarted, or is another one."""
        self.skipped: frozenset[int] = frozenset()  # earlier items that were not flown
        self.old: tuple[Item, ...] = ()  # flown in the previous run
        self._epoch, self._located_at = -1, 0  # epoch and seq of the location
        self._until = -math.inf  # [s]
        self._reached: tuple[Item, ...] = ()  # those of `_flown` with a REACHED
        self._known_reached = 0  # how many had one at the last call of `_items`
        self._flown: tuple[Item, ...] = ()  # of missions that were replaced

    def note_mission(self, held: tuple[Item, ...]) -> None:
        """Keep a mission that was read."""
        self._missions = (*self._missions[-_MAX_MISSIONS:], held)

    def located(self, at: int) -> None:
        """Take the item at which the vehicle is in the mission that the table has just begun."""
        self._epoch, self._located_at = self._progress.epoch, at

    def credit_until(self, now: float) -> None:
        """Credit tasks for `MAX_AGE` from steady time `now` [s] on."""
        self._until = now + MAX_AGE

    def add(self, passed: tuple[Item, ...], reached: bool = True) -> None:
        """Add items that are known to be flown.

        Args:
            passed: the items.
            reached: whether that is sure, as by a REACHED.
        """
        self._flown += passed
        if reached:
            self._reached += passed

    def keep(self) -> None:
        """Keep the flown items of this mission before it is replaced."""
        here = self._here()
        self._flown, self._reached = self._flown + here, self._reached + self._reached_of(here)

    def count(self, now: float) -> int:
        """How many flown items and tasks are known; it changes where `tasks_among` may."""
        if not self._flown and self._progress.epoch != self._epoch:  # as at most calls
            self._known_reached = 0
            return self.seen_passed.count(now)
        return len(self._items(now)) + self.seen_passed.count(now)

    def _items(self, now: float) -> tuple[Item, ...]:
        """Flown items that were not reported; none when no task can be credited any more."""
        here = self._here()
        if not here and not self._flown:
            self._known_reached = 0
            return ()
        reached = len(self._reached) + len(self._reached_of(here))
        if reached > self._known_reached:
            self._until = now + MAX_AGE
        self._known_reached = reached
        return (*self._flown, *here) if now < self._until + _NAMED_AGE * bool(self.ahead) else ()

    def tasks_among(self, tasks: Iterable[Task], now: float) -> tuple[Task, ...]:
        """The given tasks that are among the flown items, or were seen passed before."""
        tasks = tuple(tasks)
        flown, seen = self._items(now), self.seen_passed.among(tasks, now)
        if not flown:
            return seen
        named = [task for task in tasks if self.ahead.get(task.id) == task.position or (
            now < self._until and not self._is_of_another(task))]
        found = []
        for turned in (False, True):
            stops = tuple(MissionStop(t, reversed=turned) for t in named if t.path or not turned)
            ends = {item.task: item for item in self._tasks.items_of(stops) if item.completes}
            found += [stop.task for stop in stops if stop.task.id in ends and any(
                alike(ends[stop.task.id], other) and self._is_flown(stop.task, other)
                and self._comes_along(stop, other) for other in flown)]
        return tuple(dict.fromkeys((*seen, *found)))

    def _is_of_another(self, task: Task) -> bool:
        """Whether the previous run has recorded the place as that of another task."""
        return task.id not in self.ahead and any(
            math.dist(place, place_of(task)) <= _SAME_PLACE for place in self.ahead.values())

    def _comes_along(self, stop: MissionStop, last: Item) -> bool:
        """Whether the items before the last one of a way are of that way; ways share points."""
        if not stop.task.path:
            return True
        mission = next((each for each in self._missions if any(last is i for i in each)), ())
        at = next((n for n, item in enumerate(mission) if item is last), 0)
        end = with_position(last, self._origin).position
        for item in reversed(mission[:at]):
            place = with_position(item, self._origin).position
            if place is not None and end is not None and math.dist(place, end) > _SAME_PLACE:
                return segment_distance(place, *stop.way[-2:]) <= _SAME_PLACE
        return False

    def _is_flown(self, task: Task, item: Item) -> bool:
        """Whether an item at a task's position was reached, or passed and not skipped."""
        reached = (*self._reached, *self._reached_of(self._here()))
        if any(item is each for each in reached):
            return True
        return self.unflown.get(task.id) != place_of(task) and (
            task.id in self.reported or not any(item is old for old in self.old))

    def _reached_of(self, flown: tuple[Item, ...]) -> tuple[Item, ...]:
        """Those of the flown items on board of which a REACHED was received."""
        items = self._progress.items
        return tuple(item for item in flown if any(
            item is items[n] for n in self._progress.reached_seqs if n < len(items)))

    def _here(self) -> tuple[Item, ...]:
        """Flown items of the onboard mission that belong to no task of the list."""
        progress = self._progress
        if progress.epoch != self._epoch:
            return ()  # read again: earlier items may be of an interrupted transfer
        return tuple(item for n, item in enumerate(progress.items[:progress.current or 0])
                     if not item.task and item.position is None and n not in self.skipped
                     and (n < self._located_at or n in progress.reached_seqs))
