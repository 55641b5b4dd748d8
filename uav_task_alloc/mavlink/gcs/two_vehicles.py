# SPDX-License-Identifier: Apache-2.0
"""Finds two vehicles with one system id at one address, by positions or clocks that alternate."""
from __future__ import annotations

import math

from uav_task_alloc.model import Point

_SPREAD, _FASTEST = 30.0, 60.0  # [m], and [m/s], by which one vehicle moves at most
# [s] without a longer gap, for so long: late messages of before a reboot come for 5 s at most
_GAP, _LONG = 1.5, 7.0
_KEPT = 30.0  # [s] since the last of them
_LATEST = 6.0  # [s] of a late message
TWO_VEHICLES = 'a system id of its own: positions of two vehicles come with it'


class TwoVehicles:
    """The jumps between the positions of one system id, in place or time."""

    def __init__(self) -> None:
        self._last: tuple[Point, float] | None = None  # position [m] ENU, vehicle time [s]
        # [s] of the latest jump, of the first without a gap, and of the latest that shows two
        self._jumped_at = self._since = self._found_at = -math.inf

    def receive(self, position: Point, t: float, now: float, late: bool = False,
                rate: float = 1.0) -> None:
        """Take a position.

        Args:
            position: [m] ENU.
            t: vehicle time [s] of it; a simulator may run faster than real time.
            now: steady time [s].
            late: by the number of its frame, it was sent before the one received last.
            rate: of the vehicle's clock; NaN: not known.
        """
        last = self._last
        if not late:
            self._last = position, t
        if last is None:
            return
        step, latest = t - last[1], _LATEST * (rate if rate > 1.0 else 1.0)
        reach = _SPREAD + _FASTEST * (abs(step) if late else max(0.0, step))
        if (math.dist(position, last[0]) <= reach and step >= -latest
                and not (late and step > 0.0)):
            return
        if now - self._jumped_at > _GAP:
            self._since = now
        self._jumped_at = now
        if now - self._since >= _LONG:
            self._found_at = now

    def found(self, now: float) -> bool:
        """Whether positions of two vehicles come, or came a moment before steady time [s]."""
        return now - self._found_at < _KEPT
