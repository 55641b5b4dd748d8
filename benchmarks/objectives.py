# SPDX-License-Identifier: Apache-2.0
"""What an earlier end and a faster response cost in metres: a table for docs/times.md.

    python benchmarks/objectives.py [--size 8x100] [--instances 5] [--budget 1]
    python benchmarks/objectives.py --gaps --size 20x200 --instances 1 --budget 10

With --gaps: how far the cost of a run is above that of the best of --references runs of
--reference seconds from other seeds, for `finish`, `response` and `balanced`.
10 x 10 km, starts anywhere or one base, no ranges, 10 s of service, 15 m/s; CPU time. Progress
goes to stderr, the Markdown table to stdout.
"""
from __future__ import annotations

import argparse
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parent.parent
sys.path[:0] = [str(ROOT)]

from uav_task_alloc.model import Plan  # noqa: E402
from uav_task_alloc.objective import OBJECTIVES, Objective  # noqa: E402
from uav_task_alloc.solver.solve import plan  # noqa: E402
from uav_task_alloc.study.instances import make_instance  # noqa: E402
from uav_task_alloc.study.tables import markdown_rows  # noqa: E402

SETTINGS: dict[str, Objective] = {
    '`distance`': OBJECTIVES['distance'],
    'distance 0.1, finish 1': Objective(0.1, 1.0),
    'distance 0.03, finish 1': Objective(0.03, 1.0),
    'distance 0.01, finish 1': Objective(0.01, 1.0),
    '`finish`': OBJECTIVES['finish'],
    'distance 0.1, response 1': Objective(0.1, 0.0, 1.0),
    'distance 0.03, response 1': Objective(0.03, 0.0, 1.0),
    'distance 0.01, response 1': Objective(0.01, 0.0, 1.0),
    '`response`': OBJECTIVES['response'],
    '`balanced`': OBJECTIVES['balanced'],
}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--size', default='8x100', help='UAVs x tasks')
    parser.add_argument('--instances', type=int, default=5)
    parser.add_argument('--budget', type=float, default=1.0, help='[s]')
    parser.add_argument('--gaps', action='store_true', help='against the best of longer runs')
    parser.add_argument('--references', type=int, default=10, help='longer runs')
    parser.add_argument('--reference', type=float, default=60.0, help='[s] of each of them')
    args = parser.parse_args()
    uavs, tasks = (int(each) for each in args.size.split('x'))
    if args.gaps:
        return gaps(uavs, tasks, args)
    rows = []
    for name, objective in SETTINGS.items():
        found: list[float] = []
        for base in (False, True):
            means = np.mean([measure(uavs, tasks, seed, base, objective, args.budget)
                             for seed in range(1, args.instances + 1)], axis=0)
            found += means.tolist()
        rows.append([name, *(f'{found[i]:.{1 if i % 3 == 0 else 0}f}' for i in range(6))])
        print(rows[-1], file=sys.stderr, flush=True)
    print(markdown_rows(['objective', *(f'{kind}: {what}' for kind in ('spread', 'one base')
                                        for what in ('km', 'finish [s]', 'response [s]'))], rows))
    return 0


def gaps(uavs: int, tasks: int, args: argparse.Namespace) -> int:
    """Print the gaps of each objective, spread and from one base [%]."""
    rows = []
    for name in ('finish', 'response', 'balanced'):
        for base in (False, True):
            above = []
            for instance in range(1, args.instances + 1):
                problem = uavs, tasks, instance, base, OBJECTIVES[name]
                longer = [solved(*problem, args.reference, 1000 + k).cost
                          for k in range(args.references)]
                short = solved(*problem, args.budget, instance).cost
                above.append(100.0 * (short / min(*longer, short) - 1.0))
            rows.append([f'`{name}`', 'one base' if base else 'spread',
                         f'{np.mean(above):.2f}', f'{max(above):.2f}'])
            print(rows[-1], file=sys.stderr, flush=True)
    print(markdown_rows(['objective', 'starts', 'mean gap [%]', 'worst [%]'], rows))
    return 0


def measure(uavs: int, tasks: int, seed: int, base: bool, objective: Objective,
            budget: float) -> tuple[float, float, float]:
    """Kilometres, finish and response [s] of a plan."""
    result = solved(uavs, tasks, seed, base, objective, budget, seed)
    return 1e-3 * result.distance, result.finish, result.response


def solved(uavs: int, tasks: int, instance: int, base: bool, objective: Objective, budget: float,
           seed: int) -> Plan:
    """The plan of an instance."""
    made = make_instance(uavs, tasks, instance, base)
    return plan([replace(uav, range=float('inf')) for uav in made.uavs],
                [replace(task, service_time=10.0) for task in made.tasks], budget=budget,
                seed=seed, objective=objective, clock=time.thread_time)


if __name__ == '__main__':
    sys.exit(main())
