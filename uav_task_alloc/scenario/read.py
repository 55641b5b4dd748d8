# SPDX-License-Identifier: Apache-2.0
"""Reader of scenario files; every error has file, line and reason."""
from __future__ import annotations

import io
from collections.abc import Callable, Iterable, Sequence
from difflib import get_close_matches
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from uav_task_alloc.errors import InvalidValue, ScenarioError
from uav_task_alloc.geometry.fence_area import check_fence_area, zones_outside
from uav_task_alloc.geometry.frames import Origin
from uav_task_alloc.model import Point, Shape, Task, ThreatZone
from uav_task_alloc.objective import Objective
from uav_task_alloc.scenario.checked_yaml import YamlRow, compose, read_row, refusal
from uav_task_alloc.scenario.generate import draw_points
from uav_task_alloc.scenario.schema import GEODETIC, SCENARIO
from uav_task_alloc.scenario.values import (
    DEFAULT_ORIGIN,
    TASK_TIMES,
    UAV_LIMITS,
    Cancel,
    Scenario,
    ScenarioUav,
    ScenarioWind,
    TimedOrder,
    TimedTask,
    TimedZone,
)
from uav_task_alloc.scenario.work_rows import from_degrees, task_actions, work_of, work_position
from uav_task_alloc.separation.rule import Separation
from uav_task_alloc.zone_codec import USED_KEYS, decode_zone

_Value = TypeVar('_Value')
_LARGEST_FILE = 100_000_000  # [bytes]
_CENTER_IN_DEGREES = {'hemisphere': ('latitude', 'longitude', 'altitude'),
                      'cylinder': ('latitude', 'longitude')}


def load(path: str | Path) -> Scenario:
    """Read a scenario file.

    Args:
        path: of a YAML file.

    Returns:
        With the random arrivals drawn.

    Raises:
        ScenarioError: `file:line: reason`; the file cannot be read or is no scenario.
    """
    try:
        with Path(path).open('rb') as file:  # a device may have no end
            data = file.read(_LARGEST_FILE + 1)
        text = io.TextIOWrapper(io.BytesIO(data), encoding='utf-8').read()
    except OSError as error:
        raise ScenarioError(f'{str(path) or repr(path)}: {error.strerror}: '
                            'expected a scenario file') from None
    except UnicodeDecodeError as error:
        line = error.object.count(b'\n', 0, error.start) + 1
        raise ScenarioError(f'{path}:{line}: byte {error.object[error.start]:#04x}: '
                            'expected UTF-8 text') from None
    if len(data) > _LARGEST_FILE:
        raise ScenarioError(f'{path}: more than {_LARGEST_FILE} bytes: expected a scenario file')
    return parse(text, str(path))


def parse(text: str, name: str = 'scenario') -> Scenario:
    """Read the text of a scenario file.

    Args:
        text: YAML.
        name: of the file, for errors.

    Returns:
        With the random arrivals drawn.

    Raises:
        ScenarioError: `name:line: reason`.
    """
    root = read_row(SCENARIO, 'scenario', compose(text, name))
    origin = _origin(root['origin'])
    uavs = tuple(_uav(row, i + 1, origin) for i, row in enumerate(root['uavs']))
    if not uavs:
        raise root.refuse('uavs', 'at least one UAV')
    _unique(root['uavs'], 'id', [uav.id for uav in uavs])
    _unique(root['uavs'], 'system_id', [uav.system_id for uav in uavs])
    zones = tuple(_zone(row, origin) for row in root['zones'])
    _unique(root['zones'], 'id', [timed.zone.id for timed in zones])
    area = _valid(root, lambda: check_fence_area(_enu_corners(root['fence_area'], origin))
                  if root['fence_area'] else ())
    tasks = [_task(row, origin, [uav.id for uav in uavs]) for row in root['tasks']]
    _unique(root['tasks'], 'id', [timed.task.id for timed in tasks])
    if root['arrivals'] is not None:
        tasks += _arrivals(root['arrivals'], [*(timed.zone for timed in zones),
                                              *zones_outside(area)], tasks, root['seed'])
    times = {timed.task.id: timed.at for timed in tasks}
    if not root['altitude_min'] < root['altitude_max']:
        raise root.refuse('altitude_min', f'less than altitude_max = {root["altitude_max"]:g}')
    cancels = [_cancel(row, times) for row in root['cancels']]
    return Scenario(root['name'] or Path(name).stem, root['seed'], origin, uavs,
                    tuple(sorted(tasks, key=lambda timed: timed.at)), zones,
                    tuple(sorted(cancels, key=lambda cancel: cancel.at)), root['route_end'],
                    root['speedup'], root['clearance'], root['altitude_min'],
                    root['altitude_max'], _objective(root['objective']), root['trips'],
                    ScenarioWind(**root['wind'].values) if root['wind'] else ScenarioWind(),
                    _separation(root['separation']),
                    _orders(root['orders'], times, [uav.id for uav in uavs]), area)


def _separation(given: YamlRow | None) -> Separation:
    if given is None:
        return Separation()
    return _valid(given, lambda: Separation(**given.values))


def _objective(given: str | YamlRow | None) -> str | Objective | None:
    if given is None or isinstance(given, str):
        return given
    return _valid(given, lambda: Objective(**given.values))


def _origin(row: YamlRow | None) -> Origin:
    if row is None:
        return DEFAULT_ORIGIN
    return Origin(row['latitude'], row['longitude'], row['altitude_amsl'])


def _uav(row: YamlRow, number: int, origin: Origin) -> ScenarioUav:
    position, home = _position(row, origin), row['home']
    if isinstance(home, YamlRow):
        home = from_degrees(home, origin)
    uav = ScenarioUav(
        row['id'], row['system_id'] or number, row['autopilot'], position, home or position,
        row['cruise_speed'], row['range'], frozenset(row['capabilities']), row['dies_at'],
        **{name: row[name] for name in UAV_LIMITS})
    _valid(row, lambda: uav.uav)
    if uav.system_id > 255:
        raise row.refuse('system_id', 'a whole number in [1, 255], as there are more UAVs')
    return uav


def _task(row: YamlRow, origin: Origin, uavs: list[str]) -> TimedTask:
    allowed = row['allowed_uavs']
    for name in allowed or ():
        if name not in uavs:
            raise row.refuse('allowed_uavs', _one_of('UAVs', name, uavs))
    if row['kind'] in ('line', 'area'):
        position = work_position(row, origin)
    else:
        position = _position(row, origin)
    task = _valid(row, lambda: Task(
        row['id'], position, row['value'], row['service_time'],
        frozenset(row['required_capabilities']), None if allowed is None else frozenset(allowed),
        row['acceptance_radius'], **{name: row[name] for name in TASK_TIMES},
        heading=row['heading'], actions=task_actions(row)))
    work = _valid(row, lambda: work_of(row, task, origin))
    return TimedTask(row['at'], task if work is None else work.task, work)


def _position(row: YamlRow, origin: Origin) -> Point:
    geodetic = [row[key] for key in GEODETIC]
    if (row['position'] is None) == all(value is None for value in geodetic):
        raise row.refuse('position', 'either position, or latitude, longitude and altitude')
    if row['position'] is not None:
        x, y, z = row['position']
        return x, y, z
    for key in GEODETIC:
        if row[key] is None:
            raise row.refuse(key, 'all three of latitude, longitude, altitude')
    return from_degrees(row, origin, above_ground=row.values.get('vertical') == 'terrain')


def _zone(row: YamlRow, origin: Origin) -> TimedZone:
    used = USED_KEYS[Shape[row['shape'].upper()]]
    _zonefrom_degrees(row, origin)
    for key in used:
        if row[key] is None:
            raise row.refuse(key, f'it for a {row["shape"]}')
    for key in ('center', *GEODETIC, 'radius', 'vertices', 'z_min', 'z_max'):
        if key in row.nodes and key not in (*used, *_CENTER_IN_DEGREES.get(row['shape'], ())):
            raise row.refuse(key, f'no such key for a {row["shape"]}')
    if row['shape'] == 'hemisphere' and len(row['center']) < 3:
        raise row.refuse('center', 'three numbers [x, y, z] for a hemisphere')
    if not row['appears'] < row['vanishes']:
        raise row.refuse('vanishes', f'a time after appears = {row["appears"]:g}')
    zone = _valid(row, lambda: decode_zone(
        {key: row[key] for key in ('id', 'shape', *used, 'margin')}))
    return TimedZone(zone, row['appears'], row['vanishes'])


def _zonefrom_degrees(row: YamlRow, origin: Origin) -> None:
    """Replace the values of a zone that are in degrees by ENU."""
    geodetic = _CENTER_IN_DEGREES.get(row['shape'], ())
    if any(row[key] is not None for key in geodetic):
        if row['center'] is not None:
            raise row.refuse('center', f'either center, or {" and ".join(geodetic)}')
        for key in geodetic:
            if row[key] is None:
                raise row.refuse(key, f'all of {", ".join(geodetic)}')
        row.values['center'] = from_degrees(row, origin)
    row.values['vertices'] = row['vertices'] and _enu_corners(row['vertices'], origin)


def _enu_corners(corners: Iterable[Any], origin: Origin) -> tuple[tuple[float, float], ...]:
    """Corners in metres or degrees as (east, north) [m]."""
    return tuple(from_degrees(corner, origin)[:2] if isinstance(corner, YamlRow) else corner
                 for corner in corners)


def _cancel(row: YamlRow, times: dict[str, float]) -> Cancel:
    if row['task'] not in times:
        raise row.refuse('task', _one_of('tasks', row['task'], times))
    if row['at'] < times[row['task']]:
        raise row.refuse('at', f'not before it is announced at {times[row["task"]]:g}')
    return Cancel(row['at'], row['task'])


def _orders(rows: Iterable[YamlRow], times: dict[str, float],
            uavs: list[str]) -> tuple[TimedOrder, ...]:
    for row in rows:
        tasks = row['tasks']
        if row['uav'] not in uavs:
            raise row.refuse('uav', _one_of('UAVs', row['uav'], uavs))
        for name in tasks:
            if name not in times:
                raise row.refuse('tasks', _one_of('tasks', name, times))
            if row['at'] < times[name]:
                raise row.refuse('at', f'not before {name} is announced at {times[name]:g}')
        if len(set(tasks)) < len(tasks):
            raise row.refuse('tasks', 'each task once')
        if row['order'] != 'next' and len(tasks) > 1:
            raise row.refuse('tasks', f'one task to {row["order"]}')
    return tuple(sorted((TimedOrder(**row.values) for row in rows), key=lambda order: order.at))


def _arrivals(row: YamlRow, zones: Sequence[ThreatZone], tasks: list[TimedTask],
              seed: int) -> list[TimedTask]:
    first, last = row['between']
    low, high = row['area']
    if not first <= last:
        raise row.refuse('between', 'the first time not after the last')
    if any(a > b for a, b in zip(low, high, strict=True)):
        raise row.refuse('area', 'the lower corner first')
    rng = np.random.default_rng(seed)
    times = sorted(round(float(t), 1) for t in rng.uniform(first, last, row['count']))
    points = draw_points(rng, row['count'], low, high, zones)
    if len(points) < row['count']:
        raise row.refuse('area', 'a box with room outside the zones')
    ids = [f'{row["prefix"]}{i:02d}' for i in range(1, row['count'] + 1)]
    taken = {timed.task.id for timed in tasks}.intersection(ids)
    if taken:
        raise row.refuse('prefix', f'one that gives no id twice; {min(taken)!r} is a task')
    return [TimedTask(at, Task(name, point, row['value'], row['service_time']))
            for at, name, point in zip(times, ids, points, strict=True)]


def _one_of(kind: str, name: str, known: Iterable[str]) -> str:
    nearest = get_close_matches(name, list(known), 1, 0.0)
    return f'one of the {kind} of this file' + (f'; nearest is {nearest[0]!r}' if nearest else '')


def _unique(rows: Iterable[YamlRow], key: str, values: Iterable[Any]) -> None:
    seen: dict[Any, YamlRow] = {}
    for row, value in zip(rows, values, strict=True):
        if value in seen:
            line = seen[value].node.start_mark.line + 1
            raise refusal(row.nodes.get(key, row.node),
                          f'{row.place}.{key} = {value}: expected one not given before; '
                          f'first in line {line}')
        seen[value] = row


def _valid(row: YamlRow, build: Callable[[], _Value]) -> _Value:
    """The result of `build`; its InvalidValue becomes a ScenarioError with the line of the row."""
    try:
        return build()
    except InvalidValue as error:
        key = error.place.rpartition(' ')[2].partition('[')[0]
        raise refusal(row.nodes.get(key, row.node), f'{row.place}: {error}') from None
