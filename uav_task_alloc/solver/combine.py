# SPDX-License-Identifier: Apache-2.0
"""Routes that bees have flown, remembered, and the best way to put them together anew.

Each UAV flies one remembered route or none, each task is served once: set partitioning. A
Lagrangian bound by subgradients (Held, Wolfe, Crowder, 1974) prices the tasks; routes that cannot
be part of anything shorter than the best fall away; what remains is searched in depth.
"""
from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from uav_task_alloc.solver.kernel import kernel, maker
from uav_task_alloc.solver.routes import (
    EXCESS,
    LEFT_OUT,
    NODE,
    TINY,
    Arrays,
    Floats,
    Ints,
    Nodes,
    Routes,
    clear,
    insert,
    total,
)

ROUTES, STOPS = 1 << 14, 1 << 18  # room; who runs out of it begins anew
WORK = 3_000_000  # stops looked at for a bound
FEWEST, MOST = 30, 300  # steps of it
PATIENCE, SHORTER = 8, 0.7  # after so many steps in vain they get so much shorter
DEEPEST = 30_000  # routes tried in the search in depth


class Memory(NamedTuple):
    """Routes by the set of their tasks, each in the shortest order seen."""

    word: NDArray[np.uint64]  # (m + n) a random number a node
    place: Ints  # hash table: entry, -1: free
    key: NDArray[np.uint64]  # by entry: exclusive or of the words of its UAV and tasks
    uav: Ints
    cost: Floats  # [m] more than if that UAV stayed
    first: Ints  # of its stops; and the end of the last
    stops: Nodes
    size: Ints  # entries


def empty_memory(a: Arrays) -> Memory:
    """A memory without routes."""
    words = np.random.default_rng(0).integers(1, 2 ** 64, a.ends, np.uint64)
    return Memory(words, np.full(2 * ROUTES, -1, np.int64), np.empty(ROUTES, np.uint64),
                  np.empty(ROUTES, np.int64), np.empty(ROUTES), np.zeros(ROUTES + 1, np.int64),
                  np.empty(STOPS, NODE), np.zeros(1, np.int64))


@kernel
def remember(a: Arrays, r: Routes, known: Memory) -> None:
    """Note the routes that fly and are within range. O(n)."""
    for u in range(a.uavs):
        if r.tasks[u] == 0:
            continue
        over = r.length[u] - a.reach[u]
        if a.hard and over > TINY:
            continue
        word, cost, t = known.word[u], r.leg[u] - a.idle[u], r.next[u]
        while t < a.ends:
            word ^= known.word[t]
            cost += r.leg[t]
            t = r.next[t]
        if not a.hard:
            cost += a.strain[u] * max(0.0, over)
        at = np.int64(word & np.uint64(known.place.size - 1))
        while known.place[at] >= 0 and known.key[known.place[at]] != word:
            at = (at + 1) % known.place.size
        e = known.place[at]
        if e >= 0 and known.cost[e] <= cost + TINY:
            continue
        if e < 0:
            e = known.size[0]
            if e == known.uav.size or known.first[e] + r.tasks[u] > known.stops.size:
                known.size[0] = 0
                known.place[:] = -1
                return
            known.place[at] = e
            known.size[0] += 1
            known.first[e + 1] = known.first[e] + r.tasks[u]
        known.key[e], known.uav[e], known.cost[e] = word, u, cost
        t, i = r.next[u], known.first[e]
        while t < a.ends:
            known.stops[i] = t
            t, i = r.next[t], i + 1


@kernel
def _reduce(a: Arrays, known: Memory, price: Floats, reduced: Floats, least: Floats,
            chosen: Ints) -> float:
    """Costs less the prices of tasks; the least of each UAV, 0 if it stays; the bound [m]."""
    least[:] = 0.0
    chosen[:] = -1
    for e in range(known.size[0]):
        cost, u = known.cost[e], known.uav[e]
        for i in range(known.first[e], known.first[e + 1]):
            cost -= price[known.stops[i]]
        reduced[e] = cost
        if cost < least[u]:
            least[u], chosen[u] = cost, e
    bound = 0.0
    for t in range(a.uavs, a.ends):
        bound += price[t]
    for u in range(a.uavs):
        bound += least[u]
    return bound


@maker
def _price(a: Arrays, best: Routes, known: Memory, worth: float) -> tuple[Floats, float]:
    """Prices of tasks by node for which the bound is high, and that bound [m]."""
    price = np.zeros(a.ends)
    for u in range(a.uavs):  # at first the best's routes cost what their tasks are priced
        cost, t = best.leg[u] - a.idle[u], best.next[u]
        while t < a.ends:
            cost += best.leg[t]
            t = best.next[t]
        t = best.next[u]
        while t < a.ends:
            price[t] = cost / best.tasks[u]
            t = best.next[t]
    for t in range(a.uavs, a.ends):
        if best.on[t] < 0:
            price[t] = a.price[t - a.uavs]
    kept, highest, length, vain = price.copy(), -np.inf, 1.0, 0
    reduced, least = np.empty(known.size[0]), np.empty(a.uavs)
    chosen, served = np.empty(a.uavs, np.int64), np.empty(a.ends, np.int64)
    for _ in range(min(MOST, max(FEWEST, WORK // max(1, known.first[known.size[0]])))):
        bound = _reduce(a, known, price, reduced, least, chosen)
        if bound > highest:
            if bound > highest + 1e-4 * abs(worth - bound):
                vain = 0
            kept[:], highest = price, bound
        vain += 1
        if vain > PATIENCE:
            vain, length = 0, SHORTER * length
            price[:] = kept
            continue
        served[:] = 0
        for u in range(a.uavs):
            if chosen[u] >= 0:
                for i in range(known.first[chosen[u]], known.first[chosen[u] + 1]):
                    served[known.stops[i]] += 1
        wrong = 0
        for t in range(a.uavs, a.ends):
            wrong += (served[t] - 1) ** 2
        if wrong == 0 or highest >= worth - TINY:
            break
        for t in range(a.uavs, a.ends):
            price[t] = min(a.price[t - a.uavs], price[t] + length * (worth - bound) / wrong * (
                1 - served[t]))
    return kept, highest


@maker
def combine(a: Arrays, best: Routes, known: Memory, into: Routes) -> bool:
    """Put together what costs less than the best, if there is such a thing; whether there is."""
    remember(a, best, known)
    if known.size[0] == 0 or best.sums[EXCESS] > a.excess_floor + TINY and a.hard:
        return False
    worth = best.sums[LEFT_OUT]
    for u in range(a.uavs):
        t, cost = best.next[u], best.leg[u] - a.idle[u]
        while t < a.ends:
            cost += best.leg[t]
            t = best.next[t]
        if not a.hard:
            cost += a.strain[u] * max(0.0, best.length[u] - a.reach[u])
        worth += cost
    price, bound = _price(a, best, known, worth)
    spare = worth - bound - 1e-6
    if spare <= 0.0:
        return False
    reduced, least = np.empty(known.size[0]), np.empty(a.uavs)
    chosen = np.empty(a.uavs, np.int64)
    _reduce(a, known, price, reduced, least, chosen)
    for e in range(reduced.size):
        reduced[e] -= least[known.uav[e]]
    some = np.flatnonzero(reduced < spare)
    some = some[np.argsort(reduced[some])]
    # routes by task, those that cost least first
    begin = np.zeros(a.ends + 1, np.int64)
    for e in some:
        for i in range(known.first[e], known.first[e + 1]):
            begin[known.stops[i] + 1] += 1
    order = np.argsort(begin[a.uavs + 1:]) + a.uavs  # tasks, those with fewest routes first
    begin[:] = np.cumsum(begin)
    by, fill = np.empty(begin[a.ends], np.int64), begin.copy()
    for e in some:
        for i in range(known.first[e], known.first[e + 1]):
            by[fill[known.stops[i]]] = e
            fill[known.stops[i]] += 1
    return _deepen(a, known, price, reduced, least, begin, by, order, spare, into)


@maker
def _deepen(a: Arrays, known: Memory, price: Floats, reduced: Floats, least: Floats,
            begin: Ints, by: Ints, order: Ints, spare: float, into: Routes) -> bool:
    """Search in depth for routes that serve all within `spare` [m] of reduced cost."""
    room = order.size + 1
    task, at, took = np.empty(room, np.int64), np.empty(room, np.int64), np.empty(room, np.int64)
    spent = np.zeros(room + 1)
    served, flies = np.zeros(a.ends, np.bool_), np.zeros(a.uavs, np.bool_)
    depth, tried, found = 0, 0, False
    task[0], at[0] = 0, begin[order[0]]
    took[0] = -2
    while depth >= 0 and tried < DEEPEST:
        t = order[task[depth]]
        if took[depth] >= 0:  # back from there
            e = took[depth]
            flies[known.uav[e]] = False
            for i in range(known.first[e], known.first[e + 1]):
                served[known.stops[i]] = False
        elif took[depth] == -1:
            served[t] = False
            depth -= 1
            continue
        took[depth] = -2
        more = spent[depth]
        while at[depth] < begin[t + 1] and took[depth] == -2:
            e = by[at[depth]]
            at[depth] += 1
            tried += 1
            if spent[depth] + reduced[e] >= spare:
                at[depth] = begin[t + 1]
                break
            if flies[known.uav[e]]:
                continue
            fits = True
            for i in range(known.first[e], known.first[e + 1]):
                if served[known.stops[i]]:
                    fits = False
                    break
            if fits:
                took[depth], more = e, spent[depth] + reduced[e]
        if took[depth] >= 0:
            flies[known.uav[took[depth]]] = True
            for i in range(known.first[took[depth]], known.first[took[depth] + 1]):
                served[known.stops[i]] = True
        else:  # left out
            more = spent[depth] + a.price[t - a.uavs] - price[t]
            if more >= spare:
                depth -= 1
                continue
            took[depth] = -1
            served[t] = True
        i = task[depth]
        while i < order.size and served[order[i]]:
            i += 1
        if i < order.size:
            depth += 1
            spent[depth], task[depth], at[depth], took[depth] = more, i, begin[order[i]], -2
            continue
        for u in range(a.uavs):
            if not flies[u]:
                more -= least[u]
        if more < spare:
            spare, found = more - 1e-6, True
            clear(a, into)
            for d in range(depth + 1):
                if took[d] >= 0:
                    after = NODE(known.uav[took[d]])
                    for i in range(known.first[took[d]], known.first[took[d] + 1]):
                        insert(a, into, known.stops[i], after)
                        after = known.stops[i]
            total(a, into)
    return found
