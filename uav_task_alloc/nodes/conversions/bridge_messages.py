# SPDX-License-Identifier: Apache-2.0
"""Messages of the bridge to the values of its core and back."""
from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import replace

from geometry_msgs.msg import Vector3
from uav_task_alloc_msgs import msg as m

from uav_task_alloc.allocator.records import REPORTED_LIMITS
from uav_task_alloc.checks import check_point
from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.geometry.frames import Origin
from uav_task_alloc.mavlink.gcs.status import UavStatus
from uav_task_alloc.mavlink.mission.items import MissionStop, TaskList
from uav_task_alloc.mavlink.mission.task_progress import TaskProgress
from uav_task_alloc.model import Task, ThreatZone
from uav_task_alloc.nodes.conversions.message_limits import MOST_POINTS
from uav_task_alloc.nodes.conversions.messages import from_point, header, to_point, to_task
from uav_task_alloc.nodes.conversions.work_fields import to_kind, to_path
from uav_task_alloc.piece_ids import piece_id, split_piece
from uav_task_alloc.record.message_records import from_stamp
from uav_task_alloc.work.values import Kind
from uav_task_alloc.zone_codec import decode_zone_array

_UNKNOWN_POINT = (math.nan, math.nan, math.nan)
_EVENTS = {'STARTED': m.TaskEvent.STARTED, 'COMPLETED': m.TaskEvent.COMPLETED,
           'FAILED': m.TaskEvent.FAILED}


def to_list(msg: m.TaskList, uav_id: str, origin: Origin, radius: float) -> TaskList:
    """Return the list that a UAV is to fly.

    Args:
        msg: the message.
        uav_id: of the topic it came on.
        origin: of the ENU frame.
        radius: acceptance radius [m] of tasks without one; 0: that of the autopilot.

    Returns:
        Positions in ENU [m]; tasks in WGS84 are converted.

    Raises:
        InvalidValue: a field, which it names, is invalid.
    """
    if msg.uav_id not in ('', uav_id):
        raise InvalidValue('uav_id', msg.uav_id, uav_id)
    place = f'task_list of {uav_id}: '
    points = len(msg.tasks) + len(msg.end_via) + sum(
        len(planned.via) + len(planned.task.path) for planned in msg.tasks)
    if points > MOST_POINTS:
        raise InvalidValue(place + 'points', points, f'at most {MOST_POINTS}')
    stamp = from_stamp(msg.header.stamp)
    stops = tuple(_to_stop(planned, origin, radius, stamp) for planned in msg.tasks)
    names = [stop.task.id for stop in stops]
    if len(set(names)) != len(names):
        raise InvalidValue(place + 'task ids', names, 'each once')
    if msg.end not in (m.TaskList.HOLD, m.TaskList.RETURN_HOME):
        raise InvalidValue(place + 'end', msg.end, 'HOLD (0) or RETURN_HOME (1)')
    end_via = tuple(check_point(place + 'end_via', from_point(point)) for point in msg.end_via)
    return TaskList(msg.revision, stops, msg.end == m.TaskList.RETURN_HOME, end_via, stamp)


def _to_piece(msg: m.Task, full_id: str, origin: Origin) -> Task:
    """A task of a list: a point, or a piece with its path."""
    kind = to_kind(msg)
    place = f'task {full_id}: '
    if kind not in (Kind.POINT, Kind.LINE):
        raise InvalidValue(place + 'kind', msg.kind, 'POINT (0) or LINE (1) in a list')
    path = to_path(place + 'path', msg, msg.path, origin) if kind is Kind.LINE else ()
    if kind is Kind.LINE and len(path) < 2:
        raise InvalidValue(place + 'path', len(path), 'at least 2 points of a LINE')
    return replace(to_task(msg, origin, path[0] if path else None), id=full_id, path=path)


def _to_stop(planned: m.PlannedTask, origin: Origin, radius: float, stamp: float) -> MissionStop:
    task = _to_piece(planned.task, piece_id(planned.task.task_id, planned.piece), origin)
    eta, wait = from_stamp(planned.eta), from_stamp(planned.wait)
    if wait < 0.0:
        raise InvalidValue(f'task {task.id}: wait', wait, 'at least 0 s')
    return MissionStop(
        replace(task, acceptance_radius=task.acceptance_radius or radius or None),
        tuple(check_point(f'task {task.id}: via', from_point(point)) for point in planned.via),
        wait, stamp + eta + wait, reversed=planned.reversed)


def to_zones(msg: m.ThreatZoneArray, previous: Iterable[ThreatZone],
             ) -> tuple[tuple[ThreatZone, ...], str]:
    """Return the zones of a message; one that is invalid stays as it was in `previous`.

    Args:
        msg: from any publisher, not yet checked.
        previous: zones in force until now.

    Returns:
        The zones, and why the first invalid one is refused; '' where all are valid.

    Raises:
        InvalidValue: the message holds too much to check it zone by zone.
    """
    valid, invalid = decode_zone_array(msg)
    zones = {zone.id: zone for zone in previous if zone.id in invalid}
    zones.update((zone.id, zone) for zone in valid)
    return tuple(zones.values()), next(iter(invalid.values()), '')


def from_uav_status(status: UavStatus, capabilities: Iterable[str], stamp: float,
                    limits: Mapping[str, float] | None = None) -> m.UavState:
    """Return the state of one UAV as a message.

    Args:
        status: of the vehicle.
        capabilities: from the parameter of that name.
        stamp: [s] of the position.
        limits: of this UAV from the parameter `uav_limits`; None: none.

    Returns:
        For the topic `uav_states`; what the bridge does not know is NaN.
    """
    known = {} if limits is None else dict(limits)
    speed = known.pop('cruise_speed', math.nan)
    known.setdefault('hold_radius', status.hold_radius)
    known |= {'return_height': status.return_height, 'takeoff_height': status.takeoff_height,
              'endurance': status.endurance, 'full_range': status.full_range}
    active_task, active_piece = split_piece(status.active_task)
    return m.UavState(
        header=header(stamp), uav_id=status.uav_id, position=to_point(status.position),
        velocity=Vector3(x=status.velocity[0], y=status.velocity[1], z=status.velocity[2]),
        home=to_point(status.home or _UNKNOWN_POINT), battery=status.battery,
        range_remaining=status.range_remaining, cruise_speed=speed,
        capabilities=list(capabilities), available=status.available, mode=status.mode.value,
        mission_state=status.mission_state.value, active_task_id=active_task,
        active_piece=active_piece, list_revision=status.list_revision,
        authority=status.authority.value,
        fence_state=status.fence.value, reason=status.reason,
        **{**dict.fromkeys(REPORTED_LIMITS, math.nan), **known})


def from_progress(uav_id: str, progress: TaskProgress, stamp: float) -> m.TaskEvent:
    """Return the event of a task that was started or completed, or has failed, as a message.

    Args:
        uav_id: of the vehicle.
        progress: task, event, revision of its list.
        stamp: [s] of the event.

    Returns:
        For the topic `task_events`.
    """
    task_id, piece = split_piece(progress.task)
    return m.TaskEvent(header=header(stamp), task_id=task_id, piece=piece, uav_id=uav_id,
                       revision=progress.revision, event=_EVENTS[progress.event],
                       reason=progress.reason)
