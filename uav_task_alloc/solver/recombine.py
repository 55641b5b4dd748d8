# SPDX-License-Identifier: Apache-2.0
"""Recombination of routes of the pool: groups of neighbouring UAVs exchange their tasks.

A few UAVs that leave tasks out choose among all columns, those that are alike among each other's.
"""
from __future__ import annotations

import numpy as np

from uav_task_alloc.kernel import allocating_kernel, inner_allocating_kernel, kernel
from uav_task_alloc.solver.multipliers import Reduced, reduced_costs
from uav_task_alloc.solver.packing import choose_columns
from uav_task_alloc.solver.partition import (
    MAX_READS,
    READ_COST,
    TRY_COST,
    Flags,
    candidates,
    repartition,
)
from uav_task_alloc.solver.pool import Pool, collect, column_of, empty_pool
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


@kernel
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


@allocating_kernel
def pack_routes(pool: Pool, reduced: Reduced, uavs: Ints, classes: Ints, spare: float,
                limit: int, flown: Ints) -> bool:
    """Choose columns for all UAVs whose reduced costs are less than `spare`. O(limit).

    Args:
        pool: the columns.
        reduced: their reduced costs.
        uavs: all of them, by class.
        classes: (m) class of each UAV; those of one may fly each other's columns.
        spare: [m]
        limit: words read, about, as for `choose_columns`.
        flown: (m) column of each UAV, -1: none; is changed if there are any.

    Returns:
        Whether there are any.
    """
    ends = reduced.unassigned.size
    tasks = np.arange(uavs.size, ends)
    columns = candidates(pool, reduced, np.ones(uavs.size, np.bool_), tasks, spare)
    found, _ = choose_columns(pool, reduced, columns, uavs, classes, tasks, spare, limit, flown,
                              np.empty(ends, np.int64))
    return bool(found)


def packed(a: Arrays, pool: Pool, classes: Ints, flown: Ints, worth: float,
           work: float) -> Ints | None:
    """Find the cheapest columns for all UAVs at once. O(work).

    Args:
        a: the problem.
        pool: the columns; one belongs to any UAV of the class that may fly it.
        classes: (m) class of each UAV, from 0.
        flown: (m) column of each UAV that first prices follow, -1: none.
        worth: [m] more than empty routes and unassigned tasks cost now.
        work: how many stops of the pool may be read for a bound, and in the search.

    Returns:
        (m) column of each UAV, -1: none; None: no combination found costs less.
    """
    reduced, bound = reduced_costs(a, pool, flown, worth, work)
    most = np.zeros(a.uavs)
    np.maximum.at(most, classes, reduced.stay)  # any UAV of a class could fly the best column
    reduced.column[:] += (most[classes] - reduced.stay)[pool.uav[:reduced.column.size]]
    bound -= float((most[classes] - reduced.stay).sum())
    reduced.stay[:] = most[classes]
    chosen, spare = np.full(a.uavs, -1), worth - bound - TINY
    if spare < 0.0 or not pack_routes(pool, reduced, np.argsort(classes, kind='stable'), classes,
                                      spare, min(MAX_READS, int(work / READ_COST)), chosen):
        return None
    return chosen


def repack(a: Arrays, best: Routes, pool: Pool, classes: Ints, work: float,
           into: Routes) -> bool:
    """As `recombine`, for few UAVs that leave tasks out: all of them at once. O(work)."""
    flown = np.full(a.uavs, -1, np.int64)
    worth = float(_cost(a, pool, best, flown))
    if worth == np.inf:
        return False
    chosen = packed(a, pool, classes, flown, worth, work)
    if chosen is None:
        return False
    _write(a, pool, chosen, into)
    return True


def classes_of(a: Arrays) -> Ints:
    """(m) class of each UAV, from 0: those of one start, end, fly and serve alike. O(m n)."""
    rows = np.hstack((a.xyz[:a.uavs], a.xyz[a.ends:a.ends + a.uavs], a.compatible,
                      np.column_stack((a.range_left, a.empty_route_length))))
    seen: dict[bytes, int] = {}
    return np.array([seen.setdefault(row.tobytes(), len(seen)) for row in rows], np.int64)


def load_packing(a: Arrays) -> None:
    """Call the kernel of `packed` once, so that it is compiled.

    Args:
        a: any problem.
    """
    pool, uavs = empty_pool(a), np.arange(a.uavs)
    reduced, _ = reduced_costs(a, pool, np.full(a.uavs, -1), 0.0, 0.0)
    pack_routes(pool, reduced, uavs, uavs, 1.0, 1, uavs.copy())


def load_recombination(a: Arrays, routes: Routes) -> None:
    """Call the kernels of `recombine` and `repack` once, so that they are compiled.

    Args:
        a: any problem.
        routes: any of its routes; they are cleared.
    """
    load_packing(a)
    pool, flown = empty_pool(a), np.full(a.uavs, -1)
    reduced, _ = reduced_costs(a, pool, flown, 0.0, 0.0)
    _improve(a, pool, reduced, 0, flown, routes.uav_of.copy(), routes)
    _write(a, pool, flown, routes)
