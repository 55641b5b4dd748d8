# SPDX-License-Identifier: Apache-2.0
"""Messages of the bridge to its core and back."""
from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import Vector3
from uav_task_alloc_msgs import msg as m

from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.geometry.frames import Origin
from uav_task_alloc.mavlink.gcs.status import UavStatus
from uav_task_alloc.mavlink.mission.items import MissionStop, TaskList
from uav_task_alloc.mavlink.mission.task_progress import TaskProgress
from uav_task_alloc.model import Task, ThreatZone, check_point
from uav_task_alloc.nodes.conversions.message_limits import MOST_POINTS
from uav_task_alloc.nodes.conversions.messages import (
    from_point,
    header,
    to_point,
    to_task,
)
from uav_task_alloc.params import MOST_RANGE
from uav_task_alloc.zone_codec import decode_zone_array

NOWHERE = (math.nan, math.nan, math.nan)
EVENT = {'STARTED': m.TaskEvent.STARTED, 'COMPLETED': m.TaskEvent.COMPLETED,
         'FAILED': m.TaskEvent.FAILED}


def to_list(msg: m.TaskList, uav_id: str, origin: Origin, radius: float) -> TaskList:
    """Tasks that tell no acceptance radius get `radius` [m]; 0: the autopilot's own.

    Raise InvalidValue, naming the field, where the message is no good list of that UAV.
    """
    if msg.uav_id not in ('', uav_id):
        raise InvalidValue('uav_id', msg.uav_id, uav_id)
    points = len(msg.tasks) + sum(len(planned.via) for planned in msg.tasks) + len(msg.end_via)
    if points > MOST_POINTS:
        raise InvalidValue(f'task_list of {uav_id}: points', points, f'at most {MOST_POINTS}')
    stops = tuple(MissionStop(_accepted(to_task(planned.task, origin), radius), tuple(
        check_point(f'task {planned.task.task_id}: via', from_point(p)) for p in planned.via))
        for planned in msg.tasks)
    names = [stop.task.id for stop in stops]
    if len(set(names)) != len(names):
        raise InvalidValue(f'task_list of {msg.uav_id}: task ids', names, 'each once')
    if msg.end not in (m.TaskList.HOLD, m.TaskList.RETURN_HOME):
        raise InvalidValue(f'task_list of {msg.uav_id}: end', msg.end,
                           'HOLD (0) or RETURN_HOME (1)')
    end_via = tuple(check_point(f'task_list of {msg.uav_id}: end_via', from_point(p))
                    for p in msg.end_via)
    return TaskList(msg.revision, stops, msg.end == m.TaskList.RETURN_HOME, end_via)


def to_zones(msg: m.ThreatZoneArray, before: Iterable[ThreatZone],
             ) -> tuple[tuple[ThreatZone, ...], str]:
    """The picture, and what is bad in it, '' where nothing is; a bad zone stays as `before`.

    Raise InvalidValue where there is too much of it to be judged zone by zone.
    """
    zones, bad = decode_zone_array(msg)
    found = {zone.id: zone for zone in before if zone.id in bad}
    found.update((zone.id, zone) for zone in zones)
    return tuple(found.values()), next(iter(bad.values()), '')


def _accepted(task: Task, radius: float) -> Task:
    return replace(task, acceptance_radius=task.acceptance_radius or radius or None)


def from_uav_status(status: UavStatus, capabilities: Iterable[str], now: float) -> m.UavState:
    """The message of one UAV."""
    return m.UavState(
        header=header(now), uav_id=status.uav_id, position=to_point(status.position),
        velocity=Vector3(x=status.velocity[0], y=status.velocity[1], z=status.velocity[2]),
        home=to_point(status.home or NOWHERE), battery=status.battery,
        range_remaining=status.range_remaining, cruise_speed=math.nan,
        capabilities=list(capabilities), available=status.available, mode=status.mode.value,
        mission_state=status.mission_state.value, active_task_id=status.active_task,
        list_revision=status.list_revision, authority=status.authority.value,
        reason=status.reason)


def from_progress(uav_id: str, made: TaskProgress, now: float) -> m.TaskEvent:
    """The message of a task begun, completed or failed."""
    return m.TaskEvent(header=header(now), task_id=made.task, uav_id=uav_id,
                       revision=made.revision, event=EVENT[made.event], reason=made.reason)


def diagnostics(facts: Iterable[tuple[str, int, str, dict[str, str]]],
                now: float) -> DiagnosticArray:
    """One status for each (name, level, line, details)."""
    return DiagnosticArray(header=header(now), status=[
        DiagnosticStatus(level=bytes([level]), name=f'mavlink_bridge: {name}', message=line,
                         hardware_id=name,
                         values=[KeyValue(key=k, value=v) for k, v in details.items()])
        for name, level, line, details in facts])


def to_capabilities(entries: Iterable[str]) -> dict[str, tuple[str, ...]]:
    """`uav_1:camera,thermal` each; raise InvalidValue otherwise."""
    found = {}
    for entry in entries:
        uav_id, colon, words = entry.partition(':')
        if not colon or not uav_id:
            raise InvalidValue('capabilities', entry, '`UAV_ID:WORD,WORD`')
        found[uav_id] = tuple(w.strip() for w in words.split(',') if w.strip())
    return found


def to_full_ranges(entries: Iterable[str]) -> dict[str, float]:
    """Ranges [m] of full batteries from `uav_1:6000` each; raise InvalidValue otherwise."""
    found: dict[str, float] = {}
    for entry in entries:
        uav_id, _, number = entry.rpartition(':')
        try:
            value = float(number)
        except ValueError:
            value = math.nan
        if not (uav_id and 0.0 <= value <= MOST_RANGE) or uav_id in found:
            raise InvalidValue('full_ranges', entry,
                               f'`UAV_ID:METRES` with metres in [0, {MOST_RANGE:g}], a UAV once')
        found[uav_id] = value
    return found
