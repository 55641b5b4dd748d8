# SPDX-License-Identifier: Apache-2.0
"""First routes of a problem with time: an earlier plan as far as it still holds, and the rest."""
from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from uav_task_alloc.geometry.outline import Ints
from uav_task_alloc.kernel import inline_kernel, kernel
from uav_task_alloc.solver.rng import RngState, rng_state
from uav_task_alloc.solver.timed import columns as at
from uav_task_alloc.solver.timed.arrays import LINK, TimedArrays, TimedRoutes
from uav_task_alloc.solver.timed.insertion import insert_in_order, insert_task
from uav_task_alloc.solver.timed.order import set_order
from uav_task_alloc.solver.timed.places import cost_at
from uav_task_alloc.solver.timed.problem import TimedProblem, empty_timed_routes
from uav_task_alloc.solver.timed.search import (
    Incumbent,
    copy_incumbent,
    empty_incumbent,
    record,
)
from uav_task_alloc.solver.timed.visits import BASE_BEFORE, NO_VISIT, free_visit, split_cost
from uav_task_alloc.solver.timed.ways import TURNED, face, has_paths, is_turned
from uav_task_alloc.solver.warm import WarmState

NO_LIMIT = np.iinfo(np.int64).max
# places tried for tasks that may not be beside a neighbour, whatever the budget: no task of 2000
# is tried at fewer than all
LEAST_PLACES = 4_000_000
MOST_PLACES = 1_000_000  # absent tasks times tasks that `completed` tries
_VISIT = -1  # in a sequence of nodes: a visit of the base


class Known(NamedTuple):
    """Routes that are known from before."""

    nodes: Ints  # task nodes, -1 before the first task of a further trip
    bounds: Ints  # (m + 1) those of UAV u are nodes[bounds[u]:bounds[u + 1]]
    turned: NDArray[np.bool_]  # which of the nodes are flown from their last points


def first_plan(problem: TimedProblem, before: WarmState,
               most: int = NO_LIMIT) -> tuple[Incumbent, frozenset[int]]:
    """Routes without excess: the earlier ones, then all other tasks where each costs least.

    Args:
        problem: the current problem.
        before: the earlier plan; tasks that are gone, or come too late now, are left out of it.
        most: places that are tried for tasks that may not be beside any neighbour.

    Returns:
        The routes, and the indices of tasks in none that were tried beside their neighbours only.
    """
    a, routes = problem.arrays, empty_timed_routes(problem.arrays)
    nodes, bounds, index = [], [0], problem.base.index
    turned = {a.uavs + index[name] for name in before.reversed if name in index}
    for uav in problem.base.uavs:
        held = {task.id for task in problem.base.locked.get(uav.id, ())}
        for number, trip in enumerate(before.trips_of(uav.id)):
            row = [a.uavs + index[name] for name in trip if name in index]
            nodes += [_VISIT] * (number > 0 and bool(row or held)) + row
        bounds.append(len(nodes))
    tasks = np.arange(a.uavs, a.ends)
    tasks = tasks[np.argsort(-a.fixed[tasks, at.REMOTE], kind='stable')]
    known = Known(np.array(nodes, np.int64), np.array(bounds, np.int64),
                  np.array([node in turned for node in nodes], np.bool_))
    best = empty_incumbent(a)
    first = fill_routes(a, routes, known, tasks, problem.prizes, most, best, rng_state(0))
    untried = tasks[first:]
    absent = untried[best.order[untried] == untried] - a.uavs
    return best, frozenset(absent.tolist())


def completed(problem: TimedProblem, best: Incumbent) -> Incumbent:
    """The same routes, with absent tasks inserted where that is possible and worth it."""
    a, routes, found = problem.arrays, empty_timed_routes(problem.arrays), copy_incumbent(best)
    tasks = np.arange(a.uavs, a.ends)
    absent = tasks[best.order[a.uavs:a.ends] == tasks]
    if absent.size and absent.size * tasks.size < MOST_PLACES:
        set_order(a, routes, best.order)
        absent = absent[np.argsort(-a.fixed[absent, at.WORTH], kind='stable')]
        fill_routes(a, routes, no_routes(a), absent, problem.prizes, NO_LIMIT, found,
                    rng_state(0))
    return found


def no_routes(a: TimedArrays) -> Known:
    """None are known from before."""
    return Known(np.zeros(0, np.int64), np.zeros(a.uavs + 1, np.int64), np.zeros(0, np.bool_))


@kernel
def fill_routes(a: TimedArrays, r: TimedRoutes, known: Known, tasks: Ints, prizes: bool, most: int,
                best: Incumbent, rng: RngState) -> int:
    """Append known routes, insert task nodes where each costs least, keep what is better.

    most: see `insert_in_order`, which returns the same; best: overwritten where the routes are
    better. One kernel: they compile faster together.
    """
    _append_all(a, r, known)
    limited = insert_in_order(a, r, tasks, prizes, most, rng)
    record(a, r, best, prizes)
    return limited


@inline_kernel
def _append_all(a: TimedArrays, r: TimedRoutes, known: Known) -> None:
    """Append known routes to those of the UAVs, as far as allowed."""
    for u in range(a.uavs):
        visits = False
        for i in range(known.bounds[u], known.bounds[u + 1]):
            if known.nodes[i] < 0:
                visits = True
                continue
            t, last = LINK(known.nodes[i]), r.link[a.ends + u, at.PREV]
            if r.link[t, at.OF_UAV] != a.uavs:
                continue
            if has_paths(a):
                face(a, r, t, known.turned[i] and a.turnable[t - a.uavs])
            way = TURNED if is_turned(a, r, t) else 0
            base = free_visit(a, r, LINK(u)) if visits else -1
            if base >= 0 and split_cost(a, r, LINK(u), t, last, BASE_BEFORE, LINK(base),
                                        math.inf) < math.inf:
                insert_task(a, r, t, last, BASE_BEFORE + way)
                visits = False
            elif cost_at(a, r, LINK(u), t, last) < math.inf:
                insert_task(a, r, t, last, NO_VISIT + way)
