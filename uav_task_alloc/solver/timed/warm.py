# SPDX-License-Identifier: Apache-2.0
"""First routes of a problem with time: an earlier plan as far as it still holds, and the rest."""
from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from uav_task_alloc.geometry.outline import Ints
from uav_task_alloc.kernel import kernel
from uav_task_alloc.solver.rng import rng_state
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

MOST_PLACES = 1_000_000  # absent tasks times tasks that `completed` tries
_VISIT = -1  # in a sequence of nodes: a visit of the base


def first_plan(problem: TimedProblem, before: WarmState) -> Incumbent:
    """Routes without excess: the earlier ones, then all other tasks where each costs least.

    Args:
        problem: the current problem.
        before: the earlier plan; tasks that are gone, or come too late now, are left out of it.
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
    append_all(a, routes, np.array(nodes, np.int64), np.array(bounds, np.int64),
               np.array([node in turned for node in nodes], np.bool_))
    tasks = np.arange(a.uavs, a.ends)
    tasks = tasks[np.argsort(-a.fixed[tasks, at.REMOTE], kind='stable')]
    insert_in_order(a, routes, tasks, problem.prizes, rng_state(0))
    best = empty_incumbent(a)
    record(a, routes, best, problem.prizes)
    return best


def completed(problem: TimedProblem, best: Incumbent) -> Incumbent:
    """The same routes, with absent tasks inserted where that is possible and worth it."""
    a, routes, found = problem.arrays, empty_timed_routes(problem.arrays), copy_incumbent(best)
    tasks = np.arange(a.uavs, a.ends)
    absent = tasks[best.order[a.uavs:a.ends] == tasks]
    if absent.size and absent.size * tasks.size < MOST_PLACES:
        set_order(a, routes, best.order)
        absent = absent[np.argsort(-a.fixed[absent, at.WORTH], kind='stable')]
        insert_in_order(a, routes, absent, problem.prizes, rng_state(0))
        record(a, routes, found, problem.prizes)
    return found


@kernel
def append_all(a: TimedArrays, r: TimedRoutes, nodes: Ints, bounds: Ints,
               turned: NDArray[np.bool_]) -> None:
    """Append nodes[bounds[u]:bounds[u + 1]] to the route of each UAV u, as far as allowed.

    nodes: int64 task nodes, -1 before the first task of a further trip; bounds: (m + 1); turned:
    which of the nodes are flown from their last points.
    """
    for u in range(a.uavs):
        visits = False
        for i in range(bounds[u], bounds[u + 1]):
            if nodes[i] < 0:
                visits = True
                continue
            t, last = LINK(nodes[i]), r.link[a.ends + u, at.PREV]
            if r.link[t, at.OF_UAV] != a.uavs:
                continue
            if has_paths(a):
                face(a, r, t, turned[i] and a.turnable[t - a.uavs])
            way = TURNED if is_turned(a, r, t) else 0
            base = free_visit(a, r, LINK(u)) if visits else -1
            if base >= 0 and split_cost(a, r, LINK(u), t, last, BASE_BEFORE, LINK(base),
                                        math.inf) < math.inf:
                insert_task(a, r, t, last, BASE_BEFORE + way)
                visits = False
            elif cost_at(a, r, LINK(u), t, last) < math.inf:
                insert_task(a, r, t, last, NO_VISIT + way)
