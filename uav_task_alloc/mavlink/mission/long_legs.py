# SPDX-License-Identifier: Apache-2.0
"""Points put into the long legs of a list, so that they are flown at the height of the plan.

A leg of a plan is straight in ENU. An autopilot interpolates its altitude above sea level between
two items, and so follows the earth: in the middle of a leg of length L it is L^2 / 8R higher than
planned, 49 m on 50 km.
"""
from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise

from uav_task_alloc.geometry.polyline import point_at
from uav_task_alloc.mavlink.mission.items import MissionStop, TaskList
from uav_task_alloc.model import Point

MAX_LEG_LENGTH = 5000.0  # [m] between items: at most 0.5 m too high, R being at least 6335 km
PER_LEG = 5  # the first point is placed to MAX_LEG_LENGTH / PER_LEG
_REFUSAL_MARGIN = 100.0  # [m] by which a first point is beyond the refused distance


def points_between(start: Point, end: Point, longest: float = MAX_LEG_LENGTH) -> tuple[Point, ...]:
    """Points that divide a straight leg evenly, ENU [m]; none where it is not longer than that.

    Args:
        start: of the leg.
        end: of the leg.
        longest: largest distance between two points [m].
    """
    parts = math.ceil(math.dist(start, end) / longest)
    return tuple((x, y, z) for x, y, z in (point_at(start, end, n / parts)
                                           for n in range(1, parts)))


def first_points(start: Point, end: Point, home: Point, farthest: float) -> tuple[Point, ...]:
    """Points that divide the first leg of a mission.

    PX4 refuses a mission whose first item is too far from home (MIS_DIST_1WP), as it may belong to
    another site. A mission that is refused without these points must stay refused with them, so
    none is nearer to home than that limit.

    Args:
        start: where the leg begins, ENU [m].
        end: the first point of the list, ENU [m].
        home: of the vehicle, ENU [m].
        farthest: largest distance from home to the first item [m]; inf: no limit.
    """
    if math.dist(home, end) <= farthest or math.dist(home, start) > farthest:
        return points_between(start, end)
    points = points_between(start, end, MAX_LEG_LENGTH / PER_LEG)
    first = next((n for n, point in enumerate(points)
                  if math.dist(home, point) > farthest + _REFUSAL_MARGIN), len(points))
    return points[first::PER_LEG]


def with_points_between(tasks: TaskList, before: Sequence[Point] = ()) -> TaskList:
    """Divide the long legs of a list by more detour points.

    The flight home after the last point is the autopilot's own and stays as it is.

    Args:
        tasks: the list.
        before: points of its first leg, ENU [m].

    Returns:
        The list with more points.
    """
    stops: list[MissionStop] = []
    last: Point | None = None
    for stop in tasks.stops:
        path = _filled(last, (*stop.via, stop.start))
        way = stop.rest
        if stop.task.path:
            filled = _filled(None, stop.way)
            way = filled if len(filled) > len(stop.way) else way
        stops.append(replace(stop, via=(*(() if stops else before), *path[:-1]), rest=way))
        last = stop.end
    end = _filled(last, tasks.tail)
    if not stops and end:
        end = (*before, *end)
    return replace(tasks, stops=tuple(stops), end_via=end)


def first_point(tasks: TaskList) -> Point | None:
    """The first point of a list, ENU [m]; None where it has no point."""
    return next(_points(tasks), None)


def legs(tasks: TaskList, start: Point | None) -> Iterator[tuple[Point, Point]]:
    """The straight legs between the points of a list, the first from `start` where known."""
    return pairwise((*(() if start is None else (start,)), *_points(tasks)))


def _points(tasks: TaskList) -> Iterator[Point]:
    for stop in tasks.stops:
        yield from stop.via
        yield from stop.way
    yield from tasks.tail


def _filled(start: Point | None, path: Sequence[Point]) -> tuple[Point, ...]:
    filled: list[Point] = []
    for point in path:
        if start is not None:
            filled += points_between(start, point)
        filled.append(point)
        start = point
    return tuple(filled)
