# SPDX-License-Identifier: Apache-2.0
"""Messages to model values and back, and the QoS profiles of all topics."""
from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from builtin_interfaces.msg import Duration, Time
from geometry_msgs.msg import Point as PointMsg
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from std_msgs.msg import Header
from uav_task_alloc_msgs import msg as m

from uav_task_alloc.allocator.list_records import ListStop
from uav_task_alloc.allocator.records import REPORTED_LIMITS, TaskEvent, TaskEventKind, UavReport
from uav_task_alloc.checks import check_member, check_number, check_ros_name
from uav_task_alloc.geometry.frames import Origin
from uav_task_alloc.model import Point, Task, ThreatZone
from uav_task_alloc.nodes.conversions.message_limits import (
    MOST_VALUE,
    check_ros_names,
    check_words,
    cut,
)
from uav_task_alloc.nodes.conversions.task_times import put_times, to_times
from uav_task_alloc.nodes.conversions.work_fields import (
    put_piece,
    put_work,
    to_actions,
    to_heading,
)
from uav_task_alloc.piece_ids import piece_id, split_piece
from uav_task_alloc.record.message_records import (
    AUTHORITIES,
    MODES,
    constant_name,
    from_stamp,
    task_position,
)
from uav_task_alloc.work.pieces import Work
from uav_task_alloc.zone_codec import JOURNAL_ZONE, encode_zone

FRAME_ID = 'map'  # REP-105, ENU
_LONGEST_REASON = 300  # characters of why a UAV is not available
_MOST_REVISIONS = 2**31 - 1  # half of the range of uint32

LATCHED = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE,
                     durability=DurabilityPolicy.TRANSIENT_LOCAL)
ANNOUNCEMENTS = QoSProfile(depth=1000, reliability=ReliabilityPolicy.RELIABLE,
                           durability=DurabilityPolicy.TRANSIENT_LOCAL)
# of two sources, an operator and the separation of UAVs
HOLDS = QoSProfile(depth=10, reliability=ReliabilityPolicy.RELIABLE,
                   durability=DurabilityPolicy.TRANSIENT_LOCAL)
EVENTS = QoSProfile(depth=100, reliability=ReliabilityPolicy.RELIABLE)
STATES = QoSProfile(depth=50, reliability=ReliabilityPolicy.BEST_EFFORT)
# the allocator's queues: deep enough for a flood; the oldest message is dropped
INPUT_ANNOUNCEMENTS = QoSProfile(depth=20_000, reliability=ReliabilityPolicy.RELIABLE,
                                 durability=DurabilityPolicy.TRANSIENT_LOCAL)
INPUT_EVENTS = QoSProfile(depth=10_000, reliability=ReliabilityPolicy.RELIABLE)
INPUT_STATES = QoSProfile(depth=400, reliability=ReliabilityPolicy.BEST_EFFORT)


def to_stamp(seconds: float) -> Time:
    """Return a ROS time as a message.

    Args:
        seconds: [s] since the epoch of the clock.

    Returns:
        To the nearest nanosecond.
    """
    whole, nanoseconds = _parts(seconds)
    return Time(sec=whole, nanosec=nanoseconds)


def to_duration(seconds: float) -> Duration:
    """A duration [s] as a message, clamped to its range."""
    whole, nanoseconds = _parts(min(max(seconds, -2.0**31), 2.0**31 - 1.0))
    return Duration(sec=whole, nanosec=nanoseconds)


def _parts(seconds: float) -> tuple[int, int]:
    """Whole seconds and nanoseconds."""
    whole = math.floor(seconds)
    return whole, min(999_999_999, round((seconds - whole) * 1e9))


def header(now: float) -> Header:
    """Return a header in the ENU frame.

    Args:
        now: [s] for the stamp.

    Returns:
        Its frame_id is FRAME_ID.
    """
    return Header(stamp=to_stamp(now), frame_id=FRAME_ID)


def to_point(point: Sequence[float]) -> PointMsg:
    """Return three coordinates as a message.

    Args:
        point: (x, y, z) [m] ENU.

    Returns:
        With the same coordinates.
    """
    return PointMsg(x=point[0], y=point[1], z=point[2])


def from_point(point: PointMsg) -> Point:
    """Coordinates [m] ENU of a message, unchecked."""
    return point.x, point.y, point.z


def known(value: float) -> float | None:
    """None where a message holds NaN: unknown."""
    return None if math.isnan(value) else float(value)


def to_task(msg: m.Task, origin: Origin, position: Point | None = None) -> Task:
    """A task at one position, which is in ENU; its path is not taken.

    Args:
        msg: LOCAL [m], or WGS84 [deg] and [m] above the origin.
        origin: of the ENU frame.
        position: [m] ENU of a task that is not at the position of the message.

    Raises:
        InvalidValue: a field, which it names, is invalid.
    """
    check_ros_name('task_id', msg.task_id)
    place = f'task {msg.task_id}: '
    check_number(place + 'value', msg.value, 0.0, MOST_VALUE, open_low=True)
    position = position or task_position(msg, origin)
    assert position is not None  # it is with an origin
    return Task(
        msg.task_id, position, value=msg.value,
        service_time=from_stamp(msg.service_time),
        required_capabilities=check_words(place + 'required_capabilities',
                                          msg.required_capabilities),
        allowed_uavs=check_ros_names(place + 'allowed_uavs', msg.allowed_uavs) or None,
        acceptance_radius=known(msg.acceptance_radius) or None,
        heading=to_heading(place, msg), actions=to_actions(place, msg), **to_times(place, msg))


def from_task(task: Task) -> m.Task:
    """The message of a point or of a piece with its path, in the frame LOCAL."""
    return put_times(put_piece(m.Task(
        frame=m.Task.LOCAL, position=to_point(task.position),
        value=task.value, service_time=to_duration(task.service_time),
        acceptance_radius=math.nan if task.acceptance_radius is None else task.acceptance_radius,
        required_capabilities=sorted(task.required_capabilities),
        allowed_uavs=sorted(task.allowed_uavs or ())), task), task)


def from_work(item: Task | Work) -> m.Task:
    """The message of a task or of work, in the frame LOCAL."""
    return from_task(item) if isinstance(item, Task) else put_work(from_task(item.task), item)


def to_report(msg: m.UavState) -> UavReport:
    """Return the report of a UAV.

    Args:
        msg: from any publisher, not yet checked.

    Returns:
        None where the message has NaN; not available in FAULT.

    Raises:
        InvalidValue: a field, which it names, is invalid.
    """
    check_ros_name('uav_id', msg.uav_id)
    place = f'uav {msg.uav_id}: '
    for name, last in (('mode', m.UavState.FAULT), ('mission_state', m.UavState.FOREIGN),
                       ('authority', m.UavState.LOST)):
        check_number(place + name, getattr(msg, name), m.UavState.UNKNOWN, last)
    if msg.active_task_id:
        check_ros_name(place + 'active_task_id', msg.active_task_id)
    check_number(place + 'list_revision', msg.list_revision, 0, _MOST_REVISIONS)
    home = from_point(msg.home)
    velocity = msg.velocity.x, msg.velocity.y, msg.velocity.z
    return UavReport(
        msg.uav_id, from_point(msg.position), home=None if any(map(math.isnan, home)) else home,
        range=known(msg.range_remaining), cruise_speed=known(msg.cruise_speed) or None,
        capabilities=check_words(place + 'capabilities', msg.capabilities),
        battery=known(msg.battery),
        available=msg.available and msg.mode != m.UavState.FAULT,
        active_task=piece_id(msg.active_task_id, msg.active_piece),
        list_revision=msg.list_revision,
        standby=msg.mode == m.UavState.STANDBY,
        velocity=velocity if all(map(math.isfinite, velocity)) else None,
        mode=constant_name(MODES, msg.mode), authority=constant_name(AUTHORITIES, msg.authority),
        foreign=msg.mission_state == m.UavState.FOREIGN,
        hold_radius=known(msg.hold_radius) or 0.0, return_height=known(msg.return_height),
        takeoff_height=known(msg.takeoff_height),
        reason=' '.join(msg.reason.split())[:_LONGEST_REASON],
        **{name: known(getattr(msg, name)) or None for name in REPORTED_LIMITS})


def to_event(msg: m.TaskEvent) -> TaskEvent:
    """Return the event of a task.

    Args:
        msg: from any publisher, not yet checked.

    Returns:
        With its reason cut to one line.

    Raises:
        InvalidValue: a field, which it names, is invalid.
    """
    check_ros_name('task_id', msg.task_id)
    check_ros_name(f'event of task {msg.task_id}: uav_id', msg.uav_id)
    kind = check_member(f'event of task {msg.task_id}: event', msg.event, TaskEventKind)
    return TaskEvent(piece_id(msg.task_id, msg.piece), msg.uav_id, msg.revision, kind,
                     cut(msg.reason))


def from_zone(zone: ThreatZone) -> m.ThreatZone:
    """The message of a zone."""
    values = encode_zone(zone, JOURNAL_ZONE)
    return m.ThreatZone(
        zone_id=values.pop('id'), center=to_point(values.pop('center')),
        vertices=[PointMsg(x=x, y=y) for x, y in values.pop('vertices')], **values)


def from_zones(zones: Iterable[ThreatZone], now: float) -> m.ThreatZoneArray:
    """Return all zones in force as a message.

    Args:
        zones: the whole set.
        now: [s] for the stamp.

    Returns:
        For the topic `threat_zones`.
    """
    return m.ThreatZoneArray(header=header(now), zones=[from_zone(zone) for zone in zones])


def planned_task(stop: ListStop) -> m.PlannedTask:
    """A task of a list with the leg to it; times are [s] from the stamp of the list."""
    return m.PlannedTask(
        task=from_task(stop.task), piece=split_piece(stop.task.id)[1], reversed=stop.reversed,
        via=[to_point(p) for p in stop.leg.via], leg_distance=stop.leg.length,
        eta=to_duration(stop.eta), wait=to_duration(stop.wait), finish=to_duration(stop.finish))


def announcement(action: int, tasks: Iterable[Task | Work], now: float) -> m.TaskAnnouncement:
    """Return the message that adds, updates or cancels tasks.

    Args:
        action: TaskAnnouncement.ADD, UPDATE or CANCEL.
        tasks: of any kind, in ENU [m].
        now: [s] for the stamp.

    Returns:
        For the topic `task_announcements`.
    """
    return m.TaskAnnouncement(header=header(now), action=action,
                              tasks=[from_work(task) for task in tasks])
