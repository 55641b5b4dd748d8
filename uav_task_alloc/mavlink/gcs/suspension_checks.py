# SPDX-License-Identifier: Apache-2.0
"""Suspends authority while a failsafe is active or the mission is another's, and resumes it."""
from __future__ import annotations

from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.mavlink.gcs.authority import AuthorityEvent, Suspension
from uav_task_alloc.mavlink.gcs.authority_watch_state import AuthorityWatchState


def check_status(state: AuthorityWatchState, now: float) -> None:
    """Judge MAV_STATE: a failsafe suspends, an emergency or a flight termination takes."""
    if state.status > d.MAV_STATE_CRITICAL:
        state.apply(AuthorityEvent.KILLED, now, 'emergency, or flight terminated')
    elif state.status == d.MAV_STATE_CRITICAL:
        if not state.authority.suspended_by(Suspension.FAILSAFE):
            state.apply(AuthorityEvent.FAILSAFE_STAYS, now, 'a failsafe is active')
    elif state.authority.suspended_by(Suspension.FAILSAFE):
        state.apply(AuthorityEvent.FAILSAFE_OVER, now, 'the failsafe is over')


def check_foreign(state: AuthorityWatchState, yields: bool, now: float) -> None:
    """Judge the mission on board; `yields`: it is another's, and that is to be left alone."""
    suspended = state.authority.suspended_by(Suspension.FOREIGN)
    if yields and not suspended:
        state.apply(AuthorityEvent.FOREIGN, now, 'somebody else changed the mission: yield')
    elif not yields and suspended:
        state.apply(AuthorityEvent.FOREIGN_OVER, now, 'our mission is on board again')
