# SPDX-License-Identifier: Apache-2.0
"""Whether the straight way home is clear, seen from above: RTL flies it at a height of its own."""
from __future__ import annotations

from collections.abc import Iterable
from itertools import pairwise

from uav_task_alloc.geometry.polyline import segment_distance
from uav_task_alloc.model import Point, Shape, ThreatZone

XY = tuple[float, float]


def zone_across_path(a: Point, b: Point, zones: Iterable[ThreatZone]) -> ThreatZone | None:
    """The first zone that the vertical plane from a to b enters, whatever its heights.

    Args:
        a, b: [m] ENU; heights are ignored.
        zones: each with its margin [m].

    Returns:
        None where the way is clear, or an end is not known (NaN).
    """
    start, end = (a[0], a[1]), (b[0], b[1])
    return next((zone for zone in zones if _enters(start, end, zone)), None)


def _enters(a: XY, b: XY, zone: ThreatZone) -> bool:
    if zone.shape is not Shape.POLYGON:
        center = zone.center[0], zone.center[1]
        return segment_distance(center, a, b) <= zone.radius + zone.margin
    edges = list(pairwise((*zone.vertices, zone.vertices[0])))
    return _inside(a, edges) or any(
        _cross(a, b, c, e) or zone.margin >= min(
            segment_distance(c, a, b), segment_distance(a, c, e), segment_distance(b, c, e))
        for c, e in edges)


def _side(a: XY, b: XY, p: XY) -> float:
    return (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0])


def _cross(a: XY, b: XY, c: XY, e: XY) -> bool:
    return _side(a, b, c) * _side(a, b, e) < 0.0 and _side(c, e, a) * _side(c, e, b) < 0.0


def _inside(p: XY, edges: list[tuple[XY, XY]]) -> bool:
    inside = False
    for (x1, y1), (x2, y2) in edges:
        if (y1 > p[1]) != (y2 > p[1]) and p[0] < (x2 - x1) * (p[1] - y1) / (y2 - y1) + x1:
            inside = not inside
    return inside
