# SPDX-License-Identifier: Apache-2.0
"""Lists out of routes: ways that stay as published while they are safe, arrival times, length."""
from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

from uav_task_alloc.allocator.records import Stop, UavList
from uav_task_alloc.geometry.detour import detour
from uav_task_alloc.geometry.zones import way_is_clear
from uav_task_alloc.model import Leg, Plan, Point, Task, ThreatZone, Uav

START, HOME = '', '~'  # neither is a task id
WORTH = 1.0  # [m] a way at least so much shorter replaces a published one


@dataclass(frozen=True, slots=True)
class Ways:
    """The zones as they are now, and how far to stay away from them."""

    zones: tuple[ThreatZone, ...] = ()
    clearance: float = 0.0  # [m] beyond the margins
    altitude_min: float = -math.inf  # [m]
    altitude_max: float = math.inf  # [m]
    margin: float = 0.0  # share by which a new way must be shorter than a published one

    def leg(self, a: Point, b: Point) -> Leg | None:
        """The shortest safe way from a to b; None where there is none."""
        length, via = detour(a, b, self.zones, clearance=self.clearance,
                             altitude_min=self.altitude_min, altitude_max=self.altitude_max)
        return None if math.isinf(length) else Leg(tuple(via), length)

    def clear(self, *points: Point) -> bool:
        """The polyline enters no zone; half the clearance is left to wind and GPS."""
        return not self.zones or way_is_clear(points, self.zones, 0.5 * self.clearance)

    def rest(self, position: Point, leg: Leg, goal: Point) -> float | None:
        """Metres still to fly on a leg under way, by the via points ahead; None: it is cut."""
        for passed in range(len(leg.via), -1, -1):
            points = (position, *leg.via[passed:], goal)
            if self.clear(*points):
                return math.fsum(math.dist(a, b) for a, b in pairwise(points))
        return None


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
        held: UavList, ways: Ways) -> tuple[UavList, list[str]]:
    """The list of a route in the world as it is now, and the ids that cannot be reached."""
    stops: list[Stop] = []
    lost: list[str] = []
    before, place, clock = START, uav.position, 0.0
    for task in tasks:
        leg = _steady(held, before, task, place, ways,
                      _planned(legs, _key(uav.id, before, task.id), place, task.position, ways))
        if leg is None:
            lost.append(task.id)
            continue
        clock += leg.length / uav.cruise_speed
        stops.append(Stop(task, leg, clock))
        clock += task.service_time
        before, place = task.id, task.position
    distance = math.fsum(stop.leg.length for stop in stops)
    if returns and stops:
        home = _planned(legs, _key(uav.id, before, HOME), place, uav.home or uav.position, ways)
        distance += home.length if home else 0.0
    return replace(held, stops=tuple(stops), returns=returns, distance=distance), lost


def _key(uav_id: str, before: str, after: str) -> tuple[str, str, str]:
    return uav_id if before == START or after == HOME else '', before, after


def _planned(legs: Mapping[tuple[str, str, str], Leg], key: tuple[str, str, str], a: Point,
             b: Point, ways: Ways) -> Leg | None:
    leg = legs.get(key)
    if leg is not None:
        length = math.fsum(math.dist(p, q) for p, q in pairwise((a, *leg.via, b)))
        if ways.clear(a, *leg.via, b):
            return Leg(leg.via, length)
    return ways.leg(a, b)


def _steady(held: UavList, before: str, task: Task, place: Point, ways: Ways,
            fresh: Leg | None) -> Leg | None:
    """The published way while it is safe and no worse than the margin; else the fresh one."""
    published = _published(held, before, task)
    if published is None:
        return fresh
    if before == START:
        length = ways.rest(place, published, task.position)
    else:
        length = published.length if ways.clear(place, *published.via, task.position) else None
    if length is None or fresh is not None and (
            fresh.length + WORTH < length * (1.0 - ways.margin)):
        return fresh
    return Leg(published.via, length)


def _published(held: UavList, before: str, task: Task) -> Leg | None:
    previous = START
    for stop in held.stops:
        if stop.task.id == task.id:
            same = previous == before and stop.task.position == task.position
            return stop.leg if same else None
        previous = stop.task.id
    return None
