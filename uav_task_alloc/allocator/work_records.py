# SPDX-License-Identifier: Apache-2.0
"""Work that is flown in pieces, as the allocator keeps it."""
from __future__ import annotations

from dataclasses import dataclass

from uav_task_alloc.work.pieces import Work


@dataclass(frozen=True, slots=True)
class WorkRecord:
    """Accepted work, and which of its pieces count; the pieces are tasks with records."""

    work: Work  # with its latest values
    announced: Work  # as first added, to recognise a replay of that announcement
    pieces: tuple[str, ...] = ()  # ids of tasks; not those that were cut again
    last: int = 0  # highest number that a piece of it ever had

    @property
    def id(self) -> str:
        """Its task id."""
        return self.work.task.id
