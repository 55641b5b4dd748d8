# SPDX-License-Identifier: Apache-2.0
"""The jobs of the study: one run of one solver each; arguments and results are JSON values.

Budgets are iterations, so all results but the CPU seconds are the same on every machine.
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
from uav_task_alloc.solver.check import MAX_BUDGET
from uav_task_alloc.solver.problem import Limits, Rules, make_problem
from uav_task_alloc.solver.recorder import Recorder
from uav_task_alloc.solver.registry import SOLVERS
from uav_task_alloc.solver.routes import DISTANCE, EXCESS
from uav_task_alloc.solver.solve import load_kernels, plan
from uav_task_alloc.study import warm
from uav_task_alloc.study.instances import Instance, make_dome_scene, make_instance

SceneSpec: TypeAlias = Mapping[str, Any]  # arguments of make_instance or make_dome_scene


def instance_of(scene: SceneSpec) -> Instance:
    """The instance with these arguments: of make_dome_scene where `domes` is one of them."""
    return make_dome_scene(**scene) if 'domes' in scene else make_instance(**scene)


def converge(scene: SceneSpec, solver: str, seed: int, iterations: int,
             k: float | None = None) -> dict[str, Any]:
    """Run a solver with every task assigned and soft ranges, and record how the fit falls.

    Args:
        scene: of the instance.
        solver: of SOLVERS.
        seed: of the solver.
        iterations: budget.
        k: the paper's reward coefficient, for `paper_chain_q` only.

    Returns:
        `steps`: [iterations, CPU seconds, fit] at each improvement; of the best plan `fit` (eq
        2.12), `distance` [m] and `penalty` [m]; `iterations` and CPU `seconds` of the run.
    """
    instance = instance_of(scene)
    problem = make_problem(instance.uavs, instance.tasks, {}, Limits(instance.zones),
                           Rules(hard=False))
    load_kernels(solver)
    steps: list[tuple[int, float, float]] = []
    counts: list[int] = []  # iterations at each improvement

    def on_iteration(iteration: int, _: float) -> None:
        counts.extend([iteration] * (len(recorder.history) - len(counts)))

    started = time.thread_time()
    recorder = Recorder(time.thread_time, started, MAX_BUDGET, iterations, problem=problem,
                        on_iteration=on_iteration)
    solve = SOLVERS[solver] if k is None else partial(
        paper_chain_q.solve, settings=paper_chain_q.PaperSettings(k=k))
    solve(recorder, seed, None)
    on_iteration(recorder.iterations, math.inf)
    for iteration, (seconds, fit) in zip(counts, recorder.history, strict=True):
        if not steps or fit < steps[-1][2]:
            steps.append((iteration, seconds, fit))
    sums = recorder.best.sums
    return {'steps': steps, 'fit': steps[-1][2] if steps else math.inf,
            'distance': float(sums[DISTANCE]), 'penalty': float(sums[EXCESS]),
            'iterations': recorder.iterations, 'seconds': recorder.elapsed()}


def solve_scene(scene: SceneSpec, solver: str, seed: int, iterations: int) -> dict[str, Any]:
    """Solve an instance among domes; returns what `plan_from_result` makes a Plan of."""
    instance = instance_of(scene)
    result = plan(instance.uavs, instance.tasks, instance.zones, solver=solver, seed=seed,
                budget=MAX_BUDGET, max_iterations=iterations, hard_range=False)
    return {'routes': result.routes, 'legs': {
        uav: [asdict(leg) for leg in legs] for uav, legs in result.legs.items()},
        'fit': result.fit, 'distance': result.distance, 'penalty': result.penalty}


def plan_from_result(result: Mapping[str, Any]) -> Plan:
    """The plan whose JSON values `solve_scene` returned."""
    legs = {uav: tuple(Leg(tuple(map(tuple, leg['via'])), leg['length']) for leg in row)
            for uav, row in result['legs'].items()}
    return Plan({uav: tuple(row) for uav, row in result['routes'].items()}, legs=legs,
                **{name: result[name] for name in ('fit', 'distance', 'penalty')})


def events_trial(scene: SceneSpec, seed: int, iterations: int, count: int) -> list[
        dict[str, float]]:
    """Random arrivals, each planned warm and cold with the same iterations: see warm.compare."""
    return warm.compare(make_instance(**scene), seed, iterations, count)
