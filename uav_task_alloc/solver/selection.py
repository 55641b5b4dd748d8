# SPDX-License-Identifier: Apache-2.0
"""Whether tasks have to be left out: a lower bound on the length of routes that serve all.

Held and Karp, The Traveling-Salesman Problem and Minimum Spanning Trees, Operations Research 18
(1970): routes that serve all tasks are a spanning tree rooted at the starts, and legs home.
Multipliers of the tasks whose degree in it is not 2 raise the bound.
"""
from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uav_task_alloc.solver.problem import Problem
from uav_task_alloc.solver.routes import Floats, Routes

FEW_LEFT = 0.05  # up to this share of tasks left out by the first routes no bound is computed
MOST_STEPS = 10  # of the multipliers
MOST_BOUNDED = 1000  # tasks; of more, the lengths between all pairs would take too much memory
SHARE = 0.02  # of the budget that the bound may take
ROW_TIME, ENTRY_TIME = 5e-6, 1e-8  # [s] of a step, for each task and each pair of tasks
STEP, STEP_DECAY = 0.03, 0.95  # of the multipliers, in mean distances between tasks; its factor


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


def must_leave_tasks(problem: Problem, routes: Routes, budget: float) -> bool:
    """Return whether it is proven that not all tasks within reach can be served.

    Args:
        problem: that is solved.
        routes: its first routes.
        budget: [s] of the solve; the bound is computed as far as SHARE of it allows.

    Returns:
        False as well where the bound is too weak or takes too long, or few tasks are left out.
    """
    a = problem.arrays
    if not a.hard or a.uavs == 0 or a.ends == a.uavs:
        return False
    left = float(a.range_left.sum())
    if not math.isfinite(left) or np.mean(routes.uav_of[a.uavs:a.ends] < 0) <= FEW_LEFT:
        return False
    tasks = int(a.ends - a.uavs)
    if tasks > MOST_BOUNDED:
        return False
    steps = int(SHARE * budget / (tasks * (ROW_TIME + tasks * ENTRY_TIME)))
    return steps > 0 and _exceeds(problem, left, min(steps, MOST_STEPS))


def _exceeds(problem: Problem, left: float, steps: int) -> bool:
    """Whether routes that serve all tasks within reach are longer than `left` [m] in all."""
    a = problem.arrays
    tasks = a.xyz[a.uavs:a.ends][~out_of_reach(problem)]
    if len(tasks) == 0:
        return False
    first, last = (np.min([_distances(tasks, point) for point in points], axis=0)
                   for points in (a.xyz[:a.uavs], a.xyz[a.ends:a.ends + a.uavs]))
    between = np.sqrt(((tasks[:, None] - tasks[None]) ** 2).sum(axis=2))
    price, step = np.zeros(len(tasks)), STEP * float(between.mean())
    for _ in range(steps):
        length, degree = _tree(between + price[:, None] + price, first + price)
        legs_home = last + price if a.returns else price
        order = np.argsort(legs_home)[:a.uavs]
        for k, t in enumerate(order):
            if k == 0 or legs_home[t] < 0.0:  # a route ends there; at least one does
                length += float(legs_home[t])
                degree[t] += 1.0
        if length - 2.0 * float(price.sum()) > left * (1.0 + 1e-9):
            return True
        price += step * (degree - 2.0)
        step *= STEP_DECAY
    return False


def _tree(between: Floats, first: Floats) -> tuple[float, Floats]:
    """Length of the shortest spanning tree of a root and n nodes, and their degrees. O(n^2).

    between: (n, n) lengths; first: (n,) lengths from the root. Prim's algorithm.
    """
    key, length = first.copy(), 0.0
    parent, degree = np.full(key.size, -1), np.zeros(key.size)
    outside = np.zeros(key.size)  # inf: in the tree
    for _ in range(key.size):
        t = int(np.argmin(key + outside))
        length += float(key[t])
        degree[t] += 1.0
        if parent[t] >= 0:
            degree[parent[t]] += 1.0
        outside[t] = math.inf
        nearer = between[t] + outside < key
        key[nearer], parent[nearer] = between[t][nearer], t
    return length, degree


def _distances(points: Floats, point: Floats) -> Any:
    """(n,) [m] from each point to one."""
    return np.sqrt(((points - point) ** 2).sum(axis=1))
