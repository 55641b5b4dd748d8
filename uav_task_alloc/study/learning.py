# SPDX-License-Identifier: Apache-2.0
"""Does learning pay? Learnt against frozen Q, in the constructing bees and in the whole solver."""
from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy import stats

from uav_task_alloc.solver import chain_q, routes as of
from uav_task_alloc.solver.colony import ColonyParams
from uav_task_alloc.solver.problem import Limits, Problem, Rules, make_problem
from uav_task_alloc.solver.recorder import Recorder
from uav_task_alloc.solver.rng import chance
from uav_task_alloc.solver.routes import DISTANCE, Routes
from uav_task_alloc.solver.scouts import Scouts
from uav_task_alloc.solver.solve import warm_up
from uav_task_alloc.study.instances import make_instance

_REFERENCE = 5.0  # times the budget that the whole solver gets for the length to compare with


def scouts(budget: float = 1.0, runs: int = 10, size: str = '8x50') -> None:
    """Constructing bees alone, no search: mean gap to the whole solver, learnt and frozen."""
    warm_up()
    gaps: dict[bool, list[float]] = {True: [], False: []}
    short = {True: 0, False: 0}
    for problem, seed in _problems(size, runs):
        best = _search(problem, _REFERENCE * budget, seed, ColonyParams())
        for learning in gaps:
            found = _scouts_alone(problem, budget, seed, learning)
            gaps[learning].append(100.0 * (found.sums[DISTANCE] / best - 1.0))
            short[learning] += int((found.on < 0).sum() > 0)
    for learning, name in ((False, 'frozen Q'), (True, 'learnt Q')):
        print(f'{name}: {np.mean(gaps[learning]):6.2f} % above the whole solver, '
              f'{short[learning]} of {runs} plans left a task out')


def whole_solver(budget: float = 0.1, runs: int = 30, size: str = '20x200') -> None:
    """Forms of learning in the whole solver, each against the solver without: paired gain."""
    warm_up()
    plain = ColonyParams(scouts=0.0, bids=False)
    forms = {
        'chained Q in scouts': replace(plain, scouts=0.05),
        'frozen Q in scouts': replace(plain, scouts=0.05, learning=False),
        'bids between ruin sizes': replace(plain, bids=True),
        'all, as shipped': ColonyParams(),
    }
    gains: dict[str, list[float]] = {name: [] for name in forms}
    for problem, seed in _problems(size, runs):
        without = _search(problem, budget, seed, plain)
        for name, habits in forms.items():
            gains[name].append(100.0 * (1.0 - _search(problem, budget, seed, habits) / without))
    for name, row in gains.items():
        mean, half = confidence(row)
        print(f'{name}: {mean:+.2f} +- {half:.2f} % shorter ({len(row)} pairs, 95 %)')


def confidence(row: Sequence[float]) -> tuple[float, float]:
    """Mean and half the 95 % confidence interval (Student)."""
    n = len(row)
    if n < 2:
        return float(np.mean(row)), math.inf
    spread = float(np.std(row, ddof=1)) / math.sqrt(n)
    return float(np.mean(row)), float(stats.t.ppf(0.975, n - 1)) * spread


def _problems(size: str, runs: int) -> list[tuple[Problem, int]]:
    uavs, tasks = (int(each) for each in size.split('x'))
    made = (make_instance(uavs, tasks, seed, one_base=seed % 2 == 0)
            for seed in range(1, runs + 1))
    return [(make_problem(each.uavs, each.tasks, {}, Limits(), Rules()), seed)
            for seed, each in enumerate(made)]


def _search(problem: Problem, budget: float, seed: int, habits: ColonyParams) -> float:
    """Length [m] that the whole solver finds, what it leaves out at its price added."""
    recorder = Recorder(problem, time.process_time, time.process_time(), budget)
    chain_q.solve(recorder, seed, None, habits)
    return of.cost(problem.arrays, recorder.best)


def _scouts_alone(problem: Problem, budget: float, seed: int, learning: bool) -> Routes:
    swarm = Scouts(problem, problem.arrays, chance(seed), None, learning)
    best, began = of.empty_routes(problem.arrays), time.process_time()
    while time.process_time() - began < budget:
        swarm.fly(best)
    return best
