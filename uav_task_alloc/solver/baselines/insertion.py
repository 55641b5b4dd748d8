# SPDX-License-Identifier: Apache-2.0
"""Insertion in the order of announcement, each task where it costs least: no look back."""
from __future__ import annotations

import numpy as np

from uav_task_alloc.solver import routes as of
from uav_task_alloc.solver.insertion import place_all
from uav_task_alloc.solver.recorder import Recorder


def solve(recorder: Recorder, seed: int, learnt: object = None) -> None:
    """Offer the plan of insertion one by one."""
    a = recorder.problem.arrays
    routes = of.empty_routes(a)
    if a.ends > a.uavs:
        place_all(a, routes, np.arange(a.uavs, a.ends))
    recorder.offer(routes)
