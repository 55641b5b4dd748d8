# SPDX-License-Identifier: Apache-2.0
"""Grants and withdraws authority by the parameter `takeoff`."""
from __future__ import annotations

from collections.abc import Callable

from uav_task_alloc.mavlink.gcs.authority import AuthorityEvent
from uav_task_alloc.mavlink.gcs.authority_state import AuthorityState
from uav_task_alloc.mavlink.gcs.authority_watch_state import AuthorityWatchState
from uav_task_alloc.mavlink.gcs.policy import Policy


class TakeoffGrant:
    """Applies changes of `takeoff` to one vehicle.

    Args:
        state: of the vehicle.
        policy: returns the present parameters.
    """

    def __init__(self, state: AuthorityWatchState, policy: Callable[[], Policy]) -> None:
        self._state, self._policy = state, policy
        self.takeoff = policy().takeoff  # the value applied last

    def step(self, now: float) -> None:
        """Grant or withdraw authority where the parameter or the vehicle has changed."""
        state, authority = self._state, self._state.authority
        takeoff, telemetry = self._policy().takeoff, self._state.telemetry
        idle = state.mode is not None and not state.armed
        if not takeoff and (self.takeoff or (idle and authority.held)):
            airborne = telemetry.airborne
            event = AuthorityEvent.WITHDRAWN_IN_AIR if airborne else AuthorityEvent.WITHDRAWN
            state.apply(event, now,
                        'takeoff is false' + (': until the landing' if airborne else ''))
        elif takeoff and not self.takeoff:
            authority.until_landing = False
        if authority.state is not AuthorityState.SUSPENDED or takeoff:
            self.takeoff = takeoff  # else it is applied after the suspension
        if takeoff and state.armed and authority.state is AuthorityState.NONE and not (
                authority.undecided or authority.landed):
            authority.landed = True  # armed by a pilot, whose hands may be at the propellers
            authority.why = 'armed, not by the bridge, when takeoff became true'
        if (takeoff and idle and authority.state is AuthorityState.NONE and not authority.landed
                and not authority.undecided and telemetry.grounded and telemetry.past_boot
                and not telemetry.link.stale(now)):
            state.apply(AuthorityEvent.GRANTED, now, 'takeoff is true')
