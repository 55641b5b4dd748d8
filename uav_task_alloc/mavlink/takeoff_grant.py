# SPDX-License-Identifier: Apache-2.0
"""Grants and withdraws authority by the parameter `takeoff`."""
from __future__ import annotations

from collections.abc import Callable

from uav_task_alloc.mavlink.authority import Event, State
from uav_task_alloc.mavlink.policy import Policy
from uav_task_alloc.mavlink.watch_state import WatchState


class TakeoffGrant:
    """Follows `takeoff` for one vehicle."""

    def __init__(self, state: WatchState, policy: Callable[[], Policy]) -> None:
        self._state, self._policy = state, policy
        self.takeoff = policy().takeoff  # as acted on last

    def step(self, now: float) -> None:
        """Act where the parameter or the vehicle has changed."""
        state, authority = self._state, self._state.authority
        takeoff, telemetry = self._policy().takeoff, self._state.telemetry
        idle = state.mode is not None and not state.armed
        if not takeoff and (self.takeoff or (idle and authority.held)):
            air = telemetry.airborne
            state.apply(Event.WITHDRAWN_IN_AIR if air else Event.WITHDRAWN, now,
                        'takeoff is false' + (': until the landing' if air else ''))
        elif takeoff and not self.takeoff:
            authority.until_landing = False
        if authority.state is not State.SUSPENDED or takeoff:
            self.takeoff = takeoff  # else it becomes false when that is over
        if (takeoff and idle and authority.state is State.NONE and not authority.landed
                and not authority.undecided and telemetry.grounded and telemetry.past_boot
                and not telemetry.stale(now)):
            state.apply(Event.GRANTED, now, 'takeoff is true')
