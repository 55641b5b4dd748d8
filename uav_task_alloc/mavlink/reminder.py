# SPDX-License-Identifier: Apache-2.0
"""What has ended and a list still asks for: told again, as the allocator may have been deaf."""
from __future__ import annotations

from collections.abc import Iterable

from uav_task_alloc.mavlink.policy import TaskProgress

REMIND = 2.0  # [s] that lists may ask for a task that has ended; then twice as long, and so on


class Reminder:
    """Holds no task longer than the lists have it; a new list asks anew, and puts nothing off."""

    def __init__(self) -> None:
        self._ended: dict[str, TaskProgress] = {}
        self._due: dict[str, tuple[float, float]] = {}  # when [s], and the pause after that

    def listed(self, ended: Iterable[TaskProgress], now: float) -> None:
        """These tasks of a new list had ended before it came."""
        self._ended = {each.task: each for each in ended}
        soon = now + REMIND
        self._due = {task: (min(soon, self._due.get(task, (soon, 0.0))[0]), 2.0 * REMIND)
                     for task in self._ended}

    def step(self, now: float) -> list[TaskProgress]:
        """What is to be told now."""
        due = [task for task, (when, _) in self._due.items() if now >= when]
        for task in due:
            pause = self._due[task][1]
            self._due[task] = now + pause, 2.0 * pause
        return [self._ended[task] for task in due]
