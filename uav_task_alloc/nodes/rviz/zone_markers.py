# SPDX-License-Identifier: Apache-2.0
"""Volumes of zones as markers: domes, cylinders and prisms, each with its margin."""
from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

from geometry_msgs.msg import Point as PointMsg
from visualization_msgs.msg import Marker

from uav_task_alloc.checks import FAR
from uav_task_alloc.geometry.polygon import orientation
from uav_task_alloc.model import Shape, ThreatZone

_UNBOUNDED_HEIGHT = 1000.0  # [m] drawn of a zone without a bound
_LEAST_HEIGHT = 0.1  # [m]; RViz warns of markers without a height
_RINGS, _SECTORS = 6, 24  # of a dome's surface
_Point2 = tuple[float, float]  # [m]


def height_span(zone: ThreatZone) -> tuple[float, float]:
    """Lowest and highest z [m] that are drawn of a zone with its margin."""
    if zone.shape is Shape.HEMISPHERE:
        return zone.center[2], zone.center[2] + zone.radius + zone.margin
    low, high = zone.z_min - zone.margin, zone.z_max + zone.margin
    if low == -math.inf:
        low = 0.0 if high > 0.0 else high - _UNBOUNDED_HEIGHT
    if high == math.inf:
        high = max(low, 0.0) + _UNBOUNDED_HEIGHT
    low = min(max(low, -FAR), FAR - 1.0)
    return low, min(max(high, low + _LEAST_HEIGHT), FAR)


def label_position(zone: ThreatZone) -> _Point2:
    """East and north of the label: the center, or the mean of the vertices [m]."""
    if zone.shape is not Shape.POLYGON:
        return zone.center[0], zone.center[1]
    xs, ys = zip(*zone.vertices, strict=True)
    return sum(xs) / len(xs), sum(ys) / len(ys)


def set_volume(marker: Marker, zone: ThreatZone) -> Marker:
    """Set type, pose, scale and points of a marker to those of a zone with its margin.

    Args:
        marker: whose colour and namespace stay as they are.
        zone: lengths in [m].

    Returns:
        The same marker.
    """
    low, high = height_span(zone)
    x, y = label_position(zone)
    width = zone.radius + zone.margin
    if zone.shape is Shape.CYLINDER:
        marker.type = Marker.CYLINDER
        _place(marker, (x, y, (low + high) / 2.0), (2.0 * width, 2.0 * width, high - low))
        return marker
    marker.type = Marker.TRIANGLE_LIST
    if zone.shape is Shape.HEMISPHERE:
        _place(marker, zone.center, (width, width, width))
        marker.points = _DOME
    else:  # relative to its label: a GPU has 32 bits for a coordinate
        from uav_task_alloc.geometry.zones import outline  # imports numba
        _place(marker, (x, y, low), (1.0, 1.0, 1.0))
        marker.points = prism([(px - x, py - y) for px, py in outline(zone)], high - low)
    return marker


def prism(rim: Sequence[_Point2], height: float) -> list[PointMsg]:
    """Walls and top over a polygon [m] as triangles, three corners each. O(n^3) corners."""
    corners = []
    for (ax, ay), (bx, by) in pairwise([*rim, rim[0]]):
        corners += [(ax, ay, 0.0), (bx, by, 0.0), (bx, by, height),
                    (ax, ay, 0.0), (bx, by, height), (ax, ay, height)]
    corners += [(x, y, height) for ear in ears(rim) for x, y in ear]
    return [PointMsg(x=x, y=y, z=z) for x, y, z in corners]


def ears(rim: Sequence[_Point2]) -> list[tuple[_Point2, _Point2, _Point2]]:
    """Triangulate a simple counter-clockwise polygon by ear clipping.

    O(n^3) for n corners in the worst case. Where the rim crosses itself the result is incomplete.
    """
    left, triangles = list(rim), []
    while len(left) > 3:
        n = len(left)
        k = next((k for k in range(n) if _is_ear(left, k)), None)
        if k is None:
            break
        triangles.append((left[k - 1], left[k], left[(k + 1) % n]))
        del left[k]
    return [*triangles, (left[0], left[1], left[2])]


def _is_ear(left: list[_Point2], k: int) -> bool:
    a, b, c = left[k - 1], left[k], left[(k + 1) % len(left)]
    if orientation(a, b, c) < 0.0:
        return False
    return not any(all(orientation(p, q, other) > 0.0 for p, q in ((a, b), (b, c), (c, a)))
                   for other in left)


def _place(marker: Marker, centre: Sequence[float], scale: Sequence[float]) -> None:
    position = marker.pose.position
    position.x, position.y, position.z = map(float, centre)
    marker.scale.x, marker.scale.y, marker.scale.z = map(float, scale)


def _dome() -> list[PointMsg]:
    """The upper half of the unit sphere as triangles."""
    def vertex(ring: int, sector: int) -> PointMsg:
        up, around = ring * math.pi / 2 / _RINGS, sector * 2.0 * math.pi / _SECTORS
        return PointMsg(x=math.cos(up) * math.cos(around), y=math.cos(up) * math.sin(around),
                        z=math.sin(up))

    corners = []
    for ring in range(_RINGS):
        for sector in range(_SECTORS):
            a, b = vertex(ring, sector), vertex(ring, sector + 1)
            c, d = vertex(ring + 1, sector + 1), vertex(ring + 1, sector)
            corners += [a, b, c] if ring == _RINGS - 1 else [a, b, c, a, c, d]
    return corners


_DOME = _dome()
