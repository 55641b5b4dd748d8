# SPDX-License-Identifier: Apache-2.0
"""The original allocation, by shortest distance and balance: a balanced nearest neighbour.

Of the UAVs with the fewest tasks that can still take one, the one whose route ends nearest to an
unassigned task gets that task. The whole construction is one iteration.
"""
from __future__ import annotations

import numpy as np

from uav_task_alloc.kernel import kernel
from uav_task_alloc.solver.baselines.leg_lengths import place_rest
from uav_task_alloc.solver.recorder import Recorder
from uav_task_alloc.solver.routes import (
    Arrays,
    Routes,
    empty_routes,
    insert,
    leg_length,
    lengthening_cost,
)


@kernel
def give_nearest(a: Arrays, r: Routes) -> bool:
    """Extend a route with the fewest tasks by the shortest leg; whether any was. O(n m)."""
    fewest, shortest, task, after = a.ends, np.inf, -1, -1
    for u in range(a.uavs):
        if r.tasks[u] > fewest:
            continue
        end = a.ends + u
        last = r.prev[end]
        for t in range(a.uavs, a.ends):
            if r.uav_of[t] >= 0 or not a.compatible[u, t - a.uavs]:
                continue
            d = leg_length(a, last, t)
            if r.tasks[u] == fewest and d >= shortest:
                continue
            if lengthening_cost(a, r, u, d + leg_length(a, t, end) - r.leg[last]) < np.inf:
                fewest, shortest, task, after = r.tasks[u], d, t, last
    if task >= 0:
        insert(a, r, task, after)
    return task >= 0


def solve(recorder: Recorder, seed: int, learnt: object = None) -> None:
    """Offer the constructed plan; other tasks are inserted where they fit.

    Args:
        recorder: with the problem; takes the plan.
        seed: not used.
        learnt: not used.
    """
    a = recorder.problem.arrays
    routes = empty_routes(a)
    while give_nearest(a, routes) and not recorder.over():
        pass
    place_rest(a, routes)
    recorder.offer(routes)
    recorder.count()
