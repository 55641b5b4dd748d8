# SPDX-License-Identifier: Apache-2.0
"""Recombination of routes of the pool: groups of neighbouring UAVs exchange their tasks."""
from __future__ import annotations

import numpy as np

from uav_task_alloc.kernel import allocating_kernel, inner_allocating_kernel, inner_kernel, kernel
from uav_task_alloc.solver.multipliers import Reduced, reduced_costs
from uav_task_alloc.solver.partition import TRY_COST, Flags, repartition
from uav_task_alloc.solver.pool import Pool, collect, column_of
from uav_task_alloc.solver.routes import (
    NODE,
    TINY,
    Arrays,
    Ints,
    Routes,
    clear,
    insert,
    update_sums,
)

GROUP_SIZE = 10  # UAVs
_NEAR_TASKS = 6  # neighbours of a task that make two routes adjacent
PASSES = 2  # over all groups


@inner_allocating_kernel
def _group(a: Arrays, pool: Pool, uav_of: Ints, flown: Ints, seed: int) -> Flags:
    """The UAVs with routes nearest to that of one UAV, which is included: (m) bool. O(n)."""
    in_group, adjacency = np.zeros(a.uavs, np.bool_), np.zeros(a.uavs, np.int64)
    added = seed
    for _ in range(min(GROUP_SIZE, a.uavs)):
        in_group[added] = True
        e = flown[added]
        if e >= 0:
            for i in range(pool.first[e], pool.first[e + 1]):
                t = pool.stops[i] - a.uavs
                for k in range(min(_NEAR_TASKS, a.near.shape[1])):
                    if uav_of[a.near[t, k]] >= 0:
                        adjacency[uav_of[a.near[t, k]]] += 1
                for k in range(a.starts.shape[1]):
                    adjacency[a.starts[t, k]] += 1
        most = -1
        for u in range(a.uavs):
            if (adjacency[u] if not in_group[u] else -1) > most:
                added, most = u, adjacency[u]
    return in_group


@inner_allocating_kernel
def _tasks_of(a: Arrays, uav_of: Ints, group: Flags) -> Ints:
    """Task nodes that a group of UAVs serves, and adjacent unassigned ones. O(n)."""
    in_group = np.zeros(a.ends, np.bool_)
    for t in range(a.uavs, a.ends):
        if uav_of[t] >= 0:
            in_group[t] = group[uav_of[t]]
        else:
            in_group[t] = a.uavs <= GROUP_SIZE
            for k in range(min(_NEAR_TASKS, a.near.shape[1])):
                u = uav_of[a.near[t - a.uavs, k]]
                in_group[t] |= u >= 0 and group[u]
    tasks, count = np.empty(a.ends, np.int64), 0
    for t in range(a.uavs, a.ends):
        if in_group[t]:
            tasks[count] = t
            count += 1
    return tasks[:count]


@inner_kernel
def _write(a: Arrays, pool: Pool, flown: Ints, into: Routes) -> None:
    """Write columns as routes. O(n)"""
    clear(a, into)
    for u in range(a.uavs):
        if flown[u] >= 0:
            after = NODE(u)
            for i in range(pool.first[flown[u]], pool.first[flown[u] + 1]):
                t = pool.stops[i]
                insert(a, into, t, after)
                after = t
    update_sums(a, into)


@allocating_kernel
def _improve(a: Arrays, pool: Pool, reduced: Reduced, tries: int, flown: Ints, uav_of: Ints,
             into: Routes) -> bool:
    """Repartition the groups around each UAV while the cost falls. O(tries n)

    Returns:
        Whether it fell; then the routes are written to `into`.
    """
    improved, seeds = False, a.uavs if a.uavs > GROUP_SIZE else min(1, a.uavs)
    for _ in range(PASSES):
        improved_in_pass = False
        for u in range(seeds):  # all are in the group of each where there are few
            if tries <= 0:
                break
            group = _group(a, pool, uav_of, flown, u)
            better, tried = repartition(pool, reduced, group, _tasks_of(a, uav_of, group), tries,
                                        flown, uav_of)
            improved_in_pass |= better
            tries -= tried
        improved |= improved_in_pass
        if not improved_in_pass:
            break
    if improved:
        _write(a, pool, flown, into)
    return improved


@kernel
def _cost(a: Arrays, pool: Pool, best: Routes, flown: Ints) -> float:
    """Collect the routes, write their columns to `flown`; returns what they cost [m]. O(n).

    Unassigned tasks are included. inf: a route is not in the pool.
    """
    collect(a, best, pool)
    flying, unassigned = 0.0, 0.0
    for u in range(a.uavs):
        flown[u] = column_of(a, best, pool, u) if best.tasks[u] > 0 else -1
        if flown[u] >= 0:
            flying += pool.cost[flown[u]]
        elif best.tasks[u] > 0:
            return np.inf
    for t in range(a.uavs, a.ends):
        unassigned += a.unassigned_cost[t - a.uavs] if best.uav_of[t] < 0 else 0.0
    return unassigned + flying


def recombine(a: Arrays, best: Routes, pool: Pool, work: float, into: Routes) -> bool:
    """Write to `into` a combination of columns that costs less than `best`; whether there is one.

    Reads about `work` stops for a bound, and as many again in the search. O(work). The kernels
    are called one by one, as a kernel of all took a quarter longer to compile.
    """
    flown, uav_of = np.full(a.uavs, -1, np.int64), best.uav_of.copy()
    worth = float(_cost(a, pool, best, flown))
    if worth == np.inf:
        return False
    reduced, bound = reduced_costs(a, pool, flown, worth, work)
    tries = 0 if worth - bound < TINY else int(work / TRY_COST)
    return bool(_improve(a, pool, reduced, tries, flown, uav_of, into))
