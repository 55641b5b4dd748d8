# SPDX-License-Identifier: Apache-2.0
"""What a searching bee takes out and puts back in: strings of routes, undone by a log.

After Christiaens and Vanden Berghe, Slack Induction by String Removals (2020).
"""
from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from uav_task_alloc.kernel import inline_kernel, kernel
from uav_task_alloc.solver.insertion import any_place, near_place
from uav_task_alloc.solver.rng import Chance, below, uniform
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
)

STRING = 10  # tasks in a string at most
SPLIT = 0.5  # share of strings with a part that stays
STAY = 0.98  # chance that one more does, so often only ends of a route come out
_REACH = 12  # neighbours looked at for a place
PITY = 0.5  # share of rounds around a task that is left out, if there is one
RELIEF = 0.2  # share around a route beyond range, if there is one
FEW, DEARER = 0.05, 1.3  # what few who are left out are worth rises so much a look
BLINKS = 0.01  # share of places overlooked


class Log(NamedTuple):
    """What was done since the last mark, and who is out."""

    node: Nodes
    after: Ints  # where it was before it was removed; -1: it was inserted
    out: Nodes  # task nodes to put back
    key: Floats  # they go in by this, smallest first
    size: Ints  # entries of (node and after, out, left, over), rounds until the next look
    hit: Ints  # (m) round in which a route was last ruined
    left: Ints  # task nodes that were left out lately
    over: Ints  # UAVs whose routes were beyond range lately


def empty_log(a: Arrays) -> Log:
    """A log with room for the longest round."""
    room = 2 * (a.ends - a.uavs) + 2
    return Log(np.empty(2 * room, NODE), np.empty(2 * room, np.int64),
               np.empty(room, NODE), np.empty(room), np.zeros(5, np.int64),
               np.zeros(a.uavs, np.int64), np.empty(room, np.int64),
               np.empty(a.uavs, np.int64))


@inline_kernel
def _take(a: Arrays, r: Routes, log: Log, t: int) -> None:
    log.node[log.size[0]], log.after[log.size[0]] = t, r.prev[t]
    log.out[log.size[1]] = t
    log.size[0] += 1
    log.size[1] += 1
    remove(a, r, t)


@inline_kernel
def undo(a: Arrays, r: Routes, log: Log) -> None:
    """Back to how it was."""
    while log.size[0] > 0:
        log.size[0] -= 1
        node, after = log.node[log.size[0]], log.after[log.size[0]]
        if after < 0:
            remove(a, r, node)
        else:
            insert(a, r, node, NODE(after))


@inline_kernel
def _string(a: Arrays, r: Routes, log: Log, c: int, size: int, rng: Chance) -> None:
    """Remove `size` tasks around c, sometimes leaving a few within the string."""
    count, stay = r.tasks[r.on[c]], 0
    if size > 1 and size < count and uniform(rng) < SPLIT:
        stay = 1
        while size + stay < count and uniform(rng) < STAY:
            stay += 1
    t, back = c, below(rng, size + stay)
    while back > 0 and r.prev[t] >= a.uavs:
        t, back = r.prev[t], back - 1
    keep_from = 1 + below(rng, size - 1) if stay else size
    for i in range(size + stay):
        if t >= a.ends:
            break
        then = r.next[t]
        if i < keep_from or i >= keep_from + stay:
            _take(a, r, log, t)
        t = then


@kernel
def look_for_trouble(a: Arrays, r: Routes, log: Log) -> None:
    """Note who is left out or flies too far now; leaving few out gets dearer. O(n)."""
    log.size[2] = log.size[3] = 0
    for u in range(a.uavs):
        if r.length[u] > a.reach[u] + TINY and r.tasks[u] > 0:
            log.over[log.size[3]] = u
            log.size[3] += 1
    for t in range(a.uavs, a.ends):
        if r.on[t] < 0 and a.price[t - a.uavs] > 0.0:
            log.left[log.size[2]] = t
            log.size[2] += 1
    if log.size[2] < FEW * (a.ends - a.uavs):
        for i in range(log.size[2]):
            t = log.left[i] - a.uavs
            a.price[t] = min(DEARER * a.price[t], a.dearest[t])


@inline_kernel
def _seed(a: Arrays, r: Routes, log: Log, rng: Chance) -> Any:
    """Around whom to ruin: anybody, and often somebody left out or on a route beyond range."""
    if log.size[2] > 0 and uniform(rng) < PITY:
        t = log.left[below(rng, log.size[2])]
        if r.on[t] < 0:
            return t
    if log.size[3] > 0 and uniform(rng) < RELIEF:
        u = log.over[below(rng, log.size[3])]
        if r.length[u] > a.reach[u] + TINY and r.tasks[u] > 0:
            t = r.next[u]
            for _ in range(below(rng, r.tasks[u])):
                t = r.next[t]
            return t
    return NODE(a.uavs + below(rng, a.ends - a.uavs))


@inline_kernel
def ruin(a: Arrays, r: Routes, log: Log, mean: float, round_id: int, rng: Chance) -> None:
    """Remove about `mean` tasks in strings of routes around a random one. O(mean)."""
    log.size[0] = log.size[1] = 0
    tasks = a.ends - a.uavs
    seed = _seed(a, r, log, rng)
    served = max(1, tasks // max(1, a.uavs))
    longest = min(float(STRING), max(1.0, float(served)))
    strings = int(1.0 + uniform(rng) * (4.0 * mean / (1.0 + longest) - 1.0))
    left_out = 0
    for m in range(-1, a.near.shape[1]):
        c = seed if m < 0 else a.near[seed - a.uavs, m]
        u = r.on[c]
        if u < 0:
            if left_out < 10 and not _is_out(log, c):
                log.out[log.size[1]] = c
                log.size[1] += 1
                left_out += 1
        elif log.hit[u] != round_id and strings > 0:
            log.hit[u] = round_id
            strings -= 1
            size = 1 + below(rng, int(min(longest, float(r.tasks[u]))))
            _string(a, r, log, c, size, rng)


@inline_kernel
def _is_out(log: Log, t: int) -> bool:
    for i in range(log.size[1]):  # noqa: SIM110 - numba knows no any()
        if log.out[i] == t:
            return True
    return False


@inline_kernel
def _order(a: Arrays, log: Log, rng: Chance) -> None:
    """Sort who is out: at random, furthest first, nearest first or dearest first."""
    kind = below(rng, 8)
    for i in range(log.size[1]):
        t = log.out[i]
        key = uniform(rng)
        if kind >= 4 and kind < 6:
            key = -a.start_length[t - a.uavs, 0]
        elif kind == 6:
            key = a.start_length[t - a.uavs, 0]
        elif kind == 7:
            key = -a.price[t - a.uavs]
        place = i
        while place > 0 and log.key[place - 1] > key:
            log.key[place], log.out[place] = log.key[place - 1], log.out[place - 1]
            place -= 1
        log.key[place], log.out[place] = key, t


@inline_kernel
def recreate(a: Arrays, r: Routes, log: Log, rng: Chance) -> None:
    """Put back in who is out, each where it costs least and less than leaving it out."""
    _order(a, log, rng)
    for i in range(log.size[1]):
        t = log.out[i]
        place, delta = near_place(a, r, t, _REACH, BLINKS, rng)
        if place < 0 and (a.picky[t - a.uavs] or not a.hard):
            place, delta = any_place(a, r, t)
        if place >= 0 and (not a.hard or delta < a.price[t - a.uavs]):
            insert(a, r, t, NODE(place))
            log.node[log.size[0]], log.after[log.size[0]] = t, -1
            log.size[0] += 1
