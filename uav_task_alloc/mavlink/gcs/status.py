# SPDX-License-Identifier: Apache-2.0
"""How a vehicle stands, for programs (`state_of`) and for people (`facts_of`)."""
from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.mavlink.autopilots import ModeFunction
from uav_task_alloc.mavlink.gcs.authority import AuthorityState, Suspension
from uav_task_alloc.mavlink.gcs.ground_station import VehicleSession
from uav_task_alloc.mavlink.gcs.mission_executor import MissionExecutor
from uav_task_alloc.mavlink.gcs.telemetry import STALE
from uav_task_alloc.mavlink.mission.verified_mission import MissionState
from uav_task_alloc.model import Point


class UavMode(Enum):
    """What a vehicle does; numbers as in UavState."""

    UNKNOWN = 0
    STANDBY = 1
    TAKEOFF = 2
    ON_MISSION = 3
    HOLD = 4
    RETURNING = 5
    LANDING = 6
    FAULT = 7


_BY_FLIGHT = {
    ModeFunction.HOLD: UavMode.HOLD,
    ModeFunction.RETURN: UavMode.RETURNING,
    ModeFunction.LAND: UavMode.LANDING,
    ModeFunction.TAKEOFF: UavMode.TAKEOFF,
}
_BY_LANDED = {
    d.MAV_LANDED_STATE_TAKEOFF: UavMode.TAKEOFF,
    d.MAV_LANDED_STATE_LANDING: UavMode.LANDING,
}


@dataclass(frozen=True, slots=True)
class UavStatus:
    """What UavState carries; NaN where unknown."""

    uav_id: str
    position: Point  # [m] ENU
    velocity: Point  # [m/s] ENU
    home: Point | None  # [m] ENU
    battery: float  # 0..1
    range_remaining: float  # [m]
    available: bool
    mode: UavMode
    mission_state: MissionState
    active_task: str
    list_revision: int
    authority: AuthorityState
    reason: str  # why it is not available; '': it is

    @property
    def news(self) -> tuple[object, ...]:
        """What is told at once when it changes, not at the next position."""
        return (self.available, self.mode, self.mission_state, self.active_task,
                self.list_revision, self.authority, self.reason)


def mode_of(executor: MissionExecutor) -> UavMode:
    """The mode that people and the allocator understand."""
    telemetry, progress = executor.telemetry, executor.onboard.progress
    if telemetry.faulty:
        return UavMode.FAULT
    if not telemetry.airborne and not executor.sender.climbing:
        return UavMode.STANDBY
    if executor.sender.climbing:
        return UavMode.TAKEOFF
    if telemetry.mode is ModeFunction.MISSION:
        item = progress.active
        returns = item is not None and item.command == d.MAV_CMD_NAV_RETURN_TO_LAUNCH
        if returns or executor.going_home:
            return UavMode.RETURNING
        return UavMode.HOLD if progress.finished else UavMode.ON_MISSION
    return _BY_FLIGHT.get(telemetry.mode, _BY_LANDED.get(telemetry.landed, UavMode.UNKNOWN))


def active_task(executor: MissionExecutor) -> str:
    """The task whose leg or hold is being flown; one that waits must be on the list as well."""
    onboard, mode = executor.onboard, mode_of(executor)
    item = onboard.progress.active
    if onboard.tasks is None or item is None or item.task in onboard.progress.completed:
        return ''
    waits = mode in (UavMode.HOLD, UavMode.TAKEOFF) and any(
        stop.task.id == item.task for stop in onboard.tasks.stops)
    return item.task if waits or mode is UavMode.ON_MISSION else ''


def why_not_available(executor: MissionExecutor, now: float) -> str:
    """Why a UAV may not be given tasks, and what would change that; '' where it may."""
    telemetry, authority = executor.telemetry, executor.authority
    if telemetry.stale(now):
        return 'its link is stale'
    if authority.undecided:
        return 'not known yet who has it'
    if authority.state in (AuthorityState.LOST, AuthorityState.SUSPENDED) or authority.landed:
        return (f'authority {authority.state.name}: {authority.why}; given back by '
                f'{authority.given_back_by}')
    if mode_of(executor) is UavMode.FAULT:
        return 'it says that it is in a critical state'
    if not telemetry.past_boot:
        return 'the autopilot is starting'
    if not telemetry.has_position:
        return 'no position yet'
    if executor.alarm:
        return executor.alarm
    if executor.sender.failing:
        return f'what is tried fails again and again: mission {executor.onboard.stored.name}'
    return ''


def state_of(session: VehicleSession, now: float, full_range: float = 0.0) -> UavStatus:
    """All of it at one moment; `full_range` [m] of a full battery, 0: unknown."""
    executor = session.executor
    telemetry, onboard, mode = executor.telemetry, executor.onboard, mode_of(executor)
    reason = session.fault or why_not_available(executor, now)
    authority = executor.authority
    owner = AuthorityState.UNKNOWN if authority.undecided else authority.state
    return UavStatus(
        session.uav_id, telemetry.position, telemetry.velocity, telemetry.home,
        telemetry.battery, full_range * telemetry.battery if full_range > 0.0 else math.nan,
        not reason, mode, onboard.state, active_task(executor), onboard.revision, owner, reason)


class PublishedStates:
    """What was told of each UAV last, and what is worth telling now."""

    def __init__(self) -> None:
        self._told: dict[str, tuple[UavStatus, float]] = {}  # and the time of its position [s]

    def is_due(self, status: UavStatus, position_at: float, now: float, rate: float) -> bool:
        """A new position, at most `rate` [Hz], or something that cannot wait; then it is told.

        A UAV that is silent is told of once, as no longer available: whatever else happens to
        it here would look like a sign of life.
        """
        if position_at < 0.0:
            return False
        before, when = self._told.get(status.uav_id, (None, -math.inf))
        quiet = now - position_at > STALE
        if quiet and (before is None or not before.available or status.available):
            return False
        urgent = before is None or before.news != status.news
        if not urgent and position_at < when + 1.0 / rate:
            return False
        self._told[status.uav_id] = status, position_at
        return True


def facts_of(session: VehicleSession, now: float) -> tuple[int, str, dict[str, str]]:
    """Level (0 ok, 1 warning, 2 error, 3 stale), one line, and details."""
    executor = session.executor
    telemetry, onboard = executor.telemetry, executor.onboard
    state = onboard.state
    link = executor.authority.suspended_by(Suspension.LINK)
    if telemetry.lost(now) or (link and executor.watch.was_lost):
        level, line = 3, 'link lost'
    elif telemetry.stale(now) or link:
        level, line = 1, 'link stale'
    elif session.fault:
        level, line = 2, session.fault
    elif mode_of(executor) is UavMode.FAULT or state is MissionState.MIXED:
        level, line = 2, f'mission {state.name}' if state is MissionState.MIXED else 'fault'
    elif executor.alarm:
        level, line = 2, executor.alarm
    elif executor.authority.state in (AuthorityState.LOST, AuthorityState.SUSPENDED):
        level, line = 1, f'authority {executor.authority.state.name}: {executor.authority.why}'
    elif state is MissionState.FOREIGN:
        level, line = 1, 'mission FOREIGN'
    else:
        level, line = 0, f'mission {state.name}'
    progress = onboard.upload_progress(now)
    if progress and level < 3:
        line += f', {progress}'
    if executor.sender.waits_for and level < 3:
        line += f', waits for {executor.sender.waits_for}'
    authority, reason = executor.authority, session.fault or why_not_available(executor, now)
    return level, line, {
        'authority': AuthorityState.UNKNOWN.name if authority.undecided else authority.state.name,
        'authority_why': authority.why, 'authority_for': f'{now - authority.since:.0f} s',
        'given_back_by': authority.given_back_by or 'nothing is needed',
        'not_available': reason or 'it is available',
        'autopilot': executor.profile.name, 'address': str(session.address),
        'mode': mode_of(executor).name, 'mission': state.name,
        'list_revision': str(onboard.revision), 'epoch': str(onboard.progress.epoch),
        'item': f'{onboard.progress.current} of {len(onboard.progress.items)}',
        'upload': progress or 'none', 'uploads': str(onboard.upload.uploads),
        'restarts': str(telemetry.restarts),
        'silent_for': f'{now - telemetry.received_at:.1f} s', 'strays': str(session.strays)}
