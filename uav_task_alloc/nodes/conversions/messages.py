# SPDX-License-Identifier: Apache-2.0
"""Messages to model and back: the one place where field names of messages are known."""
from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from builtin_interfaces.msg import Duration, Time
from geometry_msgs.msg import Point as PointMsg
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from std_msgs.msg import Header
from uav_task_alloc_msgs import msg as m

from uav_task_alloc.allocator.records import TaskEvent, TaskEventKind, UavReport
from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.geometry.frames import Origin, to_enu
from uav_task_alloc.model import (
    Leg,
    Point,
    Task,
    ThreatZone,
    check_number,
    check_ros_name,
)
from uav_task_alloc.nodes.conversions.message_limits import (
    MOST_VALUE,
    check_ros_names,
    check_words,
    cut,
)
from uav_task_alloc.zone_codec import JOURNAL_ZONE, encode_zone

FRAME_ID = 'map'  # REP-105, ENU
MOST_REVISIONS = 2**31  # half of what a message can count to

LATCHED = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE,
                     durability=DurabilityPolicy.TRANSIENT_LOCAL)
ANNOUNCEMENTS = QoSProfile(depth=1000, reliability=ReliabilityPolicy.RELIABLE,
                           durability=DurabilityPolicy.TRANSIENT_LOCAL)
EVENTS = QoSProfile(depth=100, reliability=ReliabilityPolicy.RELIABLE)
STATES = QoSProfile(depth=50, reliability=ReliabilityPolicy.BEST_EFFORT)
# what a flood may pile up in front of the allocator; beyond that the oldest is lost
HEARD_ANNOUNCEMENTS = QoSProfile(depth=20_000, reliability=ReliabilityPolicy.RELIABLE,
                                 durability=DurabilityPolicy.TRANSIENT_LOCAL)
HEARD_EVENTS = QoSProfile(depth=10_000, reliability=ReliabilityPolicy.RELIABLE)
HEARD_STATES = QoSProfile(depth=400, reliability=ReliabilityPolicy.BEST_EFFORT)


def to_stamp(seconds: float) -> Time:
    """A time [s] since the epoch of the node's clock as a message."""
    whole = math.floor(seconds)
    return Time(sec=whole, nanosec=min(999_999_999, round((seconds - whole) * 1e9)))


def from_stamp(stamp: Time | Duration) -> float:
    """A stamp or duration message in [s]."""
    return float(stamp.sec) + float(stamp.nanosec) * 1e-9


def to_duration(seconds: float) -> Duration:
    """A time span [s] as a message, at most what it can hold."""
    seconds = min(max(seconds, -2.0**31), 2.0**31 - 1.0)
    whole = math.floor(seconds)
    return Duration(sec=whole, nanosec=min(999_999_999, round((seconds - whole) * 1e9)))


def header(now: float) -> Header:
    """A header in the ENU frame."""
    return Header(stamp=to_stamp(now), frame_id=FRAME_ID)


def to_point(point: Sequence[float]) -> PointMsg:
    """[m] ENU as a message."""
    return PointMsg(x=point[0], y=point[1], z=point[2])


def from_point(point: PointMsg) -> Point:
    """A message as [m] ENU, unchecked."""
    return point.x, point.y, point.z


def known(value: float) -> float | None:
    """None where a message says NaN: unknown."""
    return None if math.isnan(value) else float(value)


def to_task(msg: m.Task, origin: Origin) -> Task:
    """Raise InvalidValue, naming the field, where the message is no good task."""
    check_ros_name('task_id', msg.task_id)
    place, radius = f'task {msg.task_id}: ', known(msg.acceptance_radius)
    check_number(place + 'value', msg.value, 0.0, MOST_VALUE, open_low=True)
    return Task(
        msg.task_id, _task_position(msg, origin), value=msg.value,
        service_time=from_stamp(msg.service_time),
        required_capabilities=check_words(place + 'required_capabilities',
                                          msg.required_capabilities),
        allowed_uavs=check_ros_names(place + 'allowed_uavs', msg.allowed_uavs) or None,
        acceptance_radius=radius or None)


def _task_position(msg: m.Task, origin: Origin) -> Point:
    place = f'task {msg.task_id}: '
    if msg.frame == m.Task.LOCAL:
        return from_point(msg.position)
    if msg.frame != m.Task.WGS84:
        raise InvalidValue(place + 'frame', msg.frame, 'LOCAL (0) or WGS84 (1)')
    check_number(place + 'latitude', msg.latitude, -90.0, 90.0)
    check_number(place + 'longitude', msg.longitude, -180.0, 180.0)
    check_number(place + 'altitude', msg.altitude, -1e5, 1e5)
    return to_enu(origin, msg.latitude, msg.longitude, origin.altitude_amsl + msg.altitude)


def from_task(task: Task) -> m.Task:
    """The LOCAL message of a task."""
    return m.Task(
        task_id=task.id, frame=m.Task.LOCAL, position=to_point(task.position),
        value=task.value, service_time=to_duration(task.service_time),
        acceptance_radius=math.nan if task.acceptance_radius is None else task.acceptance_radius,
        required_capabilities=sorted(task.required_capabilities),
        allowed_uavs=sorted(task.allowed_uavs or ()))


def to_report(msg: m.UavState) -> UavReport:
    """Raise InvalidValue, naming the field, where the message tells nothing of a UAV."""
    check_ros_name('uav_id', msg.uav_id)
    place = f'uav {msg.uav_id}: '
    check_number(place + 'mode', msg.mode, m.UavState.UNKNOWN, m.UavState.FAULT)
    check_number(place + 'mission_state', msg.mission_state, m.UavState.UNKNOWN,
                 m.UavState.FOREIGN)
    if msg.active_task_id:
        check_ros_name(place + 'active_task_id', msg.active_task_id)
    check_number(place + 'list_revision', msg.list_revision, 0, MOST_REVISIONS)
    home = from_point(msg.home)
    return UavReport(
        msg.uav_id, from_point(msg.position), home=None if any(map(math.isnan, home)) else home,
        range=known(msg.range_remaining), cruise_speed=known(msg.cruise_speed) or None,
        capabilities=check_words(place + 'capabilities', msg.capabilities),
        battery=known(msg.battery),
        available=msg.available and msg.mode != m.UavState.FAULT,
        active_task=msg.active_task_id, list_revision=msg.list_revision,
        standby=msg.mode == m.UavState.STANDBY)


def to_event(msg: m.TaskEvent) -> TaskEvent:
    """Raise InvalidValue, naming the field, where the message is no event."""
    check_ros_name('task_id', msg.task_id)
    check_ros_name(f'event of task {msg.task_id}: uav_id', msg.uav_id)
    try:
        kind = TaskEventKind(msg.event)
    except ValueError:
        raise InvalidValue(f'event of task {msg.task_id}: event', msg.event,
                           'STARTED (0), COMPLETED (1) or FAILED (2)') from None
    return TaskEvent(msg.task_id, msg.uav_id, msg.revision, kind, cut(msg.reason))


def from_zone(zone: ThreatZone) -> m.ThreatZone:
    """The message of a zone."""
    values = encode_zone(zone, JOURNAL_ZONE)
    return m.ThreatZone(
        zone_id=values.pop('id'), center=to_point(values.pop('center')),
        vertices=[PointMsg(x=x, y=y) for x, y in values.pop('vertices')], **values)


def from_zones(zones: Iterable[ThreatZone], now: float) -> m.ThreatZoneArray:
    """The whole picture."""
    return m.ThreatZoneArray(header=header(now), zones=[from_zone(zone) for zone in zones])


def planned_task(task: Task, leg: Leg, eta: float) -> m.PlannedTask:
    """A task with the leg before it; eta [s] from the list's stamp."""
    return m.PlannedTask(task=from_task(task), via=[to_point(p) for p in leg.via],
                         leg_distance=leg.length, eta=to_duration(eta))


def announcement(action: int, tasks: Iterable[Task], now: float) -> m.TaskAnnouncement:
    """ADD, UPDATE or CANCEL of some tasks."""
    return m.TaskAnnouncement(header=header(now), action=action,
                              tasks=[from_task(task) for task in tasks])
