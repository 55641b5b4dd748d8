# SPDX-License-Identifier: Apache-2.0
"""How fast the time of a scenario and of a record passes: stated, or measured from vehicles."""
from __future__ import annotations

from collections.abc import Mapping
from statistics import median

# share by which a measured clock rate varies, and that of a real vehicle over a bad link
_TOLERANCE, _REAL_TIME_TOLERANCE = 0.04, 0.1


class TimeScale:
    """The rates of three clocks: those of the scenario, of the record (`wall`) and of real time.

    Without a stated rate it is that of the vehicles' clocks: the median of the fleet.
    """

    def __init__(self) -> None:
        self.rate = 1.0  # scenario seconds in a second of real time
        self.simulated = False  # `wall` is the time of /clock
        self._is_stated = False
        self._vehicles: dict[str, float] = {}  # rates by UAV

    @property
    def speedup(self) -> float:
        """Scenario seconds in a second of `wall`; 1 where that is /clock."""
        return 1.0 if self.simulated else self.rate

    @property
    def second(self) -> float:
        """Seconds of `wall` in a second of real time."""
        return self.rate if self.simulated else 1.0

    def state(self, rate: float, simulated: bool) -> None:
        """Take what a run states.

        Args:
            rate: scenario seconds in a second of real time; 0: it is measured.
            simulated: `wall` is the time of /clock.
        """
        self._is_stated, self.simulated = bool(rate), simulated
        self.rate = rate or self.rate

    def measure(self, rates: Mapping[str, float]) -> None:
        """Take rates of vehicles' clocks, where none is stated; small changes are noise.

        Args:
            rates: seconds of the vehicle in a second of real time, by UAV.
        """
        self._vehicles.update(rates)
        if self._is_stated or not self._vehicles:
            return
        rate = median(self._vehicles.values())
        if abs(rate - self.rate) > _TOLERANCE * self.rate:
            self.rate = _rounded(rate)


def _rounded(rate: float) -> float:
    """A measured rate; the whole number near it where there is one, as that was chosen.

    1.0 also for 10 % more or less.
    """
    whole = max(1.0, float(round(rate)))
    tolerance = _REAL_TIME_TOLERANCE if whole == 1.0 else _TOLERANCE * whole
    return whole if abs(rate - whole) <= tolerance else round(rate, 2)
