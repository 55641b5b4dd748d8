# SPDX-License-Identifier: Apache-2.0
"""Estimates what a flight uses of a battery: by time, metres flown, climbs and wind; no I/O.

The charge falls by a sum that is linear in what was flown, so that a Kalman filter finds its terms
and their covariance (Kalman 1960, https://doi.org/10.1115/1.3662552). The wind has two: with the
wind w a copter at the ground velocity v has the airspeed |v - w|, to the first order |v| less the
component of w along v, and its sum over a flight depends on the displacement alone. What a return
costs against the wind follows from where home is, whatever the route.
"""
from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from uav_task_alloc.model import Point

_CHARGE, _TIME, _METRE, _CLIMB, _EAST, _NORTH = range(6)  # the state
_STEP = 0.01  # share of a battery that its reading resolves
_READING = 0.004  # standard deviation of the charge when a reading changes
_JUMP = 0.05  # difference from a reading that shows another battery, or another capacity
_USUAL_TIME = 1200.0  # [s] that a copter flies where nothing is known of it
_TIME_SHARE = 0.6  # of the drain at cruise speed that does not depend on the speed, a priori
_CLIMB_METRES = 1.5  # metres of level flight that a climb of one metre costs more, a priori
_WIND = 0.25  # of the terms of the wind, as a share of the level drain
_STATED = 0.05  # standard deviation of what is stated for the vehicle as it was, as a share
_NOMINAL = 0.3  # that of what payload and age change in all terms alike, as a share
_SPREAD = 0.4  # a priori standard deviation of the other terms, as a share of the level drain
_TAKEOFF = 0.15  # standard deviation of such a change between two flights, as a share
_DRIFT = 0.004  # of the terms in one second, as a share, by the root of time
_MODEL = 0.02  # standard deviation of what the model does not have, as a share of what is used
_KNOWN = 0.25  # standard deviation of the level drain, as a share, below which it is known
_LEAST_USED = 0.01  # of the battery, until its drain is known
_COUNTED = 0.2  # standard deviation of a counted share by what the model does not have
_COUNT_DRIFT = 0.1  # that of the charge by a count, for 1 % of the battery, as a share
_COUNT_RISE = 0.03  # least rise of a reading that restarts a counted charge
_LEAST_TERM = 0.1  # share of the prior level drain below which no sum of terms is believed

_Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class NominalEnergy:
    """What is stated about a vehicle; 0: unknown."""

    full_range: float = 0.0  # [m] with a full battery
    endurance: float = 0.0  # [s] with a full battery
    speed: float = 0.0  # [m/s] cruise

    @property
    def cruise(self) -> float:
        """The cruise speed, or a usual one [m/s]."""
        return self.speed or 10.0

    @property
    def level(self) -> float:
        """Share of the battery for a level metre at cruise speed."""
        if self.full_range > 0.0:
            return 1.0 / self.full_range
        return 1.0 / (self.cruise * (self.endurance or _USUAL_TIME))


@dataclass(frozen=True, slots=True)
class FlownAmount:
    """An amount of flight, flown or planned."""

    seconds: float = 0.0  # in the air
    metres: float = 0.0  # horizontal
    climb: float = 0.0  # [m] upwards
    east: float = 0.0  # [m] displacement
    north: float = 0.0  # [m] displacement

    def plus(self, other: FlownAmount) -> FlownAmount:
        """Return the sum with another amount."""
        return FlownAmount(self.seconds + other.seconds, self.metres + other.metres,
                           self.climb + other.climb, self.east + other.east,
                           self.north + other.north)

    def row(self) -> _Floats:
        """Return by how much each term of the state lowers the charge."""
        return np.array([0.0, self.seconds, self.metres, self.climb, self.east, self.north])


def planned_amount(points: Sequence[Point], speed: float, hover: float = 0.0) -> FlownAmount:
    """Return the amount of a planned flight.

    Args:
        points: of its way [m] ENU, the first where it is.
        speed: horizontal, over ground [m/s].
        hover: [s] at its stops.

    Returns:
        The time of a leg is that of its horizontal motion.
    """
    metres = math.fsum(math.dist(a[:2], b[:2]) for a, b in pairwise(points))
    climb = math.fsum(max(0.0, b[2] - a[2]) for a, b in pairwise(points))
    first, last = points[0], points[-1]
    return FlownAmount(metres / speed + hover, metres, climb, last[0] - first[0],
                       last[1] - first[1])


@dataclass(frozen=True, slots=True)
class EnergyLimits:
    """What a battery still allows, and would allow if it were full."""

    range: float  # [m] level flight, after what climbs, wind on the way home and landing take
    endurance: float  # [s] in the air until it has landed, hovering as much as the plan does
    full_range: float  # [m]


class EnergyEstimate:
    """The charge of one battery, and what a flight uses of it.

    Args:
        nominal: what is stated about the vehicle: the estimate before the first flight.

    Arguments of methods:
        amount: of flight.
        share: reading of the battery [0..1].
    """

    def __init__(self, nominal: NominalEnergy) -> None:
        self.nominal = nominal
        level, speed = nominal.level, nominal.cruise
        stated = nominal.full_range > 0.0 or nominal.endurance > 0.0
        spread = (_SPREAD if stated else 2.0 * _SPREAD) * level
        self._x: _Floats = np.array([1.0, _TIME_SHARE * level * speed, (1.0 - _TIME_SHARE) * level,
                                    _CLIMB_METRES * level, 0.0, 0.0])
        self._cov: _Floats = np.diag([1.0, spread * speed, spread, _CLIMB_METRES * level,
                                     _WIND * level, _WIND * level]) ** 2
        if nominal.full_range > 0.0:
            self._observe(np.array([0.0, 1.0 / speed, 1.0, 0.0, 0.0, 0.0]), level,
                          _STATED * level)
        if nominal.endurance > 0.0:
            self._observe(np.array([0.0, 1.0, 0.0, 0.0, 0.0, 0.0]), 1.0 / nominal.endurance,
                          _STATED / nominal.endurance)
        self._change_all(_NOMINAL)
        self._share: float | None = None  # the last reading
        self._used = 0.0  # of the battery since the take-off
        self._flown = FlownAmount()  # since the last reading that changed, or the last count
        self._unread = FlownAmount()  # since the last reading
        self.counting = False  # what is used is counted, and the readings correct the charge

    @property
    def known(self) -> bool:
        """Whether this flight has shown what it uses."""
        level = self._level_row()
        mean = float(level @ self._x)
        return self._used >= _LEAST_USED and (
            math.sqrt(float(level @ self._cov @ level)) < _KNOWN * mean)

    def _level_row(self) -> _Floats:
        return np.array([0.0, 1.0 / self.nominal.cruise, 1.0, 0.0, 0.0, 0.0])

    def took_off(self) -> None:
        """Begin a flight: payload and battery may be others."""
        self._used, self._flown = 0.0, FlownAmount()
        self._change_all(_TAKEOFF)

    def _change_all(self, share: float) -> None:
        """Let payload or age change time, metres and climbs by a common, unknown share."""
        terms = self._x.copy()
        terms[[_CHARGE, _EAST, _NORTH]] = 0.0
        self._cov += share**2 * np.outer(terms, terms)

    def flew(self, amount: FlownAmount) -> None:
        """Add an amount that was flown."""
        self._flown, self._unread = self._flown.plus(amount), self._unread.plus(amount)

    @property
    def charge(self) -> float:
        """The expected charge now [0..1]."""
        return self._charge_now()

    def start_counting(self) -> None:
        """From now on what is used is counted."""
        self._advance()
        self.counting = True

    def count(self, share: float, deviation: float) -> None:
        """Process a share of the battery that was counted as used since the last one.

        Args:
            share: of the battery, > 0.
            deviation: standard deviation of its measurement.
        """
        row, self._flown = self._flown.row(), FlownAmount()
        if row[_TIME] > 0.0:
            self._observe(row, share, math.hypot(deviation, _COUNTED * share))
            self._used += share
            self._drift(float(row[_TIME]))
        self._x[_CHARGE] -= share
        self._cov[_CHARGE, _CHARGE] += _COUNT_DRIFT**2 * _STEP * share

    def scale(self, factor: float) -> None:
        """Change all terms by a factor: the capacity by which shares are counted is another."""
        self._x[_TIME:] *= factor
        self._cov[_TIME:, :] *= factor
        self._cov[:, _TIME:] *= factor

    def read(self, share: float, believed: bool = True) -> None:
        """Process a reading of the battery; one that is unchanged says nothing.

        Args:
            share: see above.
            believed: False: the charge is less where it was counted so.
        """
        before, self._share, self._unread = self._share, share, FlownAmount()
        if before is None or share - before > (_COUNT_RISE if self.counting else 0.0):
            self._restart_charge(share)
        elif share < before:
            self._fall(before - share, believed)

    def _fall(self, drop: float, believed: bool) -> None:
        """Process a reading that is lower than the one before."""
        if not self.counting:
            self._advance()
        share = self._share or 0.0
        # between the end of the old step and its middle: some round, some cut
        seen = share + 0.75 * min(drop, _STEP)
        more = seen - float(self._x[_CHARGE])
        if more > 0.0 and not believed:
            return
        if abs(more) > max(_JUMP, 3.0 * self._charge_deviation()):
            self._restart_charge(share)
            return
        self._used += 0.0 if self.counting else drop
        self._observe(np.eye(6)[_CHARGE], seen, _READING + 0.25 * max(0.0, drop - _STEP))

    def _charge_deviation(self) -> float:
        return math.sqrt(float(self._cov[_CHARGE, _CHARGE]))

    def _restart_charge(self, share: float) -> None:
        """Take the charge from a reading alone; what a flight uses stays as it was."""
        self._flown = FlownAmount()
        self._x[_CHARGE] = min(1.0, share + 0.5 * _STEP)
        self._cov[_CHARGE, :] = self._cov[:, _CHARGE] = 0.0
        self._cov[_CHARGE, _CHARGE] = _READING**2

    def _advance(self) -> None:
        """Let the charge fall by what was flown since the last change of the reading."""
        row, self._flown = self._flown.row(), FlownAmount()
        used = float(row @ self._x)
        move = np.eye(6)
        move[_CHARGE] -= row
        self._x = move @ self._x
        self._cov = move @ self._cov @ move.T
        self._cov[_CHARGE, _CHARGE] += (_MODEL * used) ** 2
        self._drift(float(row[_TIME]))

    def _drift(self, seconds: float) -> None:
        """Let the terms change in a time [s] of flight."""
        level, speed = self.nominal.level, self.nominal.cruise
        scale = np.array([level * speed, level, level, level, level])
        self._cov[_TIME:, _TIME:] += np.diag((_DRIFT * scale) ** 2) * seconds

    def _observe(self, row: _Floats, value: float, deviation: float) -> None:
        """Use a measurement of a weighted sum of the state."""
        gain = self._cov @ row / (float(row @ self._cov @ row) + deviation**2)
        self._x = self._x + gain * (value - float(row @ self._x))
        cov = self._cov - np.outer(gain, row @ self._cov)
        self._cov = 0.5 * (cov + cov.T)

    def charge_after(self, amount: FlownAmount, deviations: float = 0.0) -> float:
        """Return the charge after another amount of flight.

        Args:
            amount: to be flown.
            deviations: standard deviations by which it is less than expected.

        Returns:
            Share of the battery; below 0 where it does not suffice.
        """
        row = -self._flown.plus(amount).row()
        row[_CHARGE] = 1.0
        charge = self._charge_now() - float(amount.row() @ self._x)
        return charge - deviations * math.sqrt(max(0.0, float(row @ self._cov @ row)))

    def _charge_now(self) -> float:
        """The expected charge: within the step of the last reading, less what was flown since."""
        share = 1.0 if self._share is None else self._share
        since = float(self._unread.row() @ self._x)
        charge = float(self._x[_CHARGE] - self._flown.row() @ self._x) + since
        return min(charge if self.counting else max(charge, share), share + _STEP) - since

    def limits(self, ahead: FlownAmount, speed: float, deviations: float,
               landing: float = 0.0) -> EnergyLimits:
        """Return range and endurance of flights that end where the planned one ends.

        Args:
            ahead: of the plan, to the ground.
            speed: over ground in level flight [m/s].
            deviations: standard deviations of safety.
            landing: [s] of `ahead` over the end, down to the ground.

        Returns:
            Such that a flight within both uses no more than there is.
        """
        cruise = ahead.metres / speed
        share = 1.0 if ahead.seconds <= 0.0 else min(1.0, cruise / ahead.seconds)
        least = _LEAST_TERM * self.nominal.level
        level = max(least, float(self._x[_METRE]) + float(self._x[_TIME]) / speed)
        power = max(least * speed, float(self._x[_TIME] + self._x[_METRE] * speed * share))
        expected = float(ahead.row() @ self._x)
        usual = ahead.metres * level + (ahead.seconds - cruise) * float(self._x[_TIME])
        fixed = expected - usual  # climbs and wind
        charge = self.charge_after(ahead, deviations) + expected - fixed
        metres = (charge - landing * max(0.0, float(self._x[_TIME]))) / level
        return EnergyLimits(max(0.0, metres), max(0.0, charge / power), 1.0 / level)
