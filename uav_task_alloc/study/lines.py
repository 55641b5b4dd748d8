# SPDX-License-Identifier: Apache-2.0
"""Random lines to be flown, what is left of them when a UAV is lost, and PyVRP's model of them.

PyVRP gets two clients a line, one for each direction, in a group of which exactly one is served,
and asymmetric lengths: from where a line ends to where the next one begins. The lines' own lengths
are the same in all plans: without them it knows better which lines are near.
"""
from __future__ import annotations

import math
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from importlib import import_module
from itertools import pairwise
from typing import Any

import numpy as np

from uav_task_alloc.geometry.flight_time import flight_time
from uav_task_alloc.geometry.polyline import point_at
from uav_task_alloc.model import Plan, Point, Task, Uav, turned_tasks
from uav_task_alloc.study.reference_solvers import PyvrpCallbacks

_SIDE = 10_000.0  # [m] of the square
STRIPS, STRIP_LENGTH, STRIP_WIDTH = 25, 400.0, 30.0  # of a field; [m]
_UNIT = 1000.0  # integer length of a metre
_HEIGHT = 30.0  # [m]


@dataclass(frozen=True, slots=True)
class LineFlights:
    """Routes of lines."""

    trips: dict[str, tuple[tuple[str, ...], ...]]  # task ids by UAV id
    reversed: frozenset[str]  # ids of lines flown from their last points


def random_lines(kind: str, uavs: int, lines: int,
                 seed: int) -> tuple[list[Uav], list[Task]]:
    """Draw UAVs anywhere on the ground, and lines that may be flown in both directions.

    Args:
        kind: 'fields', parallel strips in blocks, or 'scattered', each line anywhere.
        uavs, lines: their numbers.
        seed: of the random values.

    Returns:
        UAVs, which are at their bases, and tasks.
    """
    rng = np.random.default_rng((seed, 23))
    fleet = [Uav(f'u{i}', (*rng.uniform(0.0, _SIDE, 2).tolist(), _HEIGHT)) for i in range(uavs)]
    ends = _strips(rng, lines) if kind == 'fields' else _scattered(rng, lines)
    tasks = []
    for k, (a, b) in enumerate(ends):
        path = (a, b) if rng.random() < 0.5 else (b, a)
        tasks.append(Task(f'line#{k + 1}', path[0], path=path, reversible=True))
    return fleet, tasks


def _scattered(rng: np.random.Generator, lines: int) -> Iterator[tuple[Point, Point]]:
    for _ in range(lines):
        x, y = rng.uniform(0.0, _SIDE, 2)
        length, angle = rng.uniform(50.0, 500.0), rng.uniform(0.0, 2.0 * math.pi)
        yield ((float(x), float(y), _HEIGHT),
               (float(x + length * math.cos(angle)), float(y + length * math.sin(angle)), _HEIGHT))


def _strips(rng: np.random.Generator, lines: int) -> Iterator[tuple[Point, Point]]:
    for k in range(lines):
        if k % STRIPS == 0:
            x, y = rng.uniform(0.0, _SIDE, 2)
            angle = rng.uniform(0.0, 2.0 * math.pi)
            ux, uy = math.cos(angle), math.sin(angle)
        aside = (k % STRIPS) * STRIP_WIDTH
        a = float(x - uy * aside), float(y + ux * aside)
        yield ((*a, _HEIGHT),
               (float(a[0] + ux * STRIP_LENGTH), float(a[1] + uy * STRIP_LENGTH), _HEIGHT))


@dataclass(frozen=True, slots=True)
class Remainder:
    """What is left to fly at a moment."""

    uavs: list[Uav]  # where they are then, in the air
    tasks: list[Task]  # not flown yet; of a line under way its rest
    locked: dict[str, tuple[str, ...]]  # lines under way, by UAV id


def left_after_loss(found: Plan, uavs: Sequence[Uav], tasks: Sequence[Task], lost: str,
                    seconds: float) -> Remainder:
    """Return what is left of a plan without waits when a UAV is lost.

    Args:
        found: the plan.
        uavs, tasks: of the plan.
        lost: id of the UAV; the line that it was on is to be flown from one of its ends.
        seconds: [s] from the moment of the plan.

    Returns:
        Positions, lines and locks of the other UAVs.
    """
    known = {task.id: task for task in turned_tasks(tasks, found.reversed)}
    left = {task.id: task for task in tasks}
    fleet, locked = list[Uav](), dict[str, tuple[str, ...]]()
    for uav in uavs:
        place, clock, row = uav.position, seconds, found.routes[uav.id]
        for name, leg in zip(row, found.legs[uav.id], strict=False):
            way = (place, *leg.via, known[name].position)
            rest = _rest(uav, way, clock)
            if len(rest) > 1:
                place = rest[0]
                break
            place, clock = known[name].position, clock - flight_time(uav, way)
            rest = _rest(uav, known[name].path, clock)
            if len(rest) > 1:
                if uav.id != lost:
                    left[name] = replace(known[name], position=rest[0], path=rest,
                                         reversible=False)
                    locked[uav.id] = (name,)
                place = rest[0]
                break
            place, clock = known[name].end, clock - flight_time(uav, known[name].path)
            del left[name]
        if uav.id != lost:
            fleet.append(replace(uav, position=place, home=uav.base))
    return Remainder(fleet, list(left.values()), locked)


def _rest(uav: Uav, points: Sequence[Point], seconds: float) -> tuple[Point, ...]:
    """What is left of a polyline after so many seconds; its end alone where all is flown."""
    for k, (a, b) in enumerate(pairwise(points)):
        part = flight_time(uav, (a, b))
        if seconds < part:
            x, y, z = point_at(a, b, max(0.0, seconds) / part)
            return ((x, y, z), *points[k + 1:])
        seconds -= part
    return tuple(points[-1:])


def pyvrp_lines(uavs: Sequence[Uav], tasks: Sequence[Task], returns: bool, seconds: float,
                seed: int = 0) -> list[tuple[float, LineFlights]]:
    """Solve lines with PyVRP: the shortest routes that fly all of them.

    Args:
        uavs: at their bases, without limits.
        tasks: with paths, all reversible.
        returns: routes end at home.
        seconds: [s] of CPU time from when its model is built.
        seed: of its random numbers.

    Returns:
        CPU time [s] and routes of each improvement.
    """
    library, search = import_module('pyvrp'), import_module('pyvrp.solve')
    data = _data(library, uavs, tasks, returns)
    callbacks = PyvrpCallbacks(seconds, time.thread_time())
    library.solve(data, stop=callbacks.is_over, seed=seed, collect_stats=False, display=False,
                  params=search.SolveParams(
                      ils=library.IteratedLocalSearchParams(callbacks=callbacks)))
    return [(when, _flights(uavs, tasks, best)) for when, best in callbacks.better]


def _data(library: Any, uavs: Sequence[Uav], tasks: Sequence[Task], returns: bool) -> Any:
    """PyVRP's ProblemData; locations: starts, homes, then both directions of each line."""
    m, n = len(uavs), len(tasks)
    both = [each for task in tasks for each in (task, task.turned)]
    begins = np.array([*(uav.position for uav in uavs), *(uav.base for uav in uavs),
                       *(task.position for task in both)])
    ends = np.array([*begins[:2 * m], *(task.end for task in both)])
    metres = np.sqrt(((ends[:, None] - begins[None]) ** 2).sum(axis=2))
    if not returns:
        metres[:, m:2 * m] = 0.0
    lengths = np.ceil(metres * _UNIT - 1e-6).astype(np.int64)
    np.fill_diagonal(lengths, 0)
    clients = [library.Client(2 * m + i, required=False, group=i // 2) for i in range(2 * n)]
    groups = [library.ClientGroup([2 * i, 2 * i + 1]) for i in range(n)]
    vehicles = [library.VehicleType(1, [], start_depot=u, end_depot=m + u) for u in range(m)]
    return library.ProblemData(
        [library.Location(0, 0) for _ in lengths], clients,
        [library.Depot(i) for i in range(2 * m)], vehicles, [lengths],
        [np.zeros_like(lengths)], groups)


def _flights(uavs: Sequence[Uav], tasks: Sequence[Task], solution: Any) -> LineFlights:
    trips: dict[str, tuple[tuple[str, ...], ...]] = {}
    turned: set[str] = set()
    for route in solution.routes():
        row = []
        for stop in route:
            if stop.is_client():
                row.append(tasks[stop.idx // 2].id)
                if stop.idx % 2:
                    turned.add(row[-1])
        trips[uavs[route.vehicle_type()].id] = (tuple(row),)
    return LineFlights(trips, frozenset(turned))
