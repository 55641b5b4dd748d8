# SPDX-License-Identifier: Apache-2.0
"""How fast the clock of a vehicle runs: a simulator may run faster than real time."""
from __future__ import annotations

import math
from collections import deque

_STEP = 1.0  # [s] between two samples
_SAMPLES = 20  # the newest are compared with the oldest of them
_LEAST = 3.0  # [s] between those two


class ClockRate:
    """Seconds of a vehicle in one second of this program, over the last 20 s."""

    def __init__(self) -> None:
        self._samples: deque[tuple[float, float]] = deque(maxlen=_SAMPLES)

    @property
    def value(self) -> float:
        """1.0 for a real vehicle; NaN: not known yet."""
        if not self._samples:
            return math.nan
        (boot, now), (last_boot, last) = self._samples[0], self._samples[-1]
        return (last_boot - boot) / (last - now) if last - now >= _LEAST else math.nan

    def add(self, boot: float, now: float) -> None:
        """Take a message.

        Args:
            boot: time since the vehicle's boot [s], not less than in the messages before.
            now: steady time of its reception [s].
        """
        if not self._samples or now - self._samples[-1][1] >= _STEP:
            self._samples.append((boot, now))

    def reset(self) -> None:
        """Begin again, after a restart of the vehicle."""
        self._samples.clear()
