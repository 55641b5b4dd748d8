# SPDX-License-Identifier: Apache-2.0
"""Recombination of routes of problems with time: UAVs that are alike may fly each other's routes.

The columns are those of `pool`, and have labels in place of UAVs. The label of a route is its UAV
where no other is alike, else its first task by number: routes of one label serve a common task,
so that at most one of them is flown in any case. Node l + i stands for task i, with l labels.
"""
from __future__ import annotations

from typing import NamedTuple

import numpy as np

from uav_task_alloc.kernel import allocating_kernel, inline_kernel, inner_kernel, kernel
from uav_task_alloc.solver.multipliers import Reduced, reduced_costs
from uav_task_alloc.solver.partition import TRY_COST, Flags, repartition
from uav_task_alloc.solver.pool import Pool, empty_pool, new_column, slot_of_key
from uav_task_alloc.solver.recombine import GROUP_SIZE, PASSES
from uav_task_alloc.solver.routes import TINY, Arrays, Ints
from uav_task_alloc.solver.timed import columns as at
from uav_task_alloc.solver.timed.arrays import TimedArrays, TimedRoutes
from uav_task_alloc.solver.timed.route_sums import is_infeasible

_NEAR_TASKS = 6  # neighbours of a task that make two routes adjacent
ROUND_COST = 5.0  # time of a round over that of one without times, by which work is counted


class TimedPool(NamedTuple):
    """A pool whose columns have labels and belong to classes of UAVs."""

    pool: Pool
    class_of: Ints  # by column
    chosen: Ints  # (m) column of each UAV's route at the last collection; -1: none


def empty_timed_pool(a: TimedArrays, base: Arrays) -> TimedPool:
    """A pool without columns."""
    pool = empty_pool(labelled(a, base))
    return TimedPool(pool, np.zeros(pool.uav.size, np.int64), np.empty(a.uavs, np.int64))


def labelled(a: TimedArrays, base: Arrays) -> Arrays:
    """Arrays with labels in place of UAVs, as far as `multipliers` needs them."""
    labels = a.ends
    return base._replace(uavs=labels, ends=labels + a.ends - a.uavs, unassigned_cost=a.unserved)


@inline_kernel
def cost_of_route(a: TimedArrays, r: TimedRoutes, u: int) -> float:
    """What UAV u's route costs more than an empty one. O(1)."""
    cost = a.weight[at.BY_DISTANCE] * (r.route[u, at.METRES] - a.begin[u, at.EMPTY_LENGTH])
    cost += r.route[u, at.TIME_COST]
    if a.weight[at.BY_EXCESS] < np.inf:
        cost += a.weight[at.BY_EXCESS] * (r.route[u, at.RANGE_EXCESS]
                                          + r.route[u, at.ENDURANCE_EXCESS])
    return float(cost)


@kernel
def collect_timed(a: TimedArrays, r: TimedRoutes, timed: TimedPool) -> bool:
    """Add the routes without excess to the pool; whether there was room. O(n)."""
    pool, n = timed.pool, a.ends - a.uavs
    for u in range(a.uavs):
        timed.chosen[u] = -1
        if r.route[u, at.TASKS] == 0.0 or is_infeasible(a, r, u):
            continue
        k, t = a.class_of[u], r.link[u, at.NEXT]
        key, label, tasks, cost = pool.node_hash[k], np.int64(t), 0, cost_of_route(a, r, u)
        while t < a.ends:
            key ^= pool.node_hash[t + n]
            label, tasks = min(label, np.int64(t)), tasks + 1
            t = r.link[t, at.NEXT]
        if a.first_member[k + 1] - a.first_member[k] == 1:
            label = np.int64(u)
        slot = slot_of_key(pool, key)
        e = pool.table[slot]
        if e < 0:
            e = new_column(pool, slot, tasks)
            if e < 0:
                return False
        elif pool.first[e + 1] - pool.first[e] != tasks:  # once in 2^64, a hash collision
            continue
        elif pool.cost[e] <= cost + TINY:
            timed.chosen[u] = e
            continue
        pool.key[e], pool.uav[e], pool.cost[e], timed.class_of[e] = key, label, cost, k
        timed.chosen[u] = e
        t, i = r.link[u, at.NEXT], pool.first[e]
        while t < a.ends:
            pool.stops[i] = t + n
            t, i = r.link[t, at.NEXT], i + 1
    return True


@inner_kernel
def _add_route(a: TimedArrays, pool: Pool, e: int, label_of: Ints, group: Flags,
               adjacency: Ints) -> None:
    """Add the labels of column e's tasks to a group, count adjacent routes. O(stops)."""
    group[pool.uav[e]] = True
    for i in range(pool.first[e], pool.first[e + 1]):
        j = pool.stops[i] - a.ends
        group[a.uavs + j] = True
        for k in range(min(_NEAR_TASKS, a.near_count[j])):
            t = a.near[j, k] + (a.ends - a.uavs)
            if label_of[t] >= 0:
                adjacency[label_of[t]] += 1
            else:  # in no route: its label belongs to the group
                group[t - (a.ends - a.uavs)] = True
        for k in range(a.near_class.shape[1]):
            c = a.near_class[j, k]
            if c >= 0 and a.first_member[c + 1] - a.first_member[c] == 1:
                adjacency[a.members[a.first_member[c]]] += 1


@inner_kernel
def _fill_group(a: TimedArrays, pool: Pool, label_of: Ints, flown: Ints, seed: int,
                group: Flags, adjacency: Ints) -> None:
    """Set the labels of the routes nearest to that of one label, which is included. O(n)."""
    group[:] = False
    adjacency[:] = 0
    added = seed
    for _ in range(GROUP_SIZE):
        group[added] = True
        if flown[added] >= 0:
            _add_route(a, pool, flown[added], label_of, group, adjacency)
        adjacency[added] = -(1 << 40)
        most = 0
        for label in range(a.ends):
            if adjacency[label] > most:
                added, most = label, adjacency[label]
        if most == 0:
            break


@inner_kernel
def _tasks_of(a: TimedArrays, label_of: Ints, group: Flags, tasks: Ints) -> int:
    """Write the nodes of a group's tasks; how many. O(n)."""
    count = 0
    for t in range(a.ends, label_of.size):
        label = label_of[t] if label_of[t] >= 0 else t - (a.ends - a.uavs)
        if group[label]:
            tasks[count] = t
            count += 1
    return count


@inner_kernel
def _too_many(a: TimedArrays, timed: TimedPool, flown: Ints, used: Ints) -> bool:
    """Whether more routes of a class are flown than it has UAVs. O(labels)."""
    used[:] = 0
    for label in range(flown.size):
        if flown[label] >= 0:
            used[timed.class_of[flown[label]]] += 1
    too_many = False
    for k in range(used.size):
        too_many = too_many or used[k] > a.first_member[k + 1] - a.first_member[k]
    return bool(too_many)


@allocating_kernel
def _improve(a: TimedArrays, timed: TimedPool, reduced: Reduced, tries: int, flown: Ints,
             label_of: Ints) -> bool:
    """Repartition groups around each route while the cost falls; whether it fell. O(tries n)."""
    pool, improved = timed.pool, False
    group, adjacency = np.zeros(a.ends, np.bool_), np.empty(a.ends, np.int64)
    tasks, used = np.empty(label_of.size, np.int64), np.empty(a.first_member.size - 1, np.int64)
    then, then_of = np.empty(a.ends, np.int64), np.empty(label_of.size, np.int64)
    for _ in range(PASSES):
        fell = False
        for label in range(a.ends):
            if tries <= 0 or flown[label] < 0:
                continue
            _fill_group(a, pool, label_of, flown, label, group, adjacency)
            count = _tasks_of(a, label_of, group, tasks)
            for i in range(a.ends):
                then[i] = flown[i]
            for i in range(label_of.size):
                then_of[i] = label_of[i]
            better, tried = repartition(pool, reduced, group, tasks[:count], tries, then, then_of)
            tries -= tried
            if better and not _too_many(a, timed, then, used):
                fell = True
                for i in range(a.ends):
                    flown[i] = then[i]
                for i in range(label_of.size):
                    label_of[i] = then_of[i]
        improved |= fell
        if not fell:
            break
    return improved


def recombined(a: TimedArrays, base: Arrays, r: TimedRoutes, timed: TimedPool,
               work: float) -> list[list[int]] | None:
    """A combination of the columns that costs less than these routes; None: not found.

    Reads about `work` stops for a bound, and ROUND_COST times as many in the search. O(work).

    Args:
        a: the problem.
        base: arrays of the same problem without time.
        r: the best routes.
        timed: the pool; the routes are collected.
        work: stops of the pool to be read.

    Returns:
        Task nodes by UAV.
    """
    if not collect_timed(a, r, timed) and not collect_timed(a, r, timed):
        return None
    pool, labels = timed.pool, a.ends
    flown, label_of = np.full(labels, -1), np.full(labels + a.ends - a.uavs, -1)
    for e in timed.chosen[timed.chosen >= 0].tolist():
        flown[pool.uav[e]] = e
        label_of[pool.stops[pool.first[e]:pool.first[e + 1]]] = pool.uav[e]
    absent = label_of[labels:] < 0
    worth = float(pool.cost[flown[flown >= 0]].sum() + a.unserved[absent].sum())
    reduced, bound = reduced_costs(labelled(a, base), pool, flown, worth, work)
    tries = 0 if worth - bound < TINY else int(ROUND_COST * work / TRY_COST)
    if not _improve(a, timed, reduced, tries, flown, label_of):
        return None
    return _by_uav(a, timed, flown[flown >= 0].tolist())


def _by_uav(a: TimedArrays, timed: TimedPool, columns: list[int]) -> list[list[int]]:
    """Task nodes by UAV; one that flew a column before keeps it."""
    kept = set(columns).intersection(timed.chosen.tolist())
    of_uav = [e if e in kept else -1 for e in timed.chosen.tolist()]
    free = {k: [u for u in a.members[a.first_member[k]:a.first_member[k + 1]].tolist()
                if of_uav[u] < 0] for k in range(a.first_member.size - 1)}
    for e in columns:
        if e not in kept:
            of_uav[free[int(timed.class_of[e])].pop()] = e
    first, stops = timed.pool.first, timed.pool.stops
    return [(stops[first[e]:first[e + 1]].astype(np.int64) - a.ends + a.uavs).tolist()
            if e >= 0 else [] for e in of_uav]
