# SPDX-License-Identifier: Apache-2.0
"""Q-learning by a single agent for all UAVs: one table of legs, one plan an episode.

The state is where the routes end now; an action is a leg from one of these ends to an unvisited
task, and Q[end -> task] its value, so that one table serves any number of UAVs. The reward of a
leg is minus its cost: metres added, with the penalty of metres beyond range, in mean leg lengths
to the nearest neighbour. A leg never flown is worth minus its length: without learning this is
nearest first. Actions are chosen as eq 2.7 says, eps being the exploitation rate. An iteration is
an episode.
"""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uav_task_alloc.kernel import kernel
from uav_task_alloc.solver.baselines.leg_lengths import all_leg_lengths, place_rest
from uav_task_alloc.solver.recorder import Recorder
from uav_task_alloc.solver.rng import RngState, rng_state, uniform
from uav_task_alloc.solver.routes import (
    Arrays,
    Floats,
    Routes,
    clear,
    empty_routes,
    insert,
    leg_length,
    lengthening_cost,
)


@dataclass(frozen=True, slots=True)
class QLearningSettings:
    """Parameters of the learning."""

    alpha: float = 0.1  # learning rate
    gamma: float = 0.8  # discount
    greedy_rate: float = 0.98  # eps of eq 2.7


@kernel
def episode(a: Arrays, r: Routes, q: Floats, unit: float, alpha: float, gamma: float,
            greedy_rate: float, rng: RngState) -> None:
    """Construct one plan and learn from each leg; q is (m + n, n), `unit` [m]. O(n^2 m)."""
    clear(a, r)
    before, then, reward = -1, -1, 0.0  # the leg flown last
    while True:
        explores, legs = uniform(rng) >= greedy_rate, 0
        best, best_t, best_u, any_t, any_u = -np.inf, -1, -1, -1, -1
        for u in range(a.uavs):
            last = r.prev[a.ends + u]
            for i in range(q.shape[1]):
                t = a.uavs + i
                if r.uav_of[t] >= 0 or not a.compatible[u, i]:
                    continue
                if q[last, i] <= best and not explores:
                    continue
                delta = leg_length(a, last, t) + leg_length(a, t, a.ends + u) - r.leg[last]
                if not lengthening_cost(a, r, u, delta) < np.inf:
                    continue
                if q[last, i] > best:
                    best, best_t, best_u = q[last, i], t, u
                if explores:
                    legs += 1
                    if uniform(rng) * legs < 1.0:
                        any_t, any_u = t, u
        if before >= 0:
            ahead = best if best_t >= 0 else 0.0
            q[before, then] += alpha * (reward + gamma * ahead - q[before, then])  # eq 2.5
        if best_t < 0:
            return
        t, u = (any_t, any_u) if explores else (best_t, best_u)  # eq 2.7
        last = r.prev[a.ends + u]
        delta = leg_length(a, last, t) + leg_length(a, t, a.ends + u) - r.leg[last]
        reward = -lengthening_cost(a, r, u, delta) / unit
        before, then = last, t - a.uavs
        insert(a, r, t, last)


def solve(recorder: Recorder, seed: int, learnt: object = None,
          settings: QLearningSettings | None = None) -> None:
    """Run episodes until the budget ends.

    Args:
        recorder: with the problem; takes the plans.
        seed: of the random numbers.
        learnt: not used.
        settings: None: the defaults.

    Raises:
        InvalidValue: there are too many tasks for a table of leg lengths.
    """
    problem, chosen, rng = recorder.problem, settings or QLearningSettings(), rng_state(seed)
    a = problem.arrays
    if not problem.uavs or not problem.tasks:
        return
    q = -all_leg_lengths(problem).onward / problem.scale
    routes = empty_routes(a)
    while True:
        episode(a, routes, q, problem.scale, chosen.alpha, chosen.gamma, chosen.greedy_rate, rng)
        place_rest(a, routes)
        recorder.offer(routes)
        recorder.count()
        if recorder.over():
            return
