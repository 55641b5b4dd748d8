# SPDX-License-Identifier: Apache-2.0
"""The remaining path of a UAV, and the area that all stay in, as messages of other packages."""
from __future__ import annotations

import math
from itertools import pairwise

from geometry_msgs.msg import Point32, PolygonStamped, PoseStamped
from nav_msgs.msg import Path

from uav_task_alloc.allocator.list_records import UavList
from uav_task_alloc.allocator.state.fleet import UavRecord
from uav_task_alloc.geometry.fence_area import AreaCorners
from uav_task_alloc.geometry.polyline import points_passed
from uav_task_alloc.model import Point
from uav_task_alloc.nodes.conversions.messages import header, to_point


def remaining_path(uav_list: UavList, uav: UavRecord | None) -> list[Point]:
    """The points that a UAV has still to fly.

    Args:
        uav_list: the list that was published for it.
        uav: its last report; None where there was none.

    Returns:
        [m] ENU: its position where that is known, detour points and tasks in order, and home
        where the list returns; or the way to its waiting place.
    """
    points: list[Point] = []
    if uav is not None and uav_list.waiting_place is not None:
        place, way = uav.report.position, uav_list.end_via
        return [place, *way[points_passed(place, way):]]
    for k, stop in enumerate(uav_list.stops):
        leg = stop.line
        points += leg[points_passed(uav.report.position, leg):] if uav and k == 0 else leg
    if uav is None or not points:
        return points
    end = [*uav_list.end_via, uav.home] if uav_list.returns else []
    return [uav.report.position, *points, *end]


def path_message(uav_list: UavList, uav: UavRecord | None) -> Path:
    """Return the remaining path; each pose faces the next one, the last keeps its heading.

    Args:
        uav_list: in force.
        uav: with its position; None: it has never reported.

    Returns:
        For the topic `<uav_id>/path`: poses in ENU [m].
    """
    path = Path(header=header(uav_list.stamp))
    points = remaining_path(uav_list, uav)
    yaw = 0.0
    for a, b in pairwise([*points, *points[-1:]]):
        east, north = b[0] - a[0], b[1] - a[1]
        yaw = math.atan2(north, east) if east or north else yaw
        pose = PoseStamped(header=path.header)
        pose.pose.position = to_point(a)
        pose.pose.orientation.z = math.sin(yaw / 2.0)
        pose.pose.orientation.w = math.cos(yaw / 2.0)
        path.poses.append(pose)
    return path


def area_message(corners: AreaCorners, now: float) -> PolygonStamped:
    """Return the area that plans stay in.

    Args:
        corners: (east, north) [m]; () where there is none.
        now: [s].

    Returns:
        For the topic `fence_area`.
    """
    message = PolygonStamped(header=header(now))
    message.polygon.points = [Point32(x=x, y=y) for x, y in corners]
    return message
