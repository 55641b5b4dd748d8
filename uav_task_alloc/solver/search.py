# SPDX-License-Identifier: Apache-2.0
"""Ruin and recreate with simulated annealing: the kernel of employed and onlooker bees."""
from __future__ import annotations

import math

from uav_task_alloc.kernel import inner_kernel, kernel
from uav_task_alloc.solver.pool import Pool, collect
from uav_task_alloc.solver.rng import RngState, uniform
from uav_task_alloc.solver.routes import (
    EXCESS,
    TINY,
    Arrays,
    Routes,
    copy_into,
    is_better_kernel,
    leg_length,
    remove,
    total_cost_kernel,
    update_sums,
)
from uav_task_alloc.solver.ruin import (
    LEAST_ROUNDS,
    MOST_PENALTY,
    RuinLog,
    list_unassigned_and_overrange,
    recreate,
    ruin,
    undo,
)

MIN_RANGE_PENALTY = 0.1  # [m/m]
PENALTY_GROWTH, PENALTY_DECAY = 1.2, 0.9  # factors of a range penalty at each update
PENALTY_UPDATES = 8  # updates in as many rounds as there are tasks


@inner_kernel
def _update_penalties(a: Arrays, r: Routes, log: RuinLog, pool: Pool) -> int:
    """Adapt penalties and costs of unassigned tasks; returns rounds to the next update. O(n)."""
    if a.hard:  # high enough that routes return into range, low enough to pass through
        in_range = r.sums[EXCESS] <= a.excess_floor + TINY
        for u in range(a.uavs):
            if in_range:
                a.range_penalty[u] = max(MIN_RANGE_PENALTY, a.range_penalty[u] * PENALTY_DECAY)
            elif r.length[u] > a.range_left[u] + TINY:
                a.range_penalty[u] = min(log.settings[MOST_PENALTY],
                                         a.range_penalty[u] * PENALTY_GROWTH)
    list_unassigned_and_overrange(a, r, log)
    collect(a, r, pool)
    update_sums(a, r)
    return max(int(log.settings[LEAST_ROUNDS]), a.unassigned_cost.size // PENALTY_UPDATES)


@kernel
def trim_to_range(a: Arrays, r: Routes) -> None:
    """Remove tasks of routes beyond range, always the one that saves most. O(n^2) at worst."""
    for u in range(a.uavs):
        while r.length[u] > a.range_left[u] + TINY and r.tasks[u] > 0:
            t, worst, most = r.next[u], r.next[u], -1.0
            while t < a.ends:
                saved = r.leg[r.prev[t]] + r.leg[t] - leg_length(a, r.prev[t], r.next[t])
                if saved > most:
                    worst, most = t, saved
                t = r.next[t]
            remove(a, r, worst)


@kernel
def search(a: Arrays, r: Routes, best: Routes, log: RuinLog, pool: Pool, mean: float,
           start: float, end: float, rounds: int, rng: RngState) -> int:
    """Anneal r from temperature `start` to `end` [m]; returns how often `best` improved.

    A round removes about `mean` tasks and costs O(mean k).
    """
    temperature = start
    decay = (end / start) ** (1.0 / max(1, rounds))
    improvements, log.last_ruined[:] = 0, -1
    for i in range(rounds):
        log.counts[4] -= 1
        if log.counts[4] < 0:
            log.counts[4] = _update_penalties(a, r, log, pool)
        before = total_cost_kernel(a, r)
        ruin(a, r, log, mean, i, rng)
        limit = before - temperature * math.log(1.0 - uniform(rng))
        recreate(a, r, log, limit, rng)
        if total_cost_kernel(a, r) < limit:
            if is_better_kernel(a, r, best):
                copy_into(r, best)
                improvements += 1
        else:
            undo(a, r, log)
        temperature *= decay
    return improvements
