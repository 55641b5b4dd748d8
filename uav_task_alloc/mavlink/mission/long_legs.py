# SPDX-License-Identifier: Apache-2.0
"""Points put into the long legs of a list, so that they are flown at the height of the plan.

A leg of a plan is straight in ENU. An autopilot changes its altitude above sea level evenly from
item to item, and so follows the earth: half-way of a leg of length L it is L^2 / 8R higher, 49 m
on 50 km.
"""
from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise

from uav_task_alloc.mavlink.mission.items import MissionStop, TaskList
from uav_task_alloc.model import Point

MAX_LEG_LENGTH = 5000.0  # [m] between items: at most 0.5 m too high, R being at least 6335 km
PER_LEG = 5  # a first point lies within LONGEST / PER_LEG of where it may be
_REFUSAL_MARGIN = 100.0  # [m] by which it is farther than what is refused


def points_between(start: Point, end: Point, longest: float = MAX_LEG_LENGTH) -> tuple[Point, ...]:
    """Evenly on the straight way, without its ends; none where it is not too long. ENU [m]."""
    parts = math.ceil(math.dist(start, end) / longest)
    return tuple((start[0] + (end[0] - start[0]) * n / parts,
                  start[1] + (end[1] - start[1]) * n / parts,
                  start[2] + (end[2] - start[2]) * n / parts) for n in range(1, parts))


def first_points(start: Point, end: Point, home: Point, farthest: float) -> tuple[Point, ...]:
    """The same for the first leg of a mission.

    PX4 refuses a mission whose first item is too far from home: it is of another place. What it
    refuses without points in between it refuses with them, so none is nearer than that.

    Args:
        start: where the leg begins, ENU [m].
        end: the first point of the list.
        home: of the vehicle.
        farthest: from home to the first item [m]; inf: nothing is refused.
    """
    if math.dist(home, end) <= farthest or math.dist(home, start) > farthest:
        return points_between(start, end)
    points = points_between(start, end, MAX_LEG_LENGTH / PER_LEG)
    first = next((n for n, point in enumerate(points)
                  if math.dist(home, point) > farthest + _REFUSAL_MARGIN), len(points))
    return points[first::PER_LEG]


def with_points_between(tasks: TaskList, before: Sequence[Point] = ()) -> TaskList:
    """The same list with more detour points; `before` are put in before its first point.

    The flight home after the last point is the autopilot's own and stays as it is.
    """
    stops: list[MissionStop] = []
    last: Point | None = None
    for stop in tasks.stops:
        way = _filled(last, (*stop.via, stop.task.position))
        stops.append(replace(stop, via=(*(() if stops else before), *way[:-1])))
        last = stop.task.position
    end = _filled(last, tasks.end_via) if tasks.returns else tasks.end_via
    if not stops and end:
        end = (*before, *end)
    return replace(tasks, stops=tuple(stops), end_via=end)


def first_point(tasks: TaskList) -> Point | None:
    """What a list leads to first; None where it is a return at most."""
    return next(_points(tasks), None)


def legs(tasks: TaskList, start: Point | None) -> Iterator[tuple[Point, Point]]:
    """The straight ways from point to point, from `start` if that is known."""
    return pairwise((*(() if start is None else (start,)), *_points(tasks)))


def _points(tasks: TaskList) -> Iterator[Point]:
    for stop in tasks.stops:
        yield from stop.via
        yield stop.task.position
    if tasks.returns:
        yield from tasks.end_via


def _filled(start: Point | None, way: Sequence[Point]) -> tuple[Point, ...]:
    found: list[Point] = []
    for point in way:
        if start is not None:
            found += points_between(start, point)
        found.append(point)
        start = point
    return tuple(found)
