# SPDX-License-Identifier: Apache-2.0
"""The mission that one vehicle should have: its list less what is completed, refused or cut."""
from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import chain

from uav_task_alloc.errors import MissionError
from uav_task_alloc.geometry.frames import Origin
from uav_task_alloc.mavlink.autopilots import Profile
from uav_task_alloc.mavlink.mission.first_leg import FirstLeg
from uav_task_alloc.mavlink.mission.horizon import Horizon
from uav_task_alloc.mavlink.mission.items import (
    MOST_ITEMS,
    Item,
    MissionStop,
    TaskList,
    all_alike,
    lands_by_item,
    mission_items,
)
from uav_task_alloc.mavlink.mission.long_legs import first_point, with_points_between
from uav_task_alloc.mavlink.mission.piece_mark import PieceMark
from uav_task_alloc.mavlink.mission.progress import ProgressTable
from uav_task_alloc.mavlink.mission.task_progress import TaskProgress
from uav_task_alloc.mavlink.mission.waits import Waits
from uav_task_alloc.mavlink.mission.way_approach import approach, first_clear
from uav_task_alloc.mavlink.mission.way_home import WayHome
from uav_task_alloc.mavlink.transport.notes import OperatorNote
from uav_task_alloc.model import Point, Task, ThreatZone


@dataclass(frozen=True, slots=True)
class TaskFailed:
    """A task that the autopilot of this vehicle refuses."""

    task: str  # id
    reason: str  # a text for users
    revision: int  # of the list with that task


class WantedMission:
    """The latest list of one vehicle, and the items of it that are still to be flown.

    Args:
        profile: of the autopilot.
        origin: of the ENU frame.
        progress: the completed tasks of this vehicle.
        airborne: whether it flies now.
        home: [m] ENU; None: not known.

    Arguments of methods:
        tasks: a list of the allocator.
        task: id.
        reason: text for users.
        held: mission on board.
    """

    def __init__(self, profile: Profile, origin: Origin, progress: ProgressTable,
                 airborne: Callable[[], bool] = lambda: True,
                 home: Callable[[], Point | None] = lambda: None) -> None:
        self.tasks: TaskList | None = None
        self.horizon = Horizon()
        self.failed: deque[TaskFailed] = deque()
        self.notes: deque[OperatorNote] = deque()
        self._capacity = MOST_ITEMS - int(profile.rules.home_first)  # [items]
        self._profile, self._origin, self._progress = profile, origin, progress
        self._refused: dict[str, tuple[Task, str]] = {}  # the task as refused, and the reason
        self.waits = Waits()
        self.perhaps_flown: frozenset[str] = frozenset()  # by another UAV, without the bridge
        # own speed of the vehicle [m/s], whether it is wanted; 0: being read, NaN: not known
        self.read_speed: Callable[[bool], float] = lambda wanted: math.nan
        self.stored_pieces: tuple[PieceMark, ...] = ()  # of the previous run of the bridge
        self.zones: Callable[[], tuple[ThreatZone, ...]] = tuple  # in force
        self.way_home = WayHome(profile.rules.lands, home)
        self._changes_speed = False  # an action of the list does
        self._airborne, self._home = airborne, home
        self.leg = FirstLeg(profile.rules.loiters, profile.farthest_first)
        self._leg_key: object = None  # the state for which the first leg was begun
        self._items: tuple[object, tuple[Item, ...]] | None = None  # cached, with their key
        self._remaining: tuple[object, TaskList] | None = None  # cached, with its key
        self._state: object = None  # what of that key and list decides the items
        # the first and the last revision with a task that was not completed
        self._listed: dict[str, tuple[int, int]] = {}
        self._dropped: frozenset[str] = frozenset()  # completed tasks that a later list dropped
        # list and task to which detour points are left out, and how many of the first ones
        self.left_out: tuple[TaskList, str, int] | None = None

    def assign(self, tasks: TaskList) -> None:
        """Take the latest list; a refused task is tried again where it has changed."""
        first, self.tasks = self.tasks is None, tasks
        start = self.leg.locate()
        self.way_home.begin(None if start is None else start.point)
        self.waits.assign(tasks, self._progress.completed, self._airborne(),
                          self._progress.active)
        self.horizon.reset()
        self._changes_speed = any(action.name == 'speed' for stop in tasks.stops
                                  for action in stop.task.actions)
        listed = [stop.task for stop in tasks.stops]
        self._progress.coverage.set_listed(tasks.stops)
        if first:
            self._progress.coverage.restore(
                self.stored_pieces, tasks.stops, self._progress.path.samples,
                self._progress.path.fastest)
        self._progress.set_listed_tasks(listed)
        ids, completed = {task.id for task in listed}, self._progress.completed.keys()
        self._dropped = (self._dropped | (completed - ids)) & completed
        self._listed.update((task, (self._listed.get(task, (tasks.revision, 0))[0],
                                    tasks.revision)) for task in ids - completed)
        for task in listed:
            if self._refused.get(task.id, (task, ''))[0] != task:
                del self._refused[task.id]

    def ended_before(self) -> list[TaskProgress]:
        """The ends of those tasks of the list that were completed or refused before."""
        assert self.tasks is not None
        completed = self._progress.completed
        ids, revision = [stop.task.id for stop in self.tasks.stops], self.tasks.revision
        return [TaskProgress(i, 'COMPLETED', self._flown_in(i)) for i in ids if i in completed] + [
            TaskProgress(i, 'FAILED', revision, self._refused[i][1])
            for i in ids if i in self._refused and i not in completed]

    def _flown_in(self, task: str) -> int:
        """The revision under which it was flown if a later list dropped it; else the latest."""
        assert self.tasks is not None
        latest = self.tasks.revision
        return self._listed.get(task, (latest, latest))[1] if task in self._dropped else latest

    def revision_with(self, task: str, revision: int) -> int:
        """Return the revision of a received list with a task that is nearest to another one.

        The vehicle may fly the mission of a list before that is verified on board.

        Args:
            task: id.
            revision: of the list that was verified last; 0: none was.
        """
        first, last = self._listed.get(task, (revision, revision)) if revision else (0, 0)
        return min(max(revision, first), last)

    def repeat(self, task: str) -> bool:
        """Fly a completed task again, whose completion the allocator has acknowledged.

        Returns:
            Whether it is another task of that id: a list in between did not have it.
        """
        assert self.tasks is not None
        if task not in self._dropped or task not in self._listed or self.tasks.find(task) is None:
            return False
        self._progress.forget(task)
        self._dropped -= {task}
        self._listed[task] = self.tasks.revision, self.tasks.revision
        return True

    def cruise(self) -> float:
        """The cruise speed of the vehicle [m/s]; 0 while it is being read, NaN: not known."""
        speed = self.read_speed(self._changes_speed) if self._changes_speed else math.nan
        return math.nan if math.isnan(speed) else speed  # one object, as NaN equals itself only so

    @property
    def awaits_speed(self) -> bool:
        """Whether its cruise speed is being read, which an item of the list needs."""
        return self.cruise() == 0.0

    @property
    def awaits_others(self) -> bool:
        """Whether another UAV may have flown one of its tasks while the bridge was down."""
        return bool(self.perhaps_flown) and any(
            task.id in self.perhaps_flown for task in self.open_tasks())

    def remaining(self) -> TaskList:
        """The list less completed and refused tasks, up to the horizon."""
        assert self.tasks is not None
        progress = self._progress
        ended = tuple(progress.completed), progress.pending, tuple(self._refused)
        coverage, way_home = progress.coverage, self.way_home.key
        left_out, horizon = self.left_out, self.horizon.stops
        ways = coverage.pieces.version, coverage.latest
        key = (self.tasks, ended, horizon, ways, left_out, way_home)
        if self._remaining is None or self._remaining[0] != key:
            tasks = self.tasks.without(chain.from_iterable(ended))
            tasks = replace(tasks, stops=self._rests(tasks.stops))
            tasks = self.way_home.of(tasks)
            if self.horizon.stops is not None:
                tasks = tasks.first(self.horizon.stops)
            rest = key[:-1]
            self._remaining = key, tasks
            state = (*rest, tasks.returns, tasks.end_via)
            if state != self._state:
                self._state = state
        return self._remaining[1]

    def items_and_list(self) -> tuple[tuple[Item, ...], TaskList]:
        """The items to fly from here, and the rest of the list that they are of."""
        items = self.items()
        assert self._remaining is not None
        return items, self._remaining[1]

    def leave_out_detours(self) -> bool:
        """Leave out those detour points of the first leg to which a zone is now between.

        The list was planned from where the vehicle was: in a long transfer, or while it waits
        for a better link, it flies on by its old mission.

        Returns:
            Whether points are left out that were not before.
        """
        start, stops = self.leg.locate(), self.remaining().stops
        if start is None or not stops or stops[0].task.path or not stops[0].via:
            return False  # of a way see `approach`
        assert self.tasks is not None
        task, before = stops[0].task.id, self._count_left_out(stops[0])
        first = first_clear(start.point, (*stops[0].via, stops[0].start), self.zones())
        if not first:
            return False  # as planned, or there is no better one
        self.left_out = self.tasks, task, before + first
        return True

    def _count_left_out(self, stop: MissionStop) -> int:
        """How many of the first detour points to a stop are left out."""
        tasks, task, count = self.left_out or (None, '', 0)
        return count if tasks is self.tasks and task == stop.task.id else 0

    def _rests(self, stops: tuple[MissionStop, ...]) -> tuple[MissionStop, ...]:
        """Stops with what is left of their ways, and with the points on which it is reached."""
        rests = [self._progress.coverage.rest(stop) for stop in stops]
        return tuple(
            self._reached(stop, rests[n - 1].end if n else None)
            if stop.task.path and (stop.begun or n == 0) else
            replace(stop, via=stop.via[self._count_left_out(stop):])
            if n == 0 and self.left_out is not None else stop
            for n, stop in enumerate(rests))

    def _reached(self, stop: MissionStop, before: Point | None) -> MissionStop:
        """A stop with a way, reached from the end of the one before; None: from the vehicle."""
        coverage, place = self._progress.coverage, before
        on_way = before is None and coverage.latest == stop.task.id
        if coverage.is_followed(stop):
            return replace(stop, via=())
        if before is None:
            start = self.leg.locate()
            place = None if start is None else start.point
        way = stop.task.path[::-1] if stop.reversed else stop.task.path
        via = approach(stop.via, place, way, coverage.pieces.begin_of_rest(stop), self.zones(),
                       coverage.corridor, on_way)
        return stop if via == stop.via else replace(stop, via=via)

    def items(self) -> tuple[Item, ...]:
        """The items to fly from here; a task that cannot be an item is refused."""
        remaining = self.remaining()
        self.waits.note_active(remaining, self._progress.active)
        state = (self._state, self.waits.version, self.cruise())
        if self._leg_key != state or self.leg.is_off:
            self.leg.begin(remaining)
            self._leg_key = state
        lands = lands_by_item(remaining, self._profile.rules, self._home())
        key = (state, self.leg.version, self.leg.passed, lands)
        if self._items is not None and self._items[0] == key:
            return self._items[1]
        try:
            items = self._items_of(remaining)
        except MissionError as error:
            self.refuse(error.task, str(error), remaining)
            return self.items()
        if len(items) > self._capacity:
            self._cut(items, remaining)
            return self.items()
        self._items = key, items
        return items

    def _items_of(self, tasks: TaskList) -> tuple[Item, ...]:
        """The items of a list, with long legs divided where a mission has the capacity."""
        rules, tasks = self._profile.rules, self.waits.with_holds(tasks)
        on_way = bool(tasks.stops) and self._progress.coverage.is_followed(tasks.stops[0])
        ahead = () if on_way else self.leg.points_ahead(first_point(tasks))
        filled = mission_items(with_points_between(tasks, ahead), rules, self._origin,
                               self._home(), self.cruise())
        if len(filled) > self._capacity and len(tasks.stops) <= 1:
            return mission_items(tasks, rules, self._origin, self._home(), self.cruise())
        return filled

    def _cut(self, items: tuple[Item, ...], tasks: TaskList) -> None:
        """Shorten to the tasks that a mission can hold; refuse a task that does not fit alone."""
        stops = min(sum(item.completes for item in items[:self._capacity]), len(tasks.stops) - 1)
        if stops > 0:
            self.notes.append(
                OperatorNote('warning', self.horizon.cut(stops, len(items), self._capacity))
            )
        else:
            task = tasks.stops[0].task.id
            self.refuse(task, f'task {task}: {len(items)} mission items: expected at most '
                        f'{self._capacity}, which is what a mission holds', tasks)

    def open_tasks(self) -> tuple[Task, ...]:
        """The tasks of the list that are still to be flown and are not refused."""
        return tuple(stop.task for stop in self.remaining().stops) if self.items() else ()

    def refuse(self, task: str, reason: str, tasks: TaskList) -> None:
        """Refuse a task as it is in that list; one that has changed since is still tried."""
        refused, latest = tasks.find(task), self.tasks.find(task) if self.tasks else None
        if refused is not None and latest in (None, refused):
            self._refused[task] = refused, reason
            self.failed.append(TaskFailed(task, reason, tasks.revision))

    def infeasible(self, reason: str) -> None:
        """Refuse all tasks of the mission, which the vehicle stores but does not fly."""
        assert self.tasks is not None
        for task in {item.task: None for item in self.items() if item.completes}:
            self.refuse(task, f'infeasible: {reason}', self.tasks)

    def has_enough(self, held: tuple[Item, ...]) -> bool:
        """Whether at least half a horizon of the latest list is still on board."""
        assert self.tasks is not None
        rest = held[self._progress.current or 0:]
        stops = sum(item.completes for item in rest)
        if stops < max(1, (self.horizon.stops or 0) // 2):
            return False  # the items of a list of thousands take a second
        open_tasks = self.tasks.without({*self._progress.completed, *self._refused})
        everything = replace(open_tasks, returns=False, end_via=(),
                             stops=self._rests(open_tasks.stops))
        wanted = self._items_of(everything)
        first = next((n for n, item in enumerate(wanted) if item.completes), 0)
        return any(all_alike(wanted[n:n + len(rest)], rest) for n in range(first + 1))
