# SPDX-License-Identifier: Apache-2.0
"""Motion and battery of a simulated copter: a point mass with limits, and a track to follow."""
from __future__ import annotations

import functools
import math
from collections.abc import Sequence

import numpy as np

from uav_task_alloc.geometry.frames import Origin, to_geodetic_batch
from uav_task_alloc.model import Point
from uav_task_alloc.sim.config import VehicleConfig
from uav_task_alloc.sim.wind import WindAtVehicle, held_velocity

_CORNER = 1.0  # [m] largest overshoot of a turn
_CLIMB = 1.5  # metres of level flight that drain as much as a climb of one metre adds
_HOVER = 0.25  # share of cruise speed whose battery drain equals that of hovering
_LEAN_RESERVE = 1.3  # airspeed at the largest lean angle, as a multiple of cruise speed
_BRAKING = 0.7  # share of the acceleration used to plan braking


class PointMass:
    """Position, velocity (ENU) and battery of one vehicle; `step` moves it towards a point."""

    def __init__(self, config: VehicleConfig) -> None:
        self._config = config
        self.position: Point = config.position  # [m]
        self.velocity: Point = (0.0, 0.0, 0.0)  # [m/s]
        self.heading = 0.0  # [rad] from east, counter-clockwise
        self.fixed_heading: float | None = None  # [rad] kept whatever the way; None: along it
        self.flown = 0.0  # [m]
        self.battery = config.charge  # [0..1]
        self.drain = 0.0  # share of the battery in a second, in the last step
        self._wind = None if config.wind is None else WindAtVehicle(
            config.wind, config.system_id)
        self._max_airspeed = (_LEAN_RESERVE * config.cruise_speed
                              if config.max_airspeed is None else config.max_airspeed)
        self._geodetic = _LinearGeodetic(config.origin)

    def step(self, dt: float, target: Point | None, speed: float, exit_speed: float) -> None:
        """Fly for `dt` [s] towards a target.

        Args:
            dt: [s].
            target: ENU [m]; None: stop.
            speed: largest speed [m/s].
            exit_speed: speed at the target [m/s].
        """
        self.steer(dt, (0.0, 0.0, 0.0) if target is None
                   else self._desired_velocity(dt, target, speed, exit_speed))

    def steer(self, dt: float, velocity: Point) -> None:
        """Change towards a velocity [m/s] within the acceleration, and fly for `dt` [s]."""
        if self._wind is not None:
            self._wind.step(dt)
            velocity = held_velocity(velocity, self._wind.velocity, self._max_airspeed)
        (x, y, z), (vx, vy, vz), (cx, cy, cz) = self.position, self.velocity, velocity
        cx, cy, cz = cx - vx, cy - vy, cz - vz
        most = self._config.acceleration * dt
        share = min(1.0, most / max(math.sqrt(cx * cx + cy * cy + cz * cz), 1e-9))
        self.velocity = vx, vy, vz = vx + cx * share, vy + cy * share, vz + cz * share
        if self.fixed_heading is not None:
            self.heading = self.fixed_heading
        elif math.hypot(vx, vy) > 0.5:
            self.heading = math.atan2(vy, vx)
        self.position = x + vx * dt, y + vy * dt, z + vz * dt
        self.flown += math.sqrt(vx * vx + vy * vy + vz * vz) * dt
        self._drain(dt)

    def _drain(self, dt: float) -> None:
        config, (vx, vy, vz) = self._config, self.velocity
        if self._wind is not None:
            wx, wy = self._wind.velocity
            vx, vy = vx - wx, vy - wy
        airspeed = math.sqrt(vx * vx + vy * vy + vz * vz)
        drain = (max(airspeed, _HOVER * config.cruise_speed)
                 + _CLIMB * max(0.0, vz)) * dt / config.range
        self.drain = max(drain, dt / config.endurance) / dt
        self.battery = max(0.0, self.battery - self.drain * dt)

    def fall(self, dt: float, speed: float) -> None:
        """Fall straight down for `dt` [s] at `speed` [m/s], motors off."""
        self.velocity = (0.0, 0.0, -speed)
        self.position = _plus(self.position, self.velocity, dt)

    def _desired_velocity(self, dt: float, target: Point, speed: float,
                          exit_speed: float) -> Point:
        gap = gx, gy, gz = _minus(target, self.position)
        distance = _norm(gap)
        if distance < 1e-6:
            return 0.0, 0.0, 0.0
        acceleration = self._config.acceleration
        braking = _BRAKING * acceleration
        limit = min(speed, math.sqrt(exit_speed**2 + 2.0 * braking * distance))
        if exit_speed == 0.0:
            limit = min(limit, distance / dt)
        # the rest of the acceleration ends the motion across the path
        along = _dot(self.velocity, gap) / distance
        limit = min(limit, max(0.0, along) + acceleration * dt)
        steep = abs(gz) / distance
        rate = self._config.climb_rate if gz > 0.0 else self._config.descent_rate
        if limit * steep > rate:
            limit = rate / steep
        return gx / distance * limit, gy / distance * limit, gz / distance * limit

    def land_at(self, height: float) -> None:
        """Come to rest on the ground at `height` [m] ENU."""
        self.position = (self.position[0], self.position[1], height)
        self.velocity = (0.0, 0.0, 0.0)

    def geodetic(self, offset: Point = (0.0, 0.0, 0.0)) -> tuple[float, float, float]:
        """Latitude [deg], longitude [deg], altitude AMSL [m] of the position, `offset` [m] off."""
        return self._geodetic.convert(_plus(self.position, offset, 1.0))


@functools.lru_cache(maxsize=4096)
def _linear_map(origin: Origin, point: Point) -> tuple[list[float], list[list[float]]]:
    """The geodetic position of a point, and its change by metre east, north and up."""
    x, y, z = point
    rows = to_geodetic_batch(origin, [
        point, (x + 10.0, y, z), (x, y + 10.0, z), (x, y, z + 10.0)])
    return rows[0].tolist(), ((rows[1:] - rows[0]) / 10.0).astype(np.float64).tolist()


class _LinearGeodetic:
    """ENU to WGS84 by a linear map, rebuilt every 50 m: cheap, error below 1 mm."""

    def __init__(self, origin: Origin) -> None:
        self._origin = origin
        self._around: Point | None = None
        self._base: list[float] = []
        self._slope: list[list[float]] = []

    def convert(self, point: Point) -> tuple[float, float, float]:
        dx, dy, dz = gap = _minus(point, self._around or point)
        if self._around is None or _norm(gap) > 50.0:
            self._around = point
            self._base, self._slope = _linear_map(self._origin, point)
            dx, dy, dz = 0.0, 0.0, 0.0
        (ax, ay, az), (bx, by, bz), (cx, cy, cz) = self._slope
        latitude, longitude, altitude = self._base
        return (latitude + dx * ax + dy * bx + dz * cx, longitude + dx * ay + dy * by + dz * cy,
                altitude + dx * az + dy * bz + dz * cz)


class Track:
    """Points to pass in order, and a hold at the last.

    Args:
        points: ENU [m].
        radius: distance at which a point is passed [m].
        hold: time to stay at the last point [s].
        lands: whether it ends on the ground.
        takes_off: whether it is the climb of a take-off.
    """

    def __init__(self, points: Sequence[Point], radius: float, hold: float = 0.0,
                 lands: bool = False, takes_off: bool = False) -> None:
        self.points = tuple(points)
        self.radius = radius
        self.hold = hold
        self.lands, self.takes_off = lands, takes_off
        self._next = 0
        self._arrived: float | None = None

    @property
    def target(self) -> Point | None:
        """The point to fly to; the last one while holding, None where there is none."""
        if self._next < len(self.points):
            return self.points[self._next]
        return self.points[-1] if self.points else None

    @property
    def descends(self) -> bool:
        """Whether it goes down to the ground from here on."""
        return self.lands and self._next >= len(self.points) - 1

    def exit_speed(self, position: Point, then: Point | None, acceleration: float) -> float:
        """Speed [m/s] at which the target may be passed.

        It lets the vehicle turn within _CORNER, and stop at the next point, after which it knows
        of no other (PX4: `PositionSmoothing`, ArduPilot: `SCurve`).

        Args:
            position: ENU [m].
            then: the point after the track, ENU [m]; None: there is none.
            acceleration: [m/s2].
        """
        if self._next < len(self.points) - 1:
            then = self.points[self._next + 1]
        elif self.hold > 0.0 or self.lands:
            return 0.0
        target = self.target
        if then is None or target is None or self._next >= len(self.points):
            return 0.0
        inward, outward = _minus(target, position), _minus(then, target)
        lengths = _norm(inward) * _norm(outward)
        cosine = _dot(inward, outward) / max(lengths, 1e-9)
        sine = 1.0 if cosine <= 0.0 else math.sqrt(max(0.0, 1.0 - cosine**2))
        return min(math.sqrt(2.0 * acceleration * _CORNER) / max(sine, 1e-3),
                   math.sqrt(2.0 * _BRAKING * acceleration * _norm(outward)))

    def finished(self, position: Point, now: float) -> bool:
        """Mark the points passed at `now` [s]; True once the last point was held long enough.

        Args:
            position: of the vehicle [m] ENU.
            now: [s].
        """
        while (self._next < len(self.points)
               and metres_between(position, self.points[self._next]) <= self.radius):
            self._next += 1
        if self._next < len(self.points):
            return False
        if self._arrived is None:
            self._arrived = now
        return now - self._arrived >= self.hold - 1e-9


def metres_between(a: Point, b: Point) -> float:
    """Return the distance between two points.

    Args:
        a: (x, y, z) [m].
        b: (x, y, z) [m].

    Returns:
        [m].
    """
    return _norm(_minus(a, b))


def _minus(a: Point, b: Point) -> Point:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def _plus(a: Point, b: Point, factor: float) -> Point:
    return a[0] + b[0] * factor, a[1] + b[1] * factor, a[2] + b[2] * factor


def _dot(a: Point, b: Point) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _norm(a: Point) -> float:
    return math.sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])
