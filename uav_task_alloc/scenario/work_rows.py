# SPDX-License-Identifier: Apache-2.0
"""Rows of tasks that are lines, areas or orbits: their points, cameras and actions."""
from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

from uav_task_alloc.actions import Action
from uav_task_alloc.geometry.frames import Origin, to_enu
from uav_task_alloc.model import Point, Task
from uav_task_alloc.scenario.checked_yaml import YamlRow
from uav_task_alloc.scenario.work_schema import FARTHEST
from uav_task_alloc.work.footprint import Camera, Footprint, footprint
from uav_task_alloc.work.pieces import Work
from uav_task_alloc.work.values import Kind, Vertical

_MILLIMETRES = 'sensor_width', 'sensor_height', 'focal_length'


def from_degrees(row: YamlRow, origin: Origin, altitude: float | None = None,
                 above_ground: bool = False) -> Point:
    """Return ENU [m] of the latitude and longitude of a row.

    Args:
        row: also with an `altitude` perhaps.
        origin: of the ENU frame.
        altitude: [m] above the origin, where the row has none.
        above_ground: whether altitudes are above the ground: z is as given, as up at a place is
            not up at the origin.

    Raises:
        ScenarioError: it is too far from the origin.
    """
    own = row.values.get('altitude')
    above = (altitude or 0.0) if own is None else own
    point = to_enu(origin, row['latitude'], row['longitude'], origin.altitude_amsl + above)
    if not math.hypot(*point) <= FARTHEST:
        raise row.refuse('latitude', f'a place within {FARTHEST / 1e3:g} km of the origin, '
                                     f'{origin.latitude:g}, {origin.longitude:g}')
    return (point[0], point[1], above) if above_ground else point


def work_position(row: YamlRow, origin: Origin) -> Point:
    """Return the first point of the path of a line or area.

    Raises:
        ScenarioError: there is no path, or another position as well.
    """
    for key in ('position', 'latitude', 'longitude'):
        if row[key] is not None:
            raise row.refuse(key, f'a path, which says where the {row["kind"]} is')
    if not row['path']:
        raise row.refuse('path', f'the points of the {row["kind"]}')
    return _points(row, 'path', row['path'], origin)[0]


def work_of(row: YamlRow, task: Task, origin: Origin) -> Work | None:
    """Return the work of a row.

    Args:
        row: of a task.
        task: made of it.
        origin: of the ENU frame.

    Returns:
        None for a plain point.

    Raises:
        ScenarioError: a point has no height, or strips have two widths.
        InvalidValue: the work is invalid.
    """
    seen = _footprint(row, task)
    work = Work(
        task if seen is None else _with_photos(task, seen.trigger_distance),
        Kind[row['kind'].upper()], _points(row, 'path', row['path'], origin),
        tuple(_points(row, 'holes', hole, origin, level=0.0) for hole in row['holes']),
        seen.strip_width if seen is not None and row['kind'] == 'area' else row['strip_width'],
        row['direction'], row['radius'], row['turns'], row['divisible'],
        Vertical[row['vertical'].upper()])
    plain = work.kind is Kind.POINT and work.vertical is Vertical.ORIGIN
    return None if plain else work


def _footprint(row: YamlRow, task: Task) -> Footprint | None:
    camera: YamlRow | None = row['camera']
    if camera is None:
        return None
    if row['kind'] not in ('area', 'line'):
        raise row.refuse('camera', 'none: only areas and lines have strips and photos on the way')
    if row['strip_width']:
        raise row.refuse('strip_width', 'either a strip_width or a camera')
    values: dict[str, Any] = {key: value / 1000.0 if key in _MILLIMETRES else value
                              for key, value in camera.values.items()}
    return footprint(Camera(**values), task.position[2])


def _with_photos(task: Task, distance: float) -> Task:
    """The task with photos at a distance, unless its actions say otherwise."""
    if any(action.name in ('trigger', 'video', 'photo') for action in task.actions):
        return task
    return replace(task, actions=(*task.actions, Action('trigger', (('distance', distance),))))


def _points(row: YamlRow, key: str, given: tuple[Any, ...], origin: Origin,
            level: float | None = None) -> tuple[Point, ...]:
    """Points [m] ENU; `level` is the height of those without one, else that of the task."""
    altitude: float | None = row['altitude'] if level is None else level
    points = []
    for each in given:
        height = each['altitude'] if isinstance(each, YamlRow) else (*each, None)[2]
        if height is None and altitude is None:
            raise row.refuse('altitude', f'the height of the points of {key} [m]')
        if isinstance(each, YamlRow):
            points.append(from_degrees(each, origin, altitude, row['vertical'] == 'terrain'))
        else:
            x, y, z = (*each, altitude)[:3]
            points.append((x, y, z))
    return tuple(points)


def task_actions(row: YamlRow) -> tuple[Action, ...]:
    """Return the actions of a task.

    Raises:
        InvalidValue: an action has not the keys that it needs.
    """
    return tuple(Action(action['name'], tuple(
        (key, float(value)) for key, value in action.values.items()
        if key != 'name' and value is not None)) for action in row['actions'])
