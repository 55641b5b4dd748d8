# SPDX-License-Identifier: Apache-2.0
"""The bench: solvers and rivals on the same instances, as gaps to the best that any found."""
from __future__ import annotations

import argparse
import json
import math
import time
from collections.abc import Iterable, Sequence
from itertools import product
from pathlib import Path

from uav_task_alloc.solver.registry import SOLVERS
from uav_task_alloc.solver.solve import plan
from uav_task_alloc.study import rivals
from uav_task_alloc.study.instances import SLACK, Instance, make_instance

Runs = dict[str, dict[str, float]]  # instance -> 'solver@budget' -> [m], inf: not all served


def main(argv: Sequence[str]) -> int:
    """`python -m uav_task_alloc bench`: print the table; returns the exit status."""
    asked = _parser().parse_args(argv)
    wanted = asked.against.split(',') if asked.rivals > 0.0 else []
    missing = sorted(set(wanted) - set(rivals.installed()))
    if missing:
        print(f'not installed, so left out: {", ".join(missing)} '
              '(pip install -r benchmarks/requirements.txt)')
    runs: Runs = json.loads(asked.json.read_text()) if asked.json and asked.json.exists() else {}
    for instance in _instances(asked):
        row = runs.setdefault(instance.name, {})
        for solver, budget in product(asked.solvers.split(','), _numbers(asked.budgets)):
            row[f'{solver}@{budget:g}'] = _length(instance, solver, budget)
        for name in [each for each in wanted if each not in missing]:
            found = rivals.run(name, instance, asked.rivals)
            for budget in _numbers(asked.budgets):
                if budget <= asked.rivals:
                    row[f'{name}@{budget:g}'] = rivals.at(found, budget)
            row[f'{name}@{asked.rivals:g}'] = rivals.at(found, math.inf)
        if asked.json:
            asked.json.write_text(json.dumps(runs, indent=1))
    print(table(runs))
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog='bench', description=__doc__)
    add = parser.add_argument
    add('--sizes', default='4x20,8x50,8x100,20x200', help='UAVs x tasks, ...')
    add('--kinds', default='spread,base', help='spread: starts anywhere; base: one start')
    add('--seeds', type=int, default=5, help='instances a size')
    add('--first', type=int, default=1, help='seed of the first instance')
    add('--slack', type=float, default=SLACK, help='ranges over a fair share of a good tour')
    add('--budgets', default='0.1,1', help='[s] of CPU time, ...')
    add('--solvers', default='chain_q', help=f'of {", ".join(SOLVERS)}')
    add('--rivals', type=float, default=0.0, help='[s] for PyVRP and OR-Tools each; 0: not asked')
    add('--against', default='pyvrp,ortools', help='which of them')
    add('--json', type=Path, help='file that keeps all lengths, and adds to those it has')
    return parser


def _numbers(text: str) -> list[float]:
    return [float(each) for each in text.split(',')]


def _instances(asked: argparse.Namespace) -> Iterable[Instance]:
    for kind, size, seed in product(asked.kinds.split(','), asked.sizes.split(','),
                                    range(asked.first, asked.first + asked.seeds)):
        uavs, tasks = (int(each) for each in size.split('x'))
        yield make_instance(uavs, tasks, seed, kind == 'base', asked.slack)


def _length(instance: Instance, solver: str, budget: float) -> float:
    made = plan(instance.uavs, instance.tasks, solver=solver, budget=budget,
                clock=time.process_time)
    return math.inf if made.unassigned else made.distance


def table(runs: Runs) -> str:
    """Mean gap [%] to the best of each instance by size, and how many plans served all."""
    columns = list(dict.fromkeys(name for row in runs.values() for name in row))
    sizes = list(dict.fromkeys(name.rpartition('-')[0] for name in runs))
    lines = ['| instances | ' + ' | '.join(columns) + ' |', '|---' * (len(columns) + 1) + '|']
    for size in sizes:
        rows = [row for name, row in runs.items() if name.rpartition('-')[0] == size]
        cells = (_cell([100.0 * (row[c] / min(row.values()) - 1.0) for row in rows if c in row])
                 for c in columns)
        lines.append(f'| {size} | ' + ' | '.join(cells) + ' |')
    return '\n'.join(lines)


def _cell(gaps: Sequence[float]) -> str:
    served = [gap for gap in gaps if math.isfinite(gap)]
    if not gaps:
        return ''
    if not served:
        return 'none'
    whole = f'{sum(served) / len(served):.2f}'
    return whole if len(served) == len(gaps) else f'{whole} ({len(served)}/{len(gaps)})'
