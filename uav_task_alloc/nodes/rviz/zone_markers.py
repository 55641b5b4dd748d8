# SPDX-License-Identifier: Apache-2.0
"""The bodies of zones as markers: domes, cylinders and prisms, each with its margin."""
from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

from geometry_msgs.msg import Point as PointMsg
from visualization_msgs.msg import Marker

from uav_task_alloc.geometry.polygon import orientation
from uav_task_alloc.model import FAR, Shape, ThreatZone

ENDLESS = 1000.0  # [m] as high as an unbounded zone is drawn
THINNEST = 0.1  # [m] so that no marker is without a height
RINGS, SECTORS = 6, 24  # of a dome's surface
Flat = tuple[float, float]


def height_span(zone: ThreatZone) -> tuple[float, float]:
    """Lowest and highest z [m] that is drawn of a zone with its margin."""
    if zone.shape is Shape.HEMISPHERE:
        return zone.center[2], zone.center[2] + zone.radius + zone.margin
    low, high = zone.z_min - zone.margin, zone.z_max + zone.margin
    if low == -math.inf:
        low = 0.0 if high > 0.0 else high - ENDLESS
    if high == math.inf:
        high = max(low, 0.0) + ENDLESS
    low = min(max(low, -FAR), FAR - 1.0)
    return low, min(max(high, low + THINNEST), FAR)


def middle(zone: ThreatZone) -> Flat:
    """Where its label stands [m]."""
    if zone.shape is not Shape.POLYGON:
        return zone.center[0], zone.center[1]
    xs, ys = zip(*zone.vertices, strict=True)
    return sum(xs) / len(xs), sum(ys) / len(ys)


def shape(marker: Marker, zone: ThreatZone) -> Marker:
    """Give a marker the form of a zone; its colour is set already."""
    low, high = height_span(zone)
    x, y = middle(zone)
    width = zone.radius + zone.margin
    if zone.shape is Shape.CYLINDER:
        marker.type = Marker.CYLINDER
        _place(marker, (x, y, (low + high) / 2.0), (2.0 * width, 2.0 * width, high - low))
        return marker
    marker.type = Marker.TRIANGLE_LIST
    if zone.shape is Shape.HEMISPHERE:
        _place(marker, zone.center, (width, width, width))
        marker.points = _DOME
    else:  # around its own middle: a GPU counts in 32 bits
        from uav_task_alloc.geometry.zones import outline  # brings the compiler along
        _place(marker, (x, y, low), (1.0, 1.0, 1.0))
        marker.points = prism([(px - x, py - y) for px, py in outline(zone)], high - low)
    return marker


def prism(rim: Sequence[Flat], height: float) -> list[PointMsg]:
    """Walls and top over a polygon as triangles, three corners each."""
    made = []
    for (ax, ay), (bx, by) in pairwise([*rim, rim[0]]):
        made += [(ax, ay, 0.0), (bx, by, 0.0), (bx, by, height),
                 (ax, ay, 0.0), (bx, by, height), (ax, ay, height)]
    made += [(x, y, height) for corner in ears(rim) for x, y in corner]
    return [PointMsg(x=x, y=y, z=z) for x, y, z in made]


def ears(rim: Sequence[Flat]) -> list[tuple[Flat, Flat, Flat]]:
    """A simple counter-clockwise polygon cut into triangles, one ear after the other.

    O(n^3) for n corners in the worst case. Where the rim crosses itself, as far as it goes.
    """
    left, found = list(rim), []
    while len(left) > 3:
        n = len(left)
        k = next((k for k in range(n) if _is_ear(left, k)), None)
        if k is None:
            break
        found.append((left[k - 1], left[k], left[(k + 1) % n]))
        del left[k]
    return [*found, (left[0], left[1], left[2])]


def _is_ear(left: list[Flat], k: int) -> bool:
    a, b, c = left[k - 1], left[k], left[(k + 1) % len(left)]
    if orientation(a, b, c) < 0.0:
        return False
    return not any(all(orientation(p, q, other) > 0.0 for p, q in ((a, b), (b, c), (c, a)))
                   for other in left)


def _place(marker: Marker, centre: Sequence[float], scale: Sequence[float]) -> None:
    where = marker.pose.position
    where.x, where.y, where.z = map(float, centre)
    marker.scale.x, marker.scale.y, marker.scale.z = map(float, scale)


def _dome() -> list[PointMsg]:
    """The upper half of the unit ball as triangles."""
    def at(ring: int, sector: int) -> PointMsg:
        up, around = ring * math.pi / 2 / RINGS, sector * 2.0 * math.pi / SECTORS
        return PointMsg(x=math.cos(up) * math.cos(around), y=math.cos(up) * math.sin(around),
                        z=math.sin(up))

    corners = []
    for ring in range(RINGS):
        for sector in range(SECTORS):
            a, b = at(ring, sector), at(ring, sector + 1)
            c, d = at(ring + 1, sector + 1), at(ring + 1, sector)
            corners += [a, b, c] if ring == RINGS - 1 else [a, b, c, a, c, d]
    return corners


_DOME = _dome()
