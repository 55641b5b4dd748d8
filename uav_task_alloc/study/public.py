# SPDX-License-Identifier: Apache-2.0
"""Public instances by the text of their files: team orienteering, its multi-source form, MDVRP.

Chao's team orienteering: `n`, `m`, `tmax`, then x, y, score a line; the first point is every
vehicle's start, the last its end. Multi-source (MSTOP): two columns more, whether a point is a
start and how many vehicles start there; the end is the last point (or the one whose second flag
alone is set). Cordeau's MDVRP: loads are left out, since UAVs carry none here; so are instances
whose durations hold service times, which ranges do not.
"""
from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import cycle, islice
from pathlib import Path

from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.model import Task, Uav
from uav_task_alloc.study.instances import Instance

TABLE = 'best_known.txt'  # in a folder: a file's name and its best value or length a line
Numbers = list[list[float]]


def read_folder(folder: Path, pattern: str = '*') -> tuple[dict[str, str], dict[str, str]]:
    """Texts of the instances whose names match, and why others are left out; by file name."""
    texts, left = {}, {}
    for path in sorted(folder.glob(pattern)):
        if not path.is_file() or path.name == TABLE:
            continue
        try:
            texts[path.name] = path.read_text()
            parse_instance(path.name, texts[path.name])
        except (InvalidValue, UnicodeDecodeError) as error:
            texts.pop(path.name, None)
            left[path.name] = str(error)
    return texts, left


def best_known(folder: Path) -> dict[str, float]:
    """The folder's table of best values, where it has one."""
    path = folder / TABLE
    lines = path.read_text().splitlines() if path.exists() else []
    rows = [line.split() for line in lines if line.strip() and not line.startswith('#')]
    return {row[0]: float(row[1]) for row in rows}


def parse_instance(name: str, text: str, known: float = math.nan) -> Instance:
    """The instance a file's text describes. Raises InvalidValue."""
    lines = [line.split() for line in text.splitlines() if line.strip()]
    try:
        if lines and lines[0][0] == 'n':
            return _orienteering(name, lines, known)
        return _mdvrp(name, [[float(each) for each in line] for line in lines], known)
    except (ValueError, IndexError) as error:
        if isinstance(error, InvalidValue):
            raise
        raise InvalidValue(name, text[:40], 'an instance of Chao, MSTOP or Cordeau') from None


def _orienteering(name: str, lines: Sequence[Sequence[str]], known: float) -> Instance:
    head = {line[0]: float(line[1]) for line in lines[:3]}
    points = [[float(each) for each in line] for line in lines[3:]]
    if len(points) != head['n'] or len(points) < 2:
        raise InvalidValue(f'{name}: points', len(points), f'n = {head["n"]:g}, at least 2')
    flagged = len(points[0]) >= 5
    starts = [i for i, p in enumerate(points) if p[3]] if flagged else [0]
    ends = [i for i, p in enumerate(points) if flagged and p[4] and not p[3]]
    end = ends[0] if ends else len(points) - 1
    if not starts or len(ends) > 1:
        raise InvalidValue(f'{name}: starts, ends', (len(starts), len(ends)), 'a start, one end')
    vehicles = int(head['m'])
    crews = [i for i in starts for _ in range(int(points[i][4]))] if flagged else []
    if len(crews) != vehicles:  # the flag only says that vehicles may start there
        crews = list(islice(cycle(starts), vehicles))
    home = _place(points[end])
    uavs = tuple(Uav(f'u{i}', _place(points[crew]), head['tmax'], home=home)
                 for i, crew in enumerate(crews))
    tasks = tuple(Task(f't{i}', _place(p), value=p[2]) for i, p in enumerate(points)
                  if i not in starts and i != end and p[2] > 0.0)
    return Instance(name, uavs, tasks, (), 'home', True, known)


def _mdvrp(name: str, rows: Numbers, known: float) -> Instance:
    kind, vehicles, customers, depots = (int(each) for each in rows[0][:4])
    if kind != 2 or len(rows) != 1 + 2 * depots + customers:
        raise InvalidValue(f'{name}: type, lines', (kind, len(rows)),
                           'type 2, a line a depot, a customer and a depot again')
    limits, served = rows[1:1 + depots], rows[1 + depots:1 + depots + customers]
    if any(limit[0] for limit in limits) and any(row[3] for row in served):
        raise InvalidValue(f'{name}: service times', max(row[3] for row in served),
                           '0 where durations are limited: ranges hold no service time')
    uavs = [Uav(f'u{d}_{i}', (row[1], row[2], 0.0), limit[0] or math.inf)
            for d, (row, limit) in enumerate(zip(rows[-depots:], limits, strict=True))
            for i in range(vehicles)]
    tasks = [Task(f't{row[0]:g}', (row[1], row[2], 0.0)) for row in served]
    bound = any(0.0 < limit[1] < sum(row[4] for row in served) for limit in limits)
    return Instance(name, tuple(uavs), tuple(tasks), (), 'home', False,
                    math.nan if bound else known)  # published with loads: another problem


def _place(point: Sequence[float]) -> tuple[float, float, float]:
    return point[0], point[1], 0.0
