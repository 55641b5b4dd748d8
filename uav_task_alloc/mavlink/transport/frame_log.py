# SPDX-License-Identifier: Apache-2.0
"""Which frames of a vehicle have come, by their sequence numbers: was anything lost in between?"""
from __future__ import annotations

from collections import deque
from collections.abc import Iterable

_KEPT = 1024  # frames
SILENCE = 1.0  # [s] in which the numbers may have begun again: something is missing then


class FrameLog:
    """Numbers frames without end; late ones are put in where they belong."""

    def __init__(self) -> None:
        self.newest = 0  # the number of the newest frame
        self._known, self._at = False, 0.0
        self._order: deque[int] = deque()
        self._came: set[int] = set()

    def note(self, seq: int, now: float) -> int:
        """Take the sequence number (0..255) of a frame; returns its number without end."""
        if not self._known:
            self._known, self.newest = True, seq
        elif now - self._at > SILENCE:
            self.newest += 256
        self._at = now
        number = self.newest + (seq - self.newest + 128) % 256 - 128
        self.newest = max(self.newest, number)
        if number not in self._came:
            self._came.add(number)
            self._order.append(number)
            if len(self._order) > _KEPT:
                self._came.discard(self._order.popleft())
        return number

    def note_all(self, seqs: Iterable[int], now: float) -> None:
        """Take frames that nobody looked at."""
        for seq in seqs:
            self.note(seq, now)

    def whole(self, first: int, last: int) -> bool:
        """Whether every frame from `first` to `last` has come."""
        return last - first < _KEPT and all(n in self._came for n in range(first, last + 1))

    def clear(self) -> None:
        """The vehicle counts from the start again."""
        self._known = False
        self._order.clear()
        self._came.clear()
