# SPDX-License-Identifier: Apache-2.0
"""Lines that may be flown in both directions: the length of our plans and of PyVRP's.

    python benchmarks/lines.py [--size 50x500] [--seconds 1] [--seeds 5] [--first 1]
    python benchmarks/lines.py --loss [--size 10x200] [--seconds 0.1]

PyVRP gets two directed clients a line in an exclusive group, and asymmetric lengths. Seconds of
CPU time of one thread, for PyVRP from when its model is built. One JSON object a seed goes to
stderr; a Markdown table of means over the seeds to stdout.

`--loss`: a UAV is lost at half of the earliest finish; a plan of the unflown lines that starts
from the first plan, in so many seconds, against one of ten times as long that starts from nothing.
"""
from __future__ import annotations

import argparse
import json
import sys
import time
from itertools import product
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parent.parent
sys.path[:0] = [str(ROOT)]

from uav_task_alloc.objective import OBJECTIVES  # noqa: E402
from uav_task_alloc.solver.problem import Rules  # noqa: E402
from uav_task_alloc.solver.solve import plan  # noqa: E402
from uav_task_alloc.solver.timed.evaluator import evaluate_routes  # noqa: E402
from uav_task_alloc.solver.timed.schedule import Held  # noqa: E402
from uav_task_alloc.solver.timed.solve import load_timed_kernels  # noqa: E402
from uav_task_alloc.study.lines import left_after_loss, pyvrp_lines, random_lines  # noqa: E402
from uav_task_alloc.study.tables import markdown_rows  # noqa: E402


def compare(kind: str, returns: bool, size: tuple[int, int], seconds: float,
            seed: int) -> tuple[float, float]:
    """Metres of our plan and of PyVRP's, both evaluated; nan: it found none in the time."""
    uavs, tasks = random_lines(kind, *size, seed)
    mine = plan(uavs, tasks, budget=seconds, seed=seed, route_end='home' if returns else 'hold',
                clock=time.thread_time)
    improved = pyvrp_lines(uavs, tasks, returns, seconds, seed)
    found = []
    for trips, turned in ((mine.trips, mine.reversed), *(
            (each.trips, each.reversed) for _, each in improved[-1:])):
        checked = evaluate_routes(uavs, tasks, Rules(returns), trips, reversed=turned)
        assert not checked.violations, checked.violations[:3]
        assert checked.value == len(tasks), checked.value
        found.append(checked.distance)
    ways = sum(task.path_length for task in tasks)
    print(json.dumps({'kind': kind, 'returns': returns, 'seed': seed, 'ours': found[0],
                      'pyvrp': found[1] if improved else None, 'lines': ways}),
          file=sys.stderr, flush=True)
    return found[0], found[1] if improved else float('nan')


def loss(kind: str, returns: bool, size: tuple[int, int], seconds: float,
         seed: int) -> tuple[float, float]:
    """Finish [s] of the rest after a loss, from the plan before, and from nothing."""
    uavs, tasks = random_lines(kind, *size, seed)
    end = 'home' if returns else 'hold'
    before = plan(uavs, tasks, budget=10.0 * seconds, seed=seed, route_end=end,
                  objective='finish', clock=time.thread_time)
    lost = max(uavs, key=lambda uav: len(before.routes[uav.id])).id
    left = left_after_loss(before, uavs, tasks, lost, 0.5 * before.finish)
    both = [plan(left.uavs, left.tasks, budget=budget, seed=seed, route_end=end, warm=warm,
                 objective='finish', locked=left.locked, clock=time.thread_time)
            for budget, warm in ((seconds, before), (10.0 * seconds, None))]
    for found in both:
        checked = evaluate_routes(
            left.uavs, left.tasks, Rules(returns, objective=OBJECTIVES['finish']), found.trips,
            held=Held(left.locked), reversed=found.reversed)
        assert not checked.violations, checked.violations[:3]
        assert checked.value == len(left.tasks), checked.value
    print(json.dumps({'kind': kind, 'returns': returns, 'seed': seed, 'left': len(left.tasks),
                      'before': before.finish, 'warm': both[0].finish, 'fresh': both[1].finish}),
          file=sys.stderr, flush=True)
    return both[0].finish, both[1].finish


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--loss', action='store_true', help='what is left when a UAV is lost')
    parser.add_argument('--size', help='UAVs x lines')
    parser.add_argument('--seconds', type=float, help='of CPU time')
    parser.add_argument('--seeds', type=int, default=5)
    parser.add_argument('--first', type=int, default=1, help='seed')
    args = parser.parse_args()
    size = args.size or ('10x200' if args.loss else '50x500')
    seconds = args.seconds or (0.1 if args.loss else 1.0)
    uavs, lines = (int(each) for each in size.split('x'))
    load_timed_kernels(paths=True)
    measure, unit, digits = (loss, 's', 1) if args.loss else (compare, 'km', 2)
    scale = 1.0 if args.loss else 1e-3
    names = ('from the plan before', 'from nothing') if args.loss else ('ours', 'PyVRP')
    rows = []
    for kind, returns in product(('fields', 'scattered'), (False, True)):
        found = scale * np.array([measure(kind, returns, (uavs, lines), seconds, seed)
                                  for seed in range(args.first, args.first + args.seeds)])
        mine, theirs = found.mean(axis=0)
        rows.append([kind, 'home' if returns else 'hold', f'{mine:.{digits}f}',
                     f'{theirs:.{digits}f}', f'{100 * (theirs / mine - 1):+.2f} %'])
    print(markdown_rows(['lines', 'routes end', *(f'{name} [{unit}]' for name in names),
                         'second over first'], rows))


if __name__ == '__main__':
    main()
