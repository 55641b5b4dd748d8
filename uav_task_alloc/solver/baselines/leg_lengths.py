# SPDX-License-Identifier: Apache-2.0
"""Lengths of all legs in one table, for baselines that evaluate many plans at once in numpy."""
from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.kernel import kernel
from uav_task_alloc.solver.insertion import place_all
from uav_task_alloc.solver.problem import Problem
from uav_task_alloc.solver.routes import Arrays, Floats, Routes, empty_routes, leg_length
from uav_task_alloc.solver.warm import replay

_MAX_TASKS = 2000  # the table takes 8 (n + m)^2 bytes


class LegLengths(NamedTuple):
    """Leg lengths [m] by stop: starts 0..m-1, then tasks; inf: there is no path."""

    onward: Floats  # (m + n, n) to each task
    final: Floats  # (m + n, m) to the end of each UAV's route: home, or 0 where it holds


@kernel
def _fill(a: Arrays, onward: Floats, final: Floats) -> None:
    """Fill onward (m + n, n) and final (m + n, m). O((m + n)^2)."""
    for i in range(a.ends):
        for t in range(a.ends - a.uavs):
            onward[i, t] = leg_length(a, i, a.uavs + t)
        for u in range(a.uavs):
            if i >= a.uavs or i == u:
                final[i, u] = leg_length(a, i, a.ends + u)


def all_leg_lengths(problem: Problem) -> LegLengths:
    """The lengths of all legs. O((m + n)^2) once they are known.

    Raises:
        InvalidValue: there are more than _MAX_TASKS tasks.
    """
    a, n = problem.arrays, len(problem.tasks)
    if n > _MAX_TASKS:
        raise InvalidValue('tasks', n, f'at most {_MAX_TASKS} for this baseline')
    legs = LegLengths(np.empty((a.ends, n)), np.full((a.ends, a.uavs), np.inf))
    _fill(a, legs.onward, legs.final)
    return legs


def routes_of(problem: Problem, rows: Sequence[Sequence[int]]) -> Routes:
    """Routes with the tasks rows[u] of each UAV u in order, as far as allowed.

    The others are inserted where they cost least.
    """
    a = problem.arrays
    routes = empty_routes(a)
    bounds = np.cumsum([0, *(len(row) for row in rows)])
    nodes = np.array([a.uavs + t for row in rows for t in row], np.int64)
    replay(a, routes, nodes, bounds)
    place_rest(a, routes)
    return routes


def place_rest(a: Arrays, routes: Routes) -> None:
    """Insert unassigned tasks where they cost least, if they fit anywhere."""
    unassigned = np.flatnonzero(routes.uav_of[a.uavs:a.ends] < 0) + a.uavs
    if unassigned.size:
        place_all(a, routes, unassigned)
