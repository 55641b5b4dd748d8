# SPDX-License-Identifier: Apache-2.0
"""Whether `plan` keeps its budget among up to 1000 zones, overlapping ones included.

    python benchmarks/solve_budget.py [--scenes 200] [--seed 1] [--budget 0.1] [--cpu]

The kernels are loaded first. Progress goes to stderr, one JSON object to stdout. The exit status
is 1 where a plan took more than twice its budget or is not valid: a leg that enters a zone, a task
lost, or one left out without a reason.
"""
from __future__ import annotations

import argparse
import json
import math
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).parent.parent
sys.path[:0] = [str(ROOT), str(ROOT / 'test' / 'geometry')]

from scenes import CLEARANCE, random_zones, violations  # noqa: E402

from uav_task_alloc import Plan, Task, ThreatZone, Uav, plan  # noqa: E402
from uav_task_alloc.geometry.obstacles import pack  # noqa: E402
from uav_task_alloc.solver.solve import load_kernels  # noqa: E402

MOST_ZONES, MOST_TASKS, MOST_UAVS = 1000, 200, 20
SIDES = (2000.0, 5000.0, 10_000.0)  # [m]
COVER = (0.1, 0.5, 1.0, 2.0)  # zones' areas, summed up, as a share of the square
TIMES = 2.0  # the budget


def random_scene(rng: np.random.Generator) -> tuple[list[Uav], list[Task], list[ThreatZone]]:
    """UAVs, tasks and zones anywhere, also inside each other; zones of all shapes."""
    side, cover = float(rng.choice(SIDES)), float(rng.choice(COVER))
    count = int(np.exp(rng.uniform(0.0, math.log(MOST_ZONES + 1))))
    size = side * math.sqrt(cover / (math.pi * 0.5 * count))
    shapes = str(rng.choice(['h', 'c', 'p', 'hcp', 'hcpe']))
    zones = random_zones(rng, count, False, side, size, shapes)

    def place() -> tuple[float, float, float]:
        x, y, z = rng.uniform((0.0, 0.0, 20.0), (side, side, 120.0))
        return float(x), float(y), float(z)

    uavs = [Uav(f'u{i}', place(), float(rng.choice([math.inf, 2.0 * side])))
            for i in range(int(rng.integers(1, MOST_UAVS + 1)))]
    tasks = [Task(f't{i}', place()) for i in range(int(rng.integers(1, MOST_TASKS + 1)))]
    return uavs, tasks, zones


def faults(uavs: list[Uav], tasks: list[Task], zones: list[ThreatZone], result: Plan) -> list[str]:
    """What is wrong with a plan, by samples on its legs and by counting its tasks."""
    rows = pack(zones, CLEARANCE).rows
    low, high = (np.stack([rows[k + end] for k in 'xy'], axis=1) for end in '01')
    places = {task.id: task.position for task in tasks}
    served = [name for row in result.routes.values() for name in row]
    errors = [] if sorted([*served, *result.unassigned]) == sorted(places) else ['tasks lost']
    errors += [f'{name}: no reason' for name, why in result.unassigned.items() if not why]
    for uav in uavs:
        here, first = uav.position, True
        for name, leg in zip(result.routes[uav.id], result.legs[uav.id], strict=False):
            points = [here, *leg.via, places[name]]
            if first and starts_inside(here, zones, rows):
                points = points[1:]
            line = np.array(points)[:, :2]
            near = ((line.max(0) >= low) & (line.min(0) <= high)).all(axis=1)
            some = [zones[k] for k in np.flatnonzero(near)]
            if not math.isfinite(leg.length) or (some and violations(points, some)):
                errors.append(f'{uav.id}: the leg to {name} enters a zone')
            here, first = places[name], False
    return errors


def starts_inside(place: tuple[float, float, float], zones: list[ThreatZone], rows: Any) -> bool:
    """Whether a path has to leave a zone first, to its first waypoint."""
    x, y, _ = place
    near = np.flatnonzero((rows['x0'] <= x) & (rows['x1'] >= x) & (rows['y0'] <= y)
                          & (rows['y1'] >= y))
    return bool(len(near)) and violations([place, place], [zones[k] for k in near]) > 0


def main() -> int:
    """Solve all scenes; 1 where a budget was not kept or a plan is not valid."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--scenes', type=int, default=200)
    parser.add_argument('--seed', type=int, default=1)
    parser.add_argument('--budget', type=float, default=0.1, help='[s] (%(default)s)')
    parser.add_argument('--cpu', action='store_true',
                        help='budget and time are CPU time: for a machine with other work')
    args = parser.parse_args()
    clock = time.process_time if args.cpu else time.perf_counter
    load_kernels('chain_q', True)
    rows, wrong = [], []
    for k in range(args.scenes):
        uavs, tasks, zones = random_scene(np.random.default_rng((args.seed, k)))
        began = clock()
        result = plan(uavs, tasks, zones, budget=args.budget, clock=clock, clearance=CLEARANCE)
        took = clock() - began
        bad = faults(uavs, tasks, zones, result)
        wrong += [f'scene {k}: {each}' for each in bad]
        deferred = sum('in the time' in why for why in result.unassigned.values())
        rows.append({'scene': k, 'zones': len(zones), 'tasks': len(tasks), 'uavs': len(uavs),
                     'seconds': round(took, 4), 'unassigned': len(result.unassigned),
                     'deferred': deferred, 'faults': len(bad)})
        print(f'{k + 1}/{args.scenes}: {len(zones)} zones, {len(tasks)} tasks: {took:.3f} s, '
              f'{deferred} deferred{"; INVALID" if bad else ""}', file=sys.stderr, flush=True)
    ratios = np.array([row['seconds'] for row in rows]) / args.budget
    late = int((ratios > TIMES).sum())
    print(json.dumps({
        'seed': args.seed, 'budget': args.budget, 'clock': 'cpu' if args.cpu else 'wall',
        'scenes': len(rows), 'late': late, 'faults': wrong,
        'ratio': {'median': float(np.median(ratios)), 'p99': float(np.percentile(ratios, 99)),
                  'worst': float(ratios.max())}, 'rows': rows}, indent=1))
    return 1 if late or wrong else 0


if __name__ == '__main__':
    sys.exit(main())
