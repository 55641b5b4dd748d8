# SPDX-License-Identifier: Apache-2.0
"""The tasks that one vehicle has completed, and the events of tasks that started or completed."""
from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass

from uav_task_alloc.mavlink.mission.items import Item
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
        self._listed_at: dict[str, Point] = {}  # positions of the tasks of the list

    def __contains__(self, task: str) -> bool:
        return task in self.places

    def start(self, task: str) -> None:
        """Note that a task has started."""
        self.events.append(ProgressEvent(task, completed=False))

    def complete(self, task: str, place: Point | None, while_offline: bool = False) -> None:
        """Complete a task, unless it is completed or the list has it at another position now."""
        if place is not None and self._listed_at.get(task, place) != place:
            return
        if task not in self.places:
            self.places[task] = place
            self.events.append(ProgressEvent(task, completed=True, while_offline=while_offline))

    def credit(self, item: Item) -> None:
        """Complete the task of an item, of whichever epoch, where the item completes it."""
        if item.completes:
            self.complete(item.task, item.position)

    def set_listed(self, tasks: Iterable[Task]) -> list[str]:
        """Set the tasks of the list; returns those completed at another position than now."""
        self._listed_at = {task.id: task.position for task in tasks}
        return [task for task, place in self._listed_at.items()
                if self.places.get(task) not in (None, place)]
