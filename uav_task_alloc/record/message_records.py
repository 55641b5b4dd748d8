# SPDX-License-Identifier: Apache-2.0
"""Conversion of messages into the lines of a record: JSON values, unknown numbers as null.

A message is any object with the fields of its type: of rclpy, or decoded from an MCAP file.
"""
from __future__ import annotations

import math
from dataclasses import asdict
from typing import Any

from uav_task_alloc.checks import FAR, check_number, check_point
from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.geometry.fence_area import check_fence_area
from uav_task_alloc.geometry.frames import Origin, to_enu
from uav_task_alloc.model import Point
from uav_task_alloc.piece_ids import piece_id
from uav_task_alloc.record.task_shapes import flown_way, task_shape
from uav_task_alloc.zone_codec import JSON_ZONE, decode_zone_array, encode_zone

RecordBody = dict[str, Any]  # a line without its wall time
_Message = Any

# names of the messages' constants, by value
EVENT_ACTIONS = ('ADD', 'UPDATE', 'CANCEL')
_STATES = ('PENDING', 'ASSIGNED', 'ACTIVE', 'COMPLETED', 'FAILED', 'CANCELLED', 'REJECTED',
          'UNASSIGNED')
MODES = ('UNKNOWN', 'STANDBY', 'TAKEOFF', 'ON_MISSION', 'HOLD', 'RETURNING', 'LANDING', 'FAULT')
MISSIONS = ('UNKNOWN', 'UPLOADING', 'VERIFIED', 'MIXED', 'FOREIGN')
FENCES = (*MISSIONS, 'OFF', 'UNSUPPORTED', 'REFUSED')
AUTHORITIES = ('UNKNOWN', 'NONE', 'HELD', 'SUSPENDED', 'LOST')
SEPARATION_ACTIONS = ('NONE', 'HOLD', 'RELEASE', 'UNRESOLVED')
_FRAME_LOCAL, WGS84 = 0, 1  # of a Task message
_ROS_TIMES = ('stamp', 'deadline', 'earliest', 'latest', 'expected')  # of lines and their rows
_TERRAIN = 1  # `vertical` of a Task message


def constant_name(names: tuple[str, ...], value: int) -> str:
    """Return the name of a constant by its value.

    Args:
        names: by value.
        value: of a message.

    Returns:
        '' for an unknown value.
    """
    return names[value] if value < len(names) else ''


def announcement_record(msg: _Message, origin: Origin | None) -> RecordBody:
    """Return the valid tasks of a TaskAnnouncement; the allocator reports the others.

    Args:
        msg: TaskAnnouncement.
        origin: of the ENU frame; None: tasks in WGS84 are left out.

    Returns:
        Kind `announcement`; positions in ENU [m], a cancelled task has its id only; `stamp`
        [unix s] where it has one.
    """
    tasks = []
    for task in msg.tasks:
        if constant_name(EVENT_ACTIONS, msg.action) == 'CANCEL':
            tasks.append({'id': task.task_id})
            continue
        try:
            shape = task_shape(task, origin)
            position = (shape.get('path') or [task_position(task, origin)])[0]
        except InvalidValue:
            continue
        if position is not None:
            tasks.append(
                {'id': task.task_id, 'position': position, 'value': finite_or_none(task.value),
                 'service': from_stamp(task.service_time), **_window(task), **shape,
                 **({'vertical': 'TERRAIN'} if above_ground(task) else {})}
            )
    action = constant_name(EVENT_ACTIONS, msg.action)
    stamp = from_stamp(msg.header.stamp)
    return {'kind': 'announcement', 'action': action, 'tasks': tasks,
            **({'stamp': stamp} if stamp else {})}


def _window(task: _Message) -> RecordBody:
    """`earliest` and `latest` [ROS s] of a task, where it has them."""
    times = {name: from_stamp(getattr(task, name)) for name in ('earliest', 'latest')
             if hasattr(task, name)}  # recordings of earlier versions have none
    return {name: time for name, time in times.items() if time > 0.0}


def task_position(task: _Message, origin: Origin | None) -> Point | None:
    """Return the position of a Task message.

    Args:
        task: of any frame, not yet checked.
        origin: of the ENU frame; None: unknown.

    Returns:
        [m] ENU, z above the ground where `vertical` is TERRAIN; None for WGS84 without an origin.

    Raises:
        InvalidValue: frame or coordinates are invalid.
    """
    place = f'task {task.task_id}: '
    if task.frame == _FRAME_LOCAL:
        return check_point(place + 'position', _xyz(task.position))
    if task.frame != WGS84:
        raise InvalidValue(place + 'frame', task.frame, 'LOCAL (0) or WGS84 (1)')
    if origin is None:
        return None
    check_number(place + 'latitude', task.latitude, -90.0, 90.0)
    check_number(place + 'longitude', task.longitude, -180.0, 180.0)
    check_number(place + 'altitude', task.altitude, -1e5, 1e5)
    x, y, z = to_enu(origin, task.latitude, task.longitude, origin.altitude_amsl + task.altitude)
    return x, y, task.altitude if above_ground(task) else z


def above_ground(task: _Message) -> bool:
    """Return whether the heights of a Task message are above the ground, not the origin.

    Args:
        task: not yet checked; recordings of earlier versions have no such field.
    """
    return getattr(task, 'vertical', 0) == _TERRAIN


def origin_record(msg: _Message) -> RecordBody:
    """The values of a FleetOrigin.

    Args:
        msg: FleetOrigin.

    Returns:
        `latitude`, `longitude` [deg] and `altitude_amsl` [m].

    Raises:
        InvalidValue: a value is out of range.
    """
    origin = Origin(msg.latitude, msg.longitude, msg.altitude_amsl)
    return {'kind': 'origin', **asdict(origin)}


def zones_record(msg: _Message) -> RecordBody:
    """Return the valid zones of a ThreatZoneArray; the allocator reports the others.

    Args:
        msg: ThreatZoneArray.

    Returns:
        Kind `zones`; each zone as JSON values, and the ids of the invalid ones, which stay.

    Raises:
        InvalidValue: there are too many zones or vertices.
    """
    valid, invalid = decode_zone_array(msg)
    return {'kind': 'zones', 'zones': [encode_zone(zone, JSON_ZONE) for zone in valid],
            **({'kept': list(invalid)} if invalid else {})}


def fence_area_record(msg: _Message) -> RecordBody:
    """Return the area that plans stay in.

    Args:
        msg: PolygonStamped in ENU [m]; without points: there is none.

    Returns:
        Kind `fence_area`, its corners [m].

    Raises:
        InvalidValue: it is no area that nodes take.
    """
    points = [(point.x, point.y) for point in msg.polygon.points]
    return {'kind': 'fence_area',
            'corners': check_fence_area(points) if points else ()}


def statuses_record(msg: _Message) -> RecordBody:
    """Return the statuses of a TaskStatusArray.

    Args:
        msg: TaskStatusArray.

    Returns:
        Kind `statuses`.
    """
    return {'kind': 'statuses', 'statuses': [
        {'task': _full_id(row), 'state': constant_name(_STATES, row.state), 'uav': row.uav_id,
         'reason': row.reason, **_expected(row), **_pieces(row)} for row in msg.statuses]}


def _full_id(row: _Message) -> str:
    """The id of a task or piece; recordings of earlier versions have no pieces."""
    return piece_id(row.task_id, getattr(row, 'piece', 0))


def _pieces(row: _Message) -> RecordBody:
    """How many `pieces` work has, and how many are `done`."""
    return {'done': row.pieces_done, 'pieces': row.pieces} if getattr(row, 'pieces', 0) else {}


def _expected(row: _Message) -> RecordBody:
    """`expected` start of a service [ROS s], where it is known."""
    time = from_stamp(row.expected) if hasattr(row, 'expected') else 0.0
    return {'expected': time} if time > 0.0 else {}


def allocation_record(msg: _Message) -> RecordBody:
    """Return the lists and figures of an Allocation.

    Args:
        msg: Allocation.

    Returns:
        Kind `allocation`; `solve_ms` in milliseconds, lengths in m.
    """
    return {
        'kind': 'allocation',
        'revision': msg.revision,
        'trigger': msg.trigger,
        'solve_ms': 1e3 * from_stamp(msg.solve_time),
        'iterations': msg.iterations,
        'warm_started': msg.warm_started,
        'fit': finite_or_none(msg.fit),
        'distance': finite_or_none(msg.distance),
        'lists': [task_list_record(row) for row in msg.lists],
    }


def proposal_record(msg: _Message) -> RecordBody:
    """Return a plan that waits for an operator, or what became of one.

    Args:
        msg: PlanProposal.

    Returns:
        Kind `proposal`; `deadline` [unix s]; `open`: it waits.
    """
    return {'kind': 'proposal', 'revision': msg.plan.revision, 'open': bool(msg.plan.lists),
            'trigger': msg.plan.trigger, 'deadline': from_stamp(msg.deadline),
            'accepted': bool(msg.accepted_on_timeout), 'changes': list(msg.changes)}


def separation_record(msg: _Message) -> RecordBody:
    """Return who would lose separation, how near, and what is done.

    Args:
        msg: SeparationAlert.

    Returns:
        Kind `separation`; `until` [s] from its stamp, lengths in m, None where nothing is
        predicted.
    """
    return {'kind': 'separation', 'uavs': list(msg.uavs),
            'horizontal': finite_or_none(msg.horizontal),
            'vertical': finite_or_none(msg.vertical), 'until': from_stamp(msg.until),
            'action': constant_name(SEPARATION_ACTIONS, msg.action), 'holder': msg.holder,
            'reason': msg.reason}


def task_list_record(msg: _Message) -> RecordBody:
    """Return the remaining tasks of a TaskList.

    Args:
        msg: TaskList.

    Returns:
        Kind `list`; `stamp` [unix s], `eta`, `finish` [s] from `stamp`, `wait` [s], lengths in m;
        `waits`: points [m] to where the UAV waits for tasks, none where it does not.
    """
    waits = msg.end_via if not (msg.tasks or msg.end) else ()  # on the way to its waiting place
    return {'kind': 'list', 'uav': msg.uav_id, 'revision': msg.revision, 'end': msg.end,
            'waits': [xyz for xyz in map(_xyz, waits) if all(map(math.isfinite, xyz))],
            'stamp': from_stamp(msg.header.stamp),
            'distance': finite_or_none(msg.distance), 'tasks': [
                {'id': piece_id(row.task.task_id, getattr(row, 'piece', 0)),
                 'leg_distance': finite_or_none(row.leg_distance) or 0.0, **flown_way(row),
                 'eta': from_stamp(row.eta),
                 **{name: from_stamp(getattr(row, name)) for name in ('wait', 'finish')
                    if hasattr(row, name)},
                 'position': [finite_or_none(v) for v in _xyz(row.task.position)],
                 'via': [xyz for xyz in map(_xyz, row.via) if all(map(math.isfinite, xyz))]}
                for row in msg.tasks]}


def state_record(msg: _Message) -> RecordBody:
    """Return the values of a UavState.

    Args:
        msg: UavState; recordings of earlier versions lack some fields.

    Returns:
        Kind `state`; unknown numbers, and coordinates beyond FAR, are None.
    """
    return {'kind': 'state', 'uav': msg.uav_id, 'mode': constant_name(MODES, msg.mode),
            'mission_state': constant_name(MISSIONS, msg.mission_state),
            'active': piece_id(msg.active_task_id, getattr(msg, 'active_piece', 0)),
            'list_revision': msg.list_revision, 'battery': finite_or_none(msg.battery),
            **{name: [v if abs(v) <= FAR else None for v in _xyz(getattr(msg, name))]
               for name in ('position', 'velocity', 'home')},
            'range_remaining': finite_or_none(msg.range_remaining), 'available': msg.available,
            # missing in recordings of earlier versions
            'authority': constant_name(AUTHORITIES, getattr(msg, 'authority', 0)),
            'reason': getattr(msg, 'reason', ''),
            'fence': constant_name(FENCES, getattr(msg, 'fence_state', 0))}


def shifted(body: RecordBody, offset: float) -> RecordBody:
    """Return a line whose times of the ROS clock are moved to the time of its record.

    Args:
        body: without its wall time.
        offset: [s] that is added.

    Returns:
        A copy, with other `stamp`, `deadline`, windows and expected starts where it has them.
    """
    def moved(row: RecordBody) -> RecordBody:
        return {**row, **{name: row[name] + offset for name in _ROS_TIMES if row.get(name)}}

    return {**moved(body), **{name: [moved(row) for row in body[name]]
                              for name in ('tasks', 'statuses') if name in body}}


def finite_or_none(value: float) -> float | None:
    """None for NaN and the infinities, which JSON cannot represent."""
    return float(value) if math.isfinite(value) else None


def from_stamp(time: _Message) -> float:
    """Return a Time or Duration message as a number.

    Args:
        time: as received.

    Returns:
        [s].
    """
    return float(time.sec) + float(time.nanosec) * 1e-9


def _xyz(point: _Message) -> Point:
    return point.x, point.y, point.z
