# SPDX-License-Identifier: Apache-2.0
"""Work that is flown in pieces, as the allocator keeps it."""
from __future__ import annotations

import math
from dataclasses import dataclass, replace

from uav_task_alloc.work.pieces import Work


@dataclass(frozen=True, slots=True)
class WorkRecord:
    """Accepted work, and which of its pieces count; the pieces are tasks with records."""

    work: Work  # with its latest values
    announced: Work  # as first added, to recognise a replay of that announcement
    pieces: tuple[str, ...] = ()  # ids of tasks; not those that were cut again
    last: int = 0  # highest number that a piece of it ever had
    # earlier values of strip_width [m], each with the highest number of a piece at its end
    widths: tuple[tuple[int, float], ...] = ()

    @property
    def id(self) -> str:
        """Its task id."""
        return self.work.task.id

    def updated(self, work: Work) -> WorkRecord:
        """Return the record with other values of the same work.

        Args:
            work: of the same task id.
        """
        changed = work.strip_width != self.work.strip_width
        return replace(self, work=work, widths=(
            *self.widths, *[(self.last, self.work.strip_width)] * changed))

    def strip_width(self, number: int) -> float:
        """Return how wide a flown piece has covered an area at least [m].

        Args:
            number: of the piece.
        """
        return min(self.work.strip_width, *(
            width for last, width in self.widths if number <= last), math.inf)
