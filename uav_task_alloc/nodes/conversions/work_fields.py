# SPDX-License-Identifier: Apache-2.0
"""Kind, path, heading and actions of Task messages to values and back; see docs/tasks.md."""
from __future__ import annotations

import math
from collections.abc import Sequence

from geometry_msgs.msg import Point as PointMsg
from uav_task_alloc_msgs import msg as m

from uav_task_alloc.actions import Action
from uav_task_alloc.checks import check_count, check_member, check_number, check_point
from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.geometry.frames import Origin, to_enu
from uav_task_alloc.model import Point, Task
from uav_task_alloc.nodes.conversions.message_limits import MOST_ACTIONS, MOST_KEYS
from uav_task_alloc.piece_ids import split_piece
from uav_task_alloc.work.pieces import Work
from uav_task_alloc.work.values import MOST_CORNERS, Kind, Vertical

_TURN = 2.0 * math.pi
_ROUNDING = 1e-6  # [rad] of float32


def to_kind(msg: m.Task) -> Kind:
    """Return the kind of a task.

    Args:
        msg: not yet checked.

    Raises:
        InvalidValue: it is unknown.
    """
    return check_member(f'task {msg.task_id}: kind', msg.kind, Kind)


def to_vertical(msg: m.Task) -> Vertical:
    """Return what the heights of a task refer to.

    Args:
        msg: not yet checked.

    Raises:
        InvalidValue: it is unknown.
    """
    return check_member(f'task {msg.task_id}: vertical', msg.vertical, Vertical)


def to_path(place: str, msg: m.Task, points: Sequence[PointMsg],
            origin: Origin) -> tuple[Point, ...]:
    """Return points of a message in ENU.

    Args:
        place: name of the field, for the error text.
        msg: says in which frame they are.
        points: not yet checked.
        origin: of the ENU frame.

    Returns:
        [m]; z as given where `vertical` is TERRAIN: above the ground.

    Raises:
        InvalidValue: there are too many, or one is out of range.
    """
    check_count(place, points, MOST_CORNERS)
    found = []
    for k, point in enumerate(points):
        if msg.frame == m.Task.WGS84:
            check_number(f'{place}[{k}].x (longitude)', point.x, -180.0, 180.0)
            check_number(f'{place}[{k}].y (latitude)', point.y, -90.0, 90.0)
            check_number(f'{place}[{k}].z', point.z, -1e5, 1e5)
            x, y, z = to_enu(origin, point.y, point.x, origin.altitude_amsl + point.z)
            found.append((x, y, z if msg.vertical == m.Task.ORIGIN else point.z))
        else:
            found.append(check_point(f'{place}[{k}]', (point.x, point.y, point.z)))
    return tuple(found)


def to_heading(place: str, msg: m.Task) -> float | None:
    """Return the heading of a task [rad] ENU; None where it is free.

    Args:
        place: `task ID: `, for the error text.
        msg: not yet checked.

    Raises:
        InvalidValue: it is more than a turn, or infinite.
    """
    return to_angle(place + 'heading', msg.heading)


def to_angle(place: str, value: float) -> float | None:
    """Return an angle of a message.

    Args:
        place: name of the field, for the error text.
        value: [rad]; NaN or 0: none.

    Returns:
        [rad] in [0, 2 pi).

    Raises:
        InvalidValue: it is more than a turn, or infinite.
    """
    if math.isnan(value) or value == 0.0:
        return None
    return check_number(place, value, -_TURN - _ROUNDING, _TURN + _ROUNDING) % _TURN


def number_or_zero(value: float) -> float:
    """Return a number of a message; 0 where it has NaN, which is none.

    Args:
        value: not yet checked.
    """
    return 0.0 if math.isnan(value) else float(value)


def to_actions(place: str, msg: m.Task) -> tuple[Action, ...]:
    """Return the actions of a task.

    Args:
        place: `task ID: `, for the error text.
        msg: not yet checked.

    Raises:
        InvalidValue: there are too many, or one is unknown, incomplete or out of range.
    """
    check_count(place + 'actions', msg.actions, MOST_ACTIONS)
    found = []
    for k, each in enumerate(msg.actions):
        here = f'{place}actions[{k}]'
        check_count(f'{here}.keys', each.keys, MOST_KEYS)
        if len(each.keys) != len(each.values):
            raise InvalidValue(f'{here}.values', len(each.values),
                               f'as many as keys, {len(each.keys)}')
        try:
            found.append(Action(each.name, tuple(zip(each.keys, each.values, strict=True))))
        except InvalidValue as error:
            raise InvalidValue(f'{here}: {error.place}', error.value,
                               error.expected) from None
    return tuple(found)


def put_piece(msg: m.Task, task: Task) -> m.Task:
    """Set what only a piece has, and heading and actions.

    Args:
        msg: is changed.
        task: a point, or a piece with its path.

    Returns:
        The same message; of a piece a LINE with the id of the whole task.
    """
    msg.task_id, _ = split_piece(task.id)
    msg.kind = m.Task.LINE if task.path else m.Task.POINT
    msg.path = [_point(point) for point in task.path]
    msg.heading = math.nan if task.heading is None else task.heading or _TURN
    msg.actions = [m.Action(name=each.name, keys=[key for key, _ in each.values],
                            values=[value for _, value in each.values])
                   for each in task.actions]
    return msg


def put_work(msg: m.Task, work: Work) -> m.Task:
    """Set what describes work.

    Args:
        msg: of its task; is changed.
        work: of any kind.

    Returns:
        The same message.
    """
    msg.kind, msg.vertical, msg.divisible = work.kind.value, work.vertical.value, work.divisible
    msg.path = [_point(point) for point in work.path]
    msg.holes = [m.Ring(points=[_point(point) for point in hole]) for hole in work.holes]
    msg.strip_width, msg.radius, msg.turns = work.strip_width, work.radius, work.turns
    msg.direction = math.nan if work.direction is None else work.direction or _TURN
    return msg


def _point(point: Point) -> PointMsg:
    return PointMsg(x=point[0], y=point[1], z=point[2])
