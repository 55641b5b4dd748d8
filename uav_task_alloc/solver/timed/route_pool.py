# SPDX-License-Identifier: Apache-2.0
"""Routes that a search of few UAVs has flown, and a better combination of them.

The search finds good routes, but seldom all those of a good plan at the same time. A column
belongs to the UAV that flew it first; those that are alike may fly each other's.
"""
from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from uav_task_alloc.kernel import allocating_kernel, inner_kernel
from uav_task_alloc.model import Task, Uav
from uav_task_alloc.solver.multipliers import Reduced, reduced_costs
from uav_task_alloc.solver.packing import MOST_PACKED, choose_columns
from uav_task_alloc.solver.partition import MAX_READS, READ_COST, candidates
from uav_task_alloc.solver.pool import Pool, empty_pool, new_column, slot_of_key
from uav_task_alloc.solver.problem import Rules
from uav_task_alloc.solver.routes import TINY, Arrays, Ints
from uav_task_alloc.solver.timed import columns as at
from uav_task_alloc.solver.timed.arrays import TimedArrays, TimedRoutes
from uav_task_alloc.solver.timed.recombine import cost_of_route
from uav_task_alloc.solver.timed.route_sums import is_infeasible


def may_combine(uavs: Sequence[Uav], tasks: Iterable[Task], rules: Rules) -> bool:
    """Return whether routes of a problem with these UAVs and tasks may be combined.

    Args:
        uavs: the fleet.
        tasks: all of them, locked ones included.
        rules: objective, trips.
    """
    return (1 < len(uavs) <= MOST_PACKED and rules.trips == 1 and rules.objective.finish == 0.0
            and not any(task.path for task in tasks))


def route_pool(base: Arrays, combines: bool) -> Pool:
    """A pool without columns; without room, too, where none are combined.

    Args:
        base: arrays of the problem without time.
        combines: whether routes are combined.
    """
    if combines:
        return empty_pool(base)
    none = np.empty(0, np.int64)
    return Pool(np.empty(0, np.uint64), none, np.empty(0, np.uint64), none, np.empty(0), none,
                np.empty(0, base.near.dtype), np.zeros(1, np.int64))


@inner_kernel
def collect_routes(a: TimedArrays, r: TimedRoutes, pool: Pool) -> None:
    """Add the routes without excess to a pool that has room for any. O(n)."""
    for u in range(a.uavs if pool.uav.size > 0 else 0):
        if r.route[u, at.TASKS] == 0.0 or is_infeasible(a, r, u):
            continue
        key, tasks, t = pool.node_hash[a.class_of[u]], 0, r.link[u, at.NEXT]
        while t < a.ends:
            key ^= pool.node_hash[t]
            t, tasks = r.link[t, at.NEXT], tasks + 1
        slot, cost = slot_of_key(pool, key), cost_of_route(a, r, u)
        e = pool.table[slot]
        if e < 0:
            e = new_column(pool, slot, tasks)
            if e < 0:
                return
            pool.uav[e] = u
        elif (pool.cost[e] <= cost + TINY  # or, once in 2^64, a hash collision
                or pool.first[e + 1] - pool.first[e] != tasks):
            continue
        pool.key[e], pool.cost[e] = key, cost
        t, i = r.link[u, at.NEXT], pool.first[e]
        while t < a.ends:
            pool.stops[i] = t
            t, i = r.link[t, at.NEXT], i + 1


@allocating_kernel
def pack_routes(a: TimedArrays, pool: Pool, reduced: Reduced, spare: float, limit: int,
                flown: Ints) -> bool:
    """Choose columns whose reduced costs are less than `spare` in all. O(limit).

    Args:
        a: the problem.
        pool: the columns.
        reduced: their reduced costs.
        spare: [m]
        limit: words read, about, as for `choose_columns`.
        flown: (m) column of each UAV, -1: none; is changed if there are any.

    Returns:
        Whether there are any.
    """
    tasks = np.arange(a.uavs, a.ends)
    columns = candidates(pool, reduced, np.ones(a.uavs, np.bool_), tasks, spare)
    found, _ = choose_columns(pool, reduced, columns, a.members, a.class_of, tasks, spare, limit,
                              flown, np.empty(a.ends, np.int64))
    return bool(found)


def _cost_over_empty(a: TimedArrays, r: TimedRoutes) -> float:
    """What all routes cost more than empty ones, with unserved tasks."""
    metres = r.sums[at.METRES] - a.begin[:, at.EMPTY_LENGTH].sum()
    cost = r.sums[at.UNSERVED_COST] + a.weight[at.BY_DISTANCE] * metres + r.sums[at.TIME_COST]
    if a.weight[at.BY_EXCESS] < np.inf:
        cost += a.weight[at.BY_EXCESS] * (r.sums[at.RANGE_EXCESS] + r.sums[at.ENDURANCE_EXCESS])
    return float(cost)


def combined(a: TimedArrays, base: Arrays, r: TimedRoutes, pool: Pool,
             work: float) -> list[list[int]] | None:
    """As `recombined`, of the columns of such a pool: all UAVs at once. O(work)."""
    worth = _cost_over_empty(a, r)
    reduced, bound = reduced_costs(base._replace(unassigned_cost=a.unserved), pool,
                                   np.full(a.uavs, -1), worth, work)
    most = np.zeros(a.first_member.size - 1)
    np.maximum.at(most, a.class_of, reduced.stay)
    reduced.column[:] += (most[a.class_of] - reduced.stay)[pool.uav[:reduced.column.size]]
    bound -= float((most[a.class_of] - reduced.stay).sum())
    reduced.stay[:] = most[a.class_of]
    flown = np.full(a.uavs, -1)
    if worth - bound < TINY or not pack_routes(
            a, pool, reduced, worth - bound - TINY, min(MAX_READS, int(work / READ_COST)), flown):
        return None
    return [pool.stops[pool.first[e]:pool.first[e + 1]].tolist() if e >= 0 else []
            for e in flown.tolist()]

