# SPDX-License-Identifier: Apache-2.0
"""`plan --terrain`: tasks above the ground, and legs that keep clear of it."""
from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.geometry.polyline import polyline_length
from uav_task_alloc.model import Leg, Plan, Point
from uav_task_alloc.model.route_stops import route_stops
from uav_task_alloc.scenario.values import Scenario, TimedTask
from uav_task_alloc.terrain import Terrain, check_above, read_terrain
from uav_task_alloc.terrain_legs import TerrainLegs
from uav_task_alloc.work.values import Vertical

CLEARANCE = 30.0  # [m] that legs keep from the ground, where it is not given
_SUNK = 5.0  # [m] below the ground: more is no inaccuracy of the raster


def ground_of(given: Scenario, path: Path | None,
              clearance: float | None) -> tuple[Terrain | None, float]:
    """The ground that options name, and the clearance from it [m].

    Args:
        given: the scenario.
        path: of a GeoTIFF; None: no ground is known.
        clearance: [m]; None: `CLEARANCE`.

    Raises:
        InvalidValue: a clearance without a ground, or a task above a ground that is not known.
        TerrainError: the file cannot be read.
    """
    if path is not None:
        return read_terrain(path, given.origin), CLEARANCE if clearance is None else clearance
    if clearance is not None:
        raise InvalidValue('--terrain-clearance', clearance, '--terrain with the ground, too')
    for timed in given.tasks:
        if timed.whole.vertical is Vertical.TERRAIN:
            raise InvalidValue(f'task {timed.task.id}: vertical', 'terrain',
                               '--terrain with the ground that it is above')
    return None, CLEARANCE


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


class _Zones:
    """The zones of a scenario, as legs over terrain ask for them."""

    def __init__(self, loaded: Scenario) -> None:
        self._loaded, self._zones = loaded, loaded.no_fly_zones()

    def way_around(self, a: Point, b: Point, low: float) -> tuple[Point, ...] | None:
        """Return the points of the shortest way around the zones."""
        from uav_task_alloc.geometry.detour import find_detour  # imports numba
        if low >= self._loaded.altitude_max:
            return () if self.grade((a, b)) else None
        found = find_detour(a, b, self._zones, clearance=self._loaded.clearance,
                            altitude_min=low, altitude_max=self._loaded.altitude_max)
        return None if math.isinf(found.length) else found.points

    def grade(self, points: Sequence[Point]) -> int:
        """Return 1 for a line that enters no zone."""
        from uav_task_alloc.geometry.zones import path_is_clear  # imports numba
        return int(path_is_clear(points, self._zones, self._loaded.clearance))


def over_terrain(loaded: Scenario, result: Plan, terrain: Terrain,
                 clearance: float) -> tuple[Plan, dict[str, str]]:
    """A plan whose legs keep clear of the ground.

    Args:
        loaded: its scenario.
        result: the plan.
        terrain: the ground.
        clearance: [m]; tasks that are lower are left and reached upright.

    Returns:
        The plan with points added to its legs, where lengths count them and times do not; and the
        UAVs that do not reach their tasks, by the tasks' ids: those legs are as they were.

    Raises:
        InvalidValue: no leg leads home.
        TerrainError: no data.
    """
    known = {timed.task.id: timed.task for timed in loaded.tasks}
    over = TerrainLegs(terrain, clearance, loaded.altitude_max, _Zones(loaded))
    legs, blocked, more = {}, dict[str, str](), 0.0
    for uav in loaded.uavs:
        at, found = uav.position, []
        for leg, stop in zip(result.legs.get(uav.id, ()), route_stops(
                result, uav.id, known, uav.home), strict=False):
            via = over.over((at, *stop.via, stop.points[0]))
            if via is None and stop.task is None:
                raise InvalidValue(f'{uav.id}: leg to its home', stop.points[0],
                                   f'a way over the terrain: {_in_the_way(loaded, clearance)}')
            if via is None:
                blocked[stop.task or ''] = uav.id
                via = stop.via
            length = polyline_length((at, *via, stop.points[0]))
            more += max(0.0, length - leg.length)
            found.append(leg if via == tuple(stop.via) else Leg(via, length))
            at = stop.points[-1]
        legs[uav.id] = tuple(found)
    return replace(result, legs=legs, distance=result.distance + more), blocked


def plan_over_terrain(loaded: Scenario, result: Plan, terrain: Terrain, clearance: float,
                      solve: Callable[[Scenario], Plan]) -> Plan:
    """A plan over the ground, without the tasks that no leg over it leads to.

    A UAV that a plan does not lead to its task is not asked for that task again; the others are.

    Args:
        loaded: the scenario.
        result: a plan of it.
        terrain: the ground.
        clearance: [m] that legs keep.
        solve: plans a scenario again, in which fewer UAVs may fly such tasks, or none.

    Returns:
        The plan; such tasks are unassigned, with the reason.

    Raises:
        InvalidValue, TerrainError: as `over_terrain`.
    """
    unreached = dict[str, list[str]]()
    left_out = dict[str, str]()
    everybody = frozenset(uav.id for uav in loaded.uavs)
    while True:
        higher, blocked = over_terrain(loaded, result, terrain, clearance)
        if not blocked:
            return replace(higher, unassigned={**higher.unassigned, **left_out})
        rest = list[TimedTask]()
        for timed in loaded.tasks:
            task, found = timed.task, unreached.setdefault(timed.task.id, [])
            if task.id in blocked:
                found.append(blocked[task.id])
            allowed = everybody if task.allowed_uavs is None else task.allowed_uavs
            if not found:
                rest.append(timed)
            elif others := allowed.difference(found):
                rest.append(replace(timed, task=replace(task, allowed_uavs=others)))
            else:
                left_out[task.id] = (f'no safe path for {", ".join(found)}: '
                                     f'{_in_the_way(loaded, clearance)}')
        loaded = replace(loaded, tasks=tuple(rest))
        result = solve(loaded)


def _in_the_way(loaded: Scenario, clearance: float) -> str:
    return (f'{clearance:g} m above the ground a zone or altitude_max = '
            f'{loaded.altitude_max:g} m is in the way')
