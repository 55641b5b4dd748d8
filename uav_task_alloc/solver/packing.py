# SPDX-License-Identifier: Apache-2.0
"""Set packing for few UAVs that leave tasks out: columns of the pool, chosen UAV by UAV.

Depth-first branch and bound: of each UAV in turn every column that shares no task with those
chosen before, those with the least reduced cost first, then none. To branch on tasks, as
`partition` does, is slow where most of them may be left out at little cost.
"""
from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from uav_task_alloc.kernel import inline_kernel, inner_allocating_kernel
from uav_task_alloc.solver.multipliers import Reduced
from uav_task_alloc.solver.pool import Pool
from uav_task_alloc.solver.routes import TINY, Floats, Ints

MOST_PACKED = 5  # UAVs: of more the combinations are too many
NONE = -1  # instead of a column: the UAV stays


class Packing(NamedTuple):
    """The columns to choose from, c of them, and the choices so far by depth: d UAVs."""

    kind: Ints  # (d) class of the UAV that chooses at a depth: those alike one after another
    kind_of: Ints  # (c) class of the UAVs that may fly the column
    tasks: NDArray[np.uint64]  # (c, words) a bit a node
    saved: Floats  # (c) [m] of not leaving its tasks out
    fit: Ints  # (d, c) columns that share no task with the choices before, by reduced cost
    fitting: Ints  # (d) how many
    next_choice: Ints  # (d) next index in `fit`; count + 1: all were tried
    choice: Ints  # (d) index of the column, NONE
    spent: Floats  # (d) [m] reduced cost of the choices before
    cost: Floats  # (d) [m] the same, with that of all tasks that they leave out
    least_spent: Floats  # (d) [m] that UAVs of greater depths add to `spent` at least
    least_cost: Floats  # (d) [m] the same for `cost`
    least: Floats  # (classes, 2) scratch: both of a UAV of each class


@inner_allocating_kernel
def _packing(pool: Pool, reduced: Reduced, columns: Ints, uavs: Ints, classes: Ints,
             left: float) -> Packing:
    """Nothing chosen; left: [m] reduced cost of leaving out all tasks. O(stops of columns)."""
    c, d, nodes = columns.size, uavs.size, reduced.unassigned.size
    p = Packing(np.empty(d, np.int64), np.empty(c, np.int64),
                np.zeros((c, (nodes + 63) >> 6), np.uint64), np.zeros(c),
                np.empty((d, c), np.int64), np.zeros(d, np.int64), np.zeros(d, np.int64),
                np.empty(d, np.int64), np.zeros(d), np.empty(d), np.zeros(d), np.zeros(d),
                np.empty((classes.size, 2)))
    for depth in range(d):
        p.kind[depth] = classes[uavs[depth]]
    for k in range(c):
        p.kind_of[k] = classes[pool.uav[columns[k]]]
        for i in range(pool.first[columns[k]], pool.first[columns[k] + 1]):
            t = np.int64(pool.stops[i])
            p.tasks[k, t >> 6] |= np.uint64(1) << np.uint64(t & 63)
            p.saved[k] += reduced.unassigned[t]
        p.fit[0, k] = k
    p.fitting[0], p.cost[0] = c, left
    _set_least(reduced, columns, uavs, p, 0)
    return p


@inline_kernel
def _set_least(reduced: Reduced, columns: Ints, uavs: Ints, p: Packing, depth: int) -> None:
    """Bound what UAVs of greater depths add, from what fits at a depth. O(c)."""
    for later in range(depth + 1, uavs.size):
        kind = p.kind[later]
        p.least[kind, 0] = p.least[kind, 1] = reduced.stay[uavs[later]]
    if depth + 1 < uavs.size:
        for i in range(p.fitting[depth]):
            k = p.fit[depth, i]
            more, kind = reduced.column[columns[k]], p.kind_of[k]
            p.least[kind, 0] = min(p.least[kind, 0], more)
            p.least[kind, 1] = min(p.least[kind, 1], more - p.saved[k])
    p.least_spent[depth] = p.least_cost[depth] = 0.0
    for later in range(depth + 1, uavs.size):
        p.least_spent[depth] += p.least[p.kind[later], 0]
        p.least_cost[depth] += p.least[p.kind[later], 1]


@inline_kernel
def _next_choice(reduced: Reduced, columns: Ints, p: Packing, depth: int, spare: float) -> bool:
    """Choose the next column of the UAV at a depth, or none; whether any was left. O(c)."""
    i, spent = p.next_choice[depth], p.spent[depth] + p.least_spent[depth]
    while i < p.fitting[depth]:
        k = p.fit[depth, i]
        if spent + reduced.column[columns[k]] >= spare:
            break
        if p.kind_of[k] == p.kind[depth]:
            p.choice[depth], p.next_choice[depth] = k, i + 1
            return True
        i += 1
    if p.next_choice[depth] > p.fitting[depth]:
        return False
    p.choice[depth], p.next_choice[depth] = NONE, p.fitting[depth] + 1
    return True


@inline_kernel
def _go_deeper(reduced: Reduced, columns: Ints, uavs: Ints, p: Packing, depth: int,
               spare: float) -> int:
    """Keep for the next depth what fits beside the choice; returns the words read. O(c).

    Of UAVs that are alike the first one flies the column that comes first.
    """
    chosen, count, then, i = p.choice[depth], 0, depth + 1, 0
    while i < p.fitting[depth]:
        k = p.fit[depth, i]
        if p.spent[then] + reduced.column[columns[k]] >= spare:
            break
        i += 1
        fits = (p.kind_of[k] > p.kind[depth]
                or (p.kind_of[k] == p.kind[then] and i > p.next_choice[depth]))
        if fits and chosen != NONE:
            for word in range(p.tasks.shape[1]):
                fits = fits and p.tasks[k, word] & p.tasks[chosen, word] == 0
        if fits:
            p.fit[then, count] = k
            count += 1
    p.fitting[then], p.next_choice[then] = count, 0
    _set_least(reduced, columns, uavs, p, then)
    return i * int(p.tasks.shape[1]) + count


@inline_kernel
def _store(pool: Pool, columns: Ints, uavs: Ints, tasks: Ints, p: Packing, flown: Ints,
           uav_of: Ints) -> None:
    """Write the choices to flown and uav_of. O(tasks)."""
    for t in tasks:
        uav_of[t] = -1
    for depth in range(uavs.size):
        k = p.choice[depth]
        e = columns[k] if k != NONE else -1
        flown[uavs[depth]] = e
        if e >= 0:
            for i in range(pool.first[e], pool.first[e + 1]):
                uav_of[pool.stops[i]] = uavs[depth]


@inner_allocating_kernel
def choose_columns(pool: Pool, reduced: Reduced, columns: Ints, uavs: Ints, classes: Ints,
                   tasks: Ints, spare: float, limit: int, flown: Ints,
                   uav_of: Ints) -> tuple[bool, int]:
    """Choose the cheapest columns for a group of UAVs and its tasks. O(limit).

    Args:
        pool: the columns.
        reduced: their reduced costs.
        columns: those to choose from, least reduced cost first.
        uavs: of the group, by class.
        classes: (m) class of each UAV of the fleet; those of one may fly each other's columns.
        tasks: int64 task nodes.
        spare: [m] the reduced cost has to be less.
        limit: words read of the columns' sets of tasks, about; a word has 64 tasks.
        flown: column of each UAV, -1: none; is changed.
        uav_of: UAV by node, -1: unassigned; is changed.

    Returns:
        Whether the cost fell, and how many words were read.
    """
    left = 0.0
    for t in tasks:
        left += reduced.unassigned[t]
    p = _packing(pool, reduced, columns, uavs, classes, left)
    depth, read, improved = 0, columns.size, False
    while depth >= 0 and read < limit:
        read += 1
        if not _next_choice(reduced, columns, p, depth, spare):
            depth -= 1
            continue
        k = p.choice[depth]
        more = reduced.column[columns[k]] if k != NONE else reduced.stay[uavs[depth]]
        spent = p.spent[depth] + more
        cost = p.cost[depth] + more - (p.saved[k] if k != NONE else 0.0)
        if depth + 1 < uavs.size:
            if max(spent + p.least_spent[depth], cost + p.least_cost[depth]) < spare:
                p.spent[depth + 1], p.cost[depth + 1] = spent, cost
                read += _go_deeper(reduced, columns, uavs, p, depth, spare)
                depth += 1
        elif cost < spare:
            spare, improved = cost - TINY, True
            _store(pool, columns, uavs, tasks, p, flown, uav_of)
    return improved, read
