# SPDX-License-Identifier: Apache-2.0
"""The route pool: columns of a set partitioning problem, collected during the search."""
from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from uav_task_alloc.kernel import inline_kernel, inner_kernel
from uav_task_alloc.solver.routes import NODE, TINY, Arrays, Floats, Ints, Nodes, Routes

MAX_COLUMNS, MAX_STOPS = 1 << 14, 1 << 18  # capacity; a full pool is emptied
_MASK: Any = np.uint64(2 * MAX_COLUMNS - 1)


class Pool(NamedTuple):
    """Columns, each a UAV, a set of tasks and the cost of the shortest order seen."""

    node_hash: NDArray[np.uint64]  # (m + n) random number of each node (Zobrist hashing)
    table: Ints  # hash table, open addressing: column, -1: free
    key: NDArray[np.uint64]  # by column: exclusive or of node_hash of its UAV and tasks
    uav: Ints  # by column
    cost: Floats  # by column [m] above the length of the UAV's empty route
    first: Ints  # by column: index of its first stop; one more entry for the end
    stops: Nodes  # task nodes of all columns
    size: Ints  # (1) number of columns


def empty_pool(a: Arrays, classes: Ints | None = None) -> Pool:
    """A pool without columns.

    Args:
        a: arrays of the problem, for the numbers of UAVs and nodes.
        classes: (m) class of each UAV, from 0: routes of one with the same tasks are the same
            column; None: each UAV has its own.

    Returns:
        The pool.
    """
    hashes = np.random.default_rng(0).integers(1, 2 ** 64, a.ends, np.uint64)
    if classes is not None:
        hashes[:a.uavs] = hashes[classes]
    return Pool(hashes, np.full(2 * MAX_COLUMNS, -1, np.int64), np.empty(MAX_COLUMNS, np.uint64),
                np.empty(MAX_COLUMNS, np.int64), np.empty(MAX_COLUMNS),
                np.zeros(MAX_COLUMNS + 1, np.int64), np.empty(MAX_STOPS, NODE),
                np.zeros(1, np.int64))


@inline_kernel
def _route_key(a: Arrays, r: Routes, pool: Pool, u: int) -> Any:
    """Hash of UAV u's route, independent of the order. O(tasks)."""
    key, t = pool.node_hash[u], r.next[u]
    while t < a.ends:
        key ^= pool.node_hash[t]
        t = r.next[t]
    return key


@inline_kernel
def slot_of_key(pool: Pool, key: Any) -> int:
    """Index in the hash table where that key is, or would be. O(1) on average.

    Args:
        pool: the columns.
        key: hash of a UAV and its tasks.

    Returns:
        The index.
    """
    at = np.int64(key & _MASK)
    while pool.table[at] >= 0 and pool.key[pool.table[at]] != key:
        at = (at + 1) % pool.table.size
    return int(at)


@inline_kernel
def column_of(a: Arrays, r: Routes, pool: Pool, u: int) -> int:
    """The column of UAV u's tasks; -1 if it is not in the pool. O(tasks)."""
    return int(pool.table[slot_of_key(pool, _route_key(a, r, pool, u))])


@inline_kernel
def _cost(a: Arrays, r: Routes, u: int) -> float:
    """Cost [m] of UAV u's route above that of its empty route. O(tasks)."""
    cost, t = r.leg[u] - a.empty_route_length[u], r.next[u]
    while t < a.ends:
        cost += r.leg[t]
        t = r.next[t]
    if not a.hard:
        cost += a.range_penalty[u] * max(0.0, r.length[u] - a.range_left[u])
    return float(cost)


@inline_kernel
def new_column(pool: Pool, slot: int, tasks: int) -> int:
    """Add a column without stops; a full pool is emptied instead. O(1), or O(columns).

    Args:
        pool: the columns.
        slot: index in the hash table of its key.
        tasks: number of its stops.

    Returns:
        The column; -1: the pool was full.
    """
    e = pool.size[0]
    if e == pool.uav.size or pool.first[e] + tasks > pool.stops.size:
        pool.size[0] = 0
        pool.table[:] = -1
        return -1
    pool.size[0] += 1
    pool.first[e + 1] = pool.first[e] + tasks
    pool.table[slot] = e
    return int(e)


@inner_kernel
def collect(a: Arrays, r: Routes, pool: Pool) -> None:
    """Add the routes that are allowed to be flown to the pool. O(n)."""
    for u in range(a.uavs):
        if r.tasks[u] == 0 or (a.hard and r.length[u] > a.range_left[u] + TINY):
            continue
        key, cost = _route_key(a, r, pool, u), _cost(a, r, u)
        slot = slot_of_key(pool, key)
        e = pool.table[slot]
        if e < 0:
            e = new_column(pool, slot, r.tasks[u])
            if e < 0:
                return
        elif (pool.cost[e] <= cost + TINY  # or, once in 2^64, a hash collision
                or pool.first[e + 1] - pool.first[e] != r.tasks[u]):
            continue
        pool.key[e], pool.uav[e], pool.cost[e] = key, u, cost
        t, i = r.next[u], pool.first[e]
        while t < a.ends:
            pool.stops[i] = t
            t, i = r.next[t], i + 1
