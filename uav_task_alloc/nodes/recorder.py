# SPDX-License-Identifier: Apache-2.0
"""Messages as the lines of a record: plain values that JSON can carry, unknown as null."""
from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from uav_task_alloc_msgs import msg as m

from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.geometry.frames import Origin
from uav_task_alloc.nodes.announcements import sort_zones
from uav_task_alloc.nodes.messages import from_point, from_stamp, to_task, to_zone
from uav_task_alloc.record.heard import zone_to_json

Body = dict[str, Any]  # a line without its wall time


def names(kind: type, constants: str) -> dict[int, str]:
    """Constants of a message by value."""
    return {getattr(kind, name): name for name in constants.split()}


ACTIONS = names(m.TaskAnnouncement, 'ADD UPDATE CANCEL')
STATES = names(m.TaskStatus, 'PENDING ASSIGNED ACTIVE COMPLETED FAILED CANCELLED REJECTED '
                             'UNASSIGNED')
MODES = names(m.UavState, 'UNKNOWN STANDBY TAKEOFF ON_MISSION HOLD RETURNING LANDING FAULT')
MISSIONS = names(m.UavState, 'UNKNOWN UPLOADING VERIFIED MIXED FOREIGN')


def announced(msg: m.TaskAnnouncement, origin: Origin) -> Body:
    """The tasks that are good; the allocator says what is wrong with the others."""
    tasks = []
    for task in msg.tasks:
        if msg.action == m.TaskAnnouncement.CANCEL:
            tasks.append({'id': task.task_id})
            continue
        try:
            tasks.append({'id': task.task_id, 'position': to_task(task, origin).position})
        except InvalidValue:
            continue
    return {'kind': 'announcement', 'action': ACTIONS.get(msg.action, ''), 'tasks': tasks}


def zones(msg: m.ThreatZoneArray) -> Body:
    """The zones that are good; the allocator says what is wrong with the others."""
    good, _ = sort_zones(msg, to_zone)
    return {'kind': 'zones', 'zones': [zone_to_json(zone) for zone in good]}


def statuses(msg: m.TaskStatusArray) -> Body:
    """Where every task stands."""
    return {'kind': 'statuses', 'statuses': [
        {'task': row.task_id, 'state': STATES.get(row.state, ''), 'uav': row.uav_id,
         'reason': row.reason} for row in msg.statuses]}


def allocation(msg: m.Allocation) -> Body:
    """A plan in figures."""
    return {'kind': 'allocation', 'revision': msg.revision, 'trigger': msg.trigger,
            'solve_ms': 1e3 * from_stamp(msg.solve_time), 'iterations': msg.iterations,
            'warm_started': msg.warm_started, 'fit': finite(msg.fit),
            'distance': finite(msg.distance), 'lists': [task_list(row) for row in msg.lists]}


def task_list(msg: m.TaskList) -> Body:
    """What a UAV has still to fly; `eta` [s] from `stamp` [unix s]."""
    return {'kind': 'list', 'uav': msg.uav_id, 'revision': msg.revision, 'end': msg.end,
            'stamp': from_stamp(msg.header.stamp),
            'distance': finite(msg.distance), 'tasks': [
                {'id': row.task.task_id, 'leg_distance': finite(row.leg_distance) or 0.0,
                 'eta': from_stamp(row.eta),
                 'via': [from_point(point) for point in row.via]} for row in msg.tasks]}


def state(msg: m.UavState) -> Body:
    """What a UAV does."""
    velocity = (msg.velocity.x, msg.velocity.y, msg.velocity.z)
    return {'kind': 'state', 'uav': msg.uav_id, 'mode': MODES.get(msg.mode, ''),
            'mission_state': MISSIONS.get(msg.mission_state, ''), 'active': msg.active_task_id,
            'list_revision': msg.list_revision, 'battery': finite(msg.battery),
            'position': [finite(v) for v in from_point(msg.position)],
            'velocity': [finite(v) for v in velocity],
            'range_remaining': finite(msg.range_remaining), 'available': msg.available}


def finite(value: float) -> float | None:
    """None for NaN and the infinities, which JSON does not know."""
    return float(value) if math.isfinite(value) else None


def uploads(msg: DiagnosticArray) -> Body:
    """The upload counters a bridge puts into its diagnostics, by name of the status.

    `health`: [level, sentence] by what it is about, a UAV where the bridge speaks.
    """
    return {'kind': 'uploads', 'uploads': dict(_uploads(msg)), 'health': {
        status.hardware_id or status.name: [ord(status.level), status.message]
        for status in msg.status}}


def _uploads(msg: DiagnosticArray) -> Iterable[tuple[str, int]]:
    for status in msg.status:
        for pair in status.values:
            if pair.key == 'uploads' and pair.value.isdigit():
                yield status.name, int(pair.value)
