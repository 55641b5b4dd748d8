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

from uav_task_alloc.solver.kernel import kernel, maker, part
from uav_task_alloc.solver.routes import (
    NODE,
    TINY,
    WHOLE,
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
FEWEST, MOST = 30, 1000  # steps towards a bound
PATIENCE, SHORTER = 8, 0.7  # after so many steps in vain they get so much shorter
GROUP = 10  # UAVs that exchange their tasks
AROUND = 6  # neighbours of a task by which routes are near each other
PASSES = 2
DEEPEST = 20_000  # routes tried in a search in depth
TRY = 4.0  # such a try costs as much as so many looks at a stop


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
        if e >= 0 and (known.cost[e] <= cost + TINY
                       or known.first[e + 1] - known.first[e] != r.tasks[u]):
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
def _price(a: Arrays, known: Memory, flown: Ints, worth: float,
           work: float) -> tuple[Floats, float]:
    """Prices of tasks by node for which the bound is high, and that bound [m]."""
    price = np.zeros(a.ends)
    price[a.uavs:] = a.price  # never more than leaving the task out costs
    for e in flown[flown >= 0]:  # at first the best's routes cost what their tasks are priced
        begin, end = known.first[e], known.first[e + 1]
        for i in range(begin, end):
            t = known.stops[i]
            price[t] = min(price[t], known.cost[e] / (end - begin))
    kept, highest, length, vain = price.copy(), -np.inf, 1.0, 0
    reduced, least = np.empty(known.size[0]), np.empty(a.uavs)
    chosen, served = np.empty(a.uavs, np.int64), np.empty(a.ends, np.int64)
    steps = work / max(1, known.first[known.size[0]])
    for _ in range(int(min(MOST, max(FEWEST, steps)))):
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


@part
def _find(a: Arrays, r: Routes, known: Memory, u: int) -> int:
    """The entry of UAV u's route, -1 if it has none."""
    word, t = known.word[u], r.next[u]
    if t >= a.ends:
        return -1
    while t < a.ends:
        word ^= known.word[t]
        t = r.next[t]
    at = np.int64(word & np.uint64(known.place.size - 1))
    while known.place[at] >= 0 and known.key[known.place[at]] != word:
        at = (at + 1) % known.place.size
    return int(known.place[at])


@maker
def combine(a: Arrays, best: Routes, known: Memory, work: float, into: Routes) -> bool:
    """Put routes together that cost less than the best, if there are any; whether there are.

    Groups of UAVs whose routes are near each other exchange their tasks, all others stay.
    """
    remember(a, best, known)
    flown = np.empty(a.uavs, np.int64)
    for u in range(a.uavs):
        flown[u] = _find(a, best, known, u)
        if flown[u] < 0 and best.tasks[u] > 0:
            return False
    worth = 0.0
    for t in range(a.uavs, a.ends):
        worth += a.price[t - a.uavs] if best.on[t] < 0 else 0.0
    for e in flown[flown >= 0]:
        worth += known.cost[e]
    price, bound = _price(a, known, flown, worth, work)
    if worth - bound < TINY:
        return False
    reduced, least = np.empty(known.size[0]), np.empty(a.uavs)
    _reduce(a, known, price, reduced, least, np.empty(a.uavs, np.int64))
    on = np.full(a.ends, -1, np.int64)
    on[a.uavs:] = best.on[a.uavs:a.ends]
    found, again, tries, u = False, True, int(work / TRY), 0
    while tries > 0 and u < PASSES * a.uavs:
        if u % a.uavs == 0:
            if not again:
                break
            again = False
        group = _group(a, known, on, flown, u % a.uavs)
        tasks = _tasks_of(a, known, on, flown, group)
        better, tried = _exchange(a, known, price, reduced, least, group, tasks,
                                  min(DEEPEST, tries), flown, on)
        if better:
            found = again = True
        tries, u = tries - tried, u + 1
    if found:
        clear(a, into)
        for u in range(a.uavs):
            if flown[u] >= 0:
                after = NODE(u)
                for i in range(known.first[flown[u]], known.first[flown[u] + 1]):
                    insert(a, into, known.stops[i], after)
                    after = known.stops[i]
        total(a, into)
    return found


@maker
def _group(a: Arrays, known: Memory, on: Ints, flown: Ints, seed: int) -> NDArray[np.bool_]:
    """Whose routes are nearest to that of one UAV, it among them."""
    inside, beside = np.zeros(a.uavs, np.bool_), np.zeros(a.uavs, np.int64)
    inside[seed] = True
    newest = seed
    for _ in range(min(GROUP, a.uavs) - 1):
        e = flown[newest]
        for i in range(known.first[e] if e >= 0 else 0, known.first[e + 1] if e >= 0 else 0):
            t = known.stops[i] - a.uavs
            for k in range(min(AROUND, a.near.shape[1])):
                other = on[a.near[t, k]]
                if other >= 0:
                    beside[other] += 1
            for k in range(a.starts.shape[1]):
                beside[a.starts[t, k]] += 1
        newest, most = -1, -1
        for u in range(a.uavs):
            if not inside[u] and beside[u] > most:
                newest, most = u, beside[u]
        inside[newest] = True
    return inside


@maker
def _tasks_of(a: Arrays, known: Memory, on: Ints, flown: Ints,
              group: NDArray[np.bool_]) -> Ints:
    """Tasks that a group of UAVs serves, and those that nobody does next to them."""
    tasks = [int(t) for t in range(0)]
    for u in range(a.uavs):
        if group[u] and flown[u] >= 0:
            for i in range(known.first[flown[u]], known.first[flown[u] + 1]):
                tasks.append(WHOLE(known.stops[i]))
    for t in range(a.uavs, a.ends):
        if on[t] >= 0:
            continue
        near = a.uavs <= GROUP
        for k in range(min(AROUND, a.near.shape[1])):
            other = on[a.near[t - a.uavs, k]]
            near |= other >= 0 and group[other]
        if near:
            tasks.append(t)
    return np.array(tasks)


@maker
def _exchange(a: Arrays, known: Memory, price: Floats, reduced: Floats, least: Floats,
              group: NDArray[np.bool_], tasks: Ints, limit: int, flown: Ints,
              on: Ints) -> tuple[bool, int]:
    """Give a group of UAVs the remembered routes through their tasks that cost least.

    Returns whether they cost less than before and how many were tried.
    """
    spare, inside = -TINY, np.zeros(a.ends, np.bool_)
    if tasks.size == 0:
        return False, 1
    for t in tasks:
        inside[t] = True
        if on[t] < 0:
            spare += a.price[t - a.uavs] - price[t]
    for u in range(a.uavs):
        if group[u]:
            spare -= least[u]
            spare += reduced[flown[u]] if flown[u] >= 0 else 0.0
    if spare <= 0.0:
        return False, 1
    some = np.empty(known.size[0], np.int64)
    count = 0
    begin = np.zeros(a.ends + 1, np.int64)
    for e in range(known.size[0]):
        u = known.uav[e]
        if not group[u] or reduced[e] - least[u] >= spare:
            continue
        fits = True
        for i in range(known.first[e], known.first[e + 1]):
            if not inside[known.stops[i]]:
                fits = False
                break
        if fits:
            some[count] = e
            count += 1
            for i in range(known.first[e], known.first[e + 1]):
                begin[known.stops[i] + 1] += 1
    some = some[:count]
    left = np.empty(count)
    for i in range(count):
        left[i] = reduced[some[i]] - least[known.uav[some[i]]]
    some = some[np.argsort(left)]
    order = tasks[np.argsort(begin[tasks + 1])]  # those with fewest routes first
    begin[:] = np.cumsum(begin)
    by, fill = np.empty(begin[a.ends], np.int64), begin.copy()
    for e in some:  # routes by task, those that cost least first
        for i in range(known.first[e], known.first[e + 1]):
            by[fill[known.stops[i]]] = e
            fill[known.stops[i]] += 1
    return _deepen(a, known, price, reduced, least, begin, by, order, group, spare, limit, flown,
                   on)


@maker
def _deepen(a: Arrays, known: Memory, price: Floats, reduced: Floats, least: Floats,
            begin: Ints, by: Ints, order: Ints, group: NDArray[np.bool_], spare: float,
            limit: int, flown: Ints, on: Ints) -> tuple[bool, int]:
    """Search in depth for routes that serve all within `spare` [m] of reduced cost."""
    room = order.size + 1
    task, at, took = np.empty(room, np.int64), np.empty(room, np.int64), np.empty(room, np.int64)
    spent = np.zeros(room + 1)
    served, flies = np.zeros(a.ends, np.bool_), np.zeros(a.uavs, np.bool_)
    depth, tried, found = 0, 0, False
    task[0], at[0] = 0, begin[order[0]]
    took[0] = -2
    while depth >= 0 and tried < limit:
        t = order[task[depth]]
        tried += 1
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
            cost = spent[depth] + reduced[e] - least[known.uav[e]]
            if cost >= spare:
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
                took[depth], more = e, cost
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
            if group[u] and not flies[u]:
                more -= least[u]
        if more < spare:
            spare, found = more - TINY, True
            for u in range(a.uavs):
                if group[u]:
                    flown[u] = -1
            for t in order:
                on[t] = -1
            for d in range(depth + 1):
                if took[d] >= 0:
                    u = known.uav[took[d]]
                    flown[u] = took[d]
                    for i in range(known.first[took[d]], known.first[took[d] + 1]):
                        on[known.stops[i]] = u
    return found, tried
