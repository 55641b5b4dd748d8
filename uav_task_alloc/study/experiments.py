# SPDX-License-Identifier: Apache-2.0
"""What the study runs: the jobs behind each figure and table, in full and quick."""
from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product
from types import MappingProxyType

from uav_task_alloc.solver.baselines.paper_chain_q import MOST_TASKS
from uav_task_alloc.study import trials
from uav_task_alloc.study.campaign import Job

LEARNERS = 'paper_chain_q', 'q_learning', 'abc', 'ga', 'chain_q'  # of figure 2
FINITE = 'nearest', 'auction', 'cbba'  # end by themselves
BRIEF = 0.2  # [s] about what they take
# iterations in a CPU second at 50 tasks, and the power of the tasks with which they fall: about
# equal time for all, and yet the same plans however fast the machine is
SPEED: Mapping[str, tuple[float, float]] = MappingProxyType({
    'chain_q': (220_000.0, 0.0), 'paper_chain_q': (1100.0, 1.4), 'q_learning': (5700.0, 1.7),
    'abc': (1600.0, 1.0), 'ga': (700.0, 0.45)})


@dataclass(frozen=True, slots=True)
class Experiments:
    """How much of it."""

    seed: int
    scene: tuple[int, int, int] = (4, 30, 6)  # UAVs, tasks, domes of all figures
    runs: int = 10  # behind a mean curve
    coefficients: tuple[float, ...] = (0.1, 0.3, 1.0, 3.0, 10.0, 30.0)  # k of figure 1
    effort: float = 3.0  # [s] about, a run behind a figure
    sizes: tuple[tuple[int, int], ...] = (
        (4, 20), (8, 50), (8, 100), (20, 200), (50, 500), (100, 1000))
    instances: int = 5  # a size
    table_effort: float = 1.5  # [s] about, a run behind a table
    events: int = 25
    event_rounds: int = 2000  # of chain_q, some 10 ms

    def pictured(self) -> dict[str, int]:
        """The instance of all figures."""
        uavs, tasks, domes = self.scene
        return {'uavs': uavs, 'tasks': tasks, 'domes': domes, 'seed': self.seed}


def quick(seed: int) -> Experiments:
    """Minutes instead of half an hour; the same figures and tables."""
    return Experiments(seed, runs=10, coefficients=(0.1, 1.0, 10.0), effort=0.6,
                   sizes=((4, 20), (8, 50), (20, 200), (100, 1000)), instances=2,
                   table_effort=0.5, events=5)


def iterations(solver: str, tasks: int, seconds: float) -> int:
    """The budget that takes about so many CPU seconds; out of reach for who ends by itself."""
    if solver in FINITE:
        return 10 ** 9
    speed, power = SPEED[solver]
    return max(10, round(seconds * speed * math.pow(50.0 / tasks, power)))


def jobs(program: Experiments) -> list[Job]:
    """All of them."""
    return [*coefficient_jobs(program).values(), *convergence_jobs(program).values(),
            *allocation_jobs(program).values(), *size_jobs(program).values(),
            *event_jobs(program).values()]


def coefficient_jobs(program: Experiments) -> dict[tuple[float, int], Job]:
    """Figure 1, by k and run."""
    scene, solver = program.pictured(), 'paper_chain_q'
    rounds = iterations(solver, scene['tasks'], program.effort)
    return {(k, run): Job(f'coefficient-{k:g}-{run}', trials.converge, {
        'scene': scene, 'solver': solver, 'seed': program.seed + run, 'iterations': rounds,
        'k': k}, program.effort)
        for k, run in product(program.coefficients, range(program.runs))}


def convergence_jobs(program: Experiments) -> dict[tuple[str, int], Job]:
    """Figure 2, by solver and run."""
    scene = program.pictured()
    return {(solver, run): Job(f'convergence-{solver}-{run}', trials.converge, {
        'scene': scene, 'solver': solver, 'seed': program.seed + run,
        'iterations': iterations(solver, scene['tasks'], program.effort)}, program.effort)
        for solver, run in product(LEARNERS, range(program.runs))}


def allocation_jobs(program: Experiments) -> dict[str, Job]:
    """Figure 3, by solver."""
    scene = program.pictured()
    return {solver: Job(f'allocation-{solver}', trials.allocate, {
        'scene': scene, 'solver': solver, 'seed': program.seed,
        'iterations': iterations(solver, scene['tasks'], program.effort)}, program.effort)
        for solver in ('paper_chain_q', 'chain_q')}


def size_jobs(program: Experiments) -> dict[tuple[int, int, int, str], Job]:
    """The table over sizes, by UAVs, tasks, instance and solver; '' is the plan to compare with.

    That is the shorter of all: chain_q again, another seed, four times the iterations.
    """
    made = {}
    for (uavs, tasks), nth, solver in product(program.sizes, range(program.instances),
                                              (*FINITE, *LEARNERS, '')):
        if solver == 'paper_chain_q' and tasks > MOST_TASKS:
            continue
        effort = program.table_effort * (1.0 if solver else 4.0)
        made[uavs, tasks, nth, solver] = Job(
            f'size-{uavs}-{tasks}-{nth}-{solver or "reference"}', trials.converge, {
                'scene': {'uavs': uavs, 'tasks': tasks, 'seed': program.seed + nth},
                'solver': solver or 'chain_q', 'seed': nth if solver else 1000 + nth,
                'iterations': iterations(solver or 'chain_q', tasks, effort)},
            BRIEF if solver in FINITE else effort)
    return made


def event_jobs(program: Experiments) -> dict[tuple[int, int, str], Job]:
    """The dynamic table, by UAVs, tasks and where all start."""
    return {(uavs, tasks, kind): Job(f'events-{uavs}-{tasks}-{kind}', trials.events_trial, {
        'scene': {'uavs': uavs, 'tasks': tasks, 'seed': program.seed,
                  'one_base': int(kind == 'one base')},
        'seed': program.seed, 'iterations': program.event_rounds, 'count': program.events},
        0.35 * program.events)
        for (uavs, tasks), kind in product(program.sizes, ('spread', 'one base'))}
