# SPDX-License-Identifier: Apache-2.0
"""Lagrange multipliers of tasks and reduced costs of the columns of the pool.

The relaxed constraint is that each task is served once or stays unassigned; the one that remains
is that each UAV flies at most one column. Subgradient optimization: Held, Wolfe and Crowder,
Validation of Subgradient Optimization, Mathematical Programming 6 (1974).
"""
from __future__ import annotations

from typing import NamedTuple

import numpy as np

from uav_task_alloc.kernel import inner_kernel, kernel
from uav_task_alloc.solver.pool import Pool
from uav_task_alloc.solver.routes import TINY, Arrays, Floats, Ints

MIN_STEPS, MAX_STEPS = 30, 1000  # subgradient steps
STALLED_STEPS, STEP_FACTOR = 8, 0.7  # after so many steps without gain they shrink by so much


class Reduced(NamedTuple):
    """Reduced costs >= 0 [m]: a plan costs the bound plus those of all that it consists of."""

    column: Floats  # by column, of flying it
    stay: Floats  # (m) of a UAV that gets no tasks
    unassigned: Floats  # (m + n) of not serving a task, by node


@inner_kernel
def _bound(a: Arrays, pool: Pool, price: Floats, reduced: Floats, least: Floats,
           chosen: Ints) -> float:
    """Lower bound [m] for these multipliers. O(stops of the pool).

    price: (m + n) multipliers. Writes reduced: cost of each column less its multipliers;
    least: (m) the least of them for each UAV, 0 if it stays; chosen: (m) its column or -1.
    """
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


@inner_kernel
def _set_first_prices(a: Arrays, pool: Pool, flown: Ints, price: Floats) -> None:
    """First multipliers by node: the costs of the columns flown, split among their tasks. O(n)."""
    for t in range(a.uavs, a.ends):
        price[t] = a.unassigned_cost[t - a.uavs]
    for e in flown:
        begin, end = (pool.first[e], pool.first[e + 1]) if e >= 0 else (0, 0)
        for i in range(begin, end):
            t = pool.stops[i]
            price[t] = min(price[t], pool.cost[e] / (end - begin))


@inner_kernel
def _copy(prices: Floats, to: Floats) -> None:
    """Copy multipliers; a slice would do, but takes a second to compile. O(n)"""
    for i in range(prices.size):
        to[i] = prices[i]


@inner_kernel
def _count(pool: Pool, chosen: Ints, served: Ints) -> None:
    """Write to `served` how many of the chosen columns contain each node. O(n)."""
    served[:] = 0
    for e in chosen:
        if e >= 0:
            for i in range(pool.first[e], pool.first[e + 1]):
                served[pool.stops[i]] += 1


def reduced_costs(a: Arrays, pool: Pool, flown: Ints, worth: float,
                  work: float) -> tuple[Reduced, float]:
    """Reduced costs for a high lower bound [m], and that bound. O(work).

    Args:
        a: the problem.
        pool: the columns.
        flown: (m) column of each UAV or -1.
        worth: [m] what they and unassigned tasks cost.
        work: how many stops of the pool may be read.

    Returns:
        The reduced costs, and the bound [m].
    """
    costs = Reduced(np.empty(pool.size[0]), np.empty(a.uavs), np.zeros(a.ends))
    bound = _set_reduced_costs(a, pool, flown, worth, work, costs, np.zeros(a.ends),
                               np.empty(a.uavs, np.int64), np.empty(a.ends, np.int64))
    return costs, float(bound)


@kernel
def _set_reduced_costs(a: Arrays, pool: Pool, flown: Ints, worth: float, work: float,
                       costs: Reduced, price: Floats, chosen: Ints, served: Ints) -> float:
    """As `reduced_costs`, into arrays made before; price, chosen and served are its own.

    A kernel that makes arrays counts references, and takes twice as long to compile.
    """
    reduced, least, best_price = costs.column, costs.stay, costs.unassigned
    _set_first_prices(a, pool, flown, price)
    highest, length, stalled = -np.inf, 1.0, 0
    _copy(price, best_price)
    steps = work / max(1, pool.first[pool.size[0]])
    for _ in range(int(min(MAX_STEPS, max(MIN_STEPS, steps)))):
        bound = _bound(a, pool, price, reduced, least, chosen)
        stalled += 1
        if bound > highest:
            if bound > highest + 1e-4 * abs(worth - bound):
                stalled = 0
            highest = bound
            _copy(price, best_price)
        if stalled >= STALLED_STEPS:
            stalled, length = 0, STEP_FACTOR * length
            _copy(best_price, price)
            continue
        _count(pool, chosen, served)
        violation = 0
        for t in range(a.uavs, a.ends):
            violation += (served[t] - 1) * (served[t] - 1)
        if violation == 0 or highest >= worth - TINY:
            break
        stride = length * (worth - bound) / violation
        for t in range(a.uavs, a.ends):
            price[t] = min(a.unassigned_cost[t - a.uavs], price[t] + stride * (1 - served[t]))
    highest = _bound(a, pool, best_price, reduced, least, chosen)
    for e in range(reduced.size):
        reduced[e] -= least[pool.uav[e]]
    for u in range(a.uavs):
        least[u] = -least[u]
    for t in range(a.uavs, a.ends):
        best_price[t] = a.unassigned_cost[t - a.uavs] - best_price[t]
    return highest
