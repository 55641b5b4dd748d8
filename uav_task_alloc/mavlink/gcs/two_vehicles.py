# SPDX-License-Identifier: Apache-2.0
"""Finds two vehicles with one system id at one address, by positions that alternate."""
from __future__ import annotations

import math
from collections import deque

from uav_task_alloc.model import Point

_SPREAD, _FASTEST = 30.0, 60.0  # [m], and [m/s], by which one vehicle moves at most
_JUMPS, _WITHIN = 4, 5.0  # so many in so many [s]: an estimate that is reset jumps once
_KEPT = 30.0  # [s] since the last of them
TWO_VEHICLES = 'a system id of its own: positions of two vehicles come with it'


class TwoVehicles:
    """The jumps between the positions of one system id."""

    def __init__(self) -> None:
        self._last: tuple[Point, float] | None = None  # position [m] ENU, vehicle time [s]
        self._jumps: deque[float] = deque(maxlen=_JUMPS)
        self._found_at = -math.inf

    def receive(self, position: Point, t: float, now: float) -> None:
        """Take a position.

        Args:
            position: [m] ENU.
            t: vehicle time [s] of it; a simulator may run faster than real time.
            now: steady time [s].
        """
        last, self._last = self._last, (position, t)
        if last is None or math.dist(position, last[0]) <= (
                _SPREAD + _FASTEST * max(0.0, t - last[1])):
            return
        self._jumps.append(now)
        if len(self._jumps) == _JUMPS and now - self._jumps[0] <= _WITHIN:
            self._found_at = now

    def found(self, now: float) -> bool:
        """Whether positions of two vehicles come, or came a moment before steady time [s]."""
        return now - self._found_at < _KEPT
