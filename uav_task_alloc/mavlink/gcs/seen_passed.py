# SPDX-License-Identifier: Apache-2.0
"""Tasks that the previous run of the bridge saw passed, while a REACHED of them could follow."""
from __future__ import annotations

import math
from collections.abc import Iterable

from uav_task_alloc.model import Point, Task

_AGE = 3600.0  # [s] after the start of this run in which a task of the same id is the same one


class SeenPassed:
    """Keeps them by id, whichever mission is on board by now."""

    def __init__(self) -> None:
        self._places: dict[str, Point] = {}  # [m] ENU, by task
        self._until = math.inf  # [s]

    def add(self, task: str, place: Point) -> None:
        """Add one of the record.

        Args:
            task: its id.
            place: of it [m] ENU.
        """
        self._places[task] = place

    def count(self, now: float) -> int:
        """Return how many there are; 0 where none counts any more.

        Args:
            now: steady time [s].
        """
        if not self._places:
            return 0
        self._until = min(self._until, now + _AGE)
        return len(self._places) if now < self._until else 0

    def among(self, tasks: Iterable[Task], now: float) -> tuple[Task, ...]:
        """Return those of the given tasks that were seen passed.

        Args:
            tasks: of a list.
            now: steady time [s].
        """
        return tuple(task for task in tasks if self._places.get(task.id) == task.position) if (
            self.count(now)) else ()
