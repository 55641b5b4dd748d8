# SPDX-License-Identifier: Apache-2.0
"""Planned flights as timed straight pieces with the uncertainty of their times; no zones, no I/O.

On the ground a UAV is not in the air: there it has no volume.
"""
from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uav_task_alloc.geometry.polyline import segment_distance
from uav_task_alloc.model import Point
from uav_task_alloc.separation.flight_legs import Flight, FlightLeg, LegTimes, leg_times
from uav_task_alloc.separation.rule import Separation

FOREVER = 1e6  # [s] a UAV that stays in the air stays so long
COLUMNS = 9  # of a row: begin, end [s], x, y, z [m], their speeds [m/s], uncertainty [s]
_SPLITS = (0.125, 0.25, 0.5, 1.0)  # of the horizon: pieces are split there, as they grow longer
PieceRow = tuple[float, ...]
PieceRows = NDArray[np.float64]  # (n, COLUMNS)


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

    Returns:
        One piece without an end, in parts; none where more legs follow.
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
