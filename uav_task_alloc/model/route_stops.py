# SPDX-License-Identifier: Apache-2.0
"""The stops of a planned route in their order of flight, with all points between."""
from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from uav_task_alloc.model.plan import Plan
from uav_task_alloc.model.task import Point, Task
from uav_task_alloc.model.uav import Uav


@dataclass(frozen=True, slots=True)
class RouteStop:
    """A task, or the base between two trips or at the end of a route."""

    task: str | None  # id; None: the base
    via: tuple[Point, ...]  # [m] ENU detour points on the leg to it
    points: tuple[Point, ...]  # [m] ENU: its position, or its path as it is flown


def route_stops(plan: Plan, uav: str, tasks: Mapping[str, Task], base: Point) -> list[RouteStop]:
    """Return the stops of a UAV.

    Args:
        plan: with routes and legs.
        uav: its id.
        tasks: by id.
        base: [m] ENU, of the UAV.

    Returns:
        Ends at the base where the plan returns.
    """
    ends: list[tuple[str | None, tuple[Point, ...]]] = []
    for trip in plan.trips_of(uav):
        for name in trip:
            way = tasks[name].path or (tasks[name].position,)
            ends.append((name, way[::-1] if name in plan.reversed else way))
        ends.append((None, (base,)))
    # a leg home after the last trip only where the plan returns
    return [RouteStop(name, tuple(leg.via), points) for leg, (name, points) in zip(
        plan.legs.get(uav, ()), ends, strict=False)]


def route_points(uav: Uav, plan: Plan, tasks: Mapping[str, Task]) -> list[Point]:
    """Return all points of a UAV's route: start, detour points, tasks with their paths.

    Args:
        uav: with its start and home.
        plan: with routes and legs.
        tasks: by id.

    Returns:
        [m] ENU; ends at home where the plan returns.
    """
    return [uav.position, *(point for stop in route_stops(plan, uav.id, tasks, uav.base)
                            for point in (*stop.via, *stop.points))]
