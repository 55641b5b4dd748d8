# SPDX-License-Identifier: Apache-2.0
"""Nearest first: the shortest leg from any route's end to any task left, again and again."""
from __future__ import annotations

import numpy as np

from uav_task_alloc.solver import routes as of
from uav_task_alloc.solver.insertion import place_all
from uav_task_alloc.solver.kernel import kernel
from uav_task_alloc.solver.recorder import Recorder
from uav_task_alloc.solver.routes import Arrays, Routes, insert, lengthened, step


@kernel
def nearest_first(a: Arrays, r: Routes) -> None:
    """Extend routes by the shortest possible leg until none is possible. O(n^2 m)."""
    while True:
        shortest, best, after = np.inf, -1, -1
        for u in range(a.uavs):
            end = a.ends + u
            last = r.prev[end]
            for t in range(a.uavs, a.ends):
                if r.on[t] >= 0 or not a.may[u, t - a.uavs]:
                    continue
                d = step(a, last, t)
                more = d + step(a, t, end) - r.leg[last]
                if d < shortest and lengthened(a, r, u, more) < np.inf:
                    shortest, best, after = d, t, last
        if best < 0:
            break
        insert(a, r, best, after)


def solve(recorder: Recorder, seed: int, learnt: object = None) -> None:
    """Offer the nearest-first plan."""
    a = recorder.problem.arrays
    routes = of.empty_routes(a)
    nearest_first(a, routes)
    left = np.flatnonzero(routes.on[a.uavs:a.ends] < 0) + a.uavs
    if left.size:
        place_all(a, routes, left)
    recorder.offer(routes)
