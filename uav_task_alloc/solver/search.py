# SPDX-License-Identifier: Apache-2.0
"""The searching bees' kernel: ruin and recreate under annealing, keeping the best."""
from __future__ import annotations

import math

from uav_task_alloc.solver.chance import Chance, uniform
from uav_task_alloc.solver.kernel import kernel
from uav_task_alloc.solver.routes import EXCESS, TINY, Arrays, Routes, better, copy, cost, total
from uav_task_alloc.solver.ruin import Log, look_for_trouble, recreate, ruin, undo

LEAST, MOST = 0.1, 1000.0  # [m/m] cost of metres beyond range
DEARER, CHEAPER = 1.2, 0.9  # it changes so much at every look
LOOKS = 8  # of them in as many rounds as there are tasks


@kernel
def _look(a: Arrays, r: Routes, log: Log) -> int:
    """Price left out tasks and metres beyond range anew; returns rounds until the next time."""
    look_for_trouble(a, r, log)
    total(a, r)
    if a.hard:  # dear enough that routes come back into range, cheap enough to pass through
        over = r.sums[EXCESS] > a.excess_floor + TINY
        a.strain[0] = min(MOST, max(LEAST, a.strain[0] * (DEARER if over else CHEAPER)))
    return max(20, a.price.size // LOOKS)


@kernel
def search(a: Arrays, r: Routes, best: Routes, log: Log, mean: float, hot: float, cold: float,
           rounds: int, rng: Chance) -> int:
    """Anneal r from temperature `hot` to `cold` [m]; returns how often `best` got better.

    A round takes out about `mean` tasks and costs O(mean k).
    """
    temperature = hot
    falls = (cold / hot) ** (1.0 / max(1, rounds))
    found, log.hit[:] = 0, -1
    for i in range(rounds):
        log.size[4] -= 1
        if log.size[4] < 0:
            log.size[4] = _look(a, r, log)
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
