# SPDX-License-Identifier: Apache-2.0
"""Where a left out task costs least: next to its neighbours, behind starts, or anywhere."""
from __future__ import annotations

import heapq
import math

import numpy as np

from uav_task_alloc.kernel import allocating_kernel, inline_kernel, kernel
from uav_task_alloc.solver.rng import Chance, uniform
from uav_task_alloc.solver.routes import WHOLE, Arrays, Ints, Routes, insert, lengthened, step


@inline_kernel
def between(a: Arrays, r: Routes, t: int, before: int, first: float, least: float) -> float:
    """Cost [m] of t behind node `before`, `first` [m] away; some number >= least if no less."""
    u, then = r.on[before], r.next[before]
    if not a.may[u, t - a.uavs] or first >= least + r.leg[before]:
        return math.inf  # ways out of a zone, which nobody gets into, take long to find
    delta = first + step(a, t, then) - r.leg[before]
    return lengthened(a, r, u, delta)


@inline_kernel
def beside(a: Arrays, r: Routes, t: int, c: int, d: float, least: float) -> tuple[int, float]:
    """The better side of c, d [m] from t, if it costs less than `least`: (node before, cost)."""
    u, best = r.on[c], -1
    if not a.may[u, t - a.uavs]:
        return best, least
    then, before = r.next[c], r.prev[c]
    # the other end of the leg is a nearer neighbour, looked at before, or further than c
    if then >= a.ends or 2.0 * d - r.leg[c] < least:
        delta = d + step(a, t, then) - r.leg[c]
        if delta < least:
            delta = lengthened(a, r, u, delta)
            if delta < least:
                best, least = c, delta
    if before < a.uavs or 2.0 * d - r.leg[before] < least:
        delta = step(a, before, t) + d - r.leg[before]
        if delta < least:
            delta = lengthened(a, r, u, delta)
            if delta < least:
                best, least = before, delta
    return best, least


@inline_kernel
def near_place(a: Arrays, r: Routes, t: int, k: int, blinks: float,
               rng: Chance) -> tuple[int, float]:
    """The cheapest place among k neighbours and the starts: (node before or -1, cost). O(k).

    Each is overlooked with probability `blinks`.
    """
    i, best, least = t - a.uavs, -1, np.inf
    for m in range(min(k, a.near.shape[1])):
        c = a.near[i, m]
        if r.on[c] < 0 or (blinks > 0.0 and uniform(rng) < blinks):
            continue
        place, delta = beside(a, r, t, c, a.near_length[i, m], least)
        if place >= 0:
            best, least = place, delta
    for m in range(a.starts.shape[1]):
        d, s = a.start_length[i, m], a.starts[i, m]
        if d - r.leg[s] >= least or (blinks > 0.0 and uniform(rng) < blinks):
            continue
        delta = between(a, r, t, s, d, least)
        if delta < least:
            best, least = s, delta
    return best, least


@kernel
def any_place(a: Arrays, r: Routes, t: int) -> tuple[int, float]:
    """The cheapest place of all. O(n)."""
    best, least = -1, np.inf
    for u in range(a.uavs):
        if not a.may[u, t - a.uavs]:
            continue
        before = u
        while before < a.ends:
            delta = between(a, r, t, before, step(a, before, t), least)
            if delta < least:
                best, least = before, delta
            before = r.next[before]
    return best, least


@allocating_kernel
def place_all(a: Arrays, r: Routes, tasks: Ints) -> int:
    """Insert task nodes one by one where each costs least; returns how many found no place."""
    missing, rng = 0, np.ones(1, np.uint64)
    for t in tasks:
        if r.on[t] >= 0:
            continue
        place, _ = near_place(a, r, t, a.near.shape[1], 0.0, rng)
        if place < 0:
            place, _ = any_place(a, r, t)
        if place < 0:
            missing += 1
        else:
            insert(a, r, t, place)
    return missing


@allocating_kernel
def insert_by_auction(a: Arrays, r: Routes, noise: float, rng: Chance) -> None:
    """Insert all left out tasks, always the one that costs least now. O(n k log n).

    Bids stand in a heap; a stale one is made anew when it comes up. `noise` scatters them.
    """
    rounds = np.ones(1, np.uint64)
    heap = [(np.inf, -1)]
    for t in range(a.uavs, a.ends):
        if r.on[t] < 0:
            _, bid = near_place(a, r, t, a.near.shape[1], 0.0, rounds)
            heap.append((bid * (1.0 + noise * uniform(rng)), t))
    heapq.heapify(heap)
    while heap[0][1] >= 0:
        bid, t = heapq.heappop(heap)
        if r.on[t] >= 0:
            continue
        place, now = near_place(a, r, t, a.near.shape[1], 0.0, rounds)
        if place < 0:
            continue
        if now > bid * (1.0 + noise) + 1e-9:
            heapq.heappush(heap, (now, t))
            continue
        insert(a, r, t, place)
        _bid_again(a, r, t, heap)


@allocating_kernel
def _bid_again(a: Arrays, r: Routes, t: int, heap: list[tuple[float, int]]) -> None:
    """Neighbours of the task just inserted may have got cheaper."""
    for m in range(min(12, a.near.shape[1])):
        c = a.near[t - a.uavs, m]
        if r.on[c] < 0:
            place, bid = beside(a, r, c, t, a.near_length[t - a.uavs, m], np.inf)
            if place >= 0:
                heapq.heappush(heap, (bid, WHOLE(c)))


def cheapest_first(a: Arrays, r: Routes, rng: Chance, noise: float = 0.0) -> None:
    """The auction, then what is left out wherever there is room."""
    insert_by_auction(a, r, noise, rng)
    left = np.flatnonzero(r.on[a.uavs:a.ends] < 0).astype(np.int64) + np.int64(a.uavs)
    if left.size:
        place_all(a, r, left)

