# SPDX-License-Identifier: Apache-2.0
"""`plan --terrain`: tasks above the ground, and legs that keep clear of it."""
from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.model import Leg, Plan, Point, ThreatZone
from uav_task_alloc.model.route_stops import route_stops
from uav_task_alloc.scenario.values import Scenario
from uav_task_alloc.terrain import Terrain, check_above

_SUNK = 5.0  # [m] below the ground: more is no inaccuracy of the raster


def check_ground(loaded: Scenario, terrain: Terrain, clearance: float) -> list[str]:
    """Check tasks, ways and starts against the ground.

    Args:
        loaded: as `with_pieces` returns it.
        terrain: the ground.
        clearance: [m] that legs keep.

    Returns:
        A line for each start below the ground and each way nearer to it than the clearance.

    Raises:
        InvalidValue: a task or its way is below the ground.
        TerrainError: no data.
    """
    lines = []
    for timed in loaded.tasks:
        task = timed.task
        check_above(terrain, f'task {task.id}: position', [task.position])
        least = min((terrain.least_clearance(a, b)[0] for a, b in pairwise(task.path)),
                    default=clearance)
        if least < 0.0:
            raise InvalidValue(f'task {task.id}: path', round(least, 1),
                               'at least 0 m above the ground on all of its way')
        if least < clearance - 0.05:
            lines.append(f'task {task.id}: its way comes as near as {least:.1f} m to the ground')
    for uav in loaded.uavs:
        above = float(terrain.above_ground([uav.position])[0])
        if above < -_SUNK:
            lines.append(f'{uav.id} starts {-above:.0f} m below the ground of {terrain.name}: '
                         'is altitude_amsl of the origin right?')
    return lines


def over_terrain(loaded: Scenario, result: Plan, terrain: Terrain, clearance: float) -> Plan:
    """A plan whose legs keep clear of the ground.

    Args:
        loaded: its scenario.
        result: the plan.
        terrain: the ground.
        clearance: [m]; tasks that are lower are left and reached upright.

    Returns:
        The plan with points added to its legs; lengths count them, times do not.

    Raises:
        InvalidValue: a leg would have to enter a zone, or be higher than altitude_max.
        TerrainError: no data.
    """
    known = {timed.task.id: timed.task for timed in loaded.tasks}
    zones, legs, more = [timed.zone for timed in loaded.zones], {}, 0.0
    for uav in loaded.uavs:
        at, found = uav.position, []
        for leg, stop in zip(result.legs.get(uav.id, ()), route_stops(
                result, uav.id, known, uav.home), strict=False):
            line = (at, *stop.via, stop.points[0])
            higher = [at]
            for a, b in pairwise(line):
                higher += [*terrain.lifted(a, b, clearance), b]
            _check_leg(loaded, zones, line, higher, f'{uav.id}: leg to {stop.task or "its home"}')
            length = math.fsum(math.dist(a, b) for a, b in pairwise(higher))
            more += max(0.0, length - leg.length)
            found.append(leg if len(higher) == len(line) else Leg(tuple(higher[1:-1]), length))
            at = stop.points[-1]
        legs[uav.id] = tuple(found)
    return replace(result, legs=legs, distance=result.distance + more)


def _check_leg(loaded: Scenario, zones: Sequence[ThreatZone], line: Sequence[Point],
               higher: Sequence[Point], place: str) -> None:
    """Check points that were added. Raises InvalidValue."""
    from uav_task_alloc.geometry.zones import path_is_clear  # imports numba
    top = max((z for _, _, z in higher[1:-1]), default=-math.inf)
    if len(higher) == len(line):
        return
    if top > loaded.altitude_max:
        raise InvalidValue(f'{place}: height over the terrain', round(top, 1),
                           f'at most altitude_max = {loaded.altitude_max:g} m')
    if path_is_clear(line, zones, loaded.clearance) and not path_is_clear(
            higher, zones, loaded.clearance):
        raise InvalidValue(f'{place}: way over the terrain', round(top, 1),
                           'a height at which no zone is in the way; see --altitude-max')
