# SPDX-License-Identifier: Apache-2.0
"""The last positions in mission mode: a vehicle is on a way before its item is reported."""
from __future__ import annotations

import math
from collections import deque

from uav_task_alloc.mavlink.mission.flown_path import GAP, PositionSample
from uav_task_alloc.model import Point

_LATE = 32  # positions: six seconds, by which the report of the current item may be late
_KEPT = 512  # positions in which that report may be late in a simulation that runs faster


class RecentPositions:
    """Keeps them without a gap, and the last one before the gap."""

    def __init__(self) -> None:
        self._samples: deque[PositionSample] = deque(maxlen=_KEPT)
        self._unseen_since: PositionSample | None = None  # the last one before a gap before these

    def add(self, sample: PositionSample, before: float) -> None:
        """Add a position.

        Args:
            sample: of the vehicle in mission mode.
            before: vehicle time [s] of the one received before it, in whichever mode.
        """
        if not 0.0 <= sample.t - before <= GAP:
            last = self._samples[-1] if self._samples and sample.t > before else None
            self.clear()
            self._unseen_since = last
        self._samples.append(sample)

    def clear(self) -> None:
        """Forget all: the vehicle is not in mission mode."""
        self._samples.clear()
        self._unseen_since = None

    def note_replaced(self) -> None:
        """Note that another mission was taken: what was flown in the gap was not of it."""
        self._unseen_since = None

    def on_way_from(self, begin: Point, corridor: float) -> tuple[
            PositionSample | None, tuple[PositionSample, ...]]:
        """Return the positions that may be of a way whose item is reported now.

        Args:
            begin: of the way [m] ENU.
            corridor: [m] from the way at which the vehicle follows it.

        Returns:
            The last position before a gap in which it may have come to the way, else None; and
            the positions since it was at the begin, or the last ones where it was not.
        """
        samples = tuple(self._samples)
        at = next((n for n in reversed(range(len(samples))) if math.dist(
            samples[n].position, begin) <= corridor), None)
        if at is not None:
            return None, samples[at:]
        unseen = self._unseen_since if 0 < len(samples) <= _LATE else None
        return unseen, samples[-_LATE:]
