# SPDX-License-Identifier: Apache-2.0
"""Chained Q: what it was worth to fly from one stop to a neighbour of it, kept by id."""
from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from uav_task_alloc.kernel import inline_kernel, kernel
from uav_task_alloc.solver.problem import Problem
from uav_task_alloc.solver.rng import Chance, uniform
from uav_task_alloc.solver.routes import Arrays, Floats, Ints, Nodes, Routes, clear, insert, step

FIRST, FLOOR = 0.5, 0.01  # Q of a leg never flown; the least Q, so that nothing is ruled out
LEARNING, DISCOUNT = 0.2, 0.1  # alpha and gamma of eq 2.6
DECAY = 0.5  # each rank counts that much of the one before (eq 2.14)


class Tables(NamedTuple):
    """Q[previous stop -> next task] on one UAV; a stop is a task or the UAV's start."""

    task: Floats  # (n, k) by place in Arrays.near
    start: Floats  # (m, n)


class Learnt(NamedTuple):
    """Tables that outlive their problem: rows are found again by id."""

    tables: Tables
    near: Nodes
    uavs: Mapping[str, int]
    tasks: Mapping[str, int]


def fresh_tables(problem: Problem, learnt: object = None) -> Tables:
    """Tables for a problem, with what an earlier one taught about ids that are still here."""
    n, m = len(problem.tasks), len(problem.uavs)
    tables = Tables(np.full(problem.arrays.near.shape, FIRST), np.full((m, n), FIRST))
    if not isinstance(learnt, Learnt) or not n:
        return tables
    was = np.array([learnt.tasks.get(task.id, -1) for task in problem.tasks], np.int64)
    _take_over(problem.arrays, tables.task, was, learnt.tables.task, learnt.near,
               len(learnt.uavs))
    known = np.flatnonzero(was >= 0)
    for u, uav in enumerate(problem.uavs):
        if uav.id in learnt.uavs:
            tables.start[u, known] = learnt.tables.start[learnt.uavs[uav.id], was[known]]
    return tables


def keep(problem: Problem, tables: Tables) -> Learnt:
    """What the next warm start wants."""
    return Learnt(tables, problem.arrays.near, {u.id: i for i, u in enumerate(problem.uavs)},
                  problem.index)


@kernel
def _take_over(a: Arrays, q: Floats, was: Ints, old: Floats, old_near: Nodes,
               old_uavs: int) -> None:
    """Rows and entries of tasks that were known. O(n k^2)."""
    for i in range(q.shape[0]):
        if was[i] < 0:
            continue
        for k in range(q.shape[1]):
            other = was[a.near[i, k] - a.uavs]
            for j in range(old.shape[1]):
                if other >= 0 and old_near[was[i], j] == other + old_uavs:
                    q[i, k] = old[was[i], j]


@inline_kernel
def _pull(d: float) -> float:
    """How much nearness attracts."""
    return 1.0 / (d * d * d + 1e-9)


@inline_kernel
def _may_end(a: Arrays, r: Routes, u: int, t: int, d: float) -> bool:
    """The range mask: whether UAV u may fly on to t and end there."""
    last = r.prev[a.ends + u]
    more = d + step(a, t, a.ends + u) - r.leg[last]
    return a.may[u, t - a.uavs] and more < math.inf and (
        not a.hard or r.length[u] + more <= a.reach[u])


@inline_kernel
def _row(a: Arrays, r: Routes, q: Tables, u: int, wanted: float) -> tuple[float, int]:
    """Attraction of all candidates of UAV u's end, or the one at which the sum passes `wanted`."""
    last, total = r.prev[a.ends + u], 0.0
    if last < a.uavs:
        for i in range(a.price.size):
            if r.on[a.uavs + i] < 0:
                d = step(a, last, a.uavs + i)
                if _may_end(a, r, u, a.uavs + i, d):
                    total += q.start[u, i] * _pull(d)
                    if total > wanted:
                        return total, a.uavs + i
        return total, -1
    for k in range(a.near.shape[1]):
        t = a.near[last - a.uavs, k]
        d = a.near_length[last - a.uavs, k]
        if r.on[t] < 0 and _may_end(a, r, u, t, d):
            total += q.task[last - a.uavs, k] * _pull(d)
            if total > wanted:
                return total, t
    return total, -1


@kernel
def construct(a: Arrays, r: Routes, q: Tables, sums: Floats, rng: Chance) -> None:
    """A scout: grow all routes at their ends by jointly drawn legs, Q (1/d)^3 each. O(n m k)."""
    clear(a, r)
    for u in range(a.uavs):
        sums[u], _ = _row(a, r, q, u, math.inf)
    for _ in range(a.price.size):
        total = 0.0
        for u in range(a.uavs):
            if r.prev[a.ends + u] >= a.uavs:
                sums[u], _ = _row(a, r, q, u, math.inf)
            total += sums[u]
        if not total > 0.0:
            break
        wanted, u = uniform(rng) * total, 0
        while u < a.uavs - 1 and wanted >= sums[u]:
            wanted -= sums[u]
            u += 1
        _, t = _row(a, r, q, u, wanted)
        sums[u], _ = (0.0, 0) if t < 0 else (sums[u], 0)
        if t >= 0:
            last = r.prev[a.ends + u]
            insert(a, r, t, last)
            if last < a.uavs:
                sums[u], _ = _row(a, r, q, u, math.inf)


@kernel
def reinforce(a: Arrays, r: Routes, q: Tables, share: float, reward: float) -> None:
    """Eq 2.14 for one bee: every leg it flew moves towards what it brought. O(n k)."""
    rate = LEARNING * share
    for u in range(a.uavs):
        t, before = r.next[u], u
        while t < a.ends:
            best = 0.0
            for k in range(a.near.shape[1]):
                best = max(best, q.task[t - a.uavs, k])
            worth = (1.0 - DISCOUNT) * reward + DISCOUNT * best  # eq 2.6
            if before < a.uavs:
                for i in range(a.price.size):
                    goal = worth if a.uavs + i == t else 0.0
                    q.start[u, i] = max(FLOOR, q.start[u, i] + rate * (goal - q.start[u, i]))
            else:
                for k in range(a.near.shape[1]):
                    goal = worth if a.near[before - a.uavs, k] == t else 0.0
                    now = q.task[before - a.uavs, k]
                    q.task[before - a.uavs, k] = max(FLOOR, now + rate * (goal - now))
            t, before = r.next[t], t
