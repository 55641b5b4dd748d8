# SPDX-License-Identifier: Apache-2.0
"""Set partitioning for a group of UAVs: the columns of the pool that serve its tasks cheapest.

Depth-first branch and bound: branch on the unserved task with the fewest columns; try each column
that fits, those with the least reduced cost first, then leave the task unassigned.
"""
from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from uav_task_alloc.kernel import inline_kernel, inner_allocating_kernel, inner_kernel
from uav_task_alloc.solver.multipliers import Reduced
from uav_task_alloc.solver.pool import Pool
from uav_task_alloc.solver.routes import TINY, Floats, Ints

Flags = NDArray[np.bool_]
MAX_TRIES = 20_000  # columns that are tried at most
MAX_READS = 4_000_000  # words that `choose_columns` reads at most
TRY_COST, READ_COST = 20.0, 5.0  # work of a try, of a word read, in stops read
_INSERTION = 15  # items from which quicksort splits
UNTRIED, UNSERVED = -1, -2  # instead of a column: nothing tried yet; the task is not served


class Branches(NamedTuple):
    """The columns to choose from."""

    tasks: Ints  # task nodes, those with the fewest columns first
    begin: Ints  # by node: first index of its columns in `column`; one more entry for the end
    column: Ints  # columns of each task, those with the least reduced cost first


class Choices(NamedTuple):
    """The choices so far, by depth."""

    task: Ints  # index in Branches.tasks
    next_choice: Ints  # next index in Branches.column
    choice: Ints  # column, UNTRIED or UNSERVED
    spent: Floats  # [m] reduced cost of the choices before
    task_served: Flags  # by node
    uav_used: Flags  # by UAV


@inner_kernel
def _swap(items: Ints, keys: Floats, i: int, j: int) -> None:
    """Swap two items and their keys. O(1)."""
    key, item = keys[i], items[i]
    keys[i], items[i] = keys[j], items[j]
    keys[j], items[j] = key, item


@inner_kernel
def _split(items: Ints, keys: Floats, low: int, high: int) -> int:
    """Put smaller keys before the median of three, larger ones after it; returns its index."""
    mid = (low + high) >> 1
    if keys[mid] < keys[low]:
        _swap(items, keys, low, mid)
    if keys[high] < keys[mid]:
        _swap(items, keys, mid, high)
    if keys[mid] < keys[low]:
        _swap(items, keys, low, mid)
    _swap(items, keys, mid, high)
    pivot, i, j = keys[high], low, high - 1
    while True:
        while i < high and keys[i] < pivot:
            i += 1
        while j >= low and pivot < keys[j]:
            j -= 1
        if i >= j:
            break
        _swap(items, keys, i, j)
        i, j = i + 1, j - 1
    _swap(items, keys, i, high)
    return i


@inner_allocating_kernel
def _sort(items: Ints, keys: Floats) -> None:
    """Sort items by their keys, both (n,), by quicksort. O(n log n) on average.

    In place of np.argsort, which takes more than a second to compile; ties end as with it.
    """
    lows, highs, depth = np.empty(64, np.int64), np.empty(64, np.int64), 1
    lows[0], highs[0] = 0, keys.size - 1
    while depth > 0:
        depth -= 1
        low, high = lows[depth], highs[depth]
        while high - low >= _INSERTION:
            i = _split(items, keys, low, high)
            if high - i > i - low:  # the larger part waits
                lows[depth], highs[depth], high = i + 1, high, i - 1
            else:
                lows[depth], highs[depth], low = low, i - 1, i + 1
            depth += 1
        for i in range(low + 1, high + 1):
            item, key, j = items[i], keys[i], i
            while j > low and key < keys[j - 1]:
                items[j], keys[j] = items[j - 1], keys[j - 1]
                j -= 1
            items[j], keys[j] = item, key


@inner_allocating_kernel
def candidates(pool: Pool, reduced: Reduced, group: Flags, tasks: Ints, spare: float) -> Ints:
    """Columns of a group that serve only its tasks, least reduced cost first. O(stops of pool).

    Args:
        pool: the columns.
        reduced: their reduced costs.
        group: (m) bool.
        tasks: int64 task nodes.
        spare: [m] their reduced costs are less.

    Returns:
        Their numbers.
    """
    inside = np.zeros(reduced.unassigned.size, np.bool_)
    for t in tasks:
        inside[t] = True
    columns, count = np.empty(pool.size[0], np.int64), 0
    for e in range(pool.size[0]):
        fits = group[pool.uav[e]] and reduced.column[e] < spare
        i = pool.first[e]
        while fits and i < pool.first[e + 1]:
            fits = inside[pool.stops[i]]
            i += 1
        if fits:
            columns[count] = e
            count += 1
    keys = np.empty(count)
    for i in range(count):
        keys[i] = reduced.column[columns[i]]
    _sort(columns[:count], keys)
    return columns[:count]


@inner_allocating_kernel
def _branches(pool: Pool, columns: Ints, tasks: Ints, nodes: int) -> Branches:
    """Sort columns by task. O(stops of the columns)."""
    begin = np.zeros(nodes + 1, np.int64)
    for e in columns:
        for i in range(pool.first[e], pool.first[e + 1]):
            begin[pool.stops[i] + 1] += 1
    counts, order = np.empty(tasks.size), np.empty(tasks.size, np.int64)
    for i in range(tasks.size):
        counts[i], order[i] = begin[tasks[i] + 1], tasks[i]
    _sort(order, counts)
    for i in range(nodes):
        begin[i + 1] += begin[i]
    column, fill = np.empty(begin[nodes], np.int64), np.empty(nodes, np.int64)
    for i in range(nodes):
        fill[i] = begin[i]
    for e in columns:
        for i in range(pool.first[e], pool.first[e + 1]):
            column[fill[pool.stops[i]]] = e
            fill[pool.stops[i]] += 1
    return Branches(order, begin, column)


@inline_kernel
def _set_chosen(pool: Pool, e: int, chosen: Choices, flies: bool) -> None:
    """Mark column e as chosen or not. O(stops of the column)."""
    chosen.uav_used[pool.uav[e]] = flies
    for i in range(pool.first[e], pool.first[e + 1]):
        chosen.task_served[pool.stops[i]] = flies


@inline_kernel
def _fits(pool: Pool, e: int, chosen: Choices) -> bool:
    """Whether column e is compatible with the chosen ones. O(stops of the column)."""
    if chosen.uav_used[pool.uav[e]]:
        return False
    for i in range(pool.first[e], pool.first[e + 1]):
        if chosen.task_served[pool.stops[i]]:
            return False
    return True


@inline_kernel
def _next_branch(pool: Pool, reduced: Reduced, b: Branches, chosen: Choices, depth: int,
                 spare: float) -> tuple[float, int]:
    """Choose the next column that fits, or none: (cost with it [m], columns tried).

    The cost is inf where no choice is left. O(stops of the columns tried).
    """
    t, spent = b.tasks[chosen.task[depth]], chosen.spent[depth]
    begin, end = chosen.next_choice[depth], b.begin[t + 1]
    i = begin
    while i < end and spent + reduced.column[b.column[i]] < spare:
        if _fits(pool, b.column[i], chosen):
            chosen.choice[depth], chosen.next_choice[depth] = b.column[i], i + 1
            _set_chosen(pool, b.column[i], chosen, True)
            return spent + reduced.column[b.column[i]], i + 1 - begin
        i += 1
    chosen.next_choice[depth] = end
    if spent + reduced.unassigned[t] < spare:
        chosen.choice[depth] = UNSERVED
        chosen.task_served[t] = True
        return spent + reduced.unassigned[t], i - begin
    return np.inf, i - begin


@inline_kernel
def _open_branch(b: Branches, chosen: Choices, depth: int, place: int, spent: float) -> None:
    """Start a branch on the task at that index of the order. O(1)."""
    chosen.task[depth], chosen.next_choice[depth] = place, b.begin[b.tasks[place]]
    chosen.choice[depth], chosen.spent[depth] = UNTRIED, spent


@inline_kernel
def _store_choices(pool: Pool, group: Flags, b: Branches, chosen: Choices, depth: int, flown: Ints,
               uav_of: Ints) -> None:
    """Write the chosen columns to flown and uav_of. O(tasks)."""
    for u in range(group.size):
        if group[u]:
            flown[u] = -1
    for t in b.tasks:
        uav_of[t] = -1
    for d in range(depth + 1):
        e = chosen.choice[d]
        if e >= 0:
            flown[pool.uav[e]] = e
            for i in range(pool.first[e], pool.first[e + 1]):
                uav_of[pool.stops[i]] = pool.uav[e]


@inner_allocating_kernel
def _branch_and_bound(pool: Pool, reduced: Reduced, group: Flags, b: Branches, spare: float,
                      limit: int, flown: Ints, uav_of: Ints) -> tuple[bool, int]:
    """See `repartition`; `spare` [m] is the current reduced cost. O(limit stops)."""
    room = b.tasks.size
    chosen = Choices(np.empty(room, np.int64), np.empty(room, np.int64), np.empty(room, np.int64),
                     np.empty(room), np.zeros(reduced.unassigned.size, np.bool_),
                     np.zeros(group.size, np.bool_))
    depth, tried, improved = 0, 0, False
    _open_branch(b, chosen, 0, 0, 0.0)
    while depth >= 0 and tried < limit:
        if chosen.choice[depth] >= 0:
            _set_chosen(pool, chosen.choice[depth], chosen, False)
        if chosen.choice[depth] == UNSERVED:  # the last branch
            chosen.task_served[b.tasks[chosen.task[depth]]] = False
            depth -= 1
            continue
        spent, attempts = _next_branch(pool, reduced, b, chosen, depth, spare)
        tried += 1 + attempts
        if spent == np.inf:
            depth -= 1
            continue
        place = chosen.task[depth]
        while place < room and chosen.task_served[b.tasks[place]]:
            place += 1
        if place < room:
            depth += 1
            _open_branch(b, chosen, depth, place, spent)
            continue
        staying = 0.0
        for u in range(group.size):
            if group[u] and not chosen.uav_used[u]:
                staying += reduced.stay[u]
        spent += staying
        if spent < spare:
            spare, improved = spent - TINY, True
            _store_choices(pool, group, b, chosen, depth, flown, uav_of)
    return improved, tried


@inner_kernel
def _reduced_cost(reduced: Reduced, group: Flags, tasks: Ints, flown: Ints, uav_of: Ints) -> float:
    """The reduced cost [m] of what a group of UAVs flies and leaves out. O(m + tasks)."""
    staying, flying, unassigned = 0.0, 0.0, 0.0
    for u in range(group.size):
        if group[u] and flown[u] < 0:
            staying += reduced.stay[u]
        elif group[u]:
            flying += reduced.column[flown[u]]
    for t in tasks:
        if uav_of[t] < 0:
            unassigned += reduced.unassigned[t]
    return staying + unassigned + flying


@inner_allocating_kernel
def repartition(pool: Pool, reduced: Reduced, group: Flags, tasks: Ints, limit: int,
                flown: Ints, uav_of: Ints) -> tuple[bool, int]:
    """Choose the cheapest columns for a group of UAVs and its tasks. O(limit n).

    Args:
        pool: the columns.
        reduced: their reduced costs.
        group: (m) bool.
        tasks: int64 task nodes.
        limit: columns tried, about.
        flown: (m) column of each UAV, -1: none; is changed.
        uav_of: (m + n) UAV by node, -1: unassigned; is changed.

    Returns:
        Whether the cost fell, and how many columns were tried.
    """
    spare = _reduced_cost(reduced, group, tasks, flown, uav_of) - TINY
    if tasks.size == 0 or spare <= 0.0:
        return False, 1
    columns = candidates(pool, reduced, group, tasks, spare)
    branches = _branches(pool, columns, tasks, uav_of.size)
    return _branch_and_bound(pool, reduced, group, branches, spare, min(MAX_TRIES, limit), flown,
                             uav_of)
