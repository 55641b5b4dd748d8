# SPDX-License-Identifier: Apache-2.0
"""Estimates the wind and the speed through the air of each UAV from measured ground velocities.

With wind w and speed s through the air, a UAV on the course u (a unit vector) has the ground speed
g = u.w + sqrt(s^2 - |w|^2 + (u.w)^2), or nearly g = u.w + s - (|w|^2 - (u.w)^2) / (2 s): linear in
1, in u and in the double angle of u. The least squares of recent samples give the wind, which all
UAVs share, and s of each UAV. Gusts change g and hardly u: a fit of |v|^2 = 2 v.w + s^2 - |w|^2
instead, with the gusts on both sides, has a UAV on one course stand still in a wind of its own
speed (errors in variables; for circles: N. Chernov, "Circular and Linear Regression", 2010). What
the courses of a flight do not tell is left to what is usual: little wind, the cruise speed. An
autopilot that holds its ground speed whatever the wind shows the same g in all directions.
"""
from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

_MEMORY = 120.0  # [s] after which a sample counts 1/e
_NOISE = 0.05  # share of the cruise speed: standard deviation of a sample's speed
_GUST_SAMPLES = 10.0  # that a gust lasts: so many samples with the error of a gust count as one
_SPREAD = 0.1  # share of the cruise speed: of the speed through the air before any sample
_WIND_SPREAD = 4.0  # [m/s] of each component of the wind before any sample
_SLOWEST, _FASTEST = 0.3, 1.5  # times the cruise speed: bounds of the speed through the air
_FITS_BETTER = 0.7  # times the squared error with wind: a UAV holds its ground speed
_CONTRADICTS = 1.5  # standard deviations of a sample: mean error that contradicts a wind
_ENOUGH = 5.0  # samples for that
_STEPS = 4  # of the fit, whose quadratic terms are those of the step before
_PERIOD = 1.0  # [s] of samples between two fits
_G = 5  # index of the ground speed in the sums
_Wind = tuple[float, float]
_Floats = NDArray[np.float64]


@dataclass(slots=True)
class _Moments:
    """Decaying sums over the samples of one UAV: products of 1, cos, sin, cos 2, sin 2, g."""

    cruise: float  # [m/s]
    at: float  # [s]
    sums: NDArray[np.float64] = field(default_factory=lambda: np.zeros((6, 6)))

    def add(self, x: float, y: float, stamp: float) -> None:
        keep = math.exp(-max(0.0, stamp - self.at) / _MEMORY)
        speed, self.at = math.hypot(x, y), stamp
        if speed > 0.0:
            x, y = x / speed, y / speed
            row = np.array((1.0, x, y, x * x - y * y, 2.0 * x * y, speed))
            self.sums = keep * self.sums + np.outer(row, row)


class _Samples:
    """The samples of some UAVs; results are one for each of them."""

    def __init__(self, many: Sequence[_Moments]) -> None:
        self._sums: _Floats = np.array([each.sums for each in many]).reshape(-1, 6, 6)
        self._cruise: _Floats = np.array([each.cruise for each in many])
        self._n: _Floats = self._sums[:, 0, 0]
        self._usual: _Floats = (_NOISE * self._cruise) ** 2  # variance of a sample [m2/s2]

    def of(self, chosen: NDArray[np.bool_]) -> _Samples:
        """Return the samples of the chosen UAVs."""
        found = _Samples(())
        found._sums, found._cruise = self._sums[chosen], self._cruise[chosen]
        found._n, found._usual = self._n[chosen], self._usual[chosen]
        return found

    def air_speeds(self, wind: _Wind, noise: _Floats | float) -> _Floats:
        """Return the best speeds through the air for a wind [m/s], near the cruise speed.

        Args:
            wind: [m/s].
            noise: variance of a sample [m2/s2]; 0: the samples alone count.
        """
        prior = noise / (_SPREAD * self._cruise) ** 2  # in samples
        speed = self._cruise
        for _ in range(2):
            mean = np.einsum('ki,ki->k', self._sums[:, 0], self._errors_of(wind, speed))
            speed = (mean + prior * self._cruise) / np.maximum(self._n + prior, 1e-9)
            speed = np.clip(speed, _SLOWEST * self._cruise, _FASTEST * self._cruise)
        return speed

    def errors(self, wind: _Wind) -> _Floats:
        """Return the mean squared errors for a wind [m2/s2], with the best speeds."""
        rows = self._errors_of(wind, self.air_speeds(wind, 0.0))
        n = np.maximum(self._n, 1e-9)
        mean = np.einsum('ki,ki->k', self._sums[:, 0], rows) / n
        return np.asarray(np.maximum(
            0.0, np.einsum('ki,kij,kj->k', rows, self._sums, rows) / n - mean**2))

    def noises(self, wind: _Wind) -> _Floats:
        """Return the variances of a sample [m2/s2], with that of gusts."""
        return self._usual + _GUST_SAMPLES * self.errors(wind)

    def hold_ground_speed(self, wind: _Wind) -> NDArray[np.bool_]:
        """Return whether samples contradict the wind, beyond their noise, and fit none better."""
        errors = self.errors(wind)
        return np.asarray((self._n >= _ENOUGH) & (errors > _CONTRADICTS**2 * self._usual) & (
            self.errors((0.0, 0.0)) < _FITS_BETTER * errors))

    def fit(self, wind: _Wind | None = None) -> _Wind:
        """Return the wind of least squares, each speed eliminated.

        Args:
            wind: what it leaves of the samples are gusts; None: there are none.
        """
        noise = self._usual if wind is None else self.noises(wind)
        prior = noise / (_SPREAD * self._cruise) ** 2
        n, own, sums, cruise = self._n + prior, self._sums[:, 0, 1:3], self._sums, self._cruise
        matrix = np.eye(2) / _WIND_SPREAD**2 + np.einsum('k,kij->ij', 1.0 / noise, (
            sums[:, 1:3, 1:3] - own[:, :, None] * own[:, None, :] / n[:, None, None]))
        x, y = 0.0, 0.0
        for _ in range(_STEPS):
            lost, *bent = _second_order((x, y), cruise)
            left = sums[:, :3, _G] - np.einsum('kij,jk->ki', sums[:, :3, 3:5], np.array(bent))
            mean = (left[:, 0] + prior * (cruise - lost)) / n
            right = np.einsum('k,ki->i', 1.0 / noise, left[:, 1:] - own * mean[:, None])
            x, y = (float(each) for each in np.linalg.solve(matrix, right))
            # beyond that the terms of second order say nothing
            excess = math.hypot(x, y) / float(cruise.max(initial=1.0))
            x, y = x / max(1.0, excess), y / max(1.0, excess)
        return x, y

    def _errors_of(self, wind: _Wind, speed: _Floats) -> _Floats:
        """Factors of the sums with which they give g less its model without the speed."""
        lost, cos2, sin2 = _second_order(wind, speed)
        one = np.ones_like(speed)
        return np.stack([lost, -wind[0] * one, -wind[1] * one, -cos2, -sin2, one], axis=1)


class WindEstimate:
    """The wind over a fleet, and the speed of each UAV through the air.

    Arguments of methods:
        uav_id: of a UAV.
        cruise: its speed as planned [m/s].
    """

    def __init__(self) -> None:
        self._moments: dict[str, _Moments] = {}
        self._wind, self._speeds = (0.0, 0.0), dict[str, tuple[float, _Wind]]()
        self._newest = self._fitted = -math.inf  # [s] stamps; -inf: to be computed

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
            self._fitted = -math.inf
        known.add(*velocity, stamp)
        self._newest = stamp

    def forget(self, uav_id: str) -> None:
        """Drop the samples of a UAV."""
        if self._moments.pop(uav_id, None):
            self._fitted = -math.inf
        if not self._moments:
            self._wind, self._speeds = (0.0, 0.0), {}

    @property
    def wind(self) -> tuple[float, float]:
        """East and north [m/s], of UAVs that drift with it; (0, 0) without samples."""
        if self._moments and not abs(self._newest - self._fitted) < _PERIOD:
            self._fit()
        return self._wind

    def of(self, uav_id: str, cruise: float) -> tuple[float, tuple[float, float]]:
        """Return the speed of a UAV through the air, and the wind that acts on it [m/s].

        Where it holds its ground speed: that, and no wind.
        """
        wind = self.wind
        return self._speeds.get(uav_id, (cruise, wind))

    def _fit(self) -> None:
        samples, self._fitted = _Samples(list(self._moments.values())), self._newest
        wind = samples.fit()
        holding = samples.hold_ground_speed(wind)
        drifting = samples
        if holding.any():
            drifting = samples.of(~holding)
            wind = drifting.fit()
        self._wind = wind = drifting.fit(wind)
        holding, still = samples.hold_ground_speed(wind), (0.0, 0.0)
        speeds = np.where(holding, samples.air_speeds(still, samples.noises(still)),
                          samples.air_speeds(wind, samples.noises(wind)))
        self._speeds = {uav_id: (float(speed), still if holds else wind) for uav_id, speed, holds
                        in zip(self._moments, speeds, holding, strict=True)}


def _second_order(wind: _Wind, speed: _Floats) -> tuple[_Floats, _Floats, _Floats]:
    """What a wind takes of g on all courses, and the factors of cos 2 and sin 2 in g [m/s]."""
    x, y = wind
    return ((x * x + y * y) / (4.0 * speed), (x * x - y * y) / (4.0 * speed),
            x * y / (2.0 * speed))
