# SPDX-License-Identifier: Apache-2.0
"""Messages as the lines of a record: plain values that JSON can carry, unknown as null.

A message is whatever has the fields of its type: one of rclpy, or one read from a file.
"""
from __future__ import annotations

import math
import re
from collections.abc import Iterable
from typing import Any

from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.geometry.frames import Origin, to_enu
from uav_task_alloc.model import Point, check_number, check_point
from uav_task_alloc.zone_codec import JSON_ZONE, decode_zone_array, encode_zone

RecordBody = dict[str, Any]  # a line without its wall time
_Message = Any

# constants of the messages, by value
ACTIONS = ('ADD', 'UPDATE', 'CANCEL')
_STATES = ('PENDING', 'ASSIGNED', 'ACTIVE', 'COMPLETED', 'FAILED', 'CANCELLED', 'REJECTED',
          'UNASSIGNED')
MODES = ('UNKNOWN', 'STANDBY', 'TAKEOFF', 'ON_MISSION', 'HOLD', 'RETURNING', 'LANDING', 'FAULT')
MISSIONS = ('UNKNOWN', 'UPLOADING', 'VERIFIED', 'MIXED', 'FOREIGN')
AUTHORITIES = ('UNKNOWN', 'NONE', 'HELD', 'SUSPENDED', 'LOST')
_COUNT = re.compile('[0-9]{1,18}')  # what isdigit() takes int() may not
NOTHING = 'nothing is needed'  # gives back what the bridge has
LOCAL = 0  # frame of a task


def word(words: tuple[str, ...], value: int) -> str:
    """The name of a constant; '' where it has none."""
    return words[value] if value < len(words) else ''


def announced_tasks(msg: _Message, origin: Origin | None) -> RecordBody:
    """The tasks that are good; the allocator says what is wrong with the others.

    Without an origin, those in degrees have no place and are left out.
    """
    tasks = []
    for task in msg.tasks:
        if word(ACTIONS, msg.action) == 'CANCEL':
            tasks.append({'id': task.task_id})
            continue
        try:
            position = task_place(task, origin)
        except InvalidValue:
            continue
        if position is not None:
            tasks.append(
                {'id': task.task_id, 'position': position, 'value': finite_or_none(task.value)}
            )
    return {'kind': 'announcement', 'action': word(ACTIONS, msg.action), 'tasks': tasks}


def task_place(task: _Message, origin: Origin | None) -> Point | None:
    """Where a Task message is [m]; None where that takes an origin. Raises InvalidValue."""
    if task.frame == LOCAL:
        return check_point('position', _xyz(task.position))
    if origin is None:
        return None
    check_number('altitude', task.altitude, -1e5, 1e5)
    return to_enu(origin, check_number('latitude', task.latitude, -90.0, 90.0),
                  check_number('longitude', task.longitude, -180.0, 180.0),
                  origin.altitude_amsl + task.altitude)


def announced_zones(msg: _Message) -> RecordBody:
    """The valid zones; the allocator reports the others. Raises InvalidValue for too many."""
    valid, _ = decode_zone_array(msg)
    return {'kind': 'zones', 'zones': [encode_zone(zone, JSON_ZONE) for zone in valid]}


def statuses(msg: _Message) -> RecordBody:
    """Where every task stands."""
    return {'kind': 'statuses', 'statuses': [
        {'task': row.task_id, 'state': word(_STATES, row.state), 'uav': row.uav_id,
         'reason': row.reason} for row in msg.statuses]}


def allocation_record(msg: _Message) -> RecordBody:
    """A plan in figures."""
    return {
        'kind': 'allocation',
        'revision': msg.revision,
        'trigger': msg.trigger,
        'solve_ms': 1e3 * seconds(msg.solve_time),
        'iterations': msg.iterations,
        'warm_started': msg.warm_started,
        'fit': finite_or_none(msg.fit),
        'distance': finite_or_none(msg.distance),
        'lists': [task_list_record(row) for row in msg.lists],
    }


def task_list_record(msg: _Message) -> RecordBody:
    """What a UAV has still to fly; `eta` [s] from `stamp` [unix s]. Via points are places."""
    return {'kind': 'list', 'uav': msg.uav_id, 'revision': msg.revision, 'end': msg.end,
            'stamp': seconds(msg.header.stamp),
            'distance': finite_or_none(msg.distance), 'tasks': [
                {'id': row.task.task_id, 'leg_distance': finite_or_none(row.leg_distance) or 0.0,
                 'eta': seconds(row.eta),
                 'position': [finite_or_none(v) for v in _xyz(row.task.position)],
                 'via': [xyz for xyz in map(_xyz, row.via) if all(map(math.isfinite, xyz))]}
                for row in msg.tasks]}


def state(msg: _Message) -> RecordBody:
    """What a UAV does."""
    return {'kind': 'state', 'uav': msg.uav_id, 'mode': word(MODES, msg.mode),
            'mission_state': word(MISSIONS, msg.mission_state), 'active': msg.active_task_id,
            'list_revision': msg.list_revision, 'battery': finite_or_none(msg.battery),
            'position': [finite_or_none(v) for v in _xyz(msg.position)],
            'velocity': [finite_or_none(v) for v in _xyz(msg.velocity)],
            'range_remaining': finite_or_none(msg.range_remaining), 'available': msg.available,
            # recordings of earlier versions have neither
            'authority': word(AUTHORITIES, getattr(msg, 'authority', 0)),
            'reason': getattr(msg, 'reason', '')}


def uploads(msg: _Message) -> RecordBody:
    """The upload counters a bridge puts into its diagnostics, by name of the status.

    `health`: [level, sentence] by what it is about, a UAV where the bridge speaks; `authority`:
    who has each UAV.
    """
    return {'kind': 'uploads', 'uploads': dict(_uploads(msg)), 'authority': dict(
        _authority(msg)), 'health': {
        status.hardware_id or status.name: [
            status.level if isinstance(status.level, int) else ord(status.level), status.message]
        for status in msg.status}}


def _uploads(msg: _Message) -> Iterable[tuple[str, int]]:
    for status in msg.status:
        for pair in status.values:
            if pair.key == 'uploads' and _COUNT.fullmatch(pair.value):
                yield status.name, int(pair.value)


def _authority(msg: _Message) -> Iterable[tuple[str, RecordBody]]:
    """By UAV: the state, why, for how long [s; None: unknown], and what gives it back."""
    for status in msg.status:
        said = {pair.key: pair.value for pair in status.values}
        if 'authority' in said:
            back = said.get('given_back_by', '')
            yield status.hardware_id, {
                'state': said['authority'], 'why': said.get('authority_why', ''),
                'for': _number(said.get('authority_for', '')),
                'back': '' if back == NOTHING else back}


def _number(text: str) -> float | None:
    """Of `12 s`; None where it is none."""
    try:
        return finite_or_none(float(text.removesuffix(' s')))
    except ValueError:
        return None


def finite_or_none(value: float) -> float | None:
    """None for NaN and the infinities, which JSON does not know."""
    return float(value) if math.isfinite(value) else None


def seconds(time: _Message) -> float:
    """A Time or Duration message in [s]."""
    return float(time.sec) + float(time.nanosec) * 1e-9


def _xyz(point: _Message) -> Point:
    return point.x, point.y, point.z
