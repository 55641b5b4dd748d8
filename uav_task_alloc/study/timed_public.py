# SPDX-License-Identifier: Apache-2.0
"""Parser of public instances with time windows: VRPLIB dialect of PyVRP, and TOPTW.

VRPLIB: types VRPTW, PCVRPTW (prizes), MTVRPTWR (trips from one depot, release times) and MDVRPTW
(several depots, limited durations). Coordinates are metres, UAVs fly 1 m/s: lengths are times.
Convention of the published solutions: lengths cut to one decimal, but those of MDVRPTW as they
are. The best known solution, in a file `.sol` beside the instance, is evaluated as any other.

TOPTW: team orienteering with time windows, for any number of vehicles; the table of good scores
has a column for each. Lengths are cut to one decimal, those of the pr instances to two.
"""
from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.model import Point, Task, Uav
from uav_task_alloc.objective import Objective
from uav_task_alloc.solver.timed.evaluator import evaluate_routes
from uav_task_alloc.study.instances import Instance

RELOADING_TRIPS = 32  # of a vehicle that may reload
_SECTION = '_SECTION'
Row = Sequence[float]


def is_vrplib(text: str) -> bool:
    """Whether a text begins as a VRPLIB instance."""
    return re.match(r'\s*NAME\s*:', text) is not None


def is_toptw(rows: Sequence[Row]) -> bool:
    """Whether lines of numbers are a TOPTW instance: points from 0 on, with windows."""
    return (len(rows) > 3 and len(rows[0]) == 4 and len(rows[1]) == 2 and rows[2][0] == 0.0
            and len(rows) == rows[0][2] + 3)


def parse_toptw(name: str, rows: Sequence[Row], vehicles: int, known: float) -> Instance:
    """Make an instance of team orienteering with time windows.

    Args:
        name: of the file.
        rows: its lines.
        vehicles: at most in use.
        known: a good score.

    Returns:
        An instance that collects value.
    """
    x, y, limit = rows[2][1], rows[2][2], rows[2][-1]
    uavs = tuple(Uav(f'u{i}', (x, y, 0.0), cruise_speed=1.0, available_until=limit)
                 for i in range(vehicles))
    tasks = tuple(Task(f't{row[0]:g}', (row[1], row[2], 0.0), row[4], row[3],
                       earliest=row[-2], latest=row[-1]) for row in rows[3:] if row[4] > 0.0)
    return Instance(name, uavs, tasks, (), 'home', True, known, f'TOPTW-{vehicles}',
                    grain=100.0 if name.startswith('pr') else 10.0)


@dataclass(frozen=True, slots=True)
class _Vrplib:
    """The values of a VRPLIB file: what its head says, and rows of numbers by section."""

    name: str
    head: Mapping[str, str]
    sections: Mapping[str, Sequence[Row]]

    def number(self, key: str, default: float = math.inf) -> float:
        """A number of the head."""
        return float(self.head.get(key, default))

    def column(self, section: str, default: float = 0.0) -> list[float]:
        """The value of each point; the default where the section is missing."""
        rows = self.sections.get(section, ())
        return [row[1] for row in rows] or [default] * int(self.number('DIMENSION'))


def parse_vrplib(name: str, text: str, solution: str = '') -> Instance:
    """Make an instance of a VRPLIB file.

    Args:
        name: of the file.
        text: of the file.
        solution: of the file with its best known solution; '': none.

    Returns:
        The instance; `known` is the cost of the solution as the evaluator has it.

    Raises:
        InvalidValue: a type is not supported, or the solution violates something.
    """
    data = _read_vrplib(name, text)
    makers: Mapping[str, Callable[[_Vrplib], Instance]] = {
        'VRPTW': _one_depot, 'PCVRPTW': _one_depot, 'MTVRPTWR': _one_depot, 'MDVRPTW': _depots}
    kind = data.head.get('TYPE', '')
    if kind not in makers:
        raise InvalidValue(f'{name}: TYPE', kind, f'one of {", ".join(makers)}')
    instance = replace(makers[kind](data), group=kind)
    if not solution:
        return instance
    best = evaluate_routes(instance.uavs, instance.tasks, instance.rules, solution_trips(solution))
    if best.violations:
        raise InvalidValue(f'{name}: solution', best.violations[0], 'a valid one')
    return replace(instance, known=best.cost)


def _read_vrplib(name: str, text: str) -> _Vrplib:
    head, sections = dict[str, str](), dict[str, list[Row]]()
    section = ''
    for line in filter(None, map(str.strip, text.splitlines())):
        key, colon, value = line.partition(':')
        if line.endswith(_SECTION):
            section = line.removesuffix(_SECTION)
            sections[section] = []
        elif line == 'EOF':
            break
        elif colon:
            head[key.strip()] = value.strip()
        elif section:
            sections[section].append([float(each) for each in line.split()])
    points = sections.get('NODE_COORD', [])
    if len(points) != float(head.get('DIMENSION', 0)):
        raise InvalidValue(f'{name}: points', len(points),
                           f'DIMENSION = {head.get("DIMENSION", 0)}')
    return _Vrplib(name, head, sections)


def _points(data: _Vrplib) -> list[Point]:
    return [(row[1], row[2], 0.0) for row in data.sections['NODE_COORD']]


def _tasks(data: _Vrplib, first: int) -> tuple[Task, ...]:
    """The tasks, all points from the first on, numbered from 0 as solutions do."""
    service = data.column('SERVICE_TIME', data.number('SERVICE_TIME', 0.0))
    loads, releases = data.column('DEMAND'), data.column('RELEASE_TIME')
    prizes, windows = data.column('PRIZE', 1.0), data.sections['TIME_WINDOW']
    return tuple(Task(f't{i}', point, prizes[i], service[i], earliest=windows[i][1],
                      latest=windows[i][2], release=releases[i], payload=loads[i])
                 for i, point in enumerate(_points(data)) if i >= first)


def _one_depot(data: _Vrplib) -> Instance:
    window, reloads = data.sections['TIME_WINDOW'][0], 'VEHICLES_RELOAD_DEPOT' in data.sections
    uavs = tuple(Uav(
        f'u{i + 1}', _points(data)[0], cruise_speed=1.0, payload_capacity=data.number('CAPACITY'),
        available_from=window[1], available_until=window[2],
        turnaround=0.0 if reloads else math.inf) for i in range(int(data.number('VEHICLES'))))
    prize = Objective(unserved=1.0) if 'PRIZE' in data.sections else 'distance'
    return Instance(data.name, uavs, _tasks(data, 1), (), 'home', objective=prize,
                    trips=RELOADING_TRIPS if reloads else 1, grain=10.0)


def _depots(data: _Vrplib) -> Instance:
    points, windows = _points(data), data.sections['TIME_WINDOW']
    first = len([row for row in data.sections['DEPOT'] if row[0] > 0])
    uavs = tuple(Uav(
        f'u{row[0]:g}', points[int(row[1]) - 1], cruise_speed=1.0,
        payload_capacity=data.number('CAPACITY'), endurance=data.number('VEHICLES_MAX_DURATION'),
        available_from=windows[int(row[1]) - 1][1], available_until=windows[int(row[1]) - 1][2])
        for row in data.sections['VEHICLES_DEPOT'])
    return Instance(data.name, uavs, _tasks(data, first), (), 'home')


def solution_trips(text: str) -> dict[str, list[list[str]]]:
    """The routes of a solution file.

    Args:
        text: lines `Route #3: 17 4 0 8`; 0 is a visit of the depot.

    Returns:
        Trips by UAV id, as `parse_vrplib` names UAVs and tasks.
    """
    routes: dict[str, list[list[str]]] = {}
    for number, stops in re.findall(r'Route #(\d+):([\d ]*)', text):
        trips: list[list[str]] = [[]]
        for stop in stops.split():
            if stop == '0':
                trips.append([])
            else:
                trips[-1].append(f't{stop}')
        routes[f'u{number}'] = [trip for trip in trips if trip]
    return routes
