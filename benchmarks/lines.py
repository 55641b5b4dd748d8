# SPDX-License-Identifier: Apache-2.0
"""Lines that may be flown in both directions: the length of our plans and of PyVRP's.

    python benchmarks/lines.py [--size 50x500] [--seconds 1] [--seeds 5] [--first 1]

PyVRP gets two directed clients a line in an exclusive group, and asymmetric lengths. Seconds of
CPU time of one thread, for PyVRP from when its model is built. One JSON object a seed goes to
stderr; a Markdown table of means over the seeds to stdout.
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

from uav_task_alloc.solver.problem import Rules  # noqa: E402
from uav_task_alloc.solver.solve import plan  # noqa: E402
from uav_task_alloc.solver.timed.evaluator import evaluate_routes  # noqa: E402
from uav_task_alloc.solver.timed.solve import load_timed_kernels  # noqa: E402
from uav_task_alloc.study.lines import pyvrp_lines, random_lines  # noqa: E402
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


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--size', default='50x500', help='UAVs x lines')
    parser.add_argument('--seconds', type=float, default=1.0, help='of CPU time')
    parser.add_argument('--seeds', type=int, default=5)
    parser.add_argument('--first', type=int, default=1, help='seed')
    args = parser.parse_args()
    uavs, lines = (int(each) for each in args.size.split('x'))
    load_timed_kernels()
    rows = []
    for kind, returns in product(('fields', 'scattered'), (False, True)):
        found = np.array([compare(kind, returns, (uavs, lines), args.seconds, seed)
                          for seed in range(args.first, args.first + args.seeds)])
        mine, theirs = found.mean(axis=0)
        rows.append([kind, 'home' if returns else 'hold', f'{mine / 1000:.2f}',
                     f'{theirs / 1000:.2f}', f'{100 * (theirs / mine - 1):+.2f} %'])
    print(markdown_rows(['lines', 'routes end', 'ours [km]', 'PyVRP [km]', 'PyVRP over ours'],
                        rows))


if __name__ == '__main__':
    main()
