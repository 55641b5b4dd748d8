# SPDX-License-Identifier: Apache-2.0
"""The searching bees' kernel: ruin and recreate under annealing, keeping the best."""
from __future__ import annotations

import math

from uav_task_alloc.solver.chance import Chance, uniform
from uav_task_alloc.solver.kernel import kernel
from uav_task_alloc.solver.routes import Arrays, Routes, better, copy, cost, total
from uav_task_alloc.solver.ruin import Log, look_for_left, recreate, ruin, undo


@kernel
def search(a: Arrays, r: Routes, best: Routes, log: Log, mean: float, hot: float, cold: float,
           rounds: int, rng: Chance) -> int:
    """Anneal r from temperature `hot` to `cold` [m]; returns how often `best` got better.

    A round takes out about `mean` tasks and costs O(mean k).
    """
    temperature = hot
    falls = (cold / hot) ** (1.0 / max(1, rounds))
    found, log.hit[:] = 0, -1
    look_for_left(a, r, log)
    total(a, r)
    for i in range(rounds):
        before = cost(a, r)
        ruin(a, r, log, mean, i, rng)
        recreate(a, r, log, rng)
        if cost(a, r) < before - temperature * math.log(1.0 - uniform(rng)):
            if better(a, r, best):
                copy(r, best)
                found += 1
        else:
            undo(a, r, log)
        temperature *= falls
    return found
