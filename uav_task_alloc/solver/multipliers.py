# SPDX-License-Identifier: Apache-2.0
"""Lagrange multipliers of tasks, and what columns of the pool cost less them.

Relaxed is that each task is served once or left out; what remains is that each UAV flies at most
one column. Subgradient optimization after Held, Wolfe and Crowder (1974).
"""
from __future__ import annotations

from typing import NamedTuple

import numpy as np

from uav_task_alloc.kernel import allocating_kernel, kernel
from uav_task_alloc.solver.pool import Pool
from uav_task_alloc.solver.routes import TINY, Arrays, Floats, Ints

FEWEST, MOST = 30, 1000  # steps
PATIENCE, SHORTER = 8, 0.7  # after so many steps in vain they get so much shorter


class Reduced(NamedTuple):
    """Reduced costs, none below 0 [m]: a plan costs the bound and those of all it consists of."""

    column: Floats  # of flying it
    stay: Floats  # (m) of a UAV without tasks
    left: Floats  # (m + n) of leaving a task out, by node


@kernel
def _bound(a: Arrays, pool: Pool, price: Floats, reduced: Floats, least: Floats,
           chosen: Ints) -> float:
    """Costs less multipliers; the least of each UAV, 0 if it stays, and its column; the bound."""
    least[:] = 0.0
    chosen[:] = -1
    for e in range(pool.size[0]):
        cost, u = pool.cost[e], pool.uav[e]
        for i in range(pool.first[e], pool.first[e + 1]):
            cost -= price[pool.stops[i]]
        reduced[e] = cost
        if cost < least[u]:
            least[u], chosen[u] = cost, e
    bound = 0.0
    for t in range(a.uavs, a.ends):
        bound += price[t]
    for u in range(a.uavs):
        bound += least[u]
    return bound


@allocating_kernel
def _first_prices(a: Arrays, pool: Pool, flown: Ints) -> Floats:
    """Multipliers by node, no more than leaving a task out costs, that share out what is flown."""
    price = np.zeros(a.ends)
    price[a.uavs:] = a.price
    for e in flown[flown >= 0]:
        begin, end = pool.first[e], pool.first[e + 1]
        for i in range(begin, end):
            t = pool.stops[i]
            price[t] = min(price[t], pool.cost[e] / (end - begin))
    return price


@kernel
def _count(pool: Pool, chosen: Ints, served: Ints) -> None:
    """How often each task is served by the chosen columns."""
    served[:] = 0
    for e in chosen:
        if e >= 0:
            for i in range(pool.first[e], pool.first[e + 1]):
                served[pool.stops[i]] += 1


@allocating_kernel
def reduced_costs(a: Arrays, pool: Pool, flown: Ints, worth: float,
                  work: float) -> tuple[Reduced, float]:
    """Reduced costs for a high lower bound, and that bound; the columns flown cost `worth` [m].

    Looks at about `work` stops.
    """
    price = _first_prices(a, pool, flown)
    kept, highest, length, vain = price.copy(), -np.inf, 1.0, 0
    reduced, least = np.empty(pool.size[0]), np.empty(a.uavs)
    chosen, served = np.empty(a.uavs, np.int64), np.empty(a.ends, np.int64)
    steps = work / max(1, pool.first[pool.size[0]])
    for _ in range(int(min(MOST, max(FEWEST, steps)))):
        bound = _bound(a, pool, price, reduced, least, chosen)
        vain += 1
        if bound > highest:
            if bound > highest + 1e-4 * abs(worth - bound):
                vain = 0
            kept[:], highest = price, bound
        if vain >= PATIENCE:
            vain, length = 0, SHORTER * length
            price[:] = kept
            continue
        _count(pool, chosen, served)
        wrong = ((served[a.uavs:] - 1) ** 2).sum()
        if wrong == 0 or highest >= worth - TINY:
            break
        stride = length * (worth - bound) / wrong
        for t in range(a.uavs, a.ends):
            price[t] = min(a.price[t - a.uavs], price[t] + stride * (1 - served[t]))
    highest = _bound(a, pool, kept, reduced, least, chosen)
    for e in range(reduced.size):
        reduced[e] -= least[pool.uav[e]]
    kept[a.uavs:] = a.price - kept[a.uavs:]
    return Reduced(reduced, -least, kept), highest
