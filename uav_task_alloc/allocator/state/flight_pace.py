# SPDX-License-Identifier: Apache-2.0
"""How fast a UAV flies: speed, wind, time lost at stops.

A leg begins and ends at rest. With the cruise speed v and the time s that a stop costs, a UAV
gains and loses speed with v / s [m/s2]; on a leg shorter than v s it does not reach v. At a detour
point it slows down as far as a corner of _CORNER at that acceleration demands.
"""
from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

from uav_task_alloc.geometry.polyline import points_passed
from uav_task_alloc.model import Point, Uav

_SLOWEST = 0.1  # share of the speed that is left against the strongest wind
_ACCELERATION = 2.5  # [m/s2] before any stop is measured: WPNAV_ACCEL; 3.0: MPC_ACC_HOR
_CORNER = 2.0  # [m] by which a corner is cut or overshot: WPNAV_RADIUS, NAV_ACC_RAD


@dataclass(frozen=True, slots=True)
class FlightPace:
    """How fast a UAV flies, as planned or as measured.

    On each straight part the slowest of horizontal, upward and downward motion sets the time, as
    in geometry/flight_time.py; here with wind.
    """

    speed: float  # [m/s] horizontal, through the air
    climb: float = math.inf  # [m/s]
    descent: float = math.inf  # [m/s]
    wind: tuple[float, float] = (0.0, 0.0)  # [m/s] ENU, as far as it changes the ground speed
    stop_time: float = 0.0  # [s] lost by braking before a stop and accelerating after it; of
    # a leg that is long enough for the full speed
    takeoff: float = 0.0  # [s] lost by arming, spooling up the motors and beginning the climb

    @classmethod
    def of(cls, uav: Uav) -> FlightPace:
        """Return the pace of a UAV as planned, without wind.

        Args:
            uav: with its speeds.
        """
        return cls(uav.cruise_speed, uav.climb_speed, uav.descent_speed)

    def ground_speed(self, dx: float, dy: float) -> float:
        """Return the ground speed in a direction.

        Args:
            dx, dy: of the direction, of any length; both 0: any direction.

        Returns:
            [m/s]; at least a tenth of the speed, whatever the wind.
        """
        length = math.hypot(dx, dy)
        if self.wind == (0.0, 0.0) or length == 0.0:
            return self.speed
        wx, wy = self.wind
        along = (wx * dx + wy * dy) / length
        across = wx * wx + wy * wy - along * along
        rest = math.sqrt(max(0.0, self.speed * self.speed - across))
        return max(along + rest, _SLOWEST * self.speed)

    def seconds(self, points: Sequence[Point]) -> float:
        """Return the time along a polyline, without stops.

        Args:
            points: [m] ENU.

        Returns:
            [s].
        """
        total = 0.0
        for (x, y, z), (x1, y1, z1) in pairwise(points):
            dx, dy, dz = x1 - x, y1 - y, z1 - z
            vertical = dz / self.climb if dz > 0.0 else -dz / self.descent
            total += max(math.hypot(dx, dy) / self.ground_speed(dx, dy), vertical)
        return total

    @property
    def usual_stop(self) -> float:
        """The time that a stop costs a copter of this speed where none was measured [s]."""
        return self.speed / _ACCELERATION

    def corners(self, points: Sequence[Point]) -> float:
        """Return the time lost at the inner points of a polyline, in stops.

        Args:
            points: [m] ENU, from stop to stop.

        Returns:
            0.0 for a straight line; 1.0 for each point where a UAV has to turn back.
        """
        if self.stop_time == 0.0 or len(points) < 3:
            return 0.0
        slow = math.sqrt(2.0 * _CORNER / (self.speed * self.stop_time))
        return math.fsum(max(0.0, 1.0 - slow / max(sine, 1e-9)) ** 2
                         for sine in map(_turn, points, points[1:], points[2:]))

    def from_stop(self, points: Sequence[Point], share: float = 0.0) -> float:
        """Return the time along a polyline that ends with a stop.

        Args:
            points: [m] ENU.
            share: of its speed that the UAV has at the begin, 0 to 1.

        Returns:
            [s].
        """
        return stopping(self.seconds(points), self.stop_time, share) + (
            self.stop_time * self.corners(points))

    @property
    def mean_speed(self) -> float:
        """Ground speed that takes the mean time of eight directions [m/s]."""
        if self.wind == (0.0, 0.0):
            return self.speed
        ways = [(math.cos(k * math.pi / 4.0), math.sin(k * math.pi / 4.0)) for k in range(8)]
        return 8.0 / sum(1.0 / self.ground_speed(*way) for way in ways)


def stopping(seconds: float, stop_time: float, share: float = 0.0) -> float:
    """Return the time of a way at whose end a UAV comes to rest.

    Args:
        seconds: [s] of the way at full speed.
        stop_time: [s] lost by a start and a stop, where the way is long enough.
        share: of its speed that the UAV has at the begin, 0 to 1.

    Returns:
        [s]; `seconds` + `stop_time` for a long way from rest.
    """
    if stop_time <= 0.0 or seconds <= 0.0:
        return seconds
    way = seconds / stop_time  # now the speed and the acceleration are 1
    if 2.0 * way <= share * share:  # it brakes
        return stop_time * 2.0 * way / share
    top = math.sqrt(way + 0.5 * share * share)
    if top < 1.0:
        return stop_time * (2.0 * top - share)
    return stop_time * (way + 0.5 + 0.5 * (1.0 - share) ** 2)


def measured_stop(seconds: float, flown: float, corners: float) -> float:
    """Return what a stop costs by the time of a way between two; the inverse of `from_stop`.

    Args:
        seconds: [s] of the way at full speed, above 0.
        flown: [s] that it took.
        corners: of the way, see `FlightPace.corners`.

    Returns:
        [s]; 0.0 where it was faster than planned.
    """
    lost = max(0.0, flown - seconds) / (1.0 + corners)
    return lost if lost <= seconds else flown * flown / (4.0 * seconds)


def _turn(a: Point, b: Point, c: Point) -> float:
    """Sine of the change of direction at b, 1 for more than a right angle."""
    one, two = (b[0] - a[0], b[1] - a[1]), (c[0] - b[0], c[1] - b[1])
    lengths = math.hypot(*one) * math.hypot(*two)
    if lengths == 0.0:
        return 0.0
    across = abs(one[0] * two[1] - one[1] * two[0]) / lengths
    return min(1.0, across) if one[0] * two[0] + one[1] * two[1] > 0.0 else 1.0


@dataclass(frozen=True, slots=True)
class UavFlight:
    """Where a UAV is, what it is doing, and how fast it flies."""

    position: Point  # [m] ENU
    pace: FlightPace  # as measured
    stamp: float = 0.0  # [s] ROS clock at the position
    on_ground: bool = False  # it has to take off
    climbing: bool = False  # its take-off has begun
    serving: str = ''  # id of the task that it has reached and not completed
    served: float = 0.0  # [s] since it reached that
    waiting: str = ''  # id of the task before whose leg it waits, at the stop before
    home: Point | None = None  # [m] ENU
    velocity: Point | None = None  # [m/s] ENU over ground; None: unknown
    takeoff_top: float = -math.inf  # [m] ENU at which its take-off ends; -inf: at its first point
    late: float = 0.0  # [s] by which it was late or early at its last stops, on average
    time_error: float = math.inf  # share by which its times may be off, as measured; inf: unknown

    def share(self, towards: Point) -> float:
        """Return the share of its speed at which it flies towards a point [m] ENU, 0 to 1.

        Args:
            towards: the next point of its way [m] ENU.

        Returns:
            1.0 where its velocity is not known.
        """
        if self.velocity is None:
            return 1.0
        way = [b - a for a, b in zip(self.position, towards, strict=True)]
        length = math.hypot(*way)
        full = self.pace.seconds((self.position, towards))
        if full == 0.0:
            return 1.0
        along = sum(v * d for v, d in zip(self.velocity, way, strict=True)) / length
        return min(1.0, max(0.0, along * full / length))

    def passed(self, points: Sequence[Point], start: Point | None = None) -> int:
        """Count the points of its way that it has passed; see `points_passed`.

        Args:
            points: of the way and its end [m] ENU.
            start: [m] where the way began; None: unknown.

        Returns:
            0 to len(points) - 1.
        """
        return points_passed(self.position, points, start, self.velocity)

    @classmethod
    def of(cls, uav: Uav, stamp: float = 0.0) -> UavFlight:
        """Return the flight of a UAV as planned.

        Args:
            uav: with its position and speeds.
            stamp: [s] ROS clock.
        """
        return cls(uav.position, FlightPace.of(uav), stamp, home=uav.home)


