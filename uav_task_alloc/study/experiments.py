# SPDX-License-Identifier: Apache-2.0
"""The settings of the study, full and quick, and the jobs of each figure and table."""
from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product
from types import MappingProxyType

from uav_task_alloc.solver.baselines.paper_chain_q import MAX_TABLE_TASKS
from uav_task_alloc.study import trials
from uav_task_alloc.study.campaign import Job

ITERATIVE = 'paper_chain_q', 'q_learning', 'abc', 'ga', 'chain_q'  # the solvers of figure 2
CONSTRUCTIVE = 'nearest', 'auction', 'cbba'  # build one plan and end
_CONSTRUCTION = 0.2  # [s] of CPU, about
# iterations in a CPU second at 50 tasks, and the power of the tasks with which they fall: the
# budgets are iterations that take about equal time, so plans do not depend on the machine
_SPEED: Mapping[str, tuple[float, float]] = MappingProxyType({
    'chain_q': (220_000.0, 0.0), 'paper_chain_q': (1100.0, 1.4), 'q_learning': (5700.0, 1.7),
    'abc': (1600.0, 1.0), 'ga': (700.0, 0.45)})


@dataclass(frozen=True, slots=True)
class Experiments:
    """The settings of a study, stored in its settings.json."""

    seed: int  # of all random numbers
    scene: tuple[int, int, int] = (4, 30, 6)  # UAVs, tasks, domes of all figures
    runs: int = 10  # averaged in a curve
    coefficients: tuple[float, ...] = (0.1, 0.3, 1.0, 3.0, 10.0, 30.0)  # k of figure 1
    effort: float = 3.0  # [s] of CPU, about: a run of a figure
    sizes: tuple[tuple[int, int], ...] = (
        (4, 20), (8, 50), (8, 100), (20, 200), (50, 500), (100, 1000))  # UAVs, tasks of the tables
    instances: int = 5  # of each size
    table_effort: float = 1.5  # [s] of CPU, about: a run of a table
    events: int = 25  # in a row of the table of warm starts
    event_rounds: int = 2000  # iterations of chain_q, about 10 ms

    def figure_scene(self) -> dict[str, int]:
        """Arguments of make_dome_scene for the instance of all figures."""
        uavs, tasks, domes = self.scene
        return {'uavs': uavs, 'tasks': tasks, 'domes': domes, 'seed': self.seed}


def quick(seed: int) -> Experiments:
    """Return settings for minutes instead of half an hour; the same figures and tables.

    Args:
        seed: of all random numbers.

    Returns:
        Fewer runs, sizes and instances, each of less effort.
    """
    return Experiments(seed, runs=10, coefficients=(0.1, 1.0, 10.0), effort=0.6,
                   sizes=((4, 20), (8, 50), (20, 200), (100, 1000)), instances=2,
                   table_effort=0.5, events=5)


def iterations(solver: str, tasks: int, seconds: float) -> int:
    """The budget of a solver that takes about so many CPU seconds.

    A constructive solver gets a budget that it never reaches.
    """
    if solver in CONSTRUCTIVE:
        return 10 ** 9
    speed, power = _SPEED[solver]
    return max(10, round(seconds * speed * math.pow(50.0 / tasks, power)))


def jobs(settings: Experiments) -> list[Job]:
    """Return all jobs of the study.

    Args:
        settings: of the study.

    Returns:
        In the order of figures and tables.
    """
    return [*coefficient_jobs(settings).values(), *convergence_jobs(settings).values(),
            *allocation_jobs(settings).values(), *size_jobs(settings).values(),
            *event_jobs(settings).values()]


def coefficient_jobs(settings: Experiments) -> dict[tuple[float, int], Job]:
    """Jobs of figure 1, by reward coefficient k and run."""
    scene, solver = settings.figure_scene(), 'paper_chain_q'
    rounds = iterations(solver, scene['tasks'], settings.effort)
    return {(k, run): Job(f'coefficient-{k:g}-{run}', trials.converge, {
        'scene': scene, 'solver': solver, 'seed': settings.seed + run, 'iterations': rounds,
        'k': k}, settings.effort)
        for k, run in product(settings.coefficients, range(settings.runs))}


def convergence_jobs(settings: Experiments) -> dict[tuple[str, int], Job]:
    """Jobs of figure 2, by solver and run."""
    scene = settings.figure_scene()
    return {(solver, run): Job(f'convergence-{solver}-{run}', trials.converge, {
        'scene': scene, 'solver': solver, 'seed': settings.seed + run,
        'iterations': iterations(solver, scene['tasks'], settings.effort)}, settings.effort)
        for solver, run in product(ITERATIVE, range(settings.runs))}


def allocation_jobs(settings: Experiments) -> dict[str, Job]:
    """Jobs of figure 3, by solver."""
    scene = settings.figure_scene()
    return {solver: Job(f'allocation-{solver}', trials.solve_scene, {
        'scene': scene, 'solver': solver, 'seed': settings.seed,
        'iterations': iterations(solver, scene['tasks'], settings.effort)}, settings.effort)
        for solver in ('paper_chain_q', 'chain_q')}


def size_jobs(settings: Experiments) -> dict[tuple[int, int, int, str], Job]:
    """Jobs of the table over sizes, by UAVs, tasks, instance and solver.

    The solver '' is the reference: chain_q with another seed and four times the iterations.
    """
    jobs = {}
    for (uavs, tasks), instance, solver in product(settings.sizes, range(settings.instances),
                                                   (*CONSTRUCTIVE, *ITERATIVE, '')):
        if solver == 'paper_chain_q' and tasks > MAX_TABLE_TASKS:
            continue
        effort = settings.table_effort * (1.0 if solver else 4.0)
        jobs[uavs, tasks, instance, solver] = Job(
            f'size-{uavs}-{tasks}-{instance}-{solver or "reference"}', trials.converge, {
                'scene': {'uavs': uavs, 'tasks': tasks, 'seed': settings.seed + instance},
                'solver': solver or 'chain_q', 'seed': instance if solver else 1000 + instance,
                'iterations': iterations(solver or 'chain_q', tasks, effort)},
            _CONSTRUCTION if solver in CONSTRUCTIVE else effort)
    return jobs


def event_jobs(settings: Experiments) -> dict[tuple[int, int, str], Job]:
    """Jobs of the table of events, by UAVs, tasks and kind of start."""
    return {(uavs, tasks, kind): Job(f'events-{uavs}-{tasks}-{kind}', trials.events_trial, {
        'scene': {'uavs': uavs, 'tasks': tasks, 'seed': settings.seed,
                  'one_base': int(kind == 'one base')},
        'seed': settings.seed, 'iterations': settings.event_rounds, 'count': settings.events},
        0.35 * settings.events)
        for (uavs, tasks), kind in product(settings.sizes, ('spread', 'one base'))}
