# SPDX-License-Identifier: Apache-2.0
"""Large fleets: tasks left out, length, time to the first plan and memory, a line per plan.

    python benchmarks/large.py [--size 200x5000] [--budgets 1,10] [--seeds 1] [--reference 60]

`--reference 60` gives PyVRP so many seconds of CPU time on each instance as well.
"""
from __future__ import annotations

import argparse
import resource
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from uav_task_alloc import plan
from uav_task_alloc.solver.solve import load_kernels
from uav_task_alloc.study.evaluator import evaluate
from uav_task_alloc.study.instances import SLACK, Instance, make_instance
from uav_task_alloc.study.reference_solvers import pyvrp


def ours(instance: Instance, budget: float) -> None:
    """Print the plan of `plan` within `budget` [s] of CPU time."""
    result = plan(instance.uavs, instance.tasks, budget=budget, clock=time.process_time)
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(f'{instance.name}: {budget:g} s: {len(result.unassigned)} left out, '
          f'{result.distance / 1000:.1f} km, '
          f'first plan after {1000 * result.history[0][0]:.0f} ms, '
          f'{memory:.0f} MB resident', flush=True)


def solve_by_pyvrp(instance: Instance, seconds: float) -> None:
    """Print when PyVRP first served all, and its best."""
    results = [(when, evaluate(instance, routes)) for when, routes in pyvrp(instance, seconds)]
    served = [(when, result.length) for when, result in results if result.is_valid(collects=False)]
    text = (f'{served[-1][1] / 1000:.1f} km, the first plan after {served[0][0]:.1f} s'
            if served else 'no plan')
    print(f'{instance.name}: PyVRP, {seconds:g} s: {text}', flush=True)


def main() -> None:
    """Spread and one base; memory first, as PyVRP's matrix counts in the same process."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--size', default='200x5000', help='UAVs x tasks')
    parser.add_argument('--budgets', default='1,10', help='[s] of CPU time, ...')
    parser.add_argument('--seeds', type=int, default=1, help='instances of each kind')
    parser.add_argument('--slack', type=float, default=SLACK, help='ranges over a fair share')
    parser.add_argument('--reference', type=float, default=0.0, help='[s] for PyVRP; 0: not run')
    args = parser.parse_args()
    uavs, tasks = (int(each) for each in args.size.split('x'))
    instances = [make_instance(uavs, tasks, 11 + seed, one_base, args.slack)
                 for seed in range(args.seeds) for one_base in (False, True)]
    load_kernels()
    for instance in instances:
        for budget in args.budgets.split(','):
            ours(instance, float(budget))
    for instance in instances if args.reference > 0.0 else []:
        solve_by_pyvrp(instance, args.reference)


if __name__ == '__main__':
    main()
