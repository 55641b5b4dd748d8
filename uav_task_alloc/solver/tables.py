# SPDX-License-Identifier: Apache-2.0
"""Chained Q: the value of flying from a stop to one of its neighbours, kept by id."""
from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from uav_task_alloc.kernel import inline_kernel, kernel
from uav_task_alloc.solver.problem import Problem
from uav_task_alloc.solver.rng import RngState, uniform
from uav_task_alloc.solver.routes import (
    NODE,
    Arrays,
    Floats,
    Ints,
    Nodes,
    Routes,
    clear,
    insert,
    leg_length,
)

INITIAL_Q, MIN_Q = 0.5, 0.01  # Q of a leg never flown; least Q, so that no leg is excluded
LEARNING_RATE, DISCOUNT = 0.2, 0.1  # alpha and gamma of eq 2.6
RANK_DECAY = 0.5  # weight of a rank over that of the one before (eq 2.14)


class Tables(NamedTuple):
    """Q[previous stop -> next task] on one UAV; a stop is a task or the UAV's start."""

    task: Floats  # (n, k) by index in Arrays.near
    start: Floats  # (m, n)


class Learnt(NamedTuple):
    """Tables that outlive their problem: rows are identified by UAV and task ids."""

    tables: Tables  # Q by rows
    near: Nodes  # (n, k) task nodes that the columns of tables.task stand for
    uavs: Mapping[str, int]  # row by UAV id
    tasks: Mapping[str, int]  # row by task id


def fresh_tables(problem: Problem, learnt: object = None) -> Tables:
    """Tables for a problem, with the values that an earlier one learnt for the same ids."""
    n, m = len(problem.tasks), len(problem.uavs)
    tables = Tables(np.full(problem.arrays.near.shape, INITIAL_Q), np.full((m, n), INITIAL_Q))
    if not isinstance(learnt, Learnt) or not n:
        return tables
    was = np.array([learnt.tasks.get(task.id, -1) for task in problem.tasks], np.int64)
    _copy_known_rows(problem.arrays, tables.task, was, learnt.tables.task, learnt.near,
               len(learnt.uavs))
    known = np.flatnonzero(was >= 0)
    for u, uav in enumerate(problem.uavs):
        if uav.id in learnt.uavs:
            tables.start[u, known] = learnt.tables.start[learnt.uavs[uav.id], was[known]]
    return tables


def to_learnt(problem: Problem, tables: Tables) -> Learnt:
    """The tables with their ids, for the next warm start."""
    return Learnt(tables, problem.arrays.near, {u.id: i for i, u in enumerate(problem.uavs)},
                  problem.index)


@kernel
def _copy_known_rows(a: Arrays, q: Floats, was: Ints, old: Floats, old_near: Nodes,
               old_uavs: int) -> None:
    """Copy entries of known tasks from `old` to `q`, both (n, k). O(n k^2).

    was: (n) index of each task in the earlier problem, -1: new.
    """
    for i in range(q.shape[0]):
        if was[i] < 0:
            continue
        for k in range(q.shape[1]):
            other = was[a.near[i, k] - a.uavs]
            for j in range(old.shape[1]):
                if other >= 0 and old_near[was[i], j] == other + old_uavs:
                    q[i, k] = old[was[i], j]


@inline_kernel
def _attraction(d: float) -> float:
    """Attraction of a leg of length d [m]: about 1 / d^3. O(1)."""
    return 1.0 / (d * d * d + 1e-9)


@inline_kernel
def _can_end_at(a: Arrays, r: Routes, u: int, t: int, d: float) -> bool:
    """Range mask: whether UAV u may append t, d [m] from its last stop. O(1)."""
    last = r.prev[a.ends + u]
    more = d + leg_length(a, t, NODE(a.ends + u)) - r.leg[last]
    return a.compatible[u, t - a.uavs] and more < math.inf and (
        not a.hard or r.length[u] + more <= a.range_left[u])


@inline_kernel
def _weigh_legs(a: Arrays, r: Routes, q: Tables, u: int, wanted: float) -> tuple[float, int]:
    """Sum of the attractions of UAV u's next legs, up to the one that passes `wanted`. O(n).

    Returns the sum and the task node of that leg, -1 if none passes.
    """
    last, total = r.prev[a.ends + u], 0.0
    if last < a.uavs:
        for i in range(a.unassigned_cost.size):
            if r.uav_of[a.uavs + i] < 0:
                d = leg_length(a, last, NODE(a.uavs + i))
                if _can_end_at(a, r, u, NODE(a.uavs + i), d):
                    total += q.start[u, i] * _attraction(d)
                    if total > wanted:
                        return total, a.uavs + i
        return total, -1
    for k in range(a.near.shape[1]):
        t = a.near[last - a.uavs, k]
        d = a.near_length[last - a.uavs, k]
        if r.uav_of[t] < 0 and _can_end_at(a, r, u, t, d):
            total += q.task[last - a.uavs, k] * _attraction(d)
            if total > wanted:
                return total, t
    return total, -1


@kernel
def construct(a: Arrays, r: Routes, q: Tables, sums: Floats, rng: RngState) -> None:
    """A scout: append legs drawn jointly over all UAVs with p ~ Q / d^3. O(n m k).

    sums: (m) scratch.
    """
    clear(a, r)
    for u in range(a.uavs):
        sums[u], _ = _weigh_legs(a, r, q, u, math.inf)
    for _ in range(a.unassigned_cost.size):
        total = 0.0
        for u in range(a.uavs):
            if r.prev[a.ends + u] >= a.uavs:
                sums[u], _ = _weigh_legs(a, r, q, u, math.inf)
            total += sums[u]
        if not total > 0.0:
            break
        wanted, u = uniform(rng) * total, 0
        while u < a.uavs - 1 and wanted >= sums[u]:
            wanted -= sums[u]
            u += 1
        _, t = _weigh_legs(a, r, q, u, wanted)
        sums[u], _ = (0.0, 0) if t < 0 else (sums[u], 0)
        if t >= 0:
            last = r.prev[a.ends + u]
            insert(a, r, NODE(t), last)
            if last < a.uavs:
                sums[u], _ = _weigh_legs(a, r, q, u, math.inf)


@kernel
def reinforce(a: Arrays, r: Routes, q: Tables, share: float, reward: float) -> None:
    """Eq 2.14 for one bee: move Q of every leg it flew towards its reward. O(n k).

    share: weight of the bee's rank; reward: in [0, 1].
    """
    rate = LEARNING_RATE * share
    for u in range(a.uavs):
        t, before = r.next[u], u
        while t < a.ends:
            best = 0.0
            for k in range(a.near.shape[1]):
                best = max(best, q.task[t - a.uavs, k])
            worth = (1.0 - DISCOUNT) * reward + DISCOUNT * best  # eq 2.6
            if before < a.uavs:
                for i in range(a.unassigned_cost.size):
                    goal = worth if a.uavs + i == t else 0.0
                    q.start[u, i] = max(MIN_Q, q.start[u, i] + rate * (goal - q.start[u, i]))
            else:
                for k in range(a.near.shape[1]):
                    goal = worth if a.near[before - a.uavs, k] == t else 0.0
                    now = q.task[before - a.uavs, k]
                    q.task[before - a.uavs, k] = max(MIN_Q, now + rate * (goal - now))
            t, before = r.next[t], t
