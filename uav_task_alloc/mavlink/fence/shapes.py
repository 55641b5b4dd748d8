# SPDX-License-Identifier: Apache-2.0
"""Shapes of a fence: circles and polygons in plan view, as mission items, and what enters them."""
from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.geometry.frames import Origin, to_enu_batch, to_geodetic_batch
from uav_task_alloc.geometry.polygon import XY, contains_point, edges, segments_cross
from uav_task_alloc.geometry.polyline import segment_distance
from uav_task_alloc.mavlink.fence.rings import LEAST_CORNERS, Ring
from uav_task_alloc.mavlink.mission.items import Item
from uav_task_alloc.model import Shape, ThreatZone

_EARTH_RADIUS = 6.371e6  # [m]
_ROUNDING = 0.03  # [m] items are rounded to 1e-7 degrees and centimetres
_RADIUS_STEP = 0.01  # [m] of a circle
CIRCLES = frozenset({d.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION, d.MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION})
_INCLUSIONS = frozenset({d.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION,
                         d.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION})
POLYGONS = frozenset({d.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION,
                      d.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_EXCLUSION})


@dataclass(frozen=True, slots=True)
class FenceShape:
    """A circle, or a polygon where it has corners; a fence has no height.

    Arguments of methods:
        point: (x, y, ...) [m] ENU.
        a, b: ends of a segment, the same.
    """

    zone: str  # id of the zone that it keeps out of; '': the area of the fleet
    center: XY = (0.0, 0.0)  # [m] ENU, of a circle
    radius: float = 0.0  # [m], of a circle
    corners: Ring = ()  # [m] ENU, counter-clockwise
    inclusion: bool = False  # to be stayed in, not kept out of

    @property
    def points(self) -> int:
        """The points that it takes of a fence store."""
        return len(self.corners) or 1

    def contains(self, point: Sequence[float]) -> bool:
        """Whether a point (x, y, ...) [m] is inside."""
        place = point[0], point[1]
        if self.corners:
            return contains_point(self.corners, place)
        return math.dist(place, self.center) < self.radius

    def meets(self, a: Sequence[float], b: Sequence[float]) -> bool:
        """Whether the segment ab [m] has points inside."""
        start, end = (a[0], a[1]), (b[0], b[1])
        if not self.corners:
            return segment_distance(self.center, start, end) < self.radius
        return self.contains(start) or self.contains(end) or self.meets_outline(a, b)

    def meets_outline(self, a: Sequence[float], b: Sequence[float]) -> bool:
        """Whether the segment ab [m] crosses the outline of a polygon."""
        start, end = (a[0], a[1]), (b[0], b[1])
        return any(segments_cross(start, end, *edge) for edge in edges(self.corners))

    def breached_by(self, point: Sequence[float]) -> bool:
        """Whether a vehicle at a point [m] breaks the rule of this shape."""
        return self.contains(point) is not self.inclusion

    def distance(self, point: Sequence[float]) -> float:
        """Distance [m] from a point (x, y, ...) to the outline."""
        place = point[0], point[1]
        if not self.corners:
            return abs(math.dist(place, self.center) - self.radius)
        return min(segment_distance(place, *edge) for edge in edges(self.corners))


def margin_of(zone: ThreatZone, origin: Origin) -> float:
    """The distance [m] that a shape keeps from a zone: its margin, and what rounding may cost.

    An edge is straight in degrees for one autopilot, and in metres for another.

    Args:
        zone: the zone.
        origin: of the ENU frame.
    """
    longest = max((math.dist(a, b) for a, b in edges(zone.vertices)), default=0.0)
    slope = min(20.0, abs(math.tan(math.radians(origin.latitude))))
    return zone.margin + _ROUNDING + longest**2 * slope / (4.0 * _EARTH_RADIUS)


def circle_of(zone: ThreatZone, origin: Origin) -> FenceShape:
    """The circle around a dome or an upright cylinder, with its margin."""
    radius = zone.radius + margin_of(zone, origin)
    return FenceShape(zone.id, (zone.center[0], zone.center[1]),
                      math.ceil(radius / _RADIUS_STEP) * _RADIUS_STEP)


def vertical_extent(zone: ThreatZone) -> tuple[float, float]:
    """The heights of a zone with its margin.

    Args:
        zone: the zone.

    Returns:
        Lower and upper end [m] ENU; a dome reaches down without end.
    """
    if zone.shape is Shape.HEMISPHERE:
        return -math.inf, zone.center[2] + zone.radius + zone.margin
    return zone.z_min - zone.margin, zone.z_max + zone.margin


def fence_items(shapes: Iterable[FenceShape], origin: Origin) -> tuple[Item, ...]:
    """The items of a fence, one for each corner and each circle.

    Protocol: https://mavlink.io/en/services/mission.html#geofence

    Args:
        shapes: in their order on board.
        origin: of the ENU frame.

    Returns:
        By seq; without height, as a fence has none.
    """
    items: list[Item] = []
    for shape in shapes:
        if shape.corners:
            command = (d.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION if shape.inclusion
                       else d.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_EXCLUSION)
            places, p1 = shape.corners, float(len(shape.corners))
        else:
            command = (d.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION if shape.inclusion
                       else d.MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION)
            places, p1 = (shape.center,), shape.radius
        for latitude, longitude, _ in to_geodetic_batch(
                origin, [(x, y, 0.0) for x, y in places]).tolist():
            items.append(Item(command, d.MAV_FRAME_GLOBAL, round(latitude * 1e7),
                              round(longitude * 1e7), 0.0, (p1, 0.0, 0.0, 0.0)))
    return tuple(items)


def shapes_of_items(items: Sequence[Item], origin: Origin) -> list[FenceShape]:
    """The shapes of a fence as read from a vehicle; one that is cut off is left out.

    Args:
        items: by seq.
        origin: of the ENU frame.

    Returns:
        Without the names of zones.
    """
    shapes, at = [], 0
    places = to_enu_batch(origin, [(item.x * 1e-7, item.y * 1e-7, origin.altitude_amsl)
                                   for item in items]).tolist()
    while at < len(items):
        item, count = items[at], 1
        inclusion = item.command in _INCLUSIONS
        if item.command in CIRCLES:
            shapes.append(FenceShape('', (places[at][0], places[at][1]), item.params[0],
                                     inclusion=inclusion))
        elif item.command in POLYGONS:
            count = max(1, round(item.params[0]))
            corners = tuple((row[0], row[1]) for row in places[at:at + count])
            if len(corners) == count >= LEAST_CORNERS:
                shapes.append(FenceShape('', corners=corners, inclusion=inclusion))
        at += count
    return shapes


def fences_alike(sent: Sequence[Item], held: Sequence[Item]) -> bool:
    """Whether a fence read back is the one sent; frames and heights mean nothing in a fence.

    Args:
        sent: items of the upload, by seq.
        held: items of the readback, by seq.
    """
    return len(sent) == len(held) and all(
        a.command == b.command and abs(a.x - b.x) <= 1 and abs(a.y - b.y) <= 1
        and math.isclose(a.params[0], b.params[0], rel_tol=1e-6, abs_tol=1e-3)
        for a, b in zip(sent, held, strict=True))
