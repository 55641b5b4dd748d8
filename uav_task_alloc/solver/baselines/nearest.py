# SPDX-License-Identifier: Apache-2.0
"""The original allocation, shortest distance and balance: UAVs take their nearest task in turn.

Of the UAVs with the fewest tasks that can still take one, the one whose route ends nearest to a
task left flies on to it. The whole is one iteration.
"""
from __future__ import annotations

import numpy as np

from uav_task_alloc.kernel import kernel
from uav_task_alloc.solver import routes as of
from uav_task_alloc.solver.baselines.leg_lengths import place_rest
from uav_task_alloc.solver.recorder import Recorder
from uav_task_alloc.solver.routes import Arrays, Routes, insert, lengthened, step


@kernel
def give_nearest(a: Arrays, r: Routes) -> bool:
    """Extend a route of the fewest tasks by the shortest leg there is; whether any. O(n m)."""
    fewest, shortest, task, after = a.ends, np.inf, -1, -1
    for u in range(a.uavs):
        if r.tasks[u] > fewest:
            continue
        end = a.ends + u
        last = r.prev[end]
        for t in range(a.uavs, a.ends):
            if r.on[t] >= 0 or not a.may[u, t - a.uavs]:
                continue
            d = step(a, last, t)
            if r.tasks[u] == fewest and d >= shortest:
                continue
            if lengthened(a, r, u, d + step(a, t, end) - r.leg[last]) < np.inf:
                fewest, shortest, task, after = r.tasks[u], d, t, last
    if task >= 0:
        insert(a, r, task, after)
    return task >= 0


def solve(recorder: Recorder, seed: int, learnt: object = None) -> None:
    """Offer the plan that comes of it; what no route could end with goes in where it fits."""
    a = recorder.problem.arrays
    routes = of.empty_routes(a)
    while give_nearest(a, routes) and not recorder.over():
        pass
    place_rest(a, routes)
    recorder.offer(routes)
    recorder.count()
