# SPDX-License-Identifier: Apache-2.0
"""Whether tasks may have to be left out, and which are out of reach in any case."""
from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uav_task_alloc.solver.problem import Problem
from uav_task_alloc.solver.routes import Floats, Routes

FEW_LEFT = 0.05  # share of the tasks within reach that first routes may leave out


def out_of_reach(problem: Problem) -> NDArray[np.bool_]:
    """Return which tasks no UAV can serve within its range, even alone. O(m n).

    Args:
        problem: its arrays are read.

    Returns:
        (n,) bool.
    """
    a = problem.arrays
    tasks, least = a.xyz[a.uavs:a.ends], np.full(a.ends - a.uavs, math.inf)
    for u in range(a.uavs):
        length = _distances(tasks, a.xyz[u])
        if a.returns:
            length = length + _distances(tasks, a.xyz[a.ends + u])
        over = length - a.range_left[u]
        least = np.minimum(least, np.where(a.compatible[u], over, math.inf))
    return np.asarray((least > 1e-6) | (a.unassigned_cost <= 0.0))


def leave_many(problem: Problem, routes: Routes) -> bool:
    """Return whether first routes leave so many tasks out that some may have to be.

    Args:
        problem: that is solved.
        routes: its first routes.

    Returns:
        Whether more than FEW_LEFT of the tasks within reach are left out, because of hard ranges.
    """
    a = problem.arrays
    if not a.hard or a.ends == a.uavs or not np.isfinite(a.range_left).any():
        return False
    left = routes.uav_of[a.uavs:a.ends] < 0
    if np.mean(left) <= FEW_LEFT:
        return False
    within = ~out_of_reach(problem)
    return bool(left[within].sum() > FEW_LEFT * within.sum())


def _distances(points: Floats, point: Floats) -> Any:
    """(n,) [m] from each point to one."""
    return np.sqrt(((points - point) ** 2).sum(axis=1))
