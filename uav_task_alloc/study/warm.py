# SPDX-License-Identifier: Apache-2.0
"""Events in a row: tasks arrive, UAVs have moved, and the plan goes on from the last one."""
from __future__ import annotations

import time
from dataclasses import replace

import numpy as np

from uav_task_alloc.model import Plan, Task, Uav
from uav_task_alloc.solver.solve import plan, warm_up
from uav_task_alloc.study.instances import SIDE, make_instance

ARRIVALS, STEP = 5, 300.0  # tasks, [m] flown between events
ROOM = 1.5  # ranges, as multiples of those of the instance
SEED = 11  # of the instance and the arrivals; nothing was tuned on it
REFERENCE = 20.0  # times the budget that the plan to compare with gets
BACKGROUND = 0.2  # [s] of search between events, as the allocator does


def events(budget: float = 0.02, runs: int = 50, size: str = '20x200') -> None:
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
    fleet = tuple(replace(uav, range=ROOM * uav.range) for uav in instance.uavs)
    work = instance.tasks
    known = plan(fleet, work, budget=2.0, clock=time.process_time)
    gaps: list[float] = []
    first: list[float] = []
    for event in range(runs):
        fleet, work = _flown(fleet, work, known)
        work += tuple(Task(f'e{event}-{i}', (*rng.uniform(0.0, SIDE, 2), 0.0))
                      for i in range(ARRIVALS))
        fresh = plan(fleet, work, budget=budget, warm=known, clock=time.process_time)
        known = plan(fleet, work, budget=BACKGROUND, warm=fresh, clock=time.process_time)
        best = plan(fleet, work, budget=REFERENCE * budget, warm=known, clock=time.process_time)
        short = 100.0 * (best.value - fresh.value)  # a task that is left out counts as 100 %
        gaps.append(short + 100.0 * (fresh.distance / best.distance - 1.0))
        first.append(fresh.history[0][0])
    return gaps, first


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
