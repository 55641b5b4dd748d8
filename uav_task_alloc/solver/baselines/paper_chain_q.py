# SPDX-License-Identifier: Apache-2.0
"""The published method, implemented literally: two Q chains over all steps, a bee colony.

Chain X1 holds the UAV of step i, chain X2 the task that it serves: step i draws a UAV from
Q_1^(i)[UAV of step i-1] and a task from Q_2^(i)[task of step i-1], which is appended to the UAV's
route. A table belongs to a position in the chains, not to a UAV's route. Gaps and errors of the
paper are resolved as follows:
- 2.1 counts only target-to-target legs: the leg from the start is included.
- 2.4: the maximum is over the next action a'.
- 2.6 bootstraps from Q^(i+1), as 2.13 does; after the last step the value is 0.
- 2.7 is greedy if q < eps, so eps is the exploitation rate: `greedy_rate`.
- 2.9, 2.10: Q is floored above 0, so that they are probabilities.
- No repeat rule is given: visited tasks are masked, the rest renormalised, and the maximum is over
  unvisited tasks only. Where ranges are hard, tasks beyond the UAV's are masked, too.
- 2.11: only the stepwise choice is kept, no A*.
- 2.14 does not say where the ranking coefficients enter: they scale alpha.
- The reward is k / fit at every step; as k has no scale, it is in units of the best fit so far.
- fit is eq 2.12; where ranges do not suffice, the cost of unassigned tasks is added to D.
- Before a plan is recorded, tasks that its bee could not reach are inserted where they fit, as all
  plans of this package serve what can be served; the bee is evaluated and learnt from without.
- The paper prints no parameters: those of `PaperSettings` were chosen here.
An iteration is a generation: every bee constructs one plan.
"""
from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.kernel import inline_kernel, inner_kernel, kernel
from uav_task_alloc.solver.baselines.judging import penalised_fit
from uav_task_alloc.solver.baselines.leg_lengths import place_rest
from uav_task_alloc.solver.recorder import Recorder
from uav_task_alloc.solver.rng import RngState, rng_state, uniform
from uav_task_alloc.solver.routes import (
    Arrays,
    Floats,
    Ints,
    Routes,
    clear,
    empty_routes,
    insert,
    leg_length,
    lengthening_cost,
)

MAX_TABLE_TASKS = 200  # the tables take 8 n^3 bytes


@dataclass(frozen=True, slots=True)
class PaperSettings:
    """Parameters that the paper does not print: the best of 48 sets at 8 x 50 (docs/solver.md)."""

    bees: int = 20  # in the swarm
    ranked: int = 5  # best bees, which are learnt from
    decay: float = 0.5  # ranking coefficient over that of the rank before
    k: float = 1.0  # reward coefficient
    alpha: float = 0.5  # learning rate
    gamma: float = 0.5  # discount
    greedy_rate: float = 0.9  # eps
    floor: float = 0.01  # least Q
    first: float = 0.01  # Q before anything is learnt


class Chains(NamedTuple):
    """Q tables by position: first index the step, second the choice before, third the choice."""

    uav: Floats  # (n, m, m) of X1
    task: Floats  # (n, n, n) of X2


class Swarm(NamedTuple):
    """The chains of each bee, and the sums of its routes."""

    uavs: Ints  # (bees, n) X1
    tasks: Ints  # (bees, n) X2
    steps: Ints  # (bees) how many steps it could make
    sums: Floats  # (bees, 5) as in Routes


class Scratch(NamedTuple):
    """Scratch arrays of a flight."""

    may_fly: NDArray[np.bool_]  # (m)
    open: NDArray[np.bool_]  # (n)
    p_uav: Floats  # (m)
    p_task: Floats  # (n)


def rank_coefficients(bees: int, decay: float) -> Floats:
    """Weights of the best, second, ... bee in eq 2.14; they fall by `decay` and sum to 1."""
    falling = decay ** np.arange(bees, dtype=np.float64)
    weights: Floats = falling / falling.sum()
    return weights


@inner_kernel
def probabilities(q: Floats, open_: NDArray[np.bool_], p: Floats) -> bool:
    """Write to p the probability of each open choice (eq 2.9, 2.10); whether one is open. O(n)."""
    total = 0.0
    for i in range(q.size):
        p[i] = q[i] if open_[i] else 0.0
        total += p[i]
    if total > 0.0:
        for i in range(q.size):
            p[i] /= total
    return total > 0.0


@inline_kernel
def _draw(p: Floats, greedy_rate: float, rng: RngState) -> int:
    """The likeliest choice if q < eps, else one by its probability (eq 2.7). O(n)."""
    best = 0
    for i in range(p.size):
        if p[i] > p[best]:
            best = i
    if uniform(rng) < greedy_rate:
        return best
    left = uniform(rng)
    for i in range(p.size):
        left -= p[i]
        if p[i] > 0.0 and left < 0.0:
            return i
    return best


@inner_kernel
def _open_tasks(a: Arrays, r: Routes, u: int, open_: NDArray[np.bool_]) -> None:
    """Write to open_ (n) the tasks that UAV u may append: unvisited, allowed, in range. O(n)."""
    last = r.prev[a.ends + u]
    for t in range(open_.size):
        open_[t] = False
        if r.uav_of[a.uavs + t] < 0 and a.compatible[u, t]:
            more = leg_length(a, last, a.uavs + t) + leg_length(a, a.uavs + t, a.ends + u)
            more -= r.leg[last]
            open_[t] = lengthening_cost(a, r, u, more) < np.inf


@inner_kernel
def fly_bee(a: Arrays, r: Routes, uavs: Ints, tasks: Ints, q: Chains, greedy_rate: float,
            scratch: Scratch, rng: RngState) -> int:
    """Construct the chains of one bee; returns the number of steps. O(n (n + m))."""
    clear(a, r)
    u, t = 0, 0  # there is no choice before the first: its tables have one row that counts
    for i in range(a.unassigned_cost.size):
        scratch.may_fly[:] = True
        while True:
            if not probabilities(q.uav[i, u], scratch.may_fly, scratch.p_uav):
                return i
            v = _draw(scratch.p_uav, greedy_rate, rng)
            _open_tasks(a, r, v, scratch.open)
            if probabilities(q.task[i, t], scratch.open, scratch.p_task):
                break
            scratch.may_fly[v] = False
        u, t = v, _draw(scratch.p_task, greedy_rate, rng)
        insert(a, r, a.uavs + t, r.prev[a.ends + u])
        uavs[i], tasks[i] = u, t
    return a.unassigned_cost.size


@kernel
def fly_all(a: Arrays, r: Routes, swarm: Swarm, q: Chains, greedy_rate: float, scratch: Scratch,
            rng: RngState) -> None:
    """Fly all bees of a generation; r is scratch. O(bees n (n + m))."""
    for b in range(swarm.steps.size):
        swarm.steps[b] = fly_bee(a, r, swarm.uavs[b], swarm.tasks[b], q, greedy_rate, scratch, rng)
        for i in range(r.sums.size):
            swarm.sums[b, i] = r.sums[i]


@kernel
def trace(a: Arrays, r: Routes, uavs: Ints, tasks: Ints, steps: int) -> None:
    """Write the routes of these chains to r. O(n)."""
    clear(a, r)
    for i in range(steps):
        insert(a, r, a.uavs + tasks[i], r.prev[a.ends + uavs[i]])


@kernel
def learn(q: Chains, uavs: Ints, tasks: Ints, steps: int, reward: float, rate: float,
          gamma: float, floor: float, unvisited: NDArray[np.bool_]) -> None:
    """Eq 2.6 and 2.13 along both chains of one bee; `rate` is alpha times its rank's (eq 2.14).

    O(n (n + m)); `unvisited` is scratch, (n).
    """
    unvisited[:] = True
    u, t = 0, 0
    for i in range(steps):
        v, s = uavs[i], tasks[i]
        unvisited[s] = False
        next_u, next_t = 0.0, 0.0
        if i + 1 < steps:
            for w in range(q.uav.shape[2]):
                next_u = max(next_u, q.uav[i + 1, v, w])
            for w in range(q.task.shape[2]):
                if unvisited[w]:
                    next_t = max(next_t, q.task[i + 1, s, w])
        old = q.uav[i, u, v]
        q.uav[i, u, v] = max(floor, old + rate * (reward + gamma * next_u - old))  # X1
        old = q.task[i, t, s]
        q.task[i, t, s] = max(floor, old + rate * (reward + gamma * next_t - old))  # X2
        u, t = v, s


def _share(best: float, fit: float) -> float:
    """best / fit in [0, 1], also where the best fit is 0 or nothing is served."""
    if fit <= best:
        return 1.0
    return best / fit


def solve(recorder: Recorder, seed: int, learnt: object = None,
          settings: PaperSettings | None = None) -> None:
    """Run generations of bees until the budget ends.

    Args:
        recorder: with the problem; takes the plans.
        seed: of the random numbers.
        learnt: not used.
        settings: None: the defaults.

    Raises:
        InvalidValue: there are more than MAX_TABLE_TASKS tasks.
    """
    problem, chosen, rng = recorder.problem, settings or PaperSettings(), rng_state(seed)
    a, n, m = problem.arrays, len(problem.tasks), len(problem.uavs)
    if n > MAX_TABLE_TASKS:
        raise InvalidValue('tasks', n, f'at most {MAX_TABLE_TASKS} for paper_chain_q')
    if not n or not m:
        return
    q = Chains(np.full((n, m, m), chosen.first), np.full((n, n, n), chosen.first))
    scratch = Scratch(np.empty(m, np.bool_), np.empty(n, np.bool_), np.empty(m), np.empty(n))
    swarm = Swarm(np.zeros((chosen.bees, n), np.int64), np.zeros((chosen.bees, n), np.int64),
                  np.zeros(chosen.bees, np.int64), np.empty((chosen.bees, 5)))
    routes, best = empty_routes(a), math.inf
    coefficients = rank_coefficients(min(chosen.ranked, chosen.bees), chosen.decay).tolist()
    while True:
        fly_all(a, routes, swarm, q, chosen.greedy_rate, scratch, rng)
        fits = [penalised_fit(problem, sums) for sums in swarm.sums]
        ranking = sorted(range(chosen.bees), key=fits.__getitem__)  # rank bidding
        if not recorder.history or fits[ranking[0]] < best:
            best = fits[ranking[0]]
            trace(a, routes, swarm.uavs[ranking[0]], swarm.tasks[ranking[0]],
                  swarm.steps[ranking[0]])
            place_rest(a, routes)
            recorder.offer(routes)
        for b, coefficient in zip(ranking, coefficients, strict=False):
            reward = chosen.k * _share(best, fits[b])
            learn(q, swarm.uavs[b], swarm.tasks[b], swarm.steps[b], reward,
                  chosen.alpha * coefficient, chosen.gamma, chosen.floor, scratch.open)  # eq 2.14
        recorder.count()
        if recorder.over():
            return
