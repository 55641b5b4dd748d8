# SPDX-License-Identifier: Apache-2.0
"""How a vehicle gets to what is left of a way: straight, along the way, or by its detour points.

The allocator plans the leg to a way to its first point, around all zones. A way of which a part is
flown goes on elsewhere, often from where the vehicle is: there the detour points are in the past,
and a straight leg may cross a zone that the way leads around.
"""
from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import accumulate, pairwise

from uav_task_alloc.geometry.level_paths import zone_at_heights
from uav_task_alloc.geometry.polyline import nearest_on_segment, segment_fraction
from uav_task_alloc.geometry.zones_on_path import zones_across_path
from uav_task_alloc.model import Point, ThreatZone

_CLEARANCE = 5.0  # [m] beyond the margins of zones, for wind and errors of positions
_SAME = 1.0  # [m] between points of which one is left out
_NOW = 0.0  # [m] from the first point: nothing is flown


def approach(via: tuple[Point, ...], place: Point | None, way: Sequence[Point], begin: float,
             zones: Iterable[ThreatZone], corridor: float, on_way: bool) -> tuple[Point, ...]:
    """Return the points that are flown to the spot where a way is begun or continued.

    Args:
        via: the detour points of the plan to the first point of the way [m] ENU.
        place: where the vehicle is, or where the stop before ends [m] ENU; None: not known.
        way: the whole way in the direction of flight [m] ENU.
        begin: [m] along the way from its first point, where it is continued.
        zones: in force, as far as they are known.
        corridor: [m] from the way within which the vehicle gets back to it.
        on_way: the vehicle is on it, or has flown nothing else since.

    Returns:
        [m] ENU. None of its legs crosses a zone in plan view that the plan and the way do not
        cross, where the vehicle is within the corridor or comes by the detour points.
    """
    zones = tuple(zones)
    target = _point_at(way, begin)
    back = None if place is None else _along(place, way, begin, corridor)
    near = back is not None and begin > _NOW
    if place is not None and (on_way or near or not via):
        if _is_clear(place, target, zones):
            return ()
        if back is not None:
            return back
    if begin <= _NOW or (via and _is_clear(via[-1], target, zones)):
        return via
    return (*via, *_points(way, _NOW, begin))


def first_clear(place: Point, points: Sequence[Point],
                zones: Iterable[ThreatZone]) -> int | None:
    """Return which point of a planned leg is to be flown to from elsewhere than planned.

    Args:
        place: where the vehicle is [m] ENU.
        points: detour points and end of the leg [m] ENU.
        zones: in force; without their margins, which a plan keeps, but no vehicle exactly.

    Returns:
        The index of the first one to which no zone is between; None: it is none.
    """
    bare = [replace(zone, margin=0.0) for zone in zones]
    return next((n for n, point in enumerate(points) if zone_at_heights(
        place, point, min(place[2], point[2]), max(place[2], point[2]), bare) is None), None)


def _is_clear(a: Point, b: Point, zones: Iterable[ThreatZone]) -> bool:
    return next(zones_across_path(a, b, zones, _CLEARANCE), None) is None


def _along(place: Point, way: Sequence[Point], begin: float,
           corridor: float) -> tuple[Point, ...] | None:
    """The points from the spot of the way that is nearest to a place; None: it is off the way."""
    at, best = _metres(way), (math.inf, 0.0, way[0])
    for n, (a, b) in enumerate(pairwise(way)):
        x, y, z = nearest_on_segment(place, a, b)
        share = min(1.0, max(0.0, segment_fraction(place, a, b)))
        spot = math.dist(place, (x, y, z)), at[n] + share * (at[n + 1] - at[n]), (x, y, z)
        best = min(best, spot)
    away, metres, nearest = best
    if away > corridor:
        return None
    inner = _points(way, min(metres, begin) + _SAME, max(metres, begin) - _SAME)
    return (nearest, *(inner if metres < begin else reversed(inner)))


def _metres(way: Sequence[Point]) -> list[float]:
    return [0.0, *accumulate(math.dist(a, b) for a, b in pairwise(way))]


def _points(way: Sequence[Point], low: float, high: float) -> list[Point]:
    """The points of a way between two distances from its first one, which counts."""
    return [point for point, at in zip(way, _metres(way), strict=True) if low <= at < high]


def _point_at(way: Sequence[Point], metres: float) -> Point:
    at = _metres(way)
    n = max((k for k in range(len(way) - 1) if at[k] <= metres), default=0)
    length = at[n + 1] - at[n]
    share = min(1.0, (metres - at[n]) / length) if length > 0.0 else 0.0
    x, y, z = (p + share * (q - p) for p, q in zip(way[n], way[n + 1], strict=True))
    return x, y, z
