# SPDX-License-Identifier: Apache-2.0
"""What a record has of tasks that are no points: outlines, paths, and the ways of pieces."""
from __future__ import annotations

import math
from typing import Any

from uav_task_alloc.checks import check_number, check_point
from uav_task_alloc.geometry.frames import Origin, to_enu
from uav_task_alloc.model import Point

_Message = Any
_KINDS = ('POINT', 'LINE', 'AREA', 'ORBIT')  # of a Task message
_WGS84 = 1  # frame of a Task message


def task_shape(task: _Message, origin: Origin | None) -> dict[str, Any]:
    """Return what is drawn of a task that is no point.

    Args:
        task: Task, not yet checked.
        origin: of the ENU frame; None: unknown.

    Returns:
        `work`, the name of its kind; `path`, `holes`, `radius` and
        `strip_width` [m] ENU. Nothing for a point.

    Raises:
        InvalidValue: a coordinate is out of range.
    """
    number = getattr(task, 'kind', 0)  # earlier versions had points only
    if not 0 < number < len(_KINDS):
        return {}
    kind = _KINDS[number]
    rings = [list(filter(None, (_placed(task, point, origin) for point in ring)))
             for ring in (task.path, *(hole.points for hole in task.holes))]
    radius = float(task.radius) if kind == 'ORBIT' and math.isfinite(task.radius) else None
    width = float(task.strip_width) if kind == 'AREA' and math.isfinite(task.strip_width) else None
    return {'work': kind, 'path': rings[0], 'holes': rings[1:], 'radius': radius,
            'strip_width': width}


def _placed(task: _Message, point: _Message, origin: Origin | None) -> Point | None:
    """A point of a path [m] ENU; None for WGS84 without an origin."""
    place = f'task {task.task_id}: path'
    if task.frame != _WGS84:
        return check_point(place, _xyz(point))
    if origin is None:
        return None
    x, y, z = check_point(place, _xyz(point))
    check_number(place, x, -180.0, 180.0)
    check_number(place, y, -90.0, 90.0)
    return to_enu(origin, y, x, origin.altitude_amsl + z)


def flown_way(row: _Message) -> dict[str, Any]:
    """Return the way of a task of a list.

    Args:
        row: PlannedTask.

    Returns:
        `way` of a piece [m] ENU, in the order in which it is flown; nothing for a point.
    """
    path = [xyz for xyz in map(_xyz, getattr(row.task, 'path', ()))
            if all(map(math.isfinite, xyz))]
    if len(path) < 2 or row.task.kind != _KINDS.index('LINE'):
        return {}
    return {'way': path[::-1] if row.reversed else path}


def _xyz(point: _Message) -> Point:
    return point.x, point.y, point.z
