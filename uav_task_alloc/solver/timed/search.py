# SPDX-License-Identifier: Apache-2.0
"""Ruin and recreate with simulated annealing, for problems with time, loads or trips."""
from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from uav_task_alloc.geometry.outline import Floats
from uav_task_alloc.kernel import inline_kernel, inner_kernel, kernel
from uav_task_alloc.solver.pool import Pool
from uav_task_alloc.solver.rng import RngState, uniform
from uav_task_alloc.solver.search import PENALTY_DECAY, PENALTY_GROWTH
from uav_task_alloc.solver.timed import columns as at
from uav_task_alloc.solver.timed.arrays import (
    LINK,
    TOLERANCE,
    Links,
    TimedArrays,
    TimedRoutes,
    node_count,
)
from uav_task_alloc.solver.timed.order import route_order, true_cost
from uav_task_alloc.solver.timed.round import ABSENT, PATIENCE, Round, begin_round, take_back
from uav_task_alloc.solver.timed.route_pool import collect_routes
from uav_task_alloc.solver.timed.route_sums import cost_of
from uav_task_alloc.solver.timed.ruin import insert_removed, list_absent, open_route, ruin_strings
from uav_task_alloc.solver.timed.ways import has_paths

MAX_OPENING = 64  # absent tasks that a round tries to insert that opens a route
OPENING_RATE = 0.1  # share of rounds with absent tasks that open a route around one of them
GENEROUS_RATE = 0.5  # share of rounds in which a task may cost more than its price
FEW_ABSENT = 0.05  # up to this share of absent tasks their price rises
BEST_COST, BEST_WORTH, BEST_METRES, BEST_EXCESS = range(4)  # entries of Incumbent.score


class Incumbent(NamedTuple):
    """The best routes so far."""

    order: Links  # (nodes) node after each node; itself: in no route; as `route_order` writes it
    # (4) cost without unserved tasks or, where those have a price, with; value; metres; of those
    # beyond ranges, and beyond endurances at cruise speed
    score: Floats


def empty_incumbent(a: TimedArrays) -> Incumbent:
    """An incumbent without routes, which any is better than."""
    order = np.arange(node_count(a))
    order[:a.uavs] += a.ends
    return Incumbent(order.astype(LINK), np.array([math.inf, -math.inf, 0.0, 0.0]))


def copy_incumbent(best: Incumbent) -> Incumbent:
    """The same in new arrays."""
    return Incumbent(best.order.copy(), best.score.copy())


class Rises(NamedTuple):
    """How prices change in a search."""

    least: Floats  # (4) lowest price of each kind of excess; inf: never allowed
    most: Floats  # (4) highest price
    unserved: float  # factor by which the price of a task in no route rises; 1: it is fixed
    max_unserved: Floats  # (n) highest price of a task
    absent: int  # absent tasks that a round tries to insert, besides those it removes
    skipped: float  # probability that a round passes over one of them
    by_value: float  # share of rounds that insert about the most valuable tasks first
    blinks: float  # probability that a place is passed over
    prizes: bool  # tasks may be left out because they are not worth their way


@kernel
def is_improvement(cost: float, worth: float, score: Floats, prizes: bool) -> bool:
    """Whether a cost and value are better than a score."""
    less = score[BEST_COST] * (1.0 - 1e-12) - TOLERANCE
    if prizes:
        return bool(cost < less)
    slack = 1e-9 * (abs(score[BEST_WORTH]) + 1.0)
    gain = worth - score[BEST_WORTH]
    return bool(gain > slack or (gain >= -slack and cost < less))


@inline_kernel
def _announced(a: TimedArrays, r: TimedRoutes) -> float:
    """What the tasks in no route would cost less as they were announced after 0. O(n)."""
    cost = 0.0
    if a.timed_cost and r.counts[at.SERVED] < a.ends - a.uavs:
        for t in range(a.uavs, a.ends):
            if r.link[t, at.OF_UAV] == a.uavs:
                cost += a.fixed[t, at.WEIGHT] * a.fixed[t, at.ANNOUNCED]
    return cost


@inner_kernel
def record(a: TimedArrays, r: TimedRoutes, best: Incumbent, prizes: bool) -> bool:
    """Keep the routes if they are allowed and better than the best; whether. O(nodes)."""
    if r.counts[at.INFEASIBLE] > 0:
        return False
    cost = true_cost(a, r) + (r.sums[at.UNSERVED_COST] if prizes else _announced(a, r))
    if not is_improvement(cost, r.sums[at.SERVED_WORTH], best.score, prizes):
        return False
    best.score[BEST_COST], best.score[BEST_WORTH] = cost, r.sums[at.SERVED_WORTH]
    best.score[BEST_METRES] = r.sums[at.METRES]
    best.score[BEST_EXCESS] = r.sums[at.RANGE_EXCESS] + r.sums[at.ENDURANCE_EXCESS]
    route_order(a, r, best.order)
    return True


@inner_kernel
def _update_prices(a: TimedArrays, r: TimedRoutes, w: Round, pool: Pool, rises: Rises) -> None:
    """Adapt the prices of excess and of tasks in no route, collect the routes. O(n)."""
    collect_routes(a, r, pool)
    for c in range(4):
        if rises.least[c] < math.inf:
            if r.sums[c] > TOLERANCE:
                a.price[c] = min(rises.most[c], a.price[c] * PENALTY_GROWTH)
            else:
                a.price[c] = max(rises.least[c], a.price[c] * PENALTY_DECAY)
    list_absent(a, r, w)
    few = max(2.0, FEW_ABSENT * (a.ends - a.uavs))  # a single task is few, however few there are
    if rises.unserved == 1.0 or w.counts[ABSENT] >= few:
        return
    for k in range(w.counts[ABSENT]):
        i = w.absent[k] - a.uavs
        more = min(a.unserved[i] * rises.unserved, rises.max_unserved[i])
        r.sums[at.UNSERVED_COST] += more - a.unserved[i]
        a.unserved[i] = more


@inline_kernel
def _limit(before: float, temperature: float, rng: RngState) -> float:
    """The cost below which new routes are accepted, by chance. O(1)."""
    return before - temperature * math.log(1.0 - uniform(rng))


@kernel
def anneal(a: TimedArrays, r: TimedRoutes, w: Round, best: Incumbent, pool: Pool, rises: Rises,
           mean: float, start: float, end: float, rounds: int, rng: RngState) -> int:
    """Anneal r from temperature `start` to `end` [cost]; returns how often the best improved.

    A round removes about `mean` tasks.
    """
    temperature, improvements = start, 0
    gives_up = a.visits == 0 and not has_paths(a)  # each task costs more than nothing
    decay = (end / start) ** (1.0 / max(1, rounds))
    for _ in range(rounds):
        w.counts[PATIENCE] -= 1
        if w.counts[PATIENCE] < 0:
            _update_prices(a, r, w, pool, rises)
            w.counts[PATIENCE] = max(20, (a.ends - a.uavs) // 8)
        before, generous = cost_of(a, r.sums), 1.0
        begin_round(r, w)
        opening = rises.prizes and w.counts[ABSENT] > 0 and uniform(rng) < OPENING_RATE
        seed = ruin_strings(a, r, w, mean, MAX_OPENING if opening else rises.absent,
                            rises.skipped, rng)
        if rises.prizes and uniform(rng) < GENEROUS_RATE:
            generous += uniform(rng)
        if (opening and a.unserved[seed - a.uavs] > 0.0  # else it may not be among those removed
                and r.link[seed, at.OF_UAV] == a.uavs):
            open_route(a, r, w, seed)
        limit = _limit(before, temperature, rng) if gives_up else math.inf
        insert_removed(a, r, w, generous, rises.by_value, rises.blinks, limit, rng)
        if not gives_up:
            limit = _limit(before, temperature, rng)
        if cost_of(a, r.sums) < limit:
            improvements += int(record(a, r, best, rises.prizes))
        else:
            take_back(a, r, w)
        temperature *= decay
    return improvements
