# SPDX-License-Identifier: Apache-2.0
"""The jobs of the study: one run of one solver each, plain data in, plain data out.

Budgets are iterations, so results but for their CPU seconds are the same wherever they are made.
"""
from __future__ import annotations

import math
import time
from collections.abc import Mapping
from dataclasses import asdict
from functools import partial
from typing import Any, TypeAlias

from uav_task_alloc.model import Leg, Plan
from uav_task_alloc.solver.baselines import paper_chain_q
from uav_task_alloc.solver.check import LONGEST
from uav_task_alloc.solver.problem import Limits, Rules, make_problem
from uav_task_alloc.solver.recorder import Recorder
from uav_task_alloc.solver.registry import SOLVERS
from uav_task_alloc.solver.routes import DISTANCE, EXCESS
from uav_task_alloc.solver.solve import plan, warm_up
from uav_task_alloc.study import warm
from uav_task_alloc.study.instances import Instance, make_dome_scene, make_instance

SceneSpec: TypeAlias = Mapping[str, Any]  # what instances.make_... take, by name


def instance_of(scene: SceneSpec) -> Instance:
    """The instance that `uavs`, `tasks`, `seed` and, where there are any, `domes` describe."""
    return make_dome_scene(**scene) if 'domes' in scene else make_instance(**scene)


def converge(scene: SceneSpec, solver: str, seed: int, iterations: int,
             k: float | None = None) -> dict[str, Any]:
    """Every task assigned, range excess priced as eq 2.12 does: how fit falls.

    `k` is the paper's reward coefficient, for `paper_chain_q` only. `steps` of the result:
    [iterations by then, CPU seconds, fit] whenever the incumbent got better.
    """
    instance = instance_of(scene)
    problem = make_problem(instance.uavs, instance.tasks, {}, Limits(instance.zones),
                           Rules(hard=False))
    warm_up(solver)
    steps: list[tuple[int, float, float]] = []
    counts: list[int] = []  # of each better plan: iterations by then

    def note(iteration: int, _: float) -> None:
        counts.extend([iteration] * (len(recorder.history) - len(counts)))

    began = time.thread_time()
    recorder = Recorder(problem, time.thread_time, began, LONGEST, iterations,
                        on_iteration=note)
    solve = SOLVERS[solver] if k is None else partial(
        paper_chain_q.solve, settings=paper_chain_q.PaperSettings(k=k))
    solve(recorder, seed, None)
    note(recorder.iterations, math.inf)
    for iteration, (seconds, fit) in zip(counts, recorder.history, strict=True):
        if not steps or fit < steps[-1][2]:
            steps.append((iteration, seconds, fit))
    sums = recorder.best.sums
    return {'steps': steps, 'fit': steps[-1][2] if steps else math.inf,
            'distance': float(sums[DISTANCE]), 'penalty': float(sums[EXCESS]),
            'iterations': recorder.iterations, 'seconds': recorder.elapsed()}


def allocate(scene: SceneSpec, solver: str, seed: int, iterations: int) -> dict[str, Any]:
    """A whole plan: what `allocation` makes a Plan of again."""
    instance = instance_of(scene)
    made = plan(instance.uavs, instance.tasks, instance.zones, solver=solver, seed=seed,
                budget=LONGEST, max_iterations=iterations, hard_range=False)
    return {'routes': made.routes, 'legs': {
        uav: [asdict(leg) for leg in legs] for uav, legs in made.legs.items()},
        'fit': made.fit, 'distance': made.distance, 'penalty': made.penalty}


def allocation_trial(result: Mapping[str, Any]) -> Plan:
    """The plan that `allocate` found."""
    legs = {uav: tuple(Leg(tuple(map(tuple, leg['via'])), leg['length']) for leg in row)
            for uav, row in result['legs'].items()}
    return Plan({uav: tuple(row) for uav, row in result['routes'].items()}, legs=legs,
                **{name: result[name] for name in ('fit', 'distance', 'penalty')})


def events_trial(scene: SceneSpec, seed: int, iterations: int, count: int) -> list[
        dict[str, float]]:
    """Random arrivals in a row, each planned warm and cold in as many iterations."""
    return warm.compare(make_instance(**scene), seed, iterations, count)
