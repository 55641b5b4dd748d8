# SPDX-License-Identifier: Apache-2.0
"""A sequential auction: the task that costs its best bidder least goes to it, and so on."""
from __future__ import annotations

from uav_task_alloc.solver import routes as of
from uav_task_alloc.solver.chance import chance
from uav_task_alloc.solver.insertion import cheapest_first
from uav_task_alloc.solver.recorder import Recorder


def solve(recorder: Recorder, seed: int, learnt: object = None) -> None:
    """Offer the auction's plan."""
    routes = of.empty_routes(recorder.problem.arrays)
    cheapest_first(recorder.problem.arrays, routes, chance(seed))
    recorder.offer(routes)
