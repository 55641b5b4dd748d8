# SPDX-License-Identifier: Apache-2.0
"""The clock of the allocator against that of the record."""
from __future__ import annotations

from collections import deque

MAX_STAMP_AGE = 86400.0  # [s]; an older stamp is of another clock
_DELAYS = 10  # newest messages, of which the fastest compares the clocks


class ClockLead:
    """By how much the clock of the record is ahead of that of the allocator: `seconds`."""

    def __init__(self) -> None:
        self.seconds = 0.0
        self._delays: deque[float] = deque(maxlen=_DELAYS)  # [s]

    def add(self, delay: float, second: float) -> None:
        """Compare the clocks by the time that a report took; less than a second is a delay.

        Args:
            delay: [s] from its stamp to its time in the record.
            second: of real time, in those of the record.
        """
        if abs(delay) >= MAX_STAMP_AGE:
            return  # time of another kind
        self._delays.append(delay)
        lead = min(self._delays)
        if abs(lead - self.seconds) > second:
            self.seconds = lead if abs(lead) > second else 0.0
