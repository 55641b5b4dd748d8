# SPDX-License-Identifier: Apache-2.0
"""Diagnostics of one vehicle for operators: a level, a summary, and named facts."""
from __future__ import annotations

import math
from dataclasses import dataclass

from uav_task_alloc.mavlink.gcs.authority import Suspension
from uav_task_alloc.mavlink.gcs.authority_state import AuthorityState
from uav_task_alloc.mavlink.gcs.ground_station import VehicleSession
from uav_task_alloc.mavlink.gcs.onboard_mission import OnboardMission
from uav_task_alloc.mavlink.gcs.status import UavMode, mode_of, why_not_available
from uav_task_alloc.mavlink.mission.verified_mission import MissionState

_OK, _WARN, _ERROR, _STALE = range(4)  # as in DiagnosticStatus


@dataclass(frozen=True, slots=True)
class VehicleFacts:
    """Details of a vehicle; the field names are the keys in /diagnostics."""

    authority: str
    authority_why: str
    authority_for: str  # time since its last change
    given_back_by: str
    not_available: str
    autopilot: str
    address: str
    mode: str
    mission: str
    list_revision: int
    epoch: int
    item: str  # current item and number of items
    upload: str
    uploads: int  # begun, also those that were repeated or failed
    restarts: int  # number of restarts of the vehicle
    silent_for: str  # time since its last message
    clock_rate: str  # its seconds in one second of the bridge; above 1 in a faster simulation
    strays: int  # number of frames from other addresses
    held_by: str  # who holds it, and why
    fence: str  # state of the fence on board
    fence_parameters: str  # whether it is on, and what happens at a breach
    fence_left_out: str  # zones that it does not hold, and why
    rally_points: str  # state of those on board
    failsafe_way: str  # what a straight way home crosses now
    batteries: str  # what is left in each, and how it is known


@dataclass(frozen=True, slots=True)
class VehicleDiagnostics:
    """One row of /diagnostics."""

    level: int  # as in DiagnosticStatus: 0 ok, 1 warning, 2 error, 3 stale
    summary: str  # on one line
    facts: VehicleFacts


def diagnostics_of(session: VehicleSession, now: float) -> VehicleDiagnostics:
    """Return the diagnostics of a vehicle.

    Args:
        session: the vehicle.
        now: steady time [s].

    Returns:
        Level, summary and facts, for a row of /diagnostics.
    """
    level, summary = _level_of(session, now)
    progress = upload_progress(session.executor.onboard, now)
    waits_for = session.executor.sender.waits_for
    if level < _STALE:
        summary += f', {progress}' if progress else ''
        summary += f', waits for {waits_for}' if waits_for else ''
        summary += f', held by {held}' if (held := session.executor.holds.reason) else ''
    return VehicleDiagnostics(level, summary, _facts_of(session, now))


def _level_of(session: VehicleSession, now: float) -> tuple[int, str]:
    executor, telemetry = session.executor, session.executor.telemetry
    authority, state = executor.authority, executor.onboard.state
    link = authority.suspended_by(Suspension.LINK)
    if telemetry.link.lost(now) or (link and executor.watch.was_lost):
        return _STALE, 'link lost'
    if telemetry.link.stale(now) or link:
        return _WARN, 'link stale'
    if session.fault:
        return _ERROR, session.fault
    if state is MissionState.MIXED:
        return _ERROR, f'mission {state.name}'
    if mode_of(executor) is UavMode.FAULT:
        return _ERROR, 'fault'
    if executor.alarm:
        return _ERROR, executor.alarm
    if authority.state in (AuthorityState.LOST, AuthorityState.SUSPENDED):
        return _WARN, f'authority {authority.state.name}: {authority.why}'
    warning = '; '.join(filter(None, (executor.fence.warning, executor.energy.warning)))
    if state is MissionState.FOREIGN:
        return _WARN, f'mission {state.name}' + (f', {warning}' if warning else '')
    return (_WARN, warning) if warning else (_OK, f'mission {state.name}')


def _facts_of(session: VehicleSession, now: float) -> VehicleFacts:
    executor = session.executor
    authority, onboard, telemetry = executor.authority, executor.onboard, executor.telemetry
    owner = AuthorityState.UNKNOWN if authority.undecided else authority.state
    reason, rate = session.fault or why_not_available(executor, now), telemetry.clock_rate.value
    return VehicleFacts(
        authority=owner.name, authority_why=authority.why,
        authority_for=f'{now - authority.since:.0f} s',
        given_back_by=authority.given_back_by or 'nothing is needed',
        not_available=reason or 'it is available',
        autopilot=executor.profile.name, address=str(session.address),
        mode=mode_of(executor).name, mission=onboard.state.name,
        list_revision=onboard.revision, epoch=onboard.progress.epoch,
        item=f'{onboard.progress.current} of {len(onboard.progress.items)}',
        upload=upload_progress(onboard, now) or 'none', uploads=onboard.upload.uploads,
        restarts=telemetry.restarts, silent_for=f'{now - telemetry.link.received_at:.1f} s',
        clock_rate='unknown' if math.isnan(rate) else f'{rate:.3f}',
        strays=session.strays, held_by=executor.holds.reason or 'nobody',
        fence=executor.fence.text, fence_parameters=executor.fence.parameters.text,
        fence_left_out=executor.fence.left_out or 'nothing',
        rally_points=executor.fence.rally_text,
        failsafe_way=executor.fence.way_home or 'nothing', batteries=executor.energy.text)


def upload_progress(onboard: OnboardMission, now: float) -> str:
    """Progress and remaining time of an upload, as a text; '': no upload.

    Args:
        onboard: the mission of the vehicle.
        now: steady time [s].
    """
    sent, read, count = onboard.upload.progress
    if count == 0:
        return ''
    text = (f'read back {read}' if read else f'sent {sent}') + f' of {count} items'
    done, elapsed = sent + read, now - onboard.latest_upload.started_at
    if done == 0 or elapsed <= 0.0:
        return text
    return f'{text}, about {elapsed * (2 * count - done) / done:.0f} s left'
