# SPDX-License-Identifier: Apache-2.0
"""Lengths of all legs in one table, for baselines that look at many plans at once in numpy."""
from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.kernel import kernel
from uav_task_alloc.solver import routes as of
from uav_task_alloc.solver.insertion import place_all
from uav_task_alloc.solver.problem import Problem
from uav_task_alloc.solver.routes import Arrays, Floats, Routes, step
from uav_task_alloc.solver.warm import replay

_MOST_TASKS = 2000  # the table takes 8 (n + m)^2 bytes


class LegLengths(NamedTuple):
    """Legs [m] by stop: starts 0..m-1, then tasks; inf where there is no way."""

    onward: Floats  # (m + n, n) to each task
    final: Floats  # (m + n, m) to the end of each UAV's route: home, or 0 where it holds


@kernel
def _fill(a: Arrays, onward: Floats, final: Floats) -> None:
    for i in range(a.ends):
        for t in range(a.ends - a.uavs):
            onward[i, t] = step(a, i, a.uavs + t)
        for u in range(a.uavs):
            if i >= a.uavs or i == u:
                final[i, u] = step(a, i, a.ends + u)


def all_ways(problem: Problem) -> LegLengths:
    """Find them all. Raises InvalidValue beyond MOST_TASKS."""
    a, n = problem.arrays, len(problem.tasks)
    if n > _MOST_TASKS:
        raise InvalidValue('tasks', n, f'at most {_MOST_TASKS} for this baseline')
    ways = LegLengths(np.empty((a.ends, n)), np.full((a.ends, a.uavs), np.inf))
    _fill(a, ways.onward, ways.final)
    return ways


def routes_of(problem: Problem, rows: Sequence[Sequence[int]]) -> Routes:
    """Routes that give UAV u the tasks rows[u] in order, as far as it may.

    Those that do not fit there go in wherever they cost least.
    """
    a = problem.arrays
    routes = of.empty_routes(a)
    bounds = np.cumsum([0, *(len(row) for row in rows)])
    nodes = np.array([a.uavs + t for row in rows for t in row], np.int64)
    replay(a, routes, nodes, bounds)
    place_rest(a, routes)
    return routes


def place_rest(a: Arrays, routes: Routes) -> None:
    """Put what is left out wherever it costs least, if it fits anywhere."""
    left = np.flatnonzero(routes.on[a.uavs:a.ends] < 0) + a.uavs
    if left.size:
        place_all(a, routes, left)
