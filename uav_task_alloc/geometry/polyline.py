# SPDX-License-Identifier: Apache-2.0
"""Polylines in plain Python: length, projection, and which of the points a vehicle has passed.

Imports only the standard library, so that nodes start fast.
"""
from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

Coordinates = Sequence[float]  # [m], 2 or 3 of them
_TIE = 1e-6  # [m] distances that differ by less are equal: rounding at coordinates of 1e8 m
_OFF = 10.0  # [m] from a polyline, beyond which a vehicle does not follow it yet
_MOVES = 2.0  # [m/s]
_TOWARDS = math.cos(math.radians(20.0))  # of the angle to the way to a point, at least


def polyline_length(points: Sequence[Coordinates]) -> float:
    """Return the length of a polyline.

    Args:
        points: [m], in order; all of the same dimension.

    Returns:
        [m]; 0.0 for less than two points.
    """
    return math.fsum(math.dist(a, b) for a, b in pairwise(points))


def segment_fraction(point: Coordinates, start: Coordinates, end: Coordinates) -> float:
    """Project a point on the line through a segment.

    Args:
        point, start, end: [m], of the same dimension.

    Returns:
        0.0 at `start`, 1.0 at `end`; below 0 before the segment and above 1 beyond it.
        0.0 where the segment has no length.
    """
    along = [q - p for p, q in zip(start, end, strict=True)]
    square = sum(d * d for d in along)
    if square == 0.0:
        return 0.0
    return sum((x - p) * d for x, p, d in zip(point, start, along, strict=True)) / square


def point_at(start: Coordinates, end: Coordinates, fraction: float) -> tuple[float, ...]:
    """Return a point on the line through a segment; the inverse of `segment_fraction`.

    Args:
        start, end: [m], of the same dimension.
        fraction: 0.0 at `start`, 1.0 at `end`.

    Returns:
        [m], of that dimension.
    """
    return tuple(p + fraction * (q - p) for p, q in zip(start, end, strict=True))


def nearest_on_segment(point: Coordinates, start: Coordinates,
                       end: Coordinates) -> tuple[float, ...]:
    """Return the spot of a segment that is nearest to a point.

    Args:
        point, start, end: [m], of the same dimension.

    Returns:
        [m], of that dimension.
    """
    return point_at(start, end, min(1.0, max(0.0, segment_fraction(point, start, end))))


def segment_distance(point: Coordinates, start: Coordinates, end: Coordinates) -> float:
    """Return the distance from a point to the nearest spot of a segment.

    Args:
        point, start, end: [m], of the same dimension.

    Returns:
        [m].
    """
    return math.dist(point, nearest_on_segment(point, start, end))


def points_passed(position: Coordinates, points: Sequence[Coordinates],
                  start: Coordinates | None = None,
                  velocity: Coordinates | None = None) -> int:
    """Count the points of a polyline that a vehicle which follows it has passed.

    A point is passed when the spot of the polyline that is nearest to the vehicle lies after it.
    Of spots equally near the first counts (a polyline may double back on itself). The last point
    is where the vehicle flies to, and never passed. O(points).

    Args:
        position: of the vehicle [m].
        points: detour points in order, and the goal [m].
        start: where the vehicle began [m]. Without it a vehicle still before the first point is
            projected on the later segments, and may count as having passed that point.
        velocity: of the vehicle [m/s]; None: unknown. More than 10 m off the polyline, as after
            an upload in which it flew elsewhere, it has passed no point to which it flies, and
            none at rest.

    Returns:
        0 to len(points) - 1: `points[n:]` are still to be flown. 0 where there are no points, or
        where `position` is not a number.
    """
    line = points if start is None else (start, *points)
    distances = [segment_distance(position, a, b) for a, b in pairwise(line)]
    nearest = min(distances, default=0.0) + _TIE
    k = next((k for k, distance in enumerate(distances) if distance <= nearest), None)
    if k is None:
        return 0
    metres = segment_fraction(position, line[k], line[k + 1]) * math.dist(line[k], line[k + 1])
    passed = max(0, k + (metres > _TIE) - (start is not None))
    if velocity is None or distances[k] <= _OFF:
        return passed
    if math.hypot(*velocity) < _MOVES:
        return 0
    towards = [_cosine(velocity, position, point) for point in points[:passed + 1]]
    return towards.index(max(towards)) if max(towards) >= _TOWARDS else passed


def _cosine(velocity: Coordinates, position: Coordinates, point: Coordinates) -> float:
    """Cosine of the angle between a velocity and the way to a point elsewhere."""
    along = math.fsum(v * (q - p) for v, p, q in zip(velocity, position, point, strict=True))
    return along / (math.hypot(*velocity) * math.dist(position, point))
