# SPDX-License-Identifier: Apache-2.0
"""The published method as literally as it can be read: two Q chains over all steps, a bee colony.

Step i draws a UAV from Q_u^(i)[UAV of step i-1] and a task from Q_t^(i)[task of step i-1]; the UAV
flies on to the task. How the paper's gaps and slips are settled:
- 2.1 counts only target-to-target legs: the leg from the start is included.
- 2.4: the maximum is over the next action a'.
- 2.6 bootstraps from Q^(i+1), as 2.13 does.
- 2.7 is greedy if q < eps, so eps is the exploitation rate: `GREEDY_RATE`.
- 2.8 wants larger-is-better: 1/fit is used.
- 2.9, 2.10: Q is floored above 0, probabilities are proportional to it.
- No repeat rule is given: visited tasks are masked, the rest renormalised, and the maximum is over
  unvisited tasks only.
- 2.11: only the stepwise choice is kept, no A*.
- 2.14 does not say where the ranking coefficients enter: they scale alpha.
- The paper prints no parameters: those below are this file's own.
"""
from __future__ import annotations

import numpy as np

from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.solver import routes as of
from uav_task_alloc.solver.chance import Chance, chance, uniform
from uav_task_alloc.solver.kernel import kernel, part
from uav_task_alloc.solver.recorder import Recorder
from uav_task_alloc.solver.routes import Arrays, Floats, Ints, Routes, insert, lengthened, step

BEES, RANKED = 20, 5
ALPHA, GAMMA, GREEDY_RATE, FLOOR, K = 0.2, 0.5, 0.1, 0.01, 1.0
MOST_TASKS = 200  # the tables take 8 n^3 bytes


@part
def _draw(weight: Floats, n: int, rng: Chance) -> int:
    """The place drawn in proportion to its weight, or the heaviest; -1: all are 0."""
    total, best = 0.0, -1
    for i in range(n):
        total += weight[i]
        if weight[i] > 0.0 and (best < 0 or weight[i] > weight[best]):
            best = i
    if best < 0 or uniform(rng) < GREEDY_RATE:  # eq 2.7
        return best
    left = uniform(rng) * total  # eq 2.9, 2.10
    for i in range(n):
        left -= weight[i]
        if weight[i] > 0.0 and left < 0.0:
            return i
    return best


@kernel
def fly(a: Arrays, r: Routes, of_uav: Floats, of_task: Floats, weight: Floats, uavs: Ints,
        tasks: Ints, rng: Chance) -> int:
    """One bee; writes its choices to `uavs` and `tasks`, returns how many steps it made."""
    of.clear(a, r)
    n, u_before, t_before = a.price.size, 0, 0
    for i in range(n):
        done = False
        for u in range(a.uavs):
            weight[n + u] = of_uav[i, u_before, u]
        while not done:
            u = _draw(weight[n:], a.uavs, rng)
            if u < 0:
                break
            last = r.prev[a.ends + u]
            for t in range(n):
                weight[t] = 0.0
                if r.on[a.uavs + t] < 0 and a.may[u, t]:
                    more = step(a, last, a.uavs + t) + step(a, a.uavs + t, a.ends + u)
                    if lengthened(a, r, u, more - r.leg[last]) < np.inf:
                        weight[t] = of_task[i, t_before, t]
            t = _draw(weight, n, rng)
            if t < 0:
                weight[n + u] = 0.0  # nothing in its range: masked
                continue
            insert(a, r, a.uavs + t, last)
            uavs[i], tasks[i], u_before, t_before, done = u, t, u, t, True
        if not done:
            return i
    return n


@kernel
def learn(of_uav: Floats, of_task: Floats, uavs: Ints, tasks: Ints, steps: int, reward: float,
          share: float, open_: Ints) -> None:
    """Eq 2.6 along the steps of one bee, alpha scaled by its rank's share (eq 2.14)."""
    for t in range(open_.size):
        open_[t] = 1
    u_before, t_before = 0, 0
    for i in range(steps):
        u, t = uavs[i], tasks[i]
        open_[t] = 0
        u_next, t_next = 0.0, 0.0
        if i + 1 < steps:
            for v in range(of_uav.shape[2]):
                u_next = max(u_next, of_uav[i + 1, u, v])  # eq 2.13
            for s in range(open_.size):
                if open_[s]:
                    t_next = max(t_next, of_task[i + 1, t, s])
        q = of_uav[i, u_before, u]
        of_uav[i, u_before, u] = max(FLOOR, q + ALPHA * share * (reward + GAMMA * u_next - q))
        q = of_task[i, t_before, t]
        of_task[i, t_before, t] = max(FLOOR, q + ALPHA * share * (reward + GAMMA * t_next - q))
        u_before, t_before = u, t


def solve(recorder: Recorder, seed: int, learnt: object = None) -> None:
    """Generations of bees until the budget ends. Raises InvalidValue beyond MOST_TASKS."""
    a, n = recorder.problem.arrays, len(recorder.problem.tasks)
    if n > MOST_TASKS:
        raise InvalidValue('tasks', n, f'at most {MOST_TASKS} for chain_q_paper')
    if not n or not a.uavs:
        return
    rng, weight = chance(seed), np.zeros(n + a.uavs)
    of_uav, of_task = np.ones((n, a.uavs, a.uavs)), np.ones((n, n, n))
    bees = [(of.empty_routes(a), np.zeros(n, np.int64), np.zeros(n, np.int64))
            for _ in range(BEES)]
    shares = 0.5 ** np.arange(RANKED)
    while True:
        steps = [fly(a, r, of_uav, of_task, weight, u, t, rng) for r, u, t in bees]
        costs = [of.cost_now(a, r) for r, _, _ in bees]
        for rank, b in enumerate(np.argsort(costs, kind='stable')[:RANKED]):  # eq 2.14
            recorder.offer(bees[b][0])
            reward = K * min(costs) / max(costs[b], 1e-9)  # eq 2.8 with 1/fit
            learn(of_uav, of_task, bees[b][1], bees[b][2], steps[b], reward,
                  float(shares[rank] / shares.sum()), np.ones(n, np.int64))
        recorder.count(BEES)
        if recorder.over():
            return
