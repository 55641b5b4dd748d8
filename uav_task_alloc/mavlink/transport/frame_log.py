# SPDX-License-Identifier: Apache-2.0
"""The received frames of one vehicle by sequence number, to detect lost ones."""
from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable

_KEPT = 1024  # frames
_SILENCE = 1.0  # [s] after which sequence numbers may have wrapped: frames are missing
_FEW = 64  # frames expected in a silence, at most, where they cannot have wrapped
_MARKS = 8  # seconds in which frames were received, for their rate


class FrameLog:
    """Maps the 8-bit sequence numbers to unbounded frame numbers; accepts late frames.

    Arguments of methods:
        seqs: sequence numbers of frames, 0..255.
        first, last: frame numbers, as `note` returns them.
        now: steady time [s].
    """

    def __init__(self) -> None:
        self.newest = 0  # the number of the newest frame
        self._known, self._at = False, 0.0
        self._newest_at = 0.0  # [s] at which the newest frame was received
        self._marks: deque[tuple[float, int]] = deque(maxlen=_MARKS)  # time [s], newest number
        self._order: deque[int] = deque()
        self._received: set[int] = set()

    def note(self, seq: int, now: float) -> int:
        """Record a received frame.

        Args:
            seq: sequence number, 0..255.
            now: steady time [s].

        Returns:
            The unbounded frame number.
        """
        if not self._known:
            self._known, self.newest, self._newest_at = True, seq, now
        elif (silence := now - self._newest_at) > _SILENCE and not (
                self._expected(silence) < _FEW):
            self.newest, self._newest_at = self.newest + 256, now
        self._at = now
        number = self.newest + (seq - self.newest + 128) % 256 - 128
        if number >= self.newest:
            self.newest, self._newest_at = number, now
            if not self._marks or now - self._marks[-1][0] >= 1.0:
                self._marks.append((now, number))
        if number not in self._received:
            self._received.add(number)
            self._order.append(number)
            if len(self._order) > _KEPT:
                self._received.discard(self._order.popleft())
        return number

    def _expected(self, seconds: float) -> float:
        """How many frames were sent in a silence [s], by the rate before; inf: not known."""
        if len(self._marks) < _MARKS:
            return math.inf
        (begin, first), (end, last) = self._marks[0], self._marks[-1]
        return seconds * (last - first) / (end - begin)

    @property
    def first(self) -> int:
        """The number of the frame received first, of those that are kept; 0 where none was."""
        return self._order[0] if self._order else 0

    @property
    def received_at(self) -> float:
        """When [s] a frame was received last; inf where none was."""
        return self._at if self._known else math.inf

    def note_all(self, seqs: Iterable[int], now: float) -> None:
        """Record frames that were not decoded, by their sequence numbers."""
        for seq in seqs:
            self.note(seq, now)

    def whole(self, first: int, last: int) -> bool:
        """Whether every frame from `first` to `last` was received."""
        return last - first < _KEPT and all(n in self._received for n in range(first, last + 1))

    def clear(self) -> None:
        """Reset after a restart of the vehicle."""
        self._known = False
        self._marks.clear()
        self._order.clear()
        self._received.clear()
