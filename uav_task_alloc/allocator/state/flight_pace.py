# SPDX-License-Identifier: Apache-2.0
"""When a UAV reaches the stops of its list: speed, wind, time lost at stops, windows and waits."""
from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

from uav_task_alloc.allocator.records import ListStop, UavList
from uav_task_alloc.geometry.polyline import points_passed
from uav_task_alloc.model import Point, Uav

_SLOWEST = 0.1  # share of the speed that is left against the strongest wind


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
    stop_time: float = 0.0  # [s] lost by braking before a stop and accelerating after it

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
        """Return the time along a polyline [m] ENU, without stops [s]."""
        total = 0.0
        for (x, y, z), (x1, y1, z1) in pairwise(points):
            dx, dy, dz = x1 - x, y1 - y, z1 - z
            vertical = dz / self.climb if dz > 0.0 else -dz / self.descent
            total += max(math.hypot(dx, dy) / self.ground_speed(dx, dy), vertical)
        return total

    @property
    def mean_speed(self) -> float:
        """Ground speed that takes the mean time of eight directions [m/s]."""
        if self.wind == (0.0, 0.0):
            return self.speed
        ways = [(math.cos(k * math.pi / 4.0), math.sin(k * math.pi / 4.0)) for k in range(8)]
        return 8.0 / sum(1.0 / self.ground_speed(*way) for way in ways)


@dataclass(frozen=True, slots=True)
class UavFlight:
    """Where a UAV is, what it is doing, and how fast it flies."""

    position: Point  # [m] ENU
    pace: FlightPace  # as measured
    stamp: float = 0.0  # [s] ROS clock at the position
    on_ground: bool = False  # it has to take off
    serving: str = ''  # id of the task that it has reached and not completed
    served: float = 0.0  # [s] since it reached that
    home: Point | None = None  # [m] ENU

    @classmethod
    def of(cls, uav: Uav, stamp: float = 0.0) -> UavFlight:
        """Return the flight of a UAV as planned.

        Args:
            uav: with its position and speeds.
            stamp: [s] ROS clock.
        """
        return cls(uav.position, FlightPace.of(uav), stamp, home=uav.home)


def timed_stops(stops: Sequence[ListStop], flight: UavFlight,
                start: Point | None = None) -> tuple[ListStop, ...]:
    """Return stops with their arrivals and waits from the present position of a UAV.

    Args:
        stops: in the order of flight.
        flight: of the UAV; it is on the leg to the first stop, or there.
        start: [m] where that leg began; None: unknown.

    Returns:
        `eta` and `wait` count from `flight.stamp`.
    """
    timed: list[ListStop] = []
    clock, place = _earliest_departure(stops, flight), flight.position
    for k, stop in enumerate(stops):
        task = stop.task
        if k == 0 and flight.serving == task.id:
            since = flight.stamp - task.earliest  # negative: it waits
            timed.append(replace(stop, eta=0.0, wait=max(0.0, -since),
                                 served=max(0.0, min(flight.served, since))))
        else:
            clock = max(clock, task.release - flight.stamp)
            clock += _leg_seconds(stop, flight, place, start, first=k == 0)
            timed.append(replace(stop, eta=clock, served=0.0,
                                 wait=max(0.0, task.earliest - flight.stamp - clock)))
        clock, place = timed[-1].finish, task.position
    return tuple(timed)


def _earliest_departure(stops: Sequence[ListStop], flight: UavFlight) -> float:
    """[s] from now: on the ground the payloads of the trip are awaited."""
    if not flight.on_ground:
        return 0.0
    return max((0.0, *(stop.task.release - flight.stamp for stop in stops
                       if stop.task.payload > 0.0)))


def _leg_seconds(stop: ListStop, flight: UavFlight, place: Point, start: Point | None,
                 first: bool) -> float:
    """Flight time of a leg; in flight the acceleration at its begin is over."""
    leg = (*stop.leg.via, stop.task.position)
    if not first:
        return flight.pace.seconds((place, *leg)) + flight.pace.stop_time
    if flight.on_ground:  # it climbs before it flies
        above = (place[0], place[1], max(place[2], leg[0][2]))
        return flight.pace.seconds((place, above, *leg)) + flight.pace.stop_time
    rest = leg[points_passed(place, leg, start):]
    return flight.pace.seconds((place, *rest)) + 0.5 * flight.pace.stop_time


def finish_time(each: UavList, flight: UavFlight) -> float:
    """Return the time until a UAV has flown a list, with its way home.

    Args:
        each: with arrival times from now.
        flight: with its pace and home.

    Returns:
        [s]; 0.0 for an empty list.
    """
    if not each.stops:
        return 0.0
    last, home = each.stops[-1], flight.home
    if not each.returns or home is None:
        return last.finish
    return last.finish + flight.pace.seconds((last.task.position, *each.end_via, home))
