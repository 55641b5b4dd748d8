# SPDX-License-Identifier: Apache-2.0
"""The planned flight of a UAV, leg by leg, and when each leg is flown; no zones, no I/O.

A UAV takes off on a column above its pad, waits before a leg at the stop before it (on the ground
before a take-off), flies as in geometry/flight_time.py, serves, and lands on a column above its
base.
"""
from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Protocol

from uav_task_alloc.geometry.flight_time import straight_time
from uav_task_alloc.model import Point
from uav_task_alloc.separation.rule import Separation


class Pace(Protocol):
    """How fast a UAV flies, as measured: with wind, and with what stops and take-offs cost."""

    @property
    def takeoff(self) -> float:
        """Lost by arming and beginning the climb [s]."""

    def seconds(self, points: Sequence[Point]) -> float:
        """Return the time along a polyline [m] ENU, without stops [s]."""

    def from_stop(self, points: Sequence[Point], share: float = 0.0) -> float:
        """Return the time up to a stop at its end, from a share of the speed [s]."""


@dataclass(frozen=True, slots=True)
class FlightLeg:
    """A flight from one stop to the next, and the service there.

    Attributes:
        points: start, detour points and end [m] ENU.
        task: id of the task at its end; '' where that is the base.
        service: [s] at its end.
        earliest: [s] the service does not begin before; the UAV waits before the leg.
        latest: [s] the service begins by then.
        release: [s] the leg does not begin before.
        hold_until: [s] the leg does not begin before, for the separation.
        takes_off: it begins on the ground.
        lands: it ends on the ground.
        top: [m] ENU at which its take-off ends, if that is known, also where that has begun; else
            at its next point.
        movable: its heights and its begin may change; not of the leg under way, or of the path
            of a task.
        may_wait: the UAV can wait before it; not before a return that follows a list, or the path
            of a task.
    """

    points: tuple[Point, ...]  # [m] ENU
    task: str = ''
    service: float = 0.0  # [s]
    earliest: float = -math.inf  # [s]
    latest: float = math.inf  # [s]
    release: float = -math.inf  # [s]
    hold_until: float = -math.inf  # [s]
    takes_off: bool = False
    lands: bool = False
    top: float = -math.inf  # [m] ENU
    movable: bool = True
    may_wait: bool = True

    @property
    def climbs_first(self) -> bool:
        """Whether it begins with a take-off, or in one."""
        return self.takes_off or self.top > -math.inf

    def flown(self) -> tuple[Point, ...]:
        """Points as they are flown: with the columns above pad and base.
"""
        points = list(self.points)
        top = self.top if self.top > -math.inf else points[1][2]
        if self.climbs_first and top > points[0][2]:
            x, y, _ = points[0]
            points.insert(1, (x, y, top))
        if self.lands and points[-2][2] > points[-1][2]:
            x, y, _ = points[-1]
            points.insert(-1, (x, y, points[-2][2]))
        return tuple(points)


@dataclass(frozen=True, slots=True)
class Flight:
    """What one UAV is planned to fly.

    Attributes:
        uav: id.
        legs: in order; none: it stays where it is.
        position: [m] ENU at `begin`.
        cruise, climb, descent: [m/s] at most.
        begin: [s] from the moment of the plan.
        in_air: it is in the air at `begin`.
        known: [s] when its position was known.
        late: [s] by which it was late or early, as measured.
        speed_error: share by which its times are off, as measured; None: that of the rule.
        pace: as measured; None: the speeds alone.
        share: of its speed that it has at `begin`, 0 to 1.
        waits: it is in the air at the stop before its first leg, which has not begun.
        goes_on: what follows the last leg is not planned yet; it does not stay there.
    """

    uav: str
    legs: tuple[FlightLeg, ...]
    position: Point  # [m] ENU
    cruise: float = 15.0  # [m/s]
    climb: float = math.inf  # [m/s]
    descent: float = math.inf  # [m/s]
    begin: float = 0.0  # [s]
    in_air: bool = True
    known: float = 0.0  # [s]
    late: float = 0.0  # [s]
    speed_error: float | None = None
    pace: Pace | None = None
    share: float = 0.0
    waits: bool = False
    goes_on: bool = False

    def seconds(self, points: Sequence[Point]) -> float:
        """Return the flight time along a polyline [s].

        Args:
            points: [m] ENU, in order.
        """
        if self.pace is not None:
            return self.pace.seconds(points)
        total = 0.0
        x, y, z = points[0]
        for x1, y1, z1 in points[1:]:
            total += straight_time(x1 - x, y1 - y, z1 - z, self.cruise, self.climb, self.descent)
            x, y, z = x1, y1, z1
        return total

    def parts(self, leg: FlightLeg, first: bool = False) -> list[tuple[float, Point]]:
        """Return the straight parts of a leg: their times [s] and ends [m] ENU.

        The time that a stop costs is spread over what lies between the columns.

        Args:
            leg: to be flown.
            first: it is the first leg, which begins at the speed of the UAV.
        """
        points = leg.flown()
        parts = [(self.seconds(pair), pair[1]) for pair in pairwise(points)]
        begin = int(leg.climbs_first and points[1][:2] == points[0][:2])
        end = len(parts) - int(leg.lands and points[-2][:2] == points[-1][:2])
        full = sum(seconds for seconds, _ in parts[begin:end])
        if self.pace is None or full <= 0.0:
            return parts
        share = self.share if first and not leg.climbs_first else 0.0
        slower = self.pace.from_stop(points[begin:end + 1], share) / full
        return [(seconds * slower if begin <= n < end else seconds, point)
                for n, (seconds, point) in enumerate(parts)]

    def leg_seconds(self, leg: FlightLeg, first: bool = False) -> float:
        """Return the flight time of a leg [s].

        Args:
            leg, first: see `parts`.
        """
        return sum(seconds for seconds, _ in self.parts(leg, first))

    def uncertainty(self, seconds: float, rule: Separation) -> float:
        """Return by how much it may be early or late [s].

        Args:
            seconds: from the moment of the plan [s].
            rule: whose share counts where none was measured.
        """
        return rule.uncertainty(seconds - self.known, self.speed_error) + self.late


@dataclass(frozen=True, slots=True)
class LegTimes:
    """When a leg is flown, [s] from the moment of the plan.

    Attributes:
        ready: the UAV is at its start, and the service there is over.
        begin: of the flight.
        arrival: at its end.
        end: of the service there.
    """

    ready: float  # [s]
    begin: float  # [s]
    arrival: float  # [s]
    end: float  # [s]


def leg_times(flight: Flight, leg: FlightLeg, ready: float, first: bool = False) -> LegTimes:
    """Return when a leg is flown by a UAV that is ready at its start.

    Args:
        flight: with its speeds.
        leg: to be flown.
        ready: [s] when the service before is over.
        first: it is the first leg; in the air that waits for its release only, and for
            `earliest` at its end, unless the flight `waits`.

    Returns:
        Its times.
    """
    seconds = flight.leg_seconds(leg, first)
    if first and flight.in_air and not flight.waits:
        begin = max(ready, leg.release)
        arrival = begin + seconds
        return LegTimes(ready, begin, arrival, max(arrival, leg.earliest) + leg.service)
    if leg.takes_off and flight.pace is not None:
        ready += flight.pace.takeoff
    begin = max(ready, leg.release, leg.hold_until, leg.earliest - seconds)
    return LegTimes(ready, begin, begin + seconds, begin + seconds + leg.service)
