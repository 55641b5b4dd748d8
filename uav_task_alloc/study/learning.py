# SPDX-License-Identifier: Apache-2.0
"""Ablation of learning: learnt against frozen Q tables, in the scouts and in the whole solver."""
from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.special import stdtrit

from uav_task_alloc.solver import chain_q, routes
from uav_task_alloc.solver.colony import ColonyParams
from uav_task_alloc.solver.problem import Limits, Problem, Rules, make_problem
from uav_task_alloc.solver.recorder import Recorder
from uav_task_alloc.solver.rng import rng_state
from uav_task_alloc.solver.routes import DISTANCE, Routes
from uav_task_alloc.solver.scouts import Scouts
from uav_task_alloc.solver.solve import load_kernels
from uav_task_alloc.study.instances import make_instance

_REFERENCE_FACTOR = 5.0  # budget of the reference plan over the budget of a run


def scouts(budget: float = 1.0, runs: int = 10, size: str = '8x50') -> None:
    """Print the mean gap of the scouts alone to the whole solver, with learnt and frozen Q.

    Args:
        budget: [s] of CPU time of each run.
        runs: number of instances.
        size: UAVs x tasks.
    """
    load_kernels()
    gaps: dict[bool, list[float]] = {True: [], False: []}
    incomplete = {True: 0, False: 0}  # plans that leave a task out
    for problem, seed in _problems(size, runs):
        best = _solve_cost(problem, _REFERENCE_FACTOR * budget, seed, ColonyParams())
        for learning in gaps:
            best_routes = _run_scouts(problem, budget, seed, learning)
            gaps[learning].append(100.0 * (best_routes.sums[DISTANCE] / best - 1.0))
            incomplete[learning] += int((best_routes.uav_of < 0).sum() > 0)
    for learning, name in ((False, 'frozen Q'), (True, 'learnt Q')):
        print(f'{name}: {np.mean(gaps[learning]):6.2f} % above the whole solver, '
              f'{incomplete[learning]} of {runs} plans left a task out')


def whole_solver(budget: float = 0.1, runs: int = 30, size: str = '20x200') -> None:
    """Print the paired gain of each form of learning over the whole solver without learning.

    Args:
        budget: [s] of CPU time of each run.
        runs: number of instances.
        size: UAVs x tasks.
    """
    load_kernels()
    plain = ColonyParams(scouts=0.0, bidding=False)
    forms = {
        'chained Q in scouts': replace(plain, scouts=0.05),
        'frozen Q in scouts': replace(plain, scouts=0.05, learning=False),
        'bids between ruin sizes': replace(plain, bidding=True),
        'all, as shipped': ColonyParams(),
    }
    gains: dict[str, list[float]] = {name: [] for name in forms}
    for problem, seed in _problems(size, runs):
        without = _solve_cost(problem, budget, seed, plain)
        for name, params in forms.items():
            cost = _solve_cost(problem, budget, seed, params)
            gains[name].append(100.0 * (1.0 - cost / without))
    for name, row in gains.items():
        mean, half = confidence(row)
        print(f'{name}: {mean:+.2f} +- {half:.2f} % shorter ({len(row)} pairs, 95 %)')


def confidence(row: Sequence[float]) -> tuple[float, float]:
    """Mean and half width of the 95 % confidence interval (Student's t); inf for one value."""
    n = len(row)
    if n < 2:
        return float(np.mean(row)), math.inf
    spread = float(np.std(row, ddof=1)) / math.sqrt(n)
    return float(np.mean(row)), float(stdtrit(n - 1, 0.975)) * spread


def _problems(size: str, runs: int) -> list[tuple[Problem, int]]:
    uavs, tasks = (int(each) for each in size.split('x'))
    instances = (make_instance(uavs, tasks, seed, one_base=seed % 2 == 0)
            for seed in range(1, runs + 1))
    return [(make_problem(each.uavs, each.tasks, {}, Limits(), Rules()), seed)
            for seed, each in enumerate(instances)]


def _solve_cost(problem: Problem, budget: float, seed: int, params: ColonyParams) -> float:
    """Cost [m] of the whole solver's plan: length and the prices of tasks left out."""
    recorder = Recorder(time.process_time, time.process_time(), budget, problem=problem)
    chain_q.solve(recorder, seed, None, params)
    return routes.total_cost(problem.arrays, recorder.best)


def _run_scouts(problem: Problem, budget: float, seed: int, learning: bool) -> Routes:
    colony = Scouts(problem, problem.arrays, rng_state(seed), None, learning)
    best, started = routes.empty_routes(problem.arrays), time.process_time()
    while time.process_time() - started < budget:
        colony.fly(best)
    return best
