# SPDX-License-Identifier: Apache-2.0
"""Which zones a straight path enters in plan view, at whichever height it is flown.

Imports no numba, so that nodes start fast.
"""
from __future__ import annotations

from collections.abc import Iterable, Iterator

from uav_task_alloc.geometry.polygon import XY, contains_point, edges, segments_cross
from uav_task_alloc.geometry.polyline import segment_distance
from uav_task_alloc.model import Point, Shape, ThreatZone


def zone_across_path(a: Point, b: Point, zones: Iterable[ThreatZone]) -> ThreatZone | None:
    """Find the first zone that the vertical plane through a path enters, whatever its heights.

    Args:
        a, b: ends of the path [m] ENU; heights are ignored.
        zones: each with its margin [m].

    Returns:
        The zone; None where the path is clear, or an end is not known (NaN).
    """
    return next(zones_across_path(a, b, zones), None)


def zones_across_path(a: Point, b: Point, zones: Iterable[ThreatZone],
                      clearance: float = 0.0) -> Iterator[ThreatZone]:
    """Find all zones that the vertical plane through a path enters.

    Args:
        a, b: see `zone_across_path`.
        zones: each with its margin [m].
        clearance: [m] beyond the margins that is to be kept as well.

    Returns:
        The zones in their order; none where an end is not known (NaN).
    """
    start, end = (a[0], a[1]), (b[0], b[1])
    return (zone for zone in zones if _enters(start, end, zone, zone.margin + clearance))


def _enters(a: XY, b: XY, zone: ThreatZone, grow: float) -> bool:
    if zone.shape is not Shape.POLYGON:
        center = zone.center[0], zone.center[1]
        return segment_distance(center, a, b) <= zone.radius + grow
    return contains_point(zone.vertices, a) or any(
        segments_cross(a, b, c, e) or grow >= min(
            segment_distance(c, a, b), segment_distance(a, c, e), segment_distance(b, c, e))
        for c, e in edges(zone.vertices))
