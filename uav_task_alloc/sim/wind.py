# SPDX-License-Identifier: Apache-2.0
"""Wind at a simulated vehicle, steady and in gusts, and the ground velocity it can hold in it.

A multirotor in a mission controls its velocity over ground: it leans into the wind, so that wind
changes neither speed nor track until the lean angle is at its limit (ATC_ANGLE_MAX of ArduCopter,
MPC_TILTMAX_AIR of PX4). There thrust and drag balance at a largest airspeed; what is left of the
ground speed is flown along the track, and a wind stronger than that carries the vehicle off.
https://ardupilot.org/copter/docs/parameters.html, https://docs.px4.io/main/en/config_mc/
Gusts are a first-order Gauss-Markov process, the form of the Dryden model's longitudinal part
(MIL-F-8785C, 3.7) at low altitude.
"""
from __future__ import annotations

import math
import random
from dataclasses import dataclass

from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.model import Point

GUST_TIME = 10.0  # [s] after which a gust is forgotten
MAX_WIND = 100.0  # [m/s]


@dataclass(frozen=True, slots=True)
class Wind:
    """Wind of a whole area; each vehicle has gusts of its own."""

    east: float = 0.0  # [m/s] towards east
    north: float = 0.0  # [m/s] towards north
    gusts: float = 0.0  # [m/s] standard deviation of each component
    seed: int = 0  # of the gusts

    def __post_init__(self) -> None:
        for name, low in (('east', -MAX_WIND), ('north', -MAX_WIND), ('gusts', 0.0)):
            value = getattr(self, name)
            if not low <= value <= MAX_WIND:
                raise InvalidValue(f'wind: {name}', value,
                                   f'a number in [{low:g}, {MAX_WIND:g}] m/s')


class WindAtVehicle:
    """The wind where one vehicle is; `step` lets time pass.

    Args:
        wind: of the area.
        system_id: of the vehicle: its gusts differ from those of others.
    """

    def __init__(self, wind: Wind, system_id: int) -> None:
        self._wind = wind
        self._rng = random.Random(wind.seed * 256 + system_id)
        self._gust = [self._rng.gauss(0.0, wind.gusts) for _ in range(2)]  # [m/s]

    @property
    def velocity(self) -> tuple[float, float]:
        """Of the air [m/s] towards east and north."""
        return self._wind.east + self._gust[0], self._wind.north + self._gust[1]

    def step(self, dt: float) -> None:
        """Let `dt` [s] pass."""
        if self._wind.gusts > 0.0:
            kept = math.exp(-dt / GUST_TIME)
            spread = self._wind.gusts * math.sqrt(1.0 - kept * kept)
            self._gust = [kept * each + self._rng.gauss(0.0, spread) for each in self._gust]


def held_velocity(wanted: Point, wind: tuple[float, float], max_airspeed: float) -> Point:
    """Return the velocity over ground that a multirotor holds in a wind.

    Args:
        wanted: by its mission [m/s] ENU.
        wind: velocity of the air [m/s] towards east and north.
        max_airspeed: horizontal [m/s], at the largest lean angle.

    Returns:
        [m/s] ENU: as wanted where the lean angle allows it; else along the wanted track as fast as
        it can, also backwards; where it cannot stay on the track, it is carried off.
    """
    wx, wy = wind
    if math.hypot(wanted[0] - wx, wanted[1] - wy) <= max_airspeed:
        return wanted
    speed, strength = math.hypot(wanted[0], wanted[1]), math.hypot(wx, wy)
    # without a track it keeps still as far as it can
    ux, uy = ((wanted[0] / speed, wanted[1] / speed) if speed > 0.0
              else (-wx / strength, -wy / strength))
    along, across = wx * ux + wy * uy, wx * uy - wy * ux
    if abs(across) > max_airspeed:  # it leans straight against the wind
        share = 1.0 - max_airspeed / strength
        return wx * share, wy * share, wanted[2]
    room = math.sqrt(max_airspeed**2 - across**2)
    ground = min(max(speed, along - room), along + room)
    return ux * ground, uy * ground, wanted[2]
