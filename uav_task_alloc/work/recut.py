# SPDX-License-Identifier: Apache-2.0
"""Ways that are cut again: their direction, and what is left where collinear parts are flown."""
from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from itertools import pairwise

import numpy as np

from uav_task_alloc.geometry.polyline import segment_distance, segment_fraction
from uav_task_alloc.model import Point
from uav_task_alloc.work.zone_sections import joined_parts, segment_point

_Shares = tuple[float, float]  # of a segment, from and to
_Segment = tuple[Point, Point]  # [m]
_BESIDE = 0.5  # [m] that a flown way may be beside another one and count for it
_ALIKE = math.pi / 3000  # [rad] directions of segments that differ by less are one
_SHORTEST = 0.5  # [m] a shorter rest is not flown


def way_key(way: Sequence[Point], reversible: bool) -> tuple[Point, ...]:
    """Return the same value for ways through the same points.

    Args:
        way: [m] ENU.
        reversible: the same in either direction.

    Returns:
        Points rounded to 1 cm.
    """
    rounded = tuple((round(x, 2), round(y, 2), round(z, 2)) for x, y, z in way)
    return min(rounded, rounded[::-1]) if reversible else rounded


def main_direction(ways: Iterable[Sequence[Point]]) -> float:
    """Return the direction in which the most of ways leads, as that of strips.

    A way along a zone, or the rest of one, may begin across its strip.

    Args:
        ways: [m] ENU, at least one.

    Returns:
        [rad] in [0, pi), counter-clockwise from east, of the longest segment in that direction.
    """
    totals: dict[int, float] = {}
    longest: dict[int, tuple[float, float]] = {}  # length [m], angle [rad]
    for (ax, ay, _), (bx, by, _) in (pair for way in ways for pair in pairwise(way)):
        length, angle = math.hypot(bx - ax, by - ay), math.atan2(by - ay, bx - ax) % math.pi
        alike = round(angle / _ALIKE) % round(math.pi / _ALIKE)
        totals[alike] = totals.get(alike, 0.0) + length
        longest[alike] = max(longest.get(alike, (0.0, 0.0)), (length, angle))
    return longest[max(totals, key=totals.__getitem__)][1]


class FlownWays:
    """Ways that are flown, each of which counts once: a place may have to be passed several times.

    Args:
        ways: [m] ENU.
    """

    def __init__(self, ways: Iterable[Sequence[Point]]) -> None:
        given = [tuple(way) for way in ways]
        self._segments = [list(pairwise(way)) for way in given]  # what has not counted yet
        self._low = np.array([np.min(way, axis=0) for way in given]).reshape(-1, 3) - _BESIDE
        self._high = np.array([np.max(way, axis=0) for way in given]).reshape(-1, 3) + _BESIDE

    def unflown_parts(self, way: Sequence[Point]) -> list[tuple[Point, ...]]:
        """Return the parts of a way along which none of the flown ways leads.

        What counts for this way counts for no later one.

        Args:
            way: [m] ENU, at least two points; flown ways that only cross it do not count.

        Returns:
            [m] in the order of `way`, each of at least 0.5 m; `way` itself where none of it is
            flown.
        """
        boxes_touch = ((np.min(way, axis=0) <= self._high)
                       & (np.max(way, axis=0) >= self._low)).all(axis=1)
        near = [self._segments[k] for k in np.flatnonzero(boxes_touch)]
        if not near:
            return [tuple(way)]

        def rest_of(a: Point, b: Point) -> list[_Shares]:
            rest = [(0.0, 1.0)]
            for segments in near:
                rest = _without_flown(a, b, rest, segments)
            return rest

        return joined_parts(way, rest_of, _SHORTEST)

    def length_left(self) -> float:
        """Return the length [m] of what has not counted yet."""
        return math.fsum(math.dist(a, b) for segments in self._segments for a, b in segments)


def _without_flown(a: Point, b: Point, rest: list[_Shares],
                   segments: list[_Segment]) -> list[_Shares]:
    """What flown segments leave of parts of ab; what they count for is taken out of them."""
    flown, segments[:] = segments[:], []
    for c, d in flown:
        start, end = _overlap(a, b, c, d) or (1.0, 0.0)
        used = [span for low, high in rest if (span := (max(low, start), min(high, end)))[0]
                < span[1]]
        if used:
            rest = [(s, t) for low, high in rest
                    for s, t in ((low, min(high, start)), (max(low, end), high)) if s < t]
        shares = [sorted(segment_fraction(segment_point(a, b, share), c, d) for share in span)
                  for span in used]
        segments += [(segment_point(c, d, s), segment_point(c, d, t))
                     for s, t in _rest([(s, t) for s, t in shares])]
    return rest


def _overlap(a: Point, b: Point, c: Point, d: Point) -> _Shares | None:
    """The part of the segment ab, as fractions, along which cd leads beside it."""
    ends = segment_fraction(c, a, b), segment_fraction(d, a, b)
    low, high = max(0.0, min(ends)), min(1.0, max(ends))
    if (high - low) * math.dist(a, b) < _BESIDE or any(
            segment_distance(segment_point(a, b, share), c, d) > _BESIDE
            for share in (low, high)):
        return None
    return low, high


def _rest(spans: list[_Shares]) -> list[_Shares]:
    """What spans leave of 0..1."""
    left, at = [], 0.0
    for low, high in sorted(spans):
        if low > at:
            left.append((at, low))
        at = max(at, high)
    return [*left, (at, 1.0)] if at < 1.0 else left
