# SPDX-License-Identifier: Apache-2.0
"""Parser of public instances: team orienteering, multi-source team orienteering, MDVRP, and time.

Team orienteering (Chao, Golden and Wasil): `n`, `m`, `tmax`, then a line x, y, score for each
point; all vehicles start at the first point and end at the last. Multi-source (MSTOP): two more
columns, whether a point is a start and how many vehicles start there; the end is the last point,
or the one of which only the second flag is set. Multi-depot vehicle routing (Cordeau): loads are
ignored, since UAVs carry none here; instances with service times in limited durations are
refused, since a range does not include them. Instances with time windows: see timed_public.py.
"""
from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import cycle, islice
from pathlib import Path
from typing import Any

from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.model import Task, Uav
from uav_task_alloc.study.instances import Instance
from uav_task_alloc.study.timed_public import is_toptw, is_vrplib, parse_toptw, parse_vrplib

BEST_KNOWN_FILE = 'best_known.txt'  # lines: name of an instance file, best known value or length
GOOD_VALUES_FILE = 'good_values.txt'  # lines: name of a TOPTW file, a score for 1, 2 ... vehicles
TABLE_FILES = BEST_KNOWN_FILE, GOOD_VALUES_FILE
MAX_TOPTW_VEHICLES = 4


def read_folder(folder: Path, pattern: str = '*') -> tuple[dict[str, str], dict[str, str]]:
    """Read all instance files of a folder.

    Args:
        folder: may also hold BEST_KNOWN_FILE.
        pattern: glob of file names.

    Returns:
        Texts of the instances, and the reasons why other files are skipped; by file name.
    """
    texts, skipped = {}, {}
    for path in sorted(folder.glob(pattern)):
        if not path.is_file() or path.name in TABLE_FILES or path.suffix == '.sol':
            continue
        try:
            texts[path.name] = path.read_text()
            parse_instance(path.name, texts[path.name])
        except (InvalidValue, UnicodeDecodeError) as error:
            texts.pop(path.name, None)
            skipped[path.name] = str(error)
    return texts, skipped


def best_known(folder: Path) -> dict[str, float]:
    """Best known values or lengths by file name; empty where the folder has no table of them."""
    path = folder / BEST_KNOWN_FILE
    lines = path.read_text().splitlines() if path.exists() else []
    rows = [line.split() for line in lines if line.strip() and not line.startswith('#')]
    return {row[0]: float(row[1]) for row in rows}


def instance_sources(folder: Path, texts: Mapping[str, str]) -> dict[str, dict[str, Any]]:
    """Arguments of `parse_instance` for each instance of a folder.

    Args:
        folder: holds best known values and solutions, where there are any.
        texts: of the instances, by file name.

    Returns:
        By name: that of the file, for TOPTW with the number of vehicles.
    """
    known, scores, sources = best_known(folder), _good_values(folder), dict[str, dict[str, Any]]()
    for name, text in texts.items():
        source: dict[str, Any] = {'name': name, 'text': text}
        if parse_instance(name, text).group.startswith('TOPTW'):
            for vehicles in range(1, MAX_TOPTW_VEHICLES + 1):
                row = scores.get(name, ())[vehicles - 1:vehicles]
                sources[f'{name}*{vehicles}'] = source | {'vehicles': vehicles} | (
                    {'known': row[0]} if row else {})
            continue
        solution = (folder / name).with_suffix('.sol')
        sources[name] = source | ({'known': known[name]} if name in known else {}) | (
            {'solution': solution.read_text()} if solution.exists() else {})
    return sources


def _good_values(folder: Path) -> dict[str, list[float]]:
    """Scores by file name, one for each number of vehicles; empty where there is no table."""
    path = folder / GOOD_VALUES_FILE
    lines = path.read_text().splitlines() if path.exists() else []
    rows = [line.split() for line in lines if line.strip() and not line.startswith('#')]
    return {row[0]: [float(each) for each in row[1:]] for row in rows}


def parse_instance(name: str, text: str, known: float = math.nan, solution: str = '',
                   vehicles: int = MAX_TOPTW_VEHICLES) -> Instance:
    """Parse the text of an instance file.

    Args:
        name: of the file.
        text: of the file.
        known: best known value (team orienteering) or length (MDVRP).
        solution: the best known solution (VRPLIB); '': none.
        vehicles: of team orienteering with time windows.

    Raises:
        InvalidValue: the text is no instance of a supported format.
    """
    lines = [line.split() for line in text.splitlines() if line.strip()]
    try:
        if is_vrplib(text):
            return parse_vrplib(name, text, solution)
        if lines and lines[0][0] == 'n':
            return _orienteering(name, lines, known)
        rows = [[float(each) for each in line] for line in lines]
        if is_toptw(rows):
            return parse_toptw(name, rows, vehicles, known)
        return _mdvrp(name, rows, known)
    except (ValueError, LookupError) as error:
        if isinstance(error, InvalidValue):
            raise
        raise InvalidValue(name, text[:40], 'an instance of Chao, MSTOP, Cordeau, VRPLIB or '
                           'TOPTW') from None


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
    start_of = [i for i in starts for _ in range(int(points[i][4]))] if flagged else []
    if len(start_of) != vehicles:  # the column is a flag: vehicles may start there
        start_of = list(islice(cycle(starts), vehicles))
    home = _position(points[end])
    uavs = tuple(Uav(f'u{i}', _position(points[start]), head['tmax'], home=home)
                 for i, start in enumerate(start_of))
    tasks = tuple(Task(f't{i}', _position(p), value=p[2]) for i, p in enumerate(points)
                  if i not in starts and i != end and p[2] > 0.0)
    return Instance(name, uavs, tasks, (), 'home', True, known)


def _mdvrp(name: str, rows: Sequence[Sequence[float]], known: float) -> Instance:
    kind, vehicles, customers, depots = (int(each) for each in rows[0][:4])
    if kind != 2 or len(rows) != 1 + 2 * depots + customers:
        raise InvalidValue(f'{name}: type, lines', (kind, len(rows)),
                           'type 2, a line for each depot, customer and depot')
    limits, customer_rows = rows[1:1 + depots], rows[1 + depots:1 + depots + customers]
    if any(limit[0] for limit in limits) and any(row[3] for row in customer_rows):
        raise InvalidValue(f'{name}: service times', max(row[3] for row in customer_rows),
                           '0 where durations are limited: ranges hold no service time')
    uavs = [Uav(f'u{d}_{i}', (row[1], row[2], 0.0), limit[0] or math.inf)
            for d, (row, limit) in enumerate(zip(rows[-depots:], limits, strict=True))
            for i in range(vehicles)]
    tasks = [Task(f't{row[0]:g}', (row[1], row[2], 0.0)) for row in customer_rows]
    demand = sum(row[4] for row in customer_rows)
    is_load_limited = any(0.0 < limit[1] < demand for limit in limits)
    return Instance(name, tuple(uavs), tuple(tasks), (), 'home', False,
                    math.nan if is_load_limited else known)  # published with loads


def _position(point: Sequence[float]) -> tuple[float, float, float]:
    return point[0], point[1], 0.0
