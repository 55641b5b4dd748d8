# SPDX-License-Identifier: Apache-2.0
"""Team orienteering: range does not suffice, the choice of tasks is what counts.

    python benchmarks/team_orienteering.py FOLDER [BUDGET ...]

FOLDER holds Chao's instances (`n`, `m`, `tmax`, then x, y, score a line) and `best_known.txt`.
"""
from __future__ import annotations

import sys
import time
from pathlib import Path

from uav_task_alloc import Plan, Task, Uav, plan


def read(path: Path) -> tuple[list[Uav], list[Task]]:
    """UAVs at the first point with home at the last; the points between are tasks."""
    lines = [line.split() for line in path.read_text().split('\n') if line.strip()]
    vehicles, reach = int(lines[1][1]), float(lines[2][1])
    points = [(float(x), float(y), float(score)) for x, y, score in lines[3:]]
    start, home = ((*point[:2], 0.0) for point in (points[0], points[-1]))
    tasks = [Task(f't{i}', (x, y, 0.0), value=score)
             for i, (x, y, score) in enumerate(points) if 0 < i < len(points) - 1 and score > 0]
    return [Uav(f'u{i}', start, reach, home=home) for i in range(vehicles)], tasks


def solve(path: Path, budget: float) -> Plan:
    """The plan within `budget` [s] of CPU time."""
    uavs, tasks = read(path)
    return plan(uavs, tasks, budget=budget, route_end='home', clock=time.process_time)


def main(folder: Path, budgets: list[float]) -> None:
    """Print how often and how nearly the table's scores are reached."""
    table = dict(line.split() for line in (folder / 'best_known.txt').read_text().split('\n')
                 if line.strip() and not line.startswith('#'))
    for budget in budgets:
        scores = {name: solve(folder / name, budget).value for name in table
                  if (folder / name).exists()}
        reached = [score >= float(table[name]) - 1e-9 for name, score in scores.items()]
        share = sum(scores.values()) / sum(float(table[name]) for name in scores)
        print(f'{budget:g} s: table reached on {sum(reached)} of {len(reached)} '
              f'({100 * sum(reached) / len(reached):.1f} %), total score {100 * share:.2f} %')
        print('  short:', ' '.join(f'{name}:{score:g}/{table[name]}' for name, score in
                                   scores.items() if score < float(table[name]) - 1e-9))


if __name__ == '__main__':
    main(Path(sys.argv[1]), [float(each) for each in sys.argv[2:]] or [0.1, 1.0])
