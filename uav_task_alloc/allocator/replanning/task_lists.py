# SPDX-License-Identifier: Apache-2.0
"""Lists out of routes: ways that stay as published while they are safe, arrival times, length."""
from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING

from uav_task_alloc.allocator.records import ListStop, UavList
from uav_task_alloc.geometry.polyline import polyline_length
from uav_task_alloc.model import Leg, Plan, Point, Task, Uav

if TYPE_CHECKING:  # it brings the compiler along, which a start must not wait for
    from uav_task_alloc.allocator.replanning.safe_paths import SafePaths

START, HOME = '', '~'  # neither is a task id
WORTH = 1.0  # [m] a way at least so much shorter replaces a published one


def planned_legs(plan: Plan) -> dict[tuple[str, str, str], Leg]:
    """The legs of a plan by (UAV where it starts there, stop before, stop)."""
    found = {}
    for uav_id, tasks in plan.routes.items():
        stops = (START, *tasks, *((HOME,) if plan.returns and tasks else ()))
        for (before, after), leg in zip(pairwise(stops), plan.legs.get(uav_id, ()),
                                        strict=False):
            found[_key(uav_id, before, after)] = leg
    return found


def lay(uav: Uav, tasks: Sequence[Task], returns: bool, legs: Mapping[tuple[str, str, str], Leg],
        held: UavList, ways: SafePaths) -> tuple[UavList, list[str]]:
    """The list of a route in the world as it is now, and the ids that cannot be reached.

    It ends with HOLD where it shall not return, and where there is no safe way home.
    """
    stops: list[ListStop] = []
    lost: list[str] = []
    before, place, clock = START, uav.position, 0.0
    for task in tasks:
        leg = _steady(held, before, task, place, ways,
                      _planned(legs, _key(uav.id, before, task.id), place, task.position, ways))
        if leg is None:
            lost.append(task.id)
            continue
        clock += leg.length / uav.cruise_speed
        stops.append(ListStop(task, leg, clock))
        clock += task.service_time
        before, place = task.id, task.position
    distance = math.fsum(stop.leg.length for stop in stops)
    home = _way_home(uav, before, place, legs, held, ways) if returns else None
    return replace(held, stops=tuple(stops), returns=home is not None,
                   end_via=home.via if home else (),
                   distance=distance + (home.length if home and stops else 0.0)), lost


def _way_home(uav: Uav, before: str, place: Point, legs: Mapping[tuple[str, str, str], Leg],
              held: UavList, ways: SafePaths) -> Leg | None:
    goal = uav.home or uav.position
    if before == START and held.returns and not held.stops:  # perhaps on this way already
        metres = ways.rest(place, Leg(held.end_via, 0.0), goal)
        if metres is not None:
            return Leg(held.end_via, metres)
    return _planned(legs, _key(uav.id, before, HOME), place, goal, ways)


def _key(uav_id: str, before: str, after: str) -> tuple[str, str, str]:
    return uav_id if before == START or after == HOME else '', before, after


def _planned(legs: Mapping[tuple[str, str, str], Leg], key: tuple[str, str, str], a: Point,
             b: Point, ways: SafePaths) -> Leg | None:
    leg = legs.get(key)
    if leg is not None and ways.clear(a, *leg.via, b):
        return Leg(leg.via, polyline_length((a, *leg.via, b)))
    return ways.leg(a, b)


def _steady(held: UavList, before: str, task: Task, place: Point, ways: SafePaths,
            fresh: Leg | None) -> Leg | None:
    """The published way while it is safe and no worse than the margin; else the fresh one."""
    published = _published(held, before, task)
    if published is None:
        return fresh
    if before == START:
        metres = ways.rest(place, published, task.position)
    else:
        metres = published.length if ways.clear(place, *published.via, task.position) else None
    if metres is None:
        return fresh
    if fresh is not None and fresh.length + WORTH < metres * (1.0 - ways.margin):
        return fresh
    return Leg(published.via, metres)


def _published(held: UavList, before: str, task: Task) -> Leg | None:
    previous = START
    for stop in held.stops:
        if stop.task.id == task.id:
            same = previous == before and stop.task.position == task.position
            return stop.leg if same else None
        previous = stop.task.id
    return None
