# SPDX-License-Identifier: Apache-2.0
"""The product: bees that ruin and recreate the recorder's best until the budget ends."""
from __future__ import annotations

from typing import Any

from uav_task_alloc.solver.chance import chance
from uav_task_alloc.solver.recorder import Recorder
from uav_task_alloc.solver.ruin import empty_log
from uav_task_alloc.solver.search import search

MEAN = 10.0
HOT, COLD = 10.0, 0.1
WARM_HOT, WARM_COLD = 0.3, 0.02


def solve(recorder: Recorder, seed: int, warm: Any = None) -> Any:
    """Anneal from the recorder's best."""
    problem, a = recorder.problem, recorder.problem.arrays
    if not problem.tasks or a.uavs == 0:
        return None
    rng, log, routes, rounds = chance(seed), empty_log(a), recorder.start(), 16
    hot = (WARM_HOT if warm is not None else HOT) * problem.scale
    cold = (WARM_COLD if warm is not None else COLD) * problem.scale
    before, since = recorder.spent(), recorder.elapsed()
    first = before
    while not recorder.over():
        done = (before - first) / (1.0 - first)
        t = hot * (cold / hot) ** done
        if search(a, routes, recorder.best, log, MEAN, t, t * 0.97, rounds, rng):
            recorder.note()
        recorder.iterations += rounds
        before, now = recorder.spent(), recorder.elapsed()
        aim = min(0.005, recorder.budget / 25)
        rounds = max(4, min(100_000, int(rounds * min(2.0, aim / max(1e-6, now - since)))))
        since = now
    return None
