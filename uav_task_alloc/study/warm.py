# SPDX-License-Identifier: Apache-2.0
"""Events in a row: tasks arrive, UAVs have moved, and the plan goes on from the last one."""
from __future__ import annotations

import time
from dataclasses import replace
from functools import partial

import numpy as np

from uav_task_alloc.model import Plan, Task, Uav
from uav_task_alloc.solver.check import LONGEST
from uav_task_alloc.solver.solve import plan, warm_up
from uav_task_alloc.study.instances import SIDE, Instance, make_instance

ARRIVALS, STEP = 5, 300.0  # tasks, [m] flown between events
_ROOM = 1.5  # ranges, as multiples of those of the instance
SEED = 11  # of the instance and the arrivals; nothing was tuned on it
_REFERENCE = 20  # times the budget that the plan to compare with gets
BETWEEN = 5  # times the iterations of an event that are searched until the next
BACKGROUND = 10.0  # times the budget that is searched between events, as the allocator does
BEFORE = 100.0  # times the budget of the first plan


def run_events(budget: float = 0.02, runs: int = 50, size: str = '20x200') -> None:
    """Per event: time to the first valid plan, gap to a long solve from the same plan."""
    warm_up()
    uavs, tasks = (int(each) for each in size.split('x'))
    for one_base in (False, True):
        gaps, first = _chain(uavs, tasks, one_base, budget, runs)
        kind = 'one base' if one_base else 'spread'
        print(f'{kind}: first plan {1e3 * np.median(first):.1f} ms (worst '
              f'{1e3 * max(first):.1f}), gap at {1e3 * budget:g} ms: median '
              f'{np.median(gaps):.2f} %, worst {max(gaps):.2f} %', flush=True)


def _chain(uavs: int, tasks: int, one_base: bool, budget: float,
           runs: int) -> tuple[list[float], list[float]]:
    instance, rng = make_instance(uavs, tasks, SEED, one_base), np.random.default_rng(SEED)
    # more tasks arrive than the ranges are made for
    fleet = tuple(replace(uav, range=_ROOM * uav.range) for uav in instance.uavs)
    work = instance.tasks
    known = plan(fleet, work, budget=BEFORE * budget, clock=time.process_time)
    gaps: list[float] = []
    first: list[float] = []
    for event in range(runs):
        fleet, work = _flown(fleet, work, known)
        work += tuple(Task(f'e{event}-{i}', (*rng.uniform(0.0, SIDE, 2), 0.0))
                      for i in range(ARRIVALS))
        fresh = plan(fleet, work, budget=budget, warm=known, clock=time.process_time)
        known = plan(fleet, work, budget=BACKGROUND * budget, warm=fresh, clock=time.process_time)
        best = plan(fleet, work, budget=_REFERENCE * budget, warm=known, clock=time.process_time)
        gaps.append(_gap(fresh, best))
        first.append(fresh.history[0][0])
    return gaps, first


def compare(instance: Instance, seed: int, iterations: int, count: int) -> list[
        dict[str, float]]:
    """Random arrivals in a row: gap [%] of a warm and a cold plan each, and their CPU seconds.

    An event brings Poisson(a twentieth of the first tasks) new ones. Both plans get as many
    iterations; the gap is to REFERENCE times as many from the better of both.
    """
    rng = np.random.default_rng((seed, count))
    fleet = tuple(replace(uav, range=_ROOM * uav.range) for uav in instance.uavs)
    work, rows = instance.tasks, list[dict[str, float]]()
    solved = partial(plan, budget=LONGEST, seed=seed, clock=time.thread_time)
    known = solved(fleet, work, max_iterations=_REFERENCE * iterations)
    for event in range(count):
        fleet, work = _flown(fleet, work, known)
        arrived = int(rng.poisson(len(instance.tasks) / 20.0))
        work += tuple(Task(f'e{event}-{i}', (*rng.uniform(0.0, SIDE, 2), 0.0))
                      for i in range(arrived))
        warm = solved(fleet, work, warm=known, max_iterations=iterations)
        cold = solved(fleet, work, max_iterations=iterations)
        better = min(warm, cold, key=lambda made: (-made.value, made.distance))
        best = solved(fleet, work, warm=better, max_iterations=_REFERENCE * iterations)
        rows.append({'arrived': arrived, 'tasks': len(work),
                     'warm_gap': _gap(warm, best), 'cold_gap': _gap(cold, best),
                     'warm_first_s': warm.history[0][0], 'cold_first_s': cold.history[0][0],
                     'warm_s': warm.solve_time, 'cold_s': cold.solve_time})
        known = solved(fleet, work, warm=warm, max_iterations=BETWEEN * iterations)
    return rows


def _gap(made: Plan, best: Plan) -> float:
    """Percent longer than the best plan; a task that is left out counts as 100 %."""
    return (100.0 * (best.value - made.value)
            + 100.0 * (made.distance / best.distance - 1.0))


def _flown(fleet: tuple[Uav, ...], work: tuple[Task, ...],
           known: Plan) -> tuple[tuple[Uav, ...], tuple[Task, ...]]:
    """Everybody STEP metres further along its route; tasks passed are done, ranges shrink."""
    place, done, moved = {task.id: task.position for task in work}, set[str](), []
    for uav in fleet:
        here, left = np.array(uav.position), STEP
        for task_id in known.routes[uav.id]:
            way = np.array(place[task_id]) - here
            length = float(np.linalg.norm(way))
            if length > left:
                here = here + way * (left / length)
                left = 0.0
                break
            here, left = np.array(place[task_id]), left - length
            done.add(task_id)
        moved.append(replace(uav, position=tuple(here), range=uav.range - (STEP - left)))
    return tuple(moved), tuple(task for task in work if task.id not in done)
