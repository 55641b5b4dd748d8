# SPDX-License-Identifier: Apache-2.0
"""Experiment on warm starts: tasks arrive, UAVs move, each plan continues the one before."""
from __future__ import annotations

import sys
import time
from dataclasses import replace
from functools import partial

import numpy as np

from uav_task_alloc.model import Plan, Task, Uav
from uav_task_alloc.solver.check import MAX_BUDGET
from uav_task_alloc.solver.solve import load_kernels, plan
from uav_task_alloc.study.instances import SIDE, Instance, make_instance

_ARRIVALS = 5  # tasks at each event
_STEP = 300.0  # [m] flown between events
_RANGE_FACTOR = 1.5  # ranges over those of the instance, as more tasks arrive
_SEED = 11  # of the first instance and its arrivals; not used for tuning
_EVENTS = 50  # of an instance at most: of 20 UAVs and 200 tasks the ranges are used up by then
# effort over that of the plan measured at an event:
_REFERENCE_FACTOR = 20  # of the reference plan
_ITERATIONS_BETWEEN = 5  # of the search until the next event in `compare`
_BACKGROUND_FACTOR = 10.0  # of the search until the next event in `run_events`
_FIRST_PLAN_FACTOR = 100.0  # of the plan before the first event


def run_events(budget: float = 0.02, runs: int = 50, size: str = '20x200') -> None:
    """Print the time to the first valid plan at an event, and the gap to a longer solve.

    After 50 events the next instance begins, with full ranges: of 20 UAVs and 200 tasks they are
    used up by then.

    Args:
        budget: [s] of CPU time of a plan.
        runs: number of events.
        size: UAVs x tasks.
    """
    load_kernels()
    uavs, tasks = (int(each) for each in size.split('x'))
    for one_base in (False, True):
        kind = 'one base' if one_base else 'spread'
        gaps, first = list[float](), list[float]()
        for chain, before in enumerate(range(0, runs, _EVENTS)):
            instance = make_instance(uavs, tasks, _SEED + chain, one_base)
            found = _measure_events(instance, _SEED + chain, budget, min(_EVENTS, runs - before))
            gaps += found[0]
            first += found[1]
            print(f'{kind}: {len(gaps)} of {runs} events', file=sys.stderr, flush=True)
        print(f'{kind}: first plan {1e3 * np.median(first):.1f} ms (worst '
              f'{1e3 * max(first):.1f}), gap at {1e3 * budget:g} ms: median '
              f'{np.median(gaps):.2f} %, worst {max(gaps):.2f} %', flush=True)


def _measure_events(instance: Instance, seed: int, budget: float,
                    runs: int) -> tuple[list[float], list[float]]:
    """Gaps [%] and seconds to the first plans of events of one instance."""
    rng = np.random.default_rng(seed)
    fleet = tuple(replace(uav, range=_RANGE_FACTOR * uav.range) for uav in instance.uavs)
    work = instance.tasks
    solve = partial(plan, clock=time.process_time)
    known = solve(fleet, work, budget=_FIRST_PLAN_FACTOR * budget)
    gaps: list[float] = []
    first: list[float] = []
    for event in range(runs):
        fleet, work = _advance(fleet, work, known)
        work += tuple(Task(f'e{event}-{i}', (*rng.uniform(0.0, SIDE, 2), 0.0))
                      for i in range(_ARRIVALS))
        fresh = solve(fleet, work, budget=budget, warm=known)
        known = solve(fleet, work, budget=_BACKGROUND_FACTOR * budget, warm=fresh)
        best = solve(fleet, work, budget=_REFERENCE_FACTOR * budget, warm=known)
        gaps.append(_gap_percent(fresh, best))
        first.append(fresh.history[0][0])
    return gaps, first


def compare(instance: Instance, seed: int, iterations: int, count: int) -> list[
        dict[str, float]]:
    """Compare warm and cold starts over a sequence of random arrivals.

    The number of arrivals at an event is Poisson distributed, its mean a twentieth of the tasks
    of the instance. The gap is to a plan of _REFERENCE_FACTOR times the iterations, started from
    the better of both.

    Args:
        instance: the UAVs and the first tasks.
        seed: of the arrivals and the solver.
        iterations: of the warm and of the cold plan.
        count: number of events.

    Returns:
        For each event: tasks `arrived`, `tasks` in all; for both starts the gap [%], CPU seconds
        to the first plan and in all.
    """
    rng = np.random.default_rng((seed, count))
    fleet = tuple(replace(uav, range=_RANGE_FACTOR * uav.range) for uav in instance.uavs)
    work, rows = instance.tasks, list[dict[str, float]]()
    solve = partial(plan, budget=MAX_BUDGET, seed=seed, clock=time.thread_time)
    known = solve(fleet, work, max_iterations=_REFERENCE_FACTOR * iterations)
    for event in range(count):
        fleet, work = _advance(fleet, work, known)
        arrived = int(rng.poisson(len(instance.tasks) / 20.0))
        work += tuple(Task(f'e{event}-{i}', (*rng.uniform(0.0, SIDE, 2), 0.0))
                      for i in range(arrived))
        warm = solve(fleet, work, warm=known, max_iterations=iterations)
        cold = solve(fleet, work, max_iterations=iterations)
        better = min(warm, cold, key=lambda result: (-result.value, result.distance))
        best = solve(fleet, work, warm=better, max_iterations=_REFERENCE_FACTOR * iterations)
        rows.append({'arrived': arrived, 'tasks': len(work),
                     'warm_gap': _gap_percent(warm, best), 'cold_gap': _gap_percent(cold, best),
                     'warm_first_s': warm.history[0][0], 'cold_first_s': cold.history[0][0],
                     'warm_s': warm.solve_time, 'cold_s': cold.solve_time})
        known = solve(fleet, work, warm=warm, max_iterations=_ITERATIONS_BETWEEN * iterations)
    return rows


def _gap_percent(result: Plan, best: Plan) -> float:
    """[%] by which a plan is longer than the best; a unit of value left out counts as 100 %."""
    longer = result.distance / best.distance - 1.0 if best.distance > 0.0 else 0.0  # none served
    return 100.0 * (best.value - result.value) + 100.0 * longer


def _advance(fleet: tuple[Uav, ...], work: tuple[Task, ...],
             known: Plan) -> tuple[tuple[Uav, ...], tuple[Task, ...]]:
    """Move every UAV _STEP along its route: reached tasks are done, ranges shrink.

    Returns:
        The UAVs, and the tasks that remain.
    """
    positions, done, moved = {task.id: task.position for task in work}, set[str](), []
    for uav in fleet:
        here, left = np.array(uav.position), _STEP
        for task_id in known.routes[uav.id]:
            leg = np.array(positions[task_id]) - here
            length = float(np.linalg.norm(leg))
            if length > left:
                here = here + leg * (left / length)
                left = 0.0
                break
            here, left = np.array(positions[task_id]), left - length
            done.add(task_id)
        moved.append(replace(uav, position=tuple(here), range=uav.range - (_STEP - left)))
    return tuple(moved), tuple(task for task in work if task.id not in done)
