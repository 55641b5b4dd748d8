# SPDX-License-Identifier: Apache-2.0
"""Set partitioning for a group of UAVs: which columns of the pool serve its tasks at least cost.

Branch and bound in depth: the next task not served yet that has fewest columns is served by each
of them that fits, those with the least reduced cost first, or left out.
"""
from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from uav_task_alloc.kernel import allocating_kernel, inline_kernel
from uav_task_alloc.solver.multipliers import Reduced
from uav_task_alloc.solver.pool import Pool
from uav_task_alloc.solver.routes import TINY, Floats, Ints

Flags = NDArray[np.bool_]
OPEN, LEFT_OUT = -1, -2  # instead of a column: nothing tried yet; the task is left out


class Branches(NamedTuple):
    """What there is to choose from."""

    tasks: Ints  # nodes, those with fewest columns first
    begin: Ints  # by node: where its columns begin in `column`; and where the last one's end
    column: Ints  # by task, those with the least reduced cost first


class Path(NamedTuple):
    """What is chosen so far, by depth."""

    task: Ints  # place in Branches.tasks
    at: Ints  # next place in Branches.column
    took: Ints  # column, OPEN or LEFT_OUT
    spent: Floats  # [m] reduced cost before
    served: Flags  # by node
    flies: Flags  # by UAV


@allocating_kernel
def _candidates(pool: Pool, reduced: Reduced, group: Flags, tasks: Ints, spare: float) -> Ints:
    """Columns of a group that serve none but its tasks, those with the least cost first."""
    inside = np.zeros(reduced.left.size, np.bool_)
    inside[tasks] = True
    some, count = np.empty(pool.size[0], np.int64), 0
    for e in range(pool.size[0]):
        fits = group[pool.uav[e]] and reduced.column[e] < spare
        i = pool.first[e]
        while fits and i < pool.first[e + 1]:
            fits = inside[pool.stops[i]]
            i += 1
        if fits:
            some[count] = e
            count += 1
    some = some[:count]
    return some[np.argsort(reduced.column[some])]


@allocating_kernel
def _branches(pool: Pool, some: Ints, tasks: Ints, nodes: int) -> Branches:
    """Columns by task."""
    begin = np.zeros(nodes + 1, np.int64)
    for e in some:
        for i in range(pool.first[e], pool.first[e + 1]):
            begin[pool.stops[i] + 1] += 1
    order = tasks[np.argsort(begin[tasks + 1])]
    begin[:] = np.cumsum(begin)
    column, fill = np.empty(begin[nodes], np.int64), begin.copy()
    for e in some:
        for i in range(pool.first[e], pool.first[e + 1]):
            column[fill[pool.stops[i]]] = e
            fill[pool.stops[i]] += 1
    return Branches(order, begin, column)


@inline_kernel
def _mark(pool: Pool, e: int, path: Path, chosen: bool) -> None:
    """Column e is chosen, or no longer."""
    path.flies[pool.uav[e]] = chosen
    for i in range(pool.first[e], pool.first[e + 1]):
        path.served[pool.stops[i]] = chosen


@inline_kernel
def _fits(pool: Pool, e: int, path: Path) -> bool:
    """Whether column e goes with what is chosen."""
    if path.flies[pool.uav[e]]:
        return False
    for i in range(pool.first[e], pool.first[e + 1]):  # noqa: SIM110 - numba knows no any()
        if path.served[pool.stops[i]]:
            return False
    return True


@inline_kernel
def _next_branch(pool: Pool, reduced: Reduced, b: Branches, path: Path, depth: int,
                 spare: float) -> tuple[float, int]:
    """Take the next column that fits, or leave the task out: (cost with it, columns tried).

    The cost is inf where nothing is left to be tried.
    """
    t, spent = b.tasks[path.task[depth]], path.spent[depth]
    begin, end = path.at[depth], b.begin[t + 1]
    i = begin
    while i < end and spent + reduced.column[b.column[i]] < spare:
        if _fits(pool, b.column[i], path):
            path.took[depth], path.at[depth] = b.column[i], i + 1
            _mark(pool, b.column[i], path, True)
            return spent + reduced.column[b.column[i]], i + 1 - begin
        i += 1
    path.at[depth] = end
    if spent + reduced.left[t] < spare:
        path.took[depth] = LEFT_OUT
        path.served[t] = True
        return spent + reduced.left[t], i - begin
    return np.inf, i - begin


@inline_kernel
def _open_branch(b: Branches, path: Path, depth: int, place: int, spent: float) -> None:
    """Begin to serve the task at that place in the order."""
    path.task[depth], path.at[depth] = place, b.begin[b.tasks[place]]
    path.took[depth], path.spent[depth] = OPEN, spent


@inline_kernel
def _take_over(pool: Pool, group: Flags, b: Branches, path: Path, depth: int, flown: Ints,
               on: Ints) -> None:
    """The group flies what was chosen."""
    for u in range(group.size):
        if group[u]:
            flown[u] = -1
    for t in b.tasks:
        on[t] = -1
    for d in range(depth + 1):
        e = path.took[d]
        if e >= 0:
            flown[pool.uav[e]] = e
            for i in range(pool.first[e], pool.first[e + 1]):
                on[pool.stops[i]] = pool.uav[e]


@allocating_kernel
def _search(pool: Pool, reduced: Reduced, group: Flags, b: Branches, spare: float, limit: int,
            flown: Ints, on: Ints) -> tuple[bool, int]:
    """See `repartition`; `spare` [m] is the reduced cost of what is flown now."""
    room = b.tasks.size
    path = Path(np.empty(room, np.int64), np.empty(room, np.int64), np.empty(room, np.int64),
                np.empty(room), np.zeros(reduced.left.size, np.bool_),
                np.zeros(group.size, np.bool_))
    depth, tried, found = 0, 0, False
    _open_branch(b, path, 0, 0, 0.0)
    while depth >= 0 and tried < limit:
        if path.took[depth] >= 0:
            _mark(pool, path.took[depth], path, False)
        if path.took[depth] == LEFT_OUT:  # the last branch
            path.served[b.tasks[path.task[depth]]] = False
            depth -= 1
            continue
        spent, looked = _next_branch(pool, reduced, b, path, depth, spare)
        tried += 1 + looked
        if spent == np.inf:
            depth -= 1
            continue
        place = path.task[depth]
        while place < room and path.served[b.tasks[place]]:
            place += 1
        if place < room:
            depth += 1
            _open_branch(b, path, depth, place, spent)
            continue
        spent += reduced.stay[group & ~path.flies].sum()
        if spent < spare:
            spare, found = spent - TINY, True
            _take_over(pool, group, b, path, depth, flown, on)
    return found, tried


@allocating_kernel
def repartition(pool: Pool, reduced: Reduced, group: Flags, tasks: Ints, limit: int,
                flown: Ints, on: Ints) -> tuple[bool, int]:
    """Give a group of UAVs the columns through their tasks that cost least together.

    flown: column by UAV, -1: none; on: UAV by node, -1: left out; both are changed. Tries about
    `limit` columns at most. Returns whether less is spent than before, and how many were tried.
    """
    spare = reduced.stay[group & (flown < 0)].sum() + reduced.left[tasks[on[tasks] < 0]].sum()
    spare += reduced.column[flown[group & (flown >= 0)]].sum() - TINY
    if tasks.size == 0 or spare <= 0.0:
        return False, 1
    some = _candidates(pool, reduced, group, tasks, spare)
    branches = _branches(pool, some, tasks, on.size)
    return _search(pool, reduced, group, branches, spare, limit, flown, on)
