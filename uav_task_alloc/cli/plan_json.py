# SPDX-License-Identifier: Apache-2.0
"""A plan as JSON values: lengths in metres, points in ENU, and routes and tasks in degrees."""
from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from uav_task_alloc.cli.plan_times import times_json
from uav_task_alloc.geometry.frames import Origin, to_geodetic_batch
from uav_task_alloc.model import Plan, Point
from uav_task_alloc.model.route_stops import route_stops
from uav_task_alloc.scenario.values import Scenario

_DIGITS = (9, 9, 3)  # of degrees and metres: 0.1 mm and 1 mm


def plan_json(loaded: Scenario, result: Plan) -> dict[str, Any]:
    """The values that `plan --json` writes.

    Args:
        loaded: the scenario of the plan.
        result: the plan.

    Returns:
        What `Plan` has, an infinite fit as None; `distances`, the length [m] of each UAV's route
        with the paths of its tasks, whose sum is `distance`; `legs`, without those paths;
        `conflicts`, of UAVs that would not have been apart; `origin`; `tasks`, the position of
        each, and `paths`, of those that are ways (ids of pieces are `field#1`); `reversed`, the
        ids of those that are flown from their last point; and `waypoints`, of each UAV, from its
        start to its end: `task` is the id of the task there, or None. Positions are latitude and
        longitude [deg] and altitude [m above the origin], as in a scenario file.
    """
    return {
        'routes': {uav: list(tasks) for uav, tasks in result.routes.items()},
        'unassigned': result.unassigned,
        'legs': {uav: [asdict(leg) for leg in legs] for uav, legs in result.legs.items()},
        'distances': {uav: result.route(uav).distance for uav in result.routes},
        'distance': result.distance, 'value': result.value, 'penalty': result.penalty,
        'fit': json_number(result.fit), 'cost': json_number(result.cost), **times_json(result),
        'conflicts': _conflicts(loaded, result),
        'history': [[seconds, json_number(fit)] for seconds, fit in result.history],
        'solver': result.solver, 'solve_time': result.solve_time, 'iterations': result.iterations,
        'origin': asdict(loaded.origin),
        'tasks': dict(zip((timed.task.id for timed in loaded.tasks), geodetic_rows(
            loaded.origin, [timed.task.position for timed in loaded.tasks]), strict=True)),
        'paths': {timed.task.id: geodetic_rows(loaded.origin, timed.task.path)
                  for timed in loaded.tasks if timed.task.path},
        'reversed': sorted(result.reversed),
        'waypoints': {uav.id: _waypoints(loaded, result, k)
                      for k, uav in enumerate(loaded.uavs)},
    }


def _conflicts(loaded: Scenario, result: Plan) -> list[dict[str, Any]]:
    """What `Conflict` has, with geodetic positions."""
    return [{**asdict(each), 'position': None if each.position is None else geodetic_rows(
        loaded.origin, [each.position])[0]} for each in result.conflicts]


def json_number(value: float) -> float | None:
    """None for NaN and the infinities, which JSON cannot represent."""
    return value if math.isfinite(value) else None


def geodetic_rows(origin: Origin, points: Sequence[Point]) -> list[dict[str, float | None]]:
    """Latitude and longitude [deg] and altitude [m above the origin] of ENU points."""
    above = (0.0, 0.0, origin.altitude_amsl)
    names = ('latitude', 'longitude', 'altitude')
    return [{name: json_number(round(float(value) - zero, digits) + 0.0)  # no -0.0
             for name, value, zero, digits in zip(names, place, above, _DIGITS, strict=True)}
            for place in to_geodetic_batch(origin, points)]


def _waypoints(loaded: Scenario, result: Plan, k: int) -> list[dict[str, Any]]:
    """The points of the k-th UAV's route, its start and home included."""
    uav, known = loaded.uavs[k], {timed.task.id: timed.task for timed in loaded.tasks}
    names, points = list[str | None]([None]), [uav.position]
    for stop in route_stops(result, uav.id, known, uav.home):
        names += [None] * len(stop.via) + [stop.task] * len(stop.points)
        points += [*stop.via, *stop.points]
    return [{'task': name, **row} for name, row in zip(
        names, geodetic_rows(loaded.origin, points), strict=True)]
