# SPDX-License-Identifier: Apache-2.0
"""Warm starts with deadlines: at each event 5 tasks with a latest start arrive and UAVs fly on.

    python benchmarks/warm_times.py [--size 100x1000] [--events 10] [--budget 0.02]
        [--reference 60] [--base] [--objective distance]

CPU time. A line for each event goes to stderr, one JSON object to stdout: the time to the first
valid plan, and the gap of the cost to a solve of `--reference` seconds that starts from it.
"""
from __future__ import annotations

import argparse
import json
import sys
import time
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parent.parent
sys.path[:0] = [str(ROOT)]

from uav_task_alloc.model import Plan, Task, Uav  # noqa: E402
from uav_task_alloc.objective import OBJECTIVES  # noqa: E402
from uav_task_alloc.solver.problem import Rules  # noqa: E402
from uav_task_alloc.solver.solve import plan  # noqa: E402
from uav_task_alloc.solver.timed.evaluator import evaluate_routes  # noqa: E402
from uav_task_alloc.solver.timed.solve import load_timed_kernels  # noqa: E402
from uav_task_alloc.study.instances import SIDE, make_instance  # noqa: E402

ARRIVALS = 5
STEP = 20.0  # [s] between events
DEADLINES = 150.0, 900.0  # [s] after the arrival
FIRST = 100.0  # times the budget: the plan before the first event
BACKGROUND = 10.0  # times the budget: the plan between events


def main() -> int:
    args = parse()
    load_timed_kernels()
    uavs, tasks = (int(each) for each in args.size.split('x'))
    rng = np.random.default_rng(args.seed)
    instance = make_instance(uavs, tasks, args.seed, args.base)
    fleet = tuple(replace(uav, range=1.5 * uav.range) for uav in instance.uavs)
    work = tuple(replace(task, latest=2.0 * DEADLINES[1]) if i < ARRIVALS else task
                 for i, task in enumerate(instance.tasks))
    solve = partial(plan, clock=time.thread_time, objective=args.objective)
    known = solve(fleet, work, budget=FIRST * args.budget)
    rows = []
    for event in range(args.events):
        fleet, work = advance(fleet, work, known)
        work += tuple(Task(f'e{event}-{i}', (*rng.uniform(0.0, SIDE, 2), 0.0),
                           latest=float(rng.uniform(*DEADLINES))) for i in range(ARRIVALS))
        fresh = solve(fleet, work, budget=args.budget, warm=known)
        best = solve(fleet, work, budget=args.reference, warm=fresh)
        rows.append({'first_ms': 1e3 * fresh.history[0][0], 'gap': gap(fresh, best),
                     'unassigned': len(fresh.unassigned), 'best_unassigned': len(best.unassigned),
                     'valid': is_valid(fleet, work, fresh, args.objective)})
        print(event, rows[-1], file=sys.stderr, flush=True)
        known = solve(fleet, work, budget=BACKGROUND * args.budget, warm=fresh)
    print(json.dumps({
        'size': args.size, 'events': args.events, 'valid': all(row['valid'] for row in rows),
        'first_ms': [float(f(row['first_ms'] for row in rows)) for f in (median, max)],
        'gap_percent': [float(f(row['gap'] for row in rows)) for f in (median, max)]}))
    return 0


def parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--size', default='100x1000', help='UAVs x tasks')
    parser.add_argument('--events', type=int, default=10)
    parser.add_argument('--budget', type=float, default=0.02, help='[s] of CPU time')
    parser.add_argument('--reference', type=float, default=60.0, help='[s] of CPU time')
    parser.add_argument('--base', action='store_true', help='one start for all UAVs')
    parser.add_argument('--seed', type=int, default=11)
    parser.add_argument('--objective', choices=tuple(OBJECTIVES), default='distance')
    return parser.parse_args()


def median(values: object) -> float:
    return float(np.median(list(values)))  # type: ignore[call-overload]


def gap(result: Plan, best: Plan) -> float:
    """[%] of the cost; a unit of value left out counts as 100 %."""
    return 100.0 * (best.value - result.value) + 100.0 * (result.cost / best.cost - 1.0)


def is_valid(fleet: tuple[Uav, ...], work: tuple[Task, ...], result: Plan, name: str) -> bool:
    rules = Rules(objective=OBJECTIVES[name])
    return not evaluate_routes(fleet, work, rules, result.trips).violations


def advance(fleet: tuple[Uav, ...], work: tuple[Task, ...],
            known: Plan) -> tuple[tuple[Uav, ...], tuple[Task, ...]]:
    """Move every UAV STEP seconds along its route; what is reached is done, times pass."""
    places, done, moved = {task.id: task.position for task in work}, set[str](), []
    for uav in fleet:
        here, left = np.array(uav.position), STEP * uav.cruise_speed
        for name in known.routes[uav.id]:
            leg = np.array(places[name]) - here
            length = float(np.linalg.norm(leg))
            if length > left:
                here, left = here + leg * (left / length), 0.0
                break
            here, left = np.array(places[name]), left - length
            done.add(name)
        flown = STEP * uav.cruise_speed - left
        moved.append(replace(uav, position=tuple(here), home=uav.base, range=uav.range - flown))
    return tuple(moved), tuple(replace(task, latest=task.latest - STEP,
                                       announced=task.announced - STEP)
                               for task in work if task.id not in done)


if __name__ == '__main__':
    sys.exit(main())
