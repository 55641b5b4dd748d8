# SPDX-License-Identifier: Apache-2.0
"""Cheapest insertion of unassigned tasks: next to neighbours, after starts, or anywhere."""
from __future__ import annotations

import heapq
import math

import numpy as np

from uav_task_alloc.geometry.pairs import is_enclosed
from uav_task_alloc.kernel import (
    allocating_kernel,
    inline_kernel,
    inner_allocating_kernel,
    inner_kernel,
)
from uav_task_alloc.solver.rng import RngState, uniform
from uav_task_alloc.solver.routes import (
    NODE,
    SIGNED,
    Arrays,
    Ints,
    Routes,
    insert,
    leg_length,
    lengthening_cost,
    straight_length,
)


@inline_kernel
def cost_after(a: Arrays, r: Routes, t: int, before: int, first: float, least: float) -> float:
    """Cost [m] of t after node `before`, `first` [m] away; a number >= least if not less. O(1)."""
    u, then = r.uav_of[before], r.next[before]
    if not a.compatible[u, t - a.uavs] or first >= least + r.leg[before]:
        return math.inf  # paths out of a zone that no path leads into take long to find
    delta = first + leg_length(a, t, then) - r.leg[before]
    return lengthening_cost(a, r, u, delta)


@inline_kernel
def best_side(a: Arrays, r: Routes, t: int, c: int, d: float, least: float) -> tuple[int, float]:
    """The cheaper side of c, d [m] from t: (node before, cost); (-1, least) if not less. O(1)."""
    u, best = r.uav_of[c], -1
    if not a.compatible[u, t - a.uavs]:
        return best, least
    then, before = r.next[c], r.prev[c]
    # the other end of the leg is a nearer neighbour, tried already, or further than c
    if then >= a.ends or 2.0 * d - r.leg[c] < least:
        delta = d + leg_length(a, t, then) - r.leg[c]
        if delta < least:
            delta = lengthening_cost(a, r, u, delta)
            if delta < least:
                best, least = c, delta
    if before < a.uavs or 2.0 * d - r.leg[before] < least:
        delta = leg_length(a, before, t) + d - r.leg[before]
        if delta < least:
            delta = lengthening_cost(a, r, u, delta)
            if delta < least:
                best, least = before, delta
    return best, least


@inline_kernel
def best_near_place(a: Arrays, r: Routes, t: int, k: int, blinks: float,
               rng: RngState) -> tuple[int, float]:
    """The cheapest place among k neighbours and the starts: (node before or -1, cost [m]). O(k).

    Each place is skipped with probability `blinks`.
    """
    i, best, least = t - a.uavs, -1, np.inf
    for m in range(min(k, a.near.shape[1])):
        c = a.near[i, m]
        if r.uav_of[c] < 0 or (blinks > 0.0 and uniform(rng) < blinks):
            continue
        place, delta = best_side(a, r, t, c, a.near_length[i, m], least)
        if place >= 0:
            best, least = place, delta
    for m in range(a.starts.shape[1]):
        d, s = a.start_length[i, m], a.starts[i, m]
        if d - r.leg[s] >= least or (blinks > 0.0 and uniform(rng) < blinks):
            continue
        delta = cost_after(a, r, t, s, d, least)
        if delta < least:
            best, least = s, delta
    return best, least


@inline_kernel
def _straight_cost(a: Arrays, r: Routes, t: int, before: int) -> float:
    """Cost [m] of t after node `before` if both legs were straight: the least it may be. O(1)."""
    u, then = r.uav_of[before], r.next[before]
    home = then < a.ends or a.returns
    delta = straight_length(a, before, t) + (straight_length(a, t, then) if home else 0.0)
    return lengthening_cost(a, r, u, delta - r.leg[before])


@inner_kernel
def best_place(a: Arrays, r: Routes, t: int) -> tuple[int, float]:
    """The cheapest place in all routes: (node before or -1, cost [m]). O(n)."""
    best, least = -1, np.inf
    if is_enclosed(a.pairs, SIGNED(t)):
        return best, least
    for u in range(a.uavs):
        if not a.compatible[u, t - a.uavs]:
            continue
        before = NODE(u)
        while before < a.ends:
            # past zones it takes long to look a leg up
            if a.straight or not _straight_cost(a, r, t, before) >= least:
                delta = cost_after(a, r, t, before, leg_length(a, before, t), least)
                if delta < least:
                    best, least = before, delta
            before = r.next[before]
    return best, least


@allocating_kernel
def place_all(a: Arrays, r: Routes, tasks: Ints) -> int:
    """Insert task nodes in the given order, each where it costs least; O(len(tasks) n) at worst.

    Args:
        a: arrays of the problem.
        r: routes, which are changed.
        tasks: int64 task nodes; those in a route already are skipped.

    Returns:
        How many could not be inserted.
    """
    missing, rng = 0, np.ones(1, np.uint64)
    for task in tasks:
        t = NODE(task)
        if r.uav_of[t] >= 0:
            continue
        place, _ = best_near_place(a, r, t, a.near.shape[1], 0.0, rng)
        if place < 0:
            place, _ = best_place(a, r, t)
        if place < 0:
            missing += 1
        else:
            insert(a, r, t, NODE(place))
    return missing


@allocating_kernel
def insert_by_auction(a: Arrays, r: Routes, noise: float, rng: RngState) -> None:
    """Insert all unassigned tasks, always the cheapest one next. O(n k log n).

    Bids are kept in a heap; an outdated bid is recomputed when it is popped. Each bid is raised
    by a random share up to `noise`.
    """
    rounds = np.ones(1, np.uint64)
    heap = [(np.inf, -1)]
    for task in range(a.uavs, a.ends):
        if r.uav_of[task] < 0:
            _, bid = best_near_place(a, r, NODE(task), a.near.shape[1], 0.0, rounds)
            heap.append((bid * (1.0 + noise * uniform(rng)), task))
    heapq.heapify(heap)
    while heap[0][1] >= 0:
        bid, task = heapq.heappop(heap)
        t = NODE(task)
        if r.uav_of[t] >= 0:
            continue
        place, now = best_near_place(a, r, t, a.near.shape[1], 0.0, rounds)
        if place < 0:
            continue
        if now > bid * (1.0 + noise) + 1e-9:
            heapq.heappush(heap, (now, task))
            continue
        insert(a, r, t, NODE(place))
        _renew_bids(a, r, t, heap)


@inner_allocating_kernel
def _renew_bids(a: Arrays, r: Routes, t: int, heap: list[tuple[float, int]]) -> None:
    """Push new bids of unassigned neighbours of t, which was just inserted. O(log n)."""
    for m in range(min(12, a.near.shape[1])):
        c = a.near[t - a.uavs, m]
        if r.uav_of[c] < 0:
            place, bid = best_side(a, r, c, t, a.near_length[t - a.uavs, m], np.inf)
            if place >= 0:
                heapq.heappush(heap, (bid, SIGNED(c)))


def insert_cheapest_first(a: Arrays, r: Routes, rng: RngState, noise: float = 0.0) -> None:
    """Run the auction, then insert the remaining tasks wherever they fit."""
    insert_by_auction(a, r, noise, rng)
    unassigned = np.flatnonzero(r.uav_of[a.uavs:a.ends] < 0).astype(np.int64) + np.int64(a.uavs)
    if unassigned.size:
        place_all(a, r, unassigned)
