# SPDX-License-Identifier: Apache-2.0
"""The searching bees' kernel: ruin and recreate under annealing, keeping the best."""
from __future__ import annotations

import math

from uav_task_alloc.kernel import kernel
from uav_task_alloc.solver.pool import Pool, collect
from uav_task_alloc.solver.rng import Chance, uniform
from uav_task_alloc.solver.routes import (
    EXCESS,
    TINY,
    Arrays,
    Routes,
    better,
    copy,
    cost,
    remove,
    step,
    total,
)
from uav_task_alloc.solver.ruin import Log, look_for_trouble, recreate, ruin, undo

LEAST, MOST = 0.1, 1000.0  # [m/m] cost of metres beyond range
DEARER, CHEAPER = 1.2, 0.9  # it changes so much at every look
LOOKS = 8  # of them in as many rounds as there are tasks


@kernel
def _look(a: Arrays, r: Routes, log: Log, pool: Pool) -> int:
    """Price left out tasks and metres beyond range anew; returns rounds until the next time."""
    if a.hard:  # dear enough that routes come back into range, cheap enough to pass through
        fine = r.sums[EXCESS] <= a.excess_floor + TINY
        for u in range(a.uavs):
            if fine:
                a.strain[u] = max(LEAST, a.strain[u] * CHEAPER)
            elif r.length[u] > a.reach[u] + TINY:
                a.strain[u] = min(MOST, a.strain[u] * DEARER)
    look_for_trouble(a, r, log)
    collect(a, r, pool)
    total(a, r)
    return max(20, a.price.size // LOOKS)


@kernel
def relieve(a: Arrays, r: Routes) -> None:
    """Leave out tasks of routes beyond range, always the one whose leg saves most. O(n)."""
    for u in range(a.uavs):
        while r.length[u] > a.reach[u] + TINY and r.tasks[u] > 0:
            t, out, most = r.next[u], r.next[u], -1.0
            while t < a.ends:
                saved = r.leg[r.prev[t]] + r.leg[t] - step(a, r.prev[t], r.next[t])
                if saved > most:
                    out, most = t, saved
                t = r.next[t]
            remove(a, r, out)


@kernel
def search(a: Arrays, r: Routes, best: Routes, log: Log, pool: Pool, mean: float,
           hot: float, cold: float, rounds: int, rng: Chance) -> int:
    """Anneal r from temperature `hot` to `cold` [m]; returns how often `best` got better.

    A round takes out about `mean` tasks and costs O(mean k).
    """
    temperature = hot
    falls = (cold / hot) ** (1.0 / max(1, rounds))
    found, log.hit[:] = 0, -1
    for i in range(rounds):
        log.size[4] -= 1
        if log.size[4] < 0:
            log.size[4] = _look(a, r, log, pool)
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
