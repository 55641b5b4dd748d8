# SPDX-License-Identifier: Apache-2.0
"""Where and when tasks were announced, from which the demand is learnt; in blocks on disk."""
from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterable, Sequence
from typing import Any

from uav_task_alloc.checks import FAR, check_number
from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.model import Point, Task
from uav_task_alloc.work.pieces import Work

_BLOCK, _MOST_BLOCKS = 50, 40  # announcements of a block, and blocks: the oldest is dropped
_LATEST = 2.0**31  # [s]
SeenTask = tuple[float, float, float, float]  # [s] ROS clock, [m] east, [m] north, value


class SeenTasks:
    """The announcements of the last 2000 new tasks.

    A block is a row of the journal, so that an announcement writes 50 others at most.

    Args:
        saved: blocks of the journal, by number.
        wanted: whether announcements are kept now.
    """

    def __init__(self, saved: Iterable[tuple[int, Sequence[SeenTask]]] = (),
                 wanted: Callable[[], bool] = lambda: True) -> None:
        self.blocks = {str(number): list(rows) for number, rows in sorted(saved)}
        self.unsaved: set[str] = set()  # numbers of blocks that are not on disk
        self.version = self.forgotten = 0  # changes with each announcement; how often all were
        self._wanted = wanted
        self._next = max((int(number) for number in self.blocks), default=-1) + 1

    @property
    def seen(self) -> list[SeenTask]:
        """All of them in their order."""
        return [each for rows in self.blocks.values() for each in rows]

    def add(self, item: Task | Work, stamp: float) -> None:
        """Keep where a new task was announced, while that is wanted.

        Args:
            item: as announced; work that is no point counts in the middle of its outline.
            stamp: [s] clock of the node.
        """
        if not self._wanted():
            return
        x, y, _ = _middle(item)
        value = item.task.value if isinstance(item, Work) else item.value
        if not self.blocks or len(self.blocks[str(self._next - 1)]) >= _BLOCK:
            self.blocks[str(self._next)] = []
            self._next += 1
            if len(self.blocks) > _MOST_BLOCKS:
                oldest = next(iter(self.blocks))
                del self.blocks[oldest]
                self.unsaved.add(oldest)
        number = str(self._next - 1)
        self.blocks[number].append((stamp, x, y, value))
        self.unsaved.add(number)
        self.version += 1

    def clock_began(self, stamp: float) -> None:
        """Date what was announced while the clock was 0 from its first time.

        Args:
            stamp: [s] clock of the node.
        """
        dated = {number: [row if row[0] != 0.0 else (stamp, *row[1:]) for row in rows]
                 for number, rows in self.blocks.items()}
        if dated != self.blocks:
            self.unsaved.update(self.blocks)
            self.blocks = dated
            self.version += 1
            self.forgotten += 1  # what was learnt of them is learnt again

    def forget(self) -> int:
        """Forget all of them; returns how many there were."""
        count = len(self.seen)
        self.unsaved.update(self.blocks)
        self.blocks.clear()
        self.version += 1
        self.forgotten += 1
        return count


def _middle(item: Task | Work) -> Point:
    """The place of a task; of work the mean of its points."""
    if isinstance(item, Task):
        return item.position
    points = item.path or (item.task.position,)
    x, y, z = (math.fsum(axis) / len(points) for axis in zip(*points, strict=True))
    return x, y, z


def restored_block(body: Any) -> list[SeenTask]:
    """Return the announcements of a row of the journal.

    Args:
        body: of the row.

    Returns:
        [s], [m] east, [m] north and value of each.

    Raises:
        InvalidValue: it is no list of four numbers each.
    """
    if not isinstance(body, list):
        raise InvalidValue('demand', body, 'a list of [s, m, m, value]')
    rows = []
    for each in body:
        if not isinstance(each, list) or len(each) != 4:
            raise InvalidValue('demand', each, '[s, m, m, value]')
        at, x, y = (check_number('demand', number, -most, most)
                    for number, most in zip(each, (_LATEST, FAR, FAR), strict=False))
        rows.append((at, x, y, check_number('demand', each[3], 0.0, sys.float_info.max)))
    return rows
