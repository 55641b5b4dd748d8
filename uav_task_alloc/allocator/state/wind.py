# SPDX-License-Identifier: Apache-2.0
"""Estimates the wind and the speed through the air of each UAV from measured ground velocities.

With wind w and speed s through the air, a ground velocity v in steady flight has |v - w| = s, so
|v|^2 = 2 v.w + c with c = s^2 - |w|^2: linear in w, which all UAVs share, and in c of each UAV.
The least squares of recent samples give both. An autopilot that holds its ground speed whatever
the wind shows the same |v| in all directions, which the same equations fit with w = 0.
"""
from __future__ import annotations

import math
from dataclasses import dataclass

_MEMORY = 120.0  # [s] after which a sample counts 1/e
_NOISE = 0.05  # share of the cruise speed: standard deviation of a sample's speed
_SPREAD = 0.1  # share of the cruise speed: of the speed through the air before any sample
_WIND_SPREAD = 4.0  # [m/s] of each component of the wind before any sample
_SLOWEST, _FASTEST = 0.3, 1.5  # times the cruise speed: bounds of the speed through the air
_FITS_BETTER = 0.7  # times the squared error with wind: a UAV holds its ground speed
_CONTRADICTS = 1.5  # standard deviations of a sample: mean error that contradicts a wind
_ENOUGH = 5.0  # samples for that


@dataclass(slots=True)
class _Moments:
    """Sums over the samples of one UAV: of v, of q = |v|^2 and their products; c0 = cruise^2."""

    cruise: float
    at: float
    n: float = 0.0
    x: float = 0.0
    y: float = 0.0
    xx: float = 0.0
    xy: float = 0.0
    yy: float = 0.0
    q: float = 0.0
    qx: float = 0.0
    qy: float = 0.0
    qq: float = 0.0

    def add(self, x: float, y: float, stamp: float) -> None:
        keep = math.exp(-max(0.0, stamp - self.at) / _MEMORY)
        q, self.at = x * x + y * y, stamp
        for name, value in (('n', 1.0), ('x', x), ('y', y), ('xx', x * x), ('xy', x * y),
                            ('yy', y * y), ('q', q), ('qx', q * x), ('qy', q * y), ('qq', q * q)):
            setattr(self, name, keep * getattr(self, name) + value)

    @property
    def prior(self) -> float:
        """Weight of c0 in samples."""
        return (_NOISE / _SPREAD) ** 2

    def constant(self, wx: float, wy: float) -> float:
        """The best c for a wind [m2/s2]."""
        return ((self.q - 2.0 * (wx * self.x + wy * self.y) + self.prior * self.cruise**2)
                / (self.n + self.prior))

    def error(self, wx: float, wy: float) -> float:
        """Sum of the squared errors for a wind, with the best c of the samples alone."""
        mean = self.q - 2.0 * (wx * self.x + wy * self.y)
        return (self.qq - 4.0 * (wx * self.qx + wy * self.qy) - mean * mean / self.n
                + 4.0 * (wx * wx * self.xx + 2.0 * wx * wy * self.xy + wy * wy * self.yy))


class WindEstimate:
    """The wind over a fleet, and the speed of each UAV through the air.

    Arguments of methods:
        uav_id: of a UAV.
        cruise: its speed as planned [m/s].
    """

    def __init__(self) -> None:
        self._moments: dict[str, _Moments] = {}
        self._wind: tuple[float, float] | None = None  # None: to be computed

    def add(self, uav_id: str, cruise: float, velocity: tuple[float, float],
            stamp: float) -> None:
        """Take a sample of steady flight.

        Args:
            uav_id: of the UAV.
            cruise: its speed as planned [m/s].
            velocity: over ground, east and north [m/s].
            stamp: [s]; one that goes back forgets nothing.
        """
        known = self._moments.get(uav_id)
        if known is None or known.cruise != cruise:
            known = self._moments[uav_id] = _Moments(cruise, stamp)
        known.add(*velocity, stamp)
        self._wind = None

    def forget(self, uav_id: str) -> None:
        """Drop the samples of a UAV."""
        if self._moments.pop(uav_id, None):
            self._wind = None

    @property
    def wind(self) -> tuple[float, float]:
        """East and north [m/s], of UAVs that drift with it; (0, 0) without samples."""
        if self._wind is None:
            many = list(self._moments.values())
            first = _fit(many)
            drifting = [each for each in many if not _holds_ground_speed(each, first)]
            self._wind = _fit(drifting) if len(drifting) < len(many) else first
        return self._wind

    def of(self, uav_id: str, cruise: float) -> tuple[float, tuple[float, float]]:
        """Return the speed of a UAV through the air, and the wind that acts on it [m/s].

        Where it holds its ground speed: that, and no wind.
        """
        known, wind = self._moments.get(uav_id), self.wind
        if known is None:
            return cruise, wind
        if _holds_ground_speed(known, wind):
            wind = (0.0, 0.0)
        square = known.constant(*wind) + wind[0]**2 + wind[1]**2
        speed = math.sqrt(max(0.0, square))
        return min(max(speed, _SLOWEST * cruise), _FASTEST * cruise), wind


def _holds_ground_speed(each: _Moments, wind: tuple[float, float]) -> bool:
    """Whether its samples contradict the wind, beyond their noise, and fit none better."""
    error, noise = each.error(*wind), (_CONTRADICTS * 2.0 * _NOISE * each.cruise**2) ** 2
    return (each.n >= _ENOUGH and error > noise * each.n
            and each.error(0.0, 0.0) < _FITS_BETTER * error)


def _fit(many: list[_Moments]) -> tuple[float, float]:
    """The wind of least squares, each c eliminated; (0, 0) without samples."""
    if not many:
        return 0.0, 0.0
    a11 = a12 = a22 = b1 = b2 = 0.0
    for each in many:
        # weights relative to the noise of one sample of q, which is 2 |v| times that of |v|
        weight, n = 1.0 / (2.0 * _NOISE * each.cruise**2) ** 2, each.n + each.prior
        q = each.q + each.prior * each.cruise**2
        a11 += weight * 4.0 * (each.xx - each.x * each.x / n)
        a12 += weight * 4.0 * (each.xy - each.x * each.y / n)
        a22 += weight * 4.0 * (each.yy - each.y * each.y / n)
        b1 += weight * 2.0 * (each.qx - each.x * q / n)
        b2 += weight * 2.0 * (each.qy - each.y * q / n)
    prior = 1.0 / _WIND_SPREAD**2
    a11, a22 = a11 + prior, a22 + prior
    determinant = a11 * a22 - a12 * a12
    return (a22 * b1 - a12 * b2) / determinant, (a11 * b2 - a12 * b1) / determinant
