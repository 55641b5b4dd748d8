# SPDX-License-Identifier: Apache-2.0
"""Ruin and recreate: remove strings of routes, insert their tasks again; undone by a log.

Christiaens and Vanden Berghe, Slack Induction by String Removals for Vehicle Routing Problems,
Transportation Science 54 (2020).
"""
from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from uav_task_alloc.kernel import inline_kernel, inner_kernel
from uav_task_alloc.solver.insertion import best_near_place, best_place
from uav_task_alloc.solver.rng import RngState, below, uniform
from uav_task_alloc.solver.routes import (
    NODE,
    TINY,
    Arrays,
    Floats,
    Ints,
    Nodes,
    Routes,
    insert,
    remove,
    total_cost_kernel,
)

MAX_STRING = 10  # tasks in a string at most
SPLIT_RATE = 0.5  # share of strings that preserve a substring
PRESERVE_RATE = 0.98  # chance that the preserved part grows by one task
_PLACES = 12  # neighbours of a task that are tried as its place
UNASSIGNED_SEED_RATE = 0.5  # share of rounds that start at an unassigned task, if there is one
OVERRANGE_SEED_RATE = 0.2  # share that start at a route beyond range, if there is one
FEW = 0.05  # up to this share of unassigned tasks their cost rises
COST_GROWTH = 1.3  # by this factor at each update
BLINK_RATE = 0.01  # share of places skipped
# entries of RuinLog.settings: probability that a round passes over an unassigned task near its
# seed; share of rounds that insert about the most valuable tasks first; least rounds between two
# updates of the penalties; upper bound of a range penalty [m/m]; length of strings that is allowed
# where the mean route has fewer tasks
SKIPPED, BY_VALUE, LEAST_ROUNDS, MOST_PENALTY, STRING_FLOOR = range(5)


class RuinLog(NamedTuple):
    """Undo log of a round, and the tasks and routes that rounds start at."""

    node: Nodes  # removed or inserted, in order
    after: Ints  # node that it was removed after; -1: it was inserted
    removed: Nodes  # task nodes to be inserted
    order: Floats  # sort key of each: smallest first
    counts: Ints  # (5) sizes of node, removed, unassigned, overrange; rounds until the next update
    last_ruined: Ints  # (m) round in which a route was ruined last
    unassigned: Ints  # task nodes unassigned at the last update
    overrange: Ints  # UAVs with routes beyond range at the last update
    settings: Floats  # (5) SKIPPED, BY_VALUE, LEAST_ROUNDS, MOST_PENALTY, STRING_FLOOR


def empty_log(a: Arrays) -> RuinLog:
    """An empty log, large enough for any round."""
    room = 2 * (a.ends - a.uavs) + 2
    return RuinLog(np.empty(2 * room, NODE), np.empty(2 * room, np.int64),
                   np.empty(room, NODE), np.empty(room), np.zeros(5, np.int64),
                   np.zeros(a.uavs, np.int64), np.empty(room, np.int64),
                   np.empty(a.uavs, np.int64), np.zeros(5))


@inline_kernel
def _remove_logged(a: Arrays, r: Routes, log: RuinLog, t: int) -> None:
    """Remove the task node t and log it. O(1)."""
    log.node[log.counts[0]], log.after[log.counts[0]] = t, r.prev[t]
    log.removed[log.counts[1]] = t
    log.counts[0] += 1
    log.counts[1] += 1
    remove(a, r, t)


@inline_kernel
def undo(a: Arrays, r: Routes, log: RuinLog) -> None:
    """Undo all changes of the round, last first. O(changes)."""
    while log.counts[0] > 0:
        log.counts[0] -= 1
        node, after = log.node[log.counts[0]], log.after[log.counts[0]]
        if after < 0:
            remove(a, r, node)
        else:
            insert(a, r, node, NODE(after))


@inline_kernel
def _remove_string(a: Arrays, r: Routes, log: RuinLog, c: int, size: int, rng: RngState) -> None:
    """Remove `size` tasks around c; sometimes preserve a substring. O(size + preserved)."""
    count, preserved = r.tasks[r.uav_of[c]], 0
    if size > 1 and size < count and uniform(rng) < SPLIT_RATE:
        preserved = 1
        while size + preserved < count and uniform(rng) < PRESERVE_RATE:
            preserved += 1
    t, back = c, below(rng, size + preserved)
    while back > 0 and r.prev[t] >= a.uavs:
        t, back = r.prev[t], back - 1
    keep_from = 1 + below(rng, size - 1) if preserved else size
    for i in range(size + preserved):
        if t >= a.ends:
            break
        then = r.next[t]
        if i < keep_from or i >= keep_from + preserved:
            _remove_logged(a, r, log, t)
        t = then


@inner_kernel
def list_unassigned_and_overrange(a: Arrays, r: Routes, log: RuinLog) -> None:
    """List unassigned tasks and routes beyond range; raise the cost of few tasks. O(m + n)."""
    log.counts[2] = log.counts[3] = 0
    for u in range(a.uavs):
        if r.length[u] > a.range_left[u] + TINY and r.tasks[u] > 0:
            log.overrange[log.counts[3]] = u
            log.counts[3] += 1
    within = 0  # tasks that it costs something not to serve
    for t in range(a.uavs, a.ends):
        if a.unassigned_cost[t - a.uavs] > 0.0:
            within += 1
            if r.uav_of[t] < 0:
                log.unassigned[log.counts[2]] = t
                log.counts[2] += 1
    if log.counts[2] < FEW * within:
        for i in range(log.counts[2]):
            t = log.unassigned[i] - a.uavs
            cost = COST_GROWTH * a.unassigned_cost[t]
            a.unassigned_cost[t] = min(cost, a.max_unassigned_cost[t])


@inline_kernel
def _choose_seed(a: Arrays, r: Routes, log: RuinLog, rng: RngState) -> Any:
    """The seed: any task, often an unassigned one or one of a route beyond range. O(tasks)."""
    if log.counts[2] > 0 and uniform(rng) < UNASSIGNED_SEED_RATE:
        t = log.unassigned[below(rng, log.counts[2])]
        if r.uav_of[t] < 0:
            return t
    if log.counts[3] > 0 and uniform(rng) < OVERRANGE_SEED_RATE:
        u = log.overrange[below(rng, log.counts[3])]
        if r.length[u] > a.range_left[u] + TINY and r.tasks[u] > 0:
            t = r.next[u]
            for _ in range(below(rng, r.tasks[u])):
                t = r.next[t]
            return t
    return NODE(a.uavs + below(rng, a.ends - a.uavs))


@inline_kernel
def ruin(a: Arrays, r: Routes, log: RuinLog, mean: float, round_id: int, rng: RngState) -> None:
    """Remove about `mean` tasks in strings of routes around a random task. O(mean)."""
    log.counts[0] = log.counts[1] = 0
    tasks = a.ends - a.uavs
    seed = _choose_seed(a, r, log, rng)
    served = max(1, tasks // max(1, a.uavs))
    longest = min(float(MAX_STRING), max(log.settings[STRING_FLOOR], float(served)))
    strings = int(1.0 + uniform(rng) * (4.0 * mean / (1.0 + longest) - 1.0))
    left_out = 0
    for m in range(-1, a.near.shape[1]):
        c = seed if m < 0 else a.near[seed - a.uavs, m]
        u = r.uav_of[c]
        if u < 0:
            if left_out < 10 and not _is_removed(log, c) and not (
                    log.settings[SKIPPED] > 0.0 and _passes_over(a, log, c, m, rng)):
                log.removed[log.counts[1]] = c
                log.counts[1] += 1
                left_out += 1
        elif log.last_ruined[u] != round_id and strings > 0:
            log.last_ruined[u] = round_id
            strings -= 1
            size = 1 + below(rng, int(min(longest, float(r.tasks[u]))))
            _remove_string(a, r, log, c, size, rng)


@inline_kernel
def _passes_over(a: Arrays, log: RuinLog, c: int, m: int, rng: RngState) -> bool:
    """Whether an unassigned task is not tried: one out of reach, or by chance. O(1)."""
    if a.unassigned_cost[c - a.uavs] <= 0.0:
        return True
    return m >= 0 and uniform(rng) < log.settings[SKIPPED]


@inline_kernel
def _is_removed(log: RuinLog, t: int) -> bool:
    """Whether t is to be inserted already. O(removed)."""
    for i in range(log.counts[1]):  # noqa: SIM110 - numba does not support any()
        if log.removed[i] == t:
            return True
    return False


@inline_kernel
def _sort_removed(a: Arrays, log: RuinLog, rng: RngState) -> None:
    """Sort removed tasks: at random, furthest, nearest or costliest first. O(removed^2)."""
    kind = below(rng, 8)
    if log.settings[BY_VALUE] > 0.0 and uniform(rng) < log.settings[BY_VALUE]:
        kind = 8
    for i in range(log.counts[1]):
        t = log.removed[i]
        key = uniform(rng)
        if kind >= 4 and kind < 6:
            key = -a.start_length[t - a.uavs, 0]
        elif kind == 6:
            key = a.start_length[t - a.uavs, 0]
        elif kind == 7:
            key = -a.unassigned_cost[t - a.uavs]
        elif kind == 8:
            key = -a.unassigned_cost[t - a.uavs] * (0.5 + key)
        place = i
        while place > 0 and log.order[place - 1] > key:
            log.order[place], log.removed[place] = log.order[place - 1], log.removed[place - 1]
            place -= 1
        log.order[place], log.removed[place] = key, t


@inline_kernel
def recreate(a: Arrays, r: Routes, log: RuinLog, limit: float, rng: RngState) -> None:
    """Insert removed tasks where each costs least, if less than not serving it. O(removed k).

    limit: the round is given up once the cost [m] cannot be below that any more, even if the tasks
    that are still to be inserted cost nothing.
    """
    _sort_removed(a, log, rng)
    for i in range(log.counts[1]):
        limit += a.unassigned_cost[log.removed[i] - a.uavs]  # of those that wait
    for i in range(log.counts[1]):
        t = log.removed[i]
        if total_cost_kernel(a, r) >= limit:
            break
        limit -= a.unassigned_cost[t - a.uavs]
        place, delta = best_near_place(a, r, t, _PLACES, BLINK_RATE, rng)
        if place < 0 and (a.restricted[t - a.uavs] or not a.hard):
            place, delta = best_place(a, r, t)
        if place >= 0 and (not a.hard or delta < a.unassigned_cost[t - a.uavs]):
            insert(a, r, t, NODE(place))
            log.node[log.counts[0]], log.after[log.counts[0]] = t, -1
            log.counts[0] += 1
