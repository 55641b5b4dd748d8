# SPDX-License-Identifier: Apache-2.0
"""Routes that a search of few UAVs has flown, and a better combination of them.

The search finds good routes, but seldom all those of a good plan at the same time. A column
belongs to the UAV that flew it first; those that are alike may fly each other's.
"""
from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from uav_task_alloc.kernel import inner_kernel
from uav_task_alloc.model import Task, Uav
from uav_task_alloc.solver.colony import RECOMBINED_COST
from uav_task_alloc.solver.packing import MOST_PACKED
from uav_task_alloc.solver.pool import Pool, empty_pool, new_column, slot_of_key
from uav_task_alloc.solver.problem import Rules
from uav_task_alloc.solver.recombine import packed
from uav_task_alloc.solver.routes import TINY, Arrays
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


def _cost_over_empty(a: TimedArrays, r: TimedRoutes) -> float:
    """What all routes cost more than empty ones, with unserved tasks at their raised prices."""
    metres = r.sums[at.METRES] - a.begin[:, at.EMPTY_LENGTH].sum()
    cost = RECOMBINED_COST * r.sums[at.UNSERVED_COST] + a.weight[at.BY_DISTANCE] * metres
    cost += r.sums[at.TIME_COST]
    if a.weight[at.BY_EXCESS] < np.inf:
        cost += a.weight[at.BY_EXCESS] * (r.sums[at.RANGE_EXCESS] + r.sums[at.ENDURANCE_EXCESS])
    return float(cost)


def combined(a: TimedArrays, base: Arrays, r: TimedRoutes, pool: Pool,
             work: float) -> list[list[int]] | None:
    """As `recombined`, of the columns of such a pool: all UAVs at once. O(work).

    A task left out costs RECOMBINED_COST times its price, as to combine columns for more value
    pays even where that costs more metres than the price.
    """
    raised = base._replace(unassigned_cost=RECOMBINED_COST * a.unserved)
    flown = packed(raised, pool, a.class_of, np.full(a.uavs, -1), _cost_over_empty(a, r), work)
    if flown is None:
        return None
    return [pool.stops[pool.first[e]:pool.first[e + 1]].tolist() if e >= 0 else []
            for e in flown.tolist()]
