# SPDX-License-Identifier: Apache-2.0
"""The tasks that one vehicle has completed, and the events of tasks that started or completed."""
from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass

from uav_task_alloc.mavlink.mission.item import Item
from uav_task_alloc.mavlink.mission.position_history import MAX_MESSAGE_DELAY
from uav_task_alloc.mavlink.mission.stop_items import place_of
from uav_task_alloc.model import Point, Task


@dataclass(frozen=True, slots=True)
class ProgressEvent:
    """A task started or completed."""

    task: str
    completed: bool
    while_offline: bool = False  # it was flown while no bridge was connected


class CompletedTasks:
    """Completes each task once; `events` is a queue that the caller empties."""

    def __init__(self) -> None:
        self.places: dict[str, Point | None] = {}  # in order, of all epochs; where
        self.events: deque[ProgressEvent] = deque()
        self._listed_at: dict[str, Point] = {}  # `place_of` the tasks of the list
        self.is_covered: Callable[[str], bool] = lambda task: True  # the whole way was flown
        # place and deadline [s] of tasks with a way that is not known to be flown to its end
        self.doubtful: dict[str, tuple[Point | None, float]] = {}
        self.uncovered: deque[str] = deque()  # those of which a part is left, to be taken

    def __contains__(self, task: str) -> bool:
        return task in self.places

    def start(self, task: str) -> None:
        """Note that a task has started."""
        self.events.append(ProgressEvent(task, completed=False))

    def complete(self, task: str, place: Point | None, while_offline: bool = False) -> None:
        """Complete a task, unless it is completed or the list has it at another position now.

        One with a way is completed once the whole of it is known to be flown.
        """
        if place is not None and self._listed_at.get(task, place) != place:
            return
        if task not in self.places and not while_offline and not self.is_covered(task):
            self.doubtful.setdefault(task, (place, math.inf))
        elif task not in self.places:
            self.doubtful.pop(task, None)
            self.places[task] = place
            self.events.append(ProgressEvent(task, completed=True, while_offline=while_offline))

    def credit(self, item: Item) -> None:
        """Complete the task of an item, of whichever epoch, where the item completes it."""
        if item.completes:
            self.complete(item.task, item.place)

    def judge_doubtful(self, now: float) -> None:
        """Complete the tasks with a way whose end was seen by now.

        Args:
            now: steady time [s].
        """
        for task, (place, deadline) in list(self.doubtful.items()):
            if self.is_covered(task):
                self.complete(task, place)
            elif math.isinf(deadline):
                self.doubtful[task] = place, now + MAX_MESSAGE_DELAY
            elif now >= deadline:
                del self.doubtful[task]
                self.uncovered.append(task)

    def set_listed(self, tasks: Iterable[Task]) -> list[str]:
        """Set the tasks of the list; returns those completed at another position than now."""
        self._listed_at = {task.id: place_of(task) for task in tasks}
        return [task for task, place in self._listed_at.items()
                if self.places.get(task) not in (None, place)]
