# SPDX-License-Identifier: Apache-2.0
"""Planned flights as timed straight pieces with the uncertainty of their times; no zones, no I/O.

A UAV takes off on a column above its pad, waits before a leg at the stop before it (on the ground
before a take-off), flies as in geometry/flight_time.py, serves, and lands on a column above its
base. On the ground it is not in the air: there it has no volume.
"""
from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from uav_task_alloc.geometry.flight_time import straight_time
from uav_task_alloc.geometry.polyline import segment_distance
from uav_task_alloc.model import Point
from uav_task_alloc.separation.rule import Separation

FOREVER = 1e6  # [s] a UAV that stays in the air stays so long
COLUMNS = 9  # of a row: begin, end [s], x, y, z [m], their speeds [m/s], uncertainty [s]
_SPLITS = (0.125, 0.25, 0.5, 1.0)  # of the horizon: pieces are split there, as they grow longer
PieceRow = tuple[float, ...]
PieceRows = NDArray[np.float64]  # (n, COLUMNS)


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
        """Points as they are flown: with the columns above pad and base."""
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
        first: it is the first leg; in the air that waits at its end, unless the flight `waits`.

    Returns:
        Its times.
    """
    seconds = flight.leg_seconds(leg, first)
    if first and flight.in_air and not flight.waits:
        arrival = ready + seconds
        return LegTimes(ready, ready, arrival, max(arrival, leg.earliest) + leg.service)
    if leg.takes_off and flight.pace is not None:
        ready += flight.pace.takeoff
    begin = max(ready, leg.release, leg.hold_until, leg.earliest - seconds)
    return LegTimes(ready, begin, begin + seconds, begin + seconds + leg.service)


def leg_rows(flight: Flight, leg: FlightLeg, times: LegTimes, rule: Separation,
             first: bool = False) -> list[PieceRow]:
    """Return the pieces of one leg: the wait before it, the flight, and the service.

    Args:
        flight: of the leg.
        leg: to be flown.
        times: see `leg_times`.
        rule: whose uncertainty the pieces have.
        first: it is the first leg.

    Returns:
        PieceRows of COLUMNS numbers.
    """
    rows: list[PieceRow] = []
    if times.begin > times.ready and not leg.takes_off:
        _add(rows, flight, rule, times.ready, times.begin, leg.points[0], leg.points[0])
    clock, place = times.begin, leg.points[0]
    for seconds, point in flight.parts(leg, first):
        if seconds > 0.0:
            _add(rows, flight, rule, clock, clock + seconds, place, point)
        clock, place = clock + seconds, point
    if times.end > clock and not leg.lands:
        _add(rows, flight, rule, clock, times.end, place, place)
    return rows


def end_rows(flight: Flight, rule: Separation, end: float, place: Point) -> list[PieceRow]:
    """Return the piece of a UAV that stays in the air.

    Args:
        flight: of the UAV.
        rule: see `leg_rows`.
        end: [s] of its last leg.
        place: [m] ENU where it stays.
    """
    rows: list[PieceRow] = []
    if not flight.goes_on:
        _add(rows, flight, rule, end, end + FOREVER, place, place)
    return rows


def _add(rows: list[PieceRow], flight: Flight, rule: Separation, begin: float, end: float,
         place: Point, goal: Point) -> None:
    """Append a straight piece, split where its uncertainty would grow much."""
    seconds = end - begin
    vx, vy, vz = ((b - a) / seconds for a, b in zip(place, goal, strict=True))
    x, y, z = place
    clock = begin
    for split in _SPLITS:
        until = flight.known + split * rule.horizon
        if clock < until < end:
            s = clock - begin
            rows.append((clock, until, x + vx * s, y + vy * s, z + vz * s, vx, vy, vz,
                         flight.uncertainty(until, rule)))
            clock = until
    s = clock - begin
    rows.append((clock, end, x + vx * s, y + vy * s, z + vz * s, vx, vy, vz,
                 flight.uncertainty(end, rule)))


@dataclass(frozen=True, slots=True)
class Volumes:
    """The pieces of some flights."""

    rows: PieceRows  # (n, COLUMNS)
    owner: NDArray[np.int64]  # (n,) index of the flight
    leg: NDArray[np.int64]  # (n,) index of the leg; that after the last for the stay at the end


def flight_volumes(flights: Iterable[Flight], rule: Separation) -> Volumes:
    """Return the pieces of flights.

    Args:
        flights: planned.
        rule: whose uncertainty the pieces have.

    Returns:
        In the order of the flights and their legs.
    """
    rows: list[PieceRow] = []
    owner: list[int] = []
    legs: list[int] = []
    for k, flight in enumerate(flights):
        for number, more in enumerate(rows_of_legs(flight, rule)):
            rows += more
            owner += [k] * len(more)
            legs += [number] * len(more)
    return Volumes(np.array(rows, np.float64).reshape(-1, COLUMNS), np.array(owner, np.int64),
                   np.array(legs, np.int64))


def rows_of_legs(flight: Flight, rule: Separation) -> list[list[PieceRow]]:
    """Return the pieces of a flight by leg, and at the end those of its stay.

    Args:
        flight: planned.
        rule: see `flight_volumes`.

    Returns:
        One list for each leg, and one more; that is empty where the UAV lands.
    """
    found: list[list[PieceRow]] = []
    ready, place, in_air = flight.begin, flight.position, flight.in_air
    for number, leg in enumerate(flight.legs):
        times = leg_times(flight, leg, ready, number == 0)
        found.append(leg_rows(flight, leg, times, rule, number == 0))
        ready, place, in_air = times.end, leg.points[-1], not leg.lands
    found.append(end_rows(flight, rule, ready, place) if in_air else [])
    return found


def meeting_place(volumes: Volumes, flights: tuple[int, int], legs: tuple[int, int],
                  time: float) -> Point:
    """Return where the first of two UAVs is when they come nearest.

    Args:
        volumes: of their flights.
        flights: indices of both.
        legs: indices of their legs.
        time: [s] when the first of both is there.

    Returns:
        [m] ENU; on the leg of the one that is then nearer to the other's leg.
    """
    ways = [volumes.rows[(volumes.owner == k) & (volumes.leg == n)]
            for k, n in zip(flights, legs, strict=True)]
    spots = [_place_at(rows, time) for rows in ways]
    gaps = [min(segment_distance(spot, row[2:5].tolist(), _moved_on(row, row[1] - row[0]))
                for row in rows) for spot, rows in zip(spots, ways[::-1], strict=True)]
    return spots[0] if gaps[0] <= gaps[1] else spots[1]


def _place_at(rows: PieceRows, time: float) -> Point:
    """Where a UAV is at a time [s], or at the nearer end of its pieces."""
    row = rows[max(0, int(np.searchsorted(rows[:, 0], time, 'right')) - 1)]
    return _moved_on(row, min(max(time, row[0]), row[1]) - row[0])


def _moved_on(row: PieceRows, seconds: float) -> Point:
    """Where a UAV is some time after the begin of a piece."""
    x, y, z = (row[2:5] + row[5:8] * seconds).tolist()
    return x, y, z
