# SPDX-License-Identifier: Apache-2.0
"""What one vehicle should have on board: its list less what is flown, refused or beyond space."""
from __future__ import annotations

from collections import deque
from dataclasses import dataclass, replace

from uav_task_alloc.errors import MissionError
from uav_task_alloc.geometry.frames import Origin
from uav_task_alloc.mavlink.autopilots import Profile
from uav_task_alloc.mavlink.mission.first_leg import FirstLeg
from uav_task_alloc.mavlink.mission.horizon import Horizon
from uav_task_alloc.mavlink.mission.items import (
    MOST_ITEMS,
    Item,
    TaskList,
    all_alike,
    mission_items,
)
from uav_task_alloc.mavlink.mission.long_legs import first_point, with_points_between
from uav_task_alloc.mavlink.mission.progress import ProgressTable
from uav_task_alloc.mavlink.mission.task_progress import TaskProgress
from uav_task_alloc.mavlink.transport.notes import OperatorNote
from uav_task_alloc.model import Task


@dataclass(frozen=True, slots=True)
class TaskFailed:
    """A task that this vehicle does not take."""

    task: str
    reason: str
    revision: int  # of the list that it was asked for in


class WantedMission:
    """The latest list of one vehicle, and the items that are still to be flown of it."""

    def __init__(self, profile: Profile, origin: Origin, progress: ProgressTable) -> None:
        self.tasks: TaskList | None = None
        self.horizon = Horizon()
        self.failed: deque[TaskFailed] = deque()
        self.notes: deque[OperatorNote] = deque()
        self._room = MOST_ITEMS - int(profile.rules.home_first)
        self._profile, self._origin, self._progress = profile, origin, progress
        self._refused: dict[str, tuple[Task, str]] = {}  # as it was, and why
        self.leg = FirstLeg(profile.rules.loiters, profile.farthest_first)
        self._asked: object = None  # what the first leg is of
        self._items: tuple[object, tuple[Item, ...]] | None = None
        self._listed: dict[str, int] = {}  # the last revision with a task that was not completed
        self._away: frozenset[str] = frozenset()  # completed tasks that a later list did not have

    def assign(self, tasks: TaskList) -> None:
        """The latest list; a task that was refused is tried again where it has changed."""
        self.tasks = tasks
        self.horizon.reset()
        asked = [stop.task for stop in tasks.stops]
        self._progress.set_listed_tasks(asked)
        ids, completed = {task.id for task in asked}, self._progress.completed.keys()
        self._away = (self._away | (completed - ids)) & completed
        self._listed.update(dict.fromkeys(ids - completed, tasks.revision))
        for task in asked:
            if self._refused.get(task.id, (task, ''))[0] != task:
                del self._refused[task.id]

    def ended_before(self) -> list[TaskProgress]:
        """How those tasks of the list ended that it should not have any more."""
        assert self.tasks is not None
        completed = self._progress.completed
        ids, revision = [stop.task.id for stop in self.tasks.stops], self.tasks.revision
        return [TaskProgress(i, 'COMPLETED', self._flown_in(i)) for i in ids if i in completed] + [
            TaskProgress(i, 'FAILED', revision, self._refused[i][1])
            for i in ids if i in self._refused and i not in completed]

    def _flown_in(self, task: str) -> int:
        """The revision that it was flown under, if a list came without it; else the latest."""
        assert self.tasks is not None
        latest = self.tasks.revision
        return self._listed.get(task, latest) if task in self._away else latest

    def repeat(self, task: str) -> bool:
        """The list still asks for a task that was flown, and the allocator has heard of that.

        Returns whether it is another task of that id: then a list in between did not have it.
        """
        assert self.tasks is not None
        if task not in self._away or task not in self._listed or self.tasks.find(task) is None:
            return False
        self._progress.forget(task)
        self._away -= {task}
        self._listed[task] = self.tasks.revision
        return True

    def remaining(self) -> TaskList:
        """The list less what is flown or refused, up to the horizon."""
        assert self.tasks is not None
        tasks = self.tasks.without({
            *self._progress.completed, *self._progress.pending, *self._refused})
        return tasks if self.horizon.stops is None else tasks.first(self.horizon.stops)

    def items(self) -> tuple[Item, ...]:
        """The items to fly from here; a task that cannot be one is refused."""
        asked = (self.tasks, len(self._progress.completed), self._progress.pending,
                 len(self._refused), self.horizon.stops)
        if self._asked != asked or self.leg.is_off:
            self.leg.begin(self.remaining())
            self._asked = asked
        key = (asked, self.leg.version, self.leg.passed)
        if self._items is not None and self._items[0] == key:
            return self._items[1]
        remaining = self.remaining()
        try:
            items = self._items_of(remaining)
        except MissionError as error:
            self.refuse(error.task, str(error), remaining)
            return self.items()
        if len(items) > self._room:
            self._cut(items, remaining)
            return self.items()
        self._items = key, items
        return items

    def _items_of(self, tasks: TaskList) -> tuple[Item, ...]:
        """With points in between on long legs, where a mission has room for them."""
        rules = self._profile.rules
        filled = mission_items(with_points_between(tasks, self.leg.points_ahead(first_point(tasks))),
                               rules, self._origin)
        if len(filled) > self._room and len(tasks.stops) <= 1:
            return mission_items(tasks, rules, self._origin)
        return filled

    def _cut(self, items: tuple[Item, ...], tasks: TaskList) -> None:
        """More than a mission can hold: the first tasks only; none where even one does not fit."""
        stops = min(sum(item.completes for item in items[:self._room]), len(tasks.stops) - 1)
        if stops > 0:
            self.notes.append(
                OperatorNote('warning', self.horizon.cut(stops, len(items), self._room))
            )
        else:
            task = tasks.stops[0].task.id
            self.refuse(task, f'task {task}: {len(items)} mission items: expected at most '
                        f'{self._room}, which is what a mission holds', tasks)

    def open_tasks(self) -> tuple[Task, ...]:
        """Those of the list that are still to be flown, and can be."""
        return tuple(stop.task for stop in self.remaining().stops) if self.items() else ()

    def refuse(self, task: str, reason: str, tasks: TaskList) -> None:
        """Not to be flown as it is in that list; what has changed since is yet to be tried."""
        asked, latest = tasks.find(task), self.tasks.find(task) if self.tasks else None
        if asked is not None and latest in (None, asked):
            self._refused[task] = asked, reason
            self.failed.append(TaskFailed(task, reason, tasks.revision))

    def infeasible(self, reason: str) -> None:
        """The vehicle stores the mission, and will not fly it."""
        assert self.tasks is not None
        for task in {item.task: None for item in self.items() if item.completes}:
            self.refuse(task, f'infeasible: {reason}', self.tasks)

    def has_enough(self, held: tuple[Item, ...]) -> bool:
        """While half a horizon of the latest list is still on board, nothing is uploaded."""
        assert self.tasks is not None
        everything = replace(
            self.tasks.without({*self._progress.completed, *self._refused}),
            returns=False, end_via=())
        wanted = self._items_of(everything)
        rest = held[self._progress.current or 0:]
        stops = sum(item.completes for item in rest)
        first = next((n for n, item in enumerate(wanted) if item.completes), 0)
        return stops >= max(1, (self.horizon.stops or 0) // 2) and any(
            all_alike(wanted[n:n + len(rest)], rest) for n in range(first + 1))
