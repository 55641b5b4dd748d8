# SPDX-License-Identifier: Apache-2.0
"""The allocation as markers: a line for each UAV, a ball for each task, a body for each zone."""
from __future__ import annotations

from collections.abc import Iterable, Sequence

from geometry_msgs.msg import Point as PointMsg, Vector3
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from uav_task_alloc.allocator.records import Allocation, UavList
from uav_task_alloc.model import Point, Shape, ThreatZone
from uav_task_alloc.nodes.messages import header, to_point

# readable side by side, also for the colour-blind
COLOURS = ((0.0, 0.45, 0.7), (0.9, 0.6, 0.0), (0.0, 0.62, 0.45), (0.8, 0.4, 0.7),
           (0.35, 0.7, 0.9), (0.84, 0.37, 0.0))
DANGER = (0.8, 0.1, 0.1)
ENDLESS = 1000.0  # [m] as high as an unbounded zone is drawn


def markers(allocation: Allocation, starts: dict[str, Point],
            zones: Iterable[ThreatZone]) -> MarkerArray:
    """Everything anew: the first marker deletes what was there."""
    head = header(allocation.stamp)
    made = [Marker(header=head, action=Marker.DELETEALL)]
    for k, uav_list in enumerate(sorted(allocation.lists, key=lambda each: each.uav)):
        made += _route(uav_list, starts.get(uav_list.uav), COLOURS[k % len(COLOURS)])
    made += [_zone(zone, k) for k, zone in enumerate(zones)]
    for marker in made[1:]:
        marker.header = head
    return MarkerArray(markers=made)


def _route(uav_list: UavList, start: Point | None,
           colour: tuple[float, float, float]) -> list[Marker]:
    goals = [to_point(stop.task.position) for stop in uav_list.stops]
    if not goals:
        return []
    way = [] if start is None else [to_point(start)]
    for stop in uav_list.stops:
        way += [to_point(p) for p in (*stop.leg.via, stop.task.position)]
    line = _marker(f'{uav_list.uav}/route', 0, Marker.LINE_STRIP, colour, 0.9, (3.0, 0.0, 0.0))
    line.points = way
    balls = _marker(f'{uav_list.uav}/tasks', 0, Marker.SPHERE_LIST, colour, 1.0, (12.0,) * 3)
    balls.points = goals
    return [line, balls]


def _zone(zone: ThreatZone, number: int) -> Marker:
    low = zone.center[2] if zone.shape is Shape.HEMISPHERE else max(zone.z_min, 0.0)
    high = min(zone.z_max, low + ENDLESS)
    if zone.shape is Shape.POLYGON:
        marker = _marker('zones', number, Marker.LINE_STRIP, DANGER, 0.8, (4.0, 0.0, 0.0))
        marker.points = [PointMsg(x=x, y=y, z=z) for z in (low, high)
                         for x, y in (*zone.vertices, zone.vertices[0])]
        return marker
    width = 2.0 * (zone.radius + zone.margin)
    dome = zone.shape is Shape.HEMISPHERE
    marker = _marker('zones', number, Marker.SPHERE if dome else Marker.CYLINDER, DANGER, 0.3,
                     (width, width, width if dome else high - low))
    marker.pose.position = to_point((*zone.center[:2], low if dome else (low + high) / 2.0))
    return marker


def _marker(space: str, number: int, kind: int, colour: tuple[float, float, float],
            alpha: float, scale: Sequence[float]) -> Marker:
    red, green, blue = colour
    marker = Marker(ns=space, id=number, type=kind, action=Marker.ADD,
                    color=ColorRGBA(r=red, g=green, b=blue, a=alpha),
                    scale=Vector3(x=scale[0], y=scale[1], z=scale[2]))
    marker.pose.orientation.w = 1.0
    return marker
