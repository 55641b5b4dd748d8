# SPDX-License-Identifier: Apache-2.0
"""The share of a battery that was used, by the charge that the vehicle counts; no I/O.

Autopilots count the charge in mAh from boot (BATTERY_STATUS.current_consumed), which is finer
than whole per cents. Where per cent and count disagree, one of them has a wrong capacity: the one
that falls faster is used.
"""
from __future__ import annotations

import math
from dataclasses import dataclass

_CHUNK = 0.002  # share of a battery that is returned at once
_RESOLUTION = 1.5  # [mAh] of a count, by its digits and the time of its message
_LEARNT_FROM = 0.05  # fall of the per cent that shows the capacity where none is given
_APART = 0.02  # share by which per cent and count differ where they disagree
_RATIO = 0.07  # of what was used, by which they differ moreover
_PRIOR = 0.3  # standard deviation of the ratio of both, a priori
_RISE = 0.03  # of the per cent that shows another or a charged battery
_STANDS_FROM = 0.03  # fall of the per cent, of which a working count shows _STANDS
_STANDS = 0.3
_FASTEST = 150.0  # [s] in which no flight uses a whole battery
_LATENESS = 2.0  # [s] of a message, at most
_USUAL_CAPACITY = 10_000.0  # [mAh] that limits a plausible count where none is known


@dataclass(frozen=True, slots=True)
class CountedUse:
    """What was used of a battery since the last one."""

    share: float  # of the battery
    deviation: float  # standard deviation of its measurement


@dataclass(frozen=True, slots=True)
class _Reading:
    share: float  # per cent [0..1]
    count: float  # [mAh]
    at: float  # [s]


class ChargeCount:
    """What one battery gave, as shares of its capacity."""

    def __init__(self) -> None:
        self.capacity = math.nan  # [mAh] as it is given; NaN: not known
        self._stood_at = math.nan  # [mAh] of a count that does not measure
        self._restart()

    def _restart(self) -> None:
        """Begin again, at a count or a per cent that does not continue the one before."""
        self.doubt = ''  # why one of both is not believed; '': they agree
        self.per_cent_believed = True  # False: it falls more slowly than the count
        self._base: _Reading | None = None  # from which their falls are compared
        self._based_on_step = False  # the per cent had just fallen there
        self._last: _Reading | None = None
        self._returned = 0.0  # [mAh]
        self._ratio = 1.0  # of the fall of the per cent to that of the count
        self._learnt = math.nan  # [mAh] capacity by the per cent

    @property
    def used_capacity(self) -> float:
        """The capacity with which shares are computed [mAh]; NaN: not known yet."""
        if math.isnan(self.capacity):
            return self._learnt
        return self.capacity / max(1.0, self._ratio)

    @property
    def counts(self) -> bool:
        """Whether it measures what is used."""
        return self._last is not None and not math.isnan(self.used_capacity)

    def took_off(self) -> None:
        """Leave out what was used on the ground."""
        if self._last is not None:
            self._returned = self._last.count

    def read(self, share: float, count: float, now: float) -> CountedUse | None:
        """Process a report of the battery.

        Args:
            share: its per cent [0..1].
            count: charge used since any moment [mAh]; NaN or 0: not measured.
            now: [s], of a clock that runs as that of the vehicle.

        Returns:
            What was used since the last one; None: too little, or not known.
        """
        if not 0.0 < count < math.inf or abs(count - self._stood_at) < _RESOLUTION:
            self._last = self._base = None
            return None
        self._stood_at = math.nan
        reading, last = _Reading(share, count, now), self._last
        if last is None or self._base is None or not self._continues(reading, last):
            self._restart()
            self._base = self._last = reading
            self._returned = count
            return None
        self._last = reading
        fell = share < last.share
        if self._stands(reading, self._base):
            self._stood_at, self._last = count, None
            self.doubt = f'the charge used stands at {count:.0f} mAh while the per cent falls'
            self.per_cent_believed = True
            return None
        self._compare(reading, self._base, fell)
        return self._use(count, fell)

    def _continues(self, new: _Reading, last: _Reading) -> bool:
        """Whether a reading follows from the last: no reset, no jump, no other battery."""
        known = self.used_capacity
        most = (_USUAL_CAPACITY if math.isnan(known) else known) / _FASTEST * (
            max(0.0, new.at - last.at) + _LATENESS)
        return -_RESOLUTION < new.count - last.count <= most and new.share - last.share < _RISE

    def _stands(self, new: _Reading, base: _Reading) -> bool:
        """Whether the count does not follow the per cent at all, as without a sensor."""
        fall, known = base.share - new.share, self.capacity
        if math.isnan(known):
            return fall >= _STANDS_FROM and new.count - base.count < _RESOLUTION
        return fall >= _STANDS_FROM and new.count - base.count < _STANDS * fall * known

    def _compare(self, new: _Reading, base: _Reading, fell: bool) -> None:
        """Compare the falls of per cent and count since the base."""
        if fell and not self._based_on_step:
            self._base, self._based_on_step = new, True
            return
        fall, given = base.share - new.share, new.count - base.count
        if math.isnan(self.capacity):
            if fell and fall > _LEARNT_FROM - 1e-6:
                self._learnt = given / fall
            return
        counted = given / self.capacity
        if fell and counted > 0.0:
            weight = 1.0 / (1.0 + (_APART / (_PRIOR * counted)) ** 2)
            self._ratio = 1.0 + weight * (fall / counted - 1.0)
        apart = fall - counted
        if abs(apart) <= _APART + _RATIO * max(fall, counted):
            self._ratio, self.doubt, self.per_cent_believed = 1.0, '', True
            return
        self.per_cent_believed = apart > 0.0
        self.doubt = (
            f'its per cent fell by {100.0 * fall:.0f} %, the charge used is '
            f'{100.0 * counted:.0f} % of its capacity ({self.capacity:.0f} mAh): '
            f'{"the per cent" if apart > 0.0 else "the charge"} counts; check the capacity')

    def _use(self, count: float, fell: bool) -> CountedUse | None:
        known = self.used_capacity
        if math.isnan(known):
            self._returned = count
            return None
        used = count - self._returned
        if used < _CHUNK * known and not (fell and used > 0.0):
            return None
        self._returned = count
        return CountedUse(used / known, _RESOLUTION / known)
