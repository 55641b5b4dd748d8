# SPDX-License-Identifier: Apache-2.0
"""The status of one vehicle, as published in UavState, and when it is published."""
from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.mavlink.autopilots import ModeFunction
from uav_task_alloc.mavlink.fence.onboard_fence import FenceState
from uav_task_alloc.mavlink.gcs.authority import OUR_MISSION
from uav_task_alloc.mavlink.gcs.authority_state import AuthorityState
from uav_task_alloc.mavlink.gcs.ground_station import VehicleSession
from uav_task_alloc.mavlink.gcs.link_times import STALE
from uav_task_alloc.mavlink.gcs.mission_executor import MissionExecutor
from uav_task_alloc.mavlink.gcs.suspension_checks import YIELDS
from uav_task_alloc.mavlink.gcs.two_vehicles import TWO_VEHICLES
from uav_task_alloc.mavlink.mission.verified_mission import MissionState
from uav_task_alloc.model import Point

# [m] the larger default of WP_LOITER_RAD (60 m) and NAV_LOITER_RAD (80 m)
HOLD_RADIUS = 80.0


class UavMode(Enum):
    """Flight mode of a vehicle; numbers as in UavState."""

    UNKNOWN = 0
    STANDBY = 1
    TAKEOFF = 2
    ON_MISSION = 3
    HOLD = 4
    RETURNING = 5
    LANDING = 6
    FAULT = 7


_BY_MODE_FUNCTION = {
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
    """The fields of UavState; NaN where unknown."""

    uav_id: str  # from the pattern of ids
    position: Point  # [m] ENU
    velocity: Point  # [m/s] ENU
    home: Point | None  # [m] ENU
    battery: float  # 0..1
    range_remaining: float  # [m]
    available: bool  # may get tasks
    mode: UavMode  # as UavState.mode
    mission_state: MissionState  # of the onboard mission
    active_task: str  # id of the task being flown; '': none
    list_revision: int  # of the last list verified on board; 0: none
    authority: AuthorityState  # who has the aircraft
    reason: str  # why it is not available; '': it is available
    hold_radius: float = 0.0  # [m] of the circle in which it holds; 0: it hovers
    return_height: float = math.nan  # [m] above home that its own return climbs to, at least
    takeoff_height: float = math.nan  # [m] above home to which the bridge takes off
    fence: FenceState = FenceState.OFF  # of the fence on board
    endurance: float = math.nan  # [s] in the air
    full_range: float = math.nan  # [m] with a full battery

    @property
    def urgent(self) -> tuple[object, ...]:
        """The fields whose change is published at once, not with the next position."""
        return (self.available, self.mode, self.mission_state, self.active_task,
                self.list_revision, self.authority, self.reason, self.fence)


def mode_of(executor: MissionExecutor) -> UavMode:
    """The flight mode of a vehicle as published."""
    telemetry, progress = executor.telemetry, executor.onboard.progress
    if telemetry.faulty:
        return UavMode.FAULT
    if not telemetry.airborne and not executor.sender.climbing:
        return UavMode.STANDBY
    if executor.sender.climbing:
        return UavMode.TAKEOFF
    if telemetry.mode is ModeFunction.MISSION:
        item = progress.active
        command = item.command if item is not None else None
        if command == d.MAV_CMD_NAV_LAND:
            return UavMode.LANDING
        if command == d.MAV_CMD_NAV_RETURN_TO_LAUNCH or executor.going_home:
            return UavMode.RETURNING
        return UavMode.HOLD if progress.finished else UavMode.ON_MISSION
    return _BY_MODE_FUNCTION.get(telemetry.mode, _BY_LANDED.get(telemetry.landed, UavMode.UNKNOWN))


def active_task(executor: MissionExecutor) -> str:
    """The task being flown or served; '': none. In HOLD or TAKEOFF it must be on the list too."""
    onboard, mode = executor.onboard, mode_of(executor)
    item = onboard.progress.active
    if onboard.tasks is None or item is None or item.task in onboard.progress.completed:
        return ''
    waits = mode in (UavMode.HOLD, UavMode.TAKEOFF) and any(
        stop.task.id == item.task for stop in onboard.tasks.stops)
    return item.task if waits or mode is UavMode.ON_MISSION else ''


def why_not_available(executor: MissionExecutor, now: float) -> str:
    """Why a UAV is not available for tasks, and what would change that; '': it is available."""
    telemetry, authority = executor.telemetry, executor.authority
    if telemetry.link.stale(now):
        return 'its link is stale'
    if authority.undecided:
        return 'its authority is not known yet'
    if authority.state in (AuthorityState.LOST, AuthorityState.SUSPENDED) or authority.landed:
        return (f'authority {authority.state.name}: {authority.why}; given back by '
                f'{authority.given_back_by}')
    if executor.watch.yields:  # never granted
        return f'{YIELDS}; given back by {OUR_MISSION}'
    if mode_of(executor) is UavMode.FAULT:
        return 'it reports a critical state'
    if not telemetry.past_boot:
        return telemetry.starting
    if not telemetry.has_position:
        return 'no position yet'
    if telemetry.two_vehicles.found(now):
        return f'it waits for {TWO_VEHICLES}'
    if executor.alarm:
        return executor.alarm
    if executor.policy.takeoff and not telemetry.airborne and (
            need := executor.fence.needs_operator()):
        return f'it waits for {need}'
    if executor.sender.failing:
        return f'its commands or uploads fail repeatedly: mission {executor.onboard.stored.name}'
    return ''


def state_of(session: VehicleSession, now: float) -> UavStatus:
    """Return the status of a vehicle.

    Args:
        session: the vehicle.
        now: steady time [s].

    Returns:
        Values for UavState; the position is of the last valid report.
    """
    executor = session.executor
    telemetry, onboard, mode = executor.telemetry, executor.onboard, mode_of(executor)
    reason = session.fault or why_not_available(executor, now)
    authority = executor.authority
    owner = AuthorityState.UNKNOWN if authority.undecided else authority.state
    limits = executor.energy.limits_now(now)
    return UavStatus(
        session.uav_id, telemetry.position, telemetry.velocity, telemetry.home,
        telemetry.battery, limits.range, not reason, mode, onboard.state,
        active_task(executor), onboard.revision, owner, reason,
        HOLD_RADIUS if executor.profile.rules.loiters else 0.0,
        executor.fence.parameters.return_height,
        executor.policy.cruise_altitude if executor.policy.takeoff else math.nan,
        executor.fence.state, limits.endurance, limits.full_range)


class PublishedStates:
    """The status of each UAV published last; decides when the next one is due."""

    def __init__(self) -> None:
        self._published: dict[str, tuple[UavStatus, float]] = {}  # and time of its position [s]

    def is_due(self, status: UavStatus, position_at: float, now: float, rate: float) -> bool:
        """Whether to publish a status, which then counts as published.

        A silent UAV is published once, as unavailable: a later message about it would
        suggest that it is connected.

        Args:
            status: the present one.
            position_at: steady time [s] of its position; < 0: none was received.
            now: steady time [s].
            rate: [Hz] of positions; a change of `UavStatus.urgent` is due at once.
        """
        if position_at < 0.0:
            return False
        before, published_at = self._published.get(status.uav_id, (None, -math.inf))
        silent = now - position_at > STALE
        if silent and (before is None or not before.available or status.available):
            return False
        urgent = before is None or before.urgent != status.urgent
        if not urgent and position_at < published_at + 1.0 / rate:
            return False
        self._published[status.uav_id] = status, position_at
        return True
