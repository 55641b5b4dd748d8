# SPDX-License-Identifier: Apache-2.0
"""Routes of the pool put together anew: groups of UAVs next to each other exchange their tasks."""
from __future__ import annotations

import numpy as np

from uav_task_alloc.kernel import allocating_kernel
from uav_task_alloc.solver.multipliers import reduced_costs
from uav_task_alloc.solver.partition import Flags, repartition
from uav_task_alloc.solver.pool import Pool, collect, column_of
from uav_task_alloc.solver.routes import NODE, TINY, Arrays, Ints, Routes, clear, insert, total

GROUP = 10  # UAVs
_AROUND = 6  # neighbours of a task by which routes are next to each other
PASSES = 2  # through all groups
DEEPEST = 20_000  # columns tried in a group
TRY = 4.0  # such a try costs as much as so many looks at a stop


@allocating_kernel
def _group(a: Arrays, pool: Pool, on: Ints, flown: Ints, seed: int) -> Flags:
    """Whose routes are nearest to that of one UAV, it among them."""
    inside, beside = np.zeros(a.uavs, np.bool_), np.zeros(a.uavs, np.int64)
    newest = seed
    for _ in range(min(GROUP, a.uavs)):
        inside[newest] = True
        e = flown[newest]
        if e >= 0:
            for t in pool.stops[pool.first[e]:pool.first[e + 1]]:
                for c in a.near[t - a.uavs, :_AROUND]:
                    if on[c] >= 0:
                        beside[on[c]] += 1
                for s in a.starts[t - a.uavs]:
                    beside[s] += 1
        newest = int(np.argmax(np.where(inside, -1, beside)))
    return inside


@allocating_kernel
def _tasks_of(a: Arrays, on: Ints, group: Flags) -> Ints:
    """Tasks that a group of UAVs serves, and those that nobody does next to them."""
    inside = np.zeros(a.ends, np.bool_)
    for t in range(a.uavs, a.ends):
        if on[t] >= 0:
            inside[t] = group[on[t]]
        else:
            inside[t] = a.uavs <= GROUP
            for c in a.near[t - a.uavs, :_AROUND]:
                inside[t] |= on[c] >= 0 and group[on[c]]
    return np.flatnonzero(inside)


@allocating_kernel
def _improve(a: Arrays, pool: Pool, work: float, flown: Ints, on: Ints) -> bool:
    """Let groups around each UAV exchange while that pays; whether it did."""
    worth = 0.0
    for t in range(a.uavs, a.ends):
        worth += a.price[t - a.uavs] if on[t] < 0 else 0.0
    worth += pool.cost[flown[flown >= 0]].sum()
    reduced, bound = reduced_costs(a, pool, flown, worth, work)
    found, tries = False, int(work / TRY)
    if worth - bound < TINY:
        return False
    for _ in range(PASSES):
        again = False
        for u in range(a.uavs):
            if tries <= 0:
                break
            group = _group(a, pool, on, flown, u)
            better, tried = repartition(pool, reduced, group, _tasks_of(a, on, group),
                                        min(DEEPEST, tries), flown, on)
            again |= better
            tries -= tried
        found |= again
        if not again:
            break
    return found


@allocating_kernel
def recombine(a: Arrays, best: Routes, pool: Pool, work: float, into: Routes) -> bool:
    """Put columns together that cost less than the best, if there are any; whether there are.

    Does about `work` looks at stops for a bound, and as much again to search.
    """
    collect(a, best, pool)
    flown, on = np.full(a.uavs, -1, np.int64), np.full(a.ends, -1, np.int64)
    on[a.uavs:] = best.on[a.uavs:a.ends]
    for u in range(a.uavs):
        if best.tasks[u] > 0:
            flown[u] = column_of(a, best, pool, u)
            if flown[u] < 0:
                return False
    if not _improve(a, pool, work, flown, on):
        return False
    clear(a, into)
    for u in range(a.uavs):
        if flown[u] >= 0:
            after = NODE(u)
            for t in pool.stops[pool.first[flown[u]]:pool.first[flown[u] + 1]]:
                insert(a, into, t, after)
                after = t
    total(a, into)
    return True
