# SPDX-License-Identifier: Apache-2.0
"""Suspends authority while a failsafe is active or the mission is FOREIGN, and resumes it."""
from __future__ import annotations

from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.mavlink.gcs.authority import AuthorityEvent, Suspension
from uav_task_alloc.mavlink.gcs.authority_watch_state import AuthorityWatchState

YIELDS = 'somebody else changed the mission: yield'


def check_system_status(state: AuthorityWatchState, now: float) -> None:
    """Apply MAV_STATE: CRITICAL is a failsafe, EMERGENCY and above count as a kill."""
    if state.status > d.MAV_STATE_CRITICAL:
        state.apply(AuthorityEvent.KILLED, now, 'emergency, or flight terminated')
    elif state.status == d.MAV_STATE_CRITICAL:
        if not state.authority.suspended_by(Suspension.FAILSAFE):
            state.apply(AuthorityEvent.FAILSAFE_STAYS, now, 'a failsafe is active')
    elif state.authority.suspended_by(Suspension.FAILSAFE):
        state.apply(AuthorityEvent.FAILSAFE_OVER, now, 'the failsafe is over')


def check_foreign(state: AuthorityWatchState, yields: bool, now: float) -> None:
    """Apply a FOREIGN mission, or its end.

    Args:
        state: of the vehicle.
        yields: the mission is FOREIGN, and `when_foreign` is 'yield'.
        now: steady time [s].
    """
    suspended = state.authority.suspended_by(Suspension.FOREIGN)
    if yields and not suspended:
        state.apply(AuthorityEvent.FOREIGN, now, YIELDS)
    elif not yields and suspended:
        state.apply(AuthorityEvent.FOREIGN_OVER, now, 'our mission is on board again')
