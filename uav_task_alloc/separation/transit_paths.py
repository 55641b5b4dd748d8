# SPDX-License-Identifier: Apache-2.0
"""The points of a leg that is flown at another height between its ends."""
from __future__ import annotations

import math
from collections.abc import Sequence

from uav_task_alloc.model import Point
from uav_task_alloc.separation.flight_legs import Flight, FlightLeg

_STEEP = 0.45  # share of the first and last straight part that a slanted climb may take


def upright(leg: FlightLeg, points: Sequence[Point], level: float) -> tuple[Point, ...]:
    """Return the points of a leg that changes its height above its ends.

    Args:
        leg: as planned.
        points: of it [m] ENU, without those that only change its height.
        level: [m] ENU between its ends.
    """
    a, b = points[0], points[-1]
    inner = [(x, y, max(z, level)) for x, y, z in points[1:-1]]
    first = [(a[0], a[1], level)] if max(a[2], leg.top) != level else []
    last = [(b[0], b[1], level)] if b[2] != level else []
    return (a, *first, *inner, *last, b)


def slanted(flight: Flight, leg: FlightLeg, points: Sequence[Point],
            level: float) -> tuple[Point, ...]:
    """Return the points of a leg that changes its height on the way.

    Where it is long enough that costs no time.

    Args:
        flight: of the leg, with its speeds.
        leg, points, level: see `upright`.
    """
    a, b = points[0], points[-1]
    inner = [(x, y, max(z, level)) for x, y, z in points[1:-1]]
    path: list[Point] = [a]
    start = max(a[2], leg.top)  # above the pad, where that is known
    if start != level:
        goal = inner[0] if inner else b
        upright = leg.takes_off and leg.top == -math.inf
        path.append((a[0], a[1], level) if upright else _along(
            a, goal, flight.cruise * _vertical_seconds(flight, level - start), level))
    path += inner
    if b[2] != level:
        before = inner[-1] if inner else a
        path.append((b[0], b[1], level) if leg.lands else _along(
            b, before, flight.cruise * _vertical_seconds(flight, b[2] - level), level))
    return (*path, b)


def _vertical_seconds(flight: Flight, rise: float) -> float:
    return rise / flight.climb if rise > 0.0 else -rise / flight.descent


def _along(a: Point, b: Point, metres: float, level: float) -> Point:
    """The point at some horizontal distance from a towards b, at most _STEEP of the way."""
    length = math.dist(a[:2], b[:2])
    share = min(_STEEP, metres / length) if length > 0.0 else 0.0
    return a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1]), level
