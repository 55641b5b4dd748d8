# SPDX-License-Identifier: Apache-2.0
"""Repeats the final events of tasks that lists still contain: the allocator may have lost them."""
from __future__ import annotations

from collections.abc import Iterable

from uav_task_alloc.mavlink.mission.task_progress import TaskProgress

_MAX_LISTS = 3  # lists that contain a task after a repetition: the allocator knows, and wants it
_RETRY = 2.0  # [s] until the first repetition; doubled after each


class EventRetry:
    """Final events to repeat; a task that a new list does not contain is removed."""

    def __init__(self) -> None:
        self._ended: dict[str, TaskProgress] = {}
        self._due: dict[str, tuple[float, float]] = {}  # time [s], and the next pause [s]
        self._resent: set[str] = set()  # since the last list
        self._lists: dict[str, int] = {}  # number of lists after a repetition, by task

    def set_ended(self, ended: Iterable[TaskProgress], now: float) -> None:
        """Set the final events of the tasks of a new list that had ended before it."""
        self._ended = {each.task: each for each in ended}
        soon = now + _RETRY
        self._due = {task: (min(soon, self._due.get(task, (soon, 0.0))[0]), 2.0 * _RETRY)
                     for task in self._ended}
        self._lists = {task: n for task, n in self._lists.items() if task in self._ended}
        self._resent.clear()

    def wanted_again(self) -> list[str]:
        """Count a new list; returns the tasks that _MAX_LISTS lists contain after a repetition."""
        for task in self._resent:
            self._lists[task] = self._lists.get(task, 0) + 1
        self._resent.clear()
        return [task for task, n in self._lists.items() if n >= _MAX_LISTS]

    def step(self, now: float) -> list[TaskProgress]:
        """The events to repeat now."""
        due = [task for task, (when, _) in self._due.items() if now >= when]
        for task in due:
            pause = self._due[task][1]
            self._due[task] = now + pause, 2.0 * pause
            self._resent.add(task)
        return [self._ended[task] for task in due]
