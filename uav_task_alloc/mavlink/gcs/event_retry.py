# SPDX-License-Identifier: Apache-2.0
"""What has ended and a list still asks for: told again, as the allocator may have been deaf."""
from __future__ import annotations

from collections.abc import Iterable

from uav_task_alloc.mavlink.mission.task_progress import TaskProgress

ANSWERS = 3  # lists that still ask for a task after it was told: the allocator has heard of it
REMIND = 2.0  # [s] that lists may ask for a task that has ended; then twice as long, and so on


class EventRetry:
    """Holds no task longer than the lists have it; a new list asks anew, and puts nothing off."""

    def __init__(self) -> None:
        self._ended: dict[str, TaskProgress] = {}
        self._due: dict[str, tuple[float, float]] = {}  # when [s], and the pause after that
        self._told: set[str] = set()  # since the last list
        self._answers: dict[str, int] = {}  # lists that came after it was told

    def listed(self, ended: Iterable[TaskProgress], now: float) -> None:
        """These tasks of a new list had ended before it came."""
        self._ended = {each.task: each for each in ended}
        soon = now + REMIND
        self._due = {task: (min(soon, self._due.get(task, (soon, 0.0))[0]), 2.0 * REMIND)
                     for task in self._ended}
        self._answers = {task: n for task, n in self._answers.items() if task in self._ended}
        self._told.clear()

    def answered(self) -> list[str]:
        """A new list comes: the tasks that were told before it, and before ANSWERS - 1 others."""
        for task in self._told:
            self._answers[task] = self._answers.get(task, 0) + 1
        self._told.clear()
        return [task for task, n in self._answers.items() if n >= ANSWERS]

    def step(self, now: float) -> list[TaskProgress]:
        """What is to be told now."""
        due = [task for task, (when, _) in self._due.items() if now >= when]
        for task in due:
            pause = self._due[task][1]
            self._due[task] = now + pause, 2.0 * pause
            self._told.add(task)
        return [self._ended[task] for task in due]
