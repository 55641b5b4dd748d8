# SPDX-License-Identifier: Apache-2.0
"""The route pool: columns of a set partitioning problem, collected from what bees fly."""
from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from uav_task_alloc.kernel import inline_kernel, kernel
from uav_task_alloc.solver.routes import NODE, TINY, Arrays, Floats, Ints, Nodes, Routes

COLUMNS, STOPS = 1 << 14, 1 << 18  # room; a pool that runs out of it begins anew
MASK: Any = np.uint64(2 * COLUMNS - 1)


class Pool(NamedTuple):
    """Columns: who serves which tasks at what cost, each in the shortest order seen."""

    word: NDArray[np.uint64]  # (m + n) a random number a node
    table: Ints  # open addressing: column, -1: free
    key: NDArray[np.uint64]  # by column: exclusive or of the words of its UAV and tasks
    uav: Ints
    cost: Floats  # [m] more than if that UAV stayed
    first: Ints  # where its stops begin; and where the last one's end
    stops: Nodes
    size: Ints  # columns


def empty_pool(a: Arrays) -> Pool:
    """A pool without columns."""
    words = np.random.default_rng(0).integers(1, 2 ** 64, a.ends, np.uint64)
    return Pool(words, np.full(2 * COLUMNS, -1, np.int64), np.empty(COLUMNS, np.uint64),
                np.empty(COLUMNS, np.int64), np.empty(COLUMNS), np.zeros(COLUMNS + 1, np.int64),
                np.empty(STOPS, NODE), np.zeros(1, np.int64))


@inline_kernel
def _key(a: Arrays, r: Routes, pool: Pool, u: int) -> Any:
    """What UAV u's route is found by, whatever its order."""
    key, t = pool.word[u], r.next[u]
    while t < a.ends:
        key ^= pool.word[t]
        t = r.next[t]
    return key


@inline_kernel
def _slot(pool: Pool, key: Any) -> int:
    """Where in the table that key is, or would be."""
    at = np.int64(key & MASK)
    while pool.table[at] >= 0 and pool.key[pool.table[at]] != key:
        at = (at + 1) % pool.table.size
    return int(at)


@inline_kernel
def column_of(a: Arrays, r: Routes, pool: Pool, u: int) -> int:
    """The column of UAV u's tasks, -1 if it is not in the pool."""
    return int(pool.table[_slot(pool, _key(a, r, pool, u))])


@inline_kernel
def _cost(a: Arrays, r: Routes, u: int) -> float:
    """What UAV u's route costs more than none [m]."""
    cost, t = r.leg[u] - a.idle[u], r.next[u]
    while t < a.ends:
        cost += r.leg[t]
        t = r.next[t]
    if not a.hard:
        cost += a.strain[u] * max(0.0, r.length[u] - a.reach[u])
    return float(cost)


@inline_kernel
def _new_column(pool: Pool, tasks: int) -> int:
    """A column with room for so many tasks, -1 if there is no more."""
    e = pool.size[0]
    if e == pool.uav.size or pool.first[e] + tasks > pool.stops.size:
        return -1
    pool.size[0] += 1
    pool.first[e + 1] = pool.first[e] + tasks
    return int(e)


@kernel
def collect(a: Arrays, r: Routes, pool: Pool) -> None:
    """Note the routes that are flown and may be. O(n)."""
    for u in range(a.uavs):
        if r.tasks[u] == 0 or (a.hard and r.length[u] > a.reach[u] + TINY):
            continue
        key, cost = _key(a, r, pool, u), _cost(a, r, u)
        slot = _slot(pool, key)
        e = pool.table[slot]
        if e < 0:
            e = _new_column(pool, r.tasks[u])
            if e < 0:
                pool.size[0] = 0
                pool.table[:] = -1
                return
            pool.table[slot] = e
        elif (pool.cost[e] <= cost + TINY  # or, one in 2^64, another set of tasks
                or pool.first[e + 1] - pool.first[e] != r.tasks[u]):
            continue
        pool.key[e], pool.uav[e], pool.cost[e] = key, u, cost
        t, i = r.next[u], pool.first[e]
        while t < a.ends:
            pool.stops[i] = t
            t, i = r.next[t], i + 1
