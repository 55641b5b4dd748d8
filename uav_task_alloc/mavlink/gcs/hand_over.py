# SPDX-License-Identifier: Apache-2.0
"""Hand-over to the bridge: by `~/hand_over`, or by a change from a stick mode to HOLD at rest."""
from __future__ import annotations

import math
from collections.abc import Callable

from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.mavlink.gcs.authority import AuthorityEvent
from uav_task_alloc.mavlink.gcs.authority_state import AuthorityState
from uav_task_alloc.mavlink.gcs.authority_watch_state import AuthorityWatchState
from uav_task_alloc.mavlink.gcs.mission_evidence import MissionEvidence
from uav_task_alloc.mavlink.gcs.policy import Policy

REST_SPEED = 1.0  # [m/s] below which a vehicle is at rest
_REST_DISTANCE, _REST_TIME = 3.0, 6.0  # [m], [s]: at rest, for a hand-over
_LIES_TIME = 2.0  # [s] at rest, of a killed one; a fall is faster than REST_SPEED at once
LOW_BATTERY = 0.2  # [0..1] below which a hand-over is refused


class HandOver:
    """Hands one vehicle over to the bridge, or refuses with a reason.

    Args:
        state: of the vehicle; changed by the methods.
        evidence: of its mission.
        policy: returns the present parameters.
    """

    def __init__(self, state: AuthorityWatchState, evidence: MissionEvidence,
                 policy: Callable[[], Policy]) -> None:
        self._state, self._evidence, self._policy = state, evidence, policy
        # since when [s], and at which height [m], a killed vehicle has not moved
        self._lies: tuple[float, float] | None = None

    def request(self, operator: str, now: float) -> str:
        """Hand over a vehicle that is not HELD; returns the refusal, '' on success."""
        refusal = self._refusal(now)
        if not refusal:
            state = self._state
            state.forget_mode()
            state.sent.clear_pending()
            state.flown = state.armed
            state.authority.undecided = False
            state.apply(
                AuthorityEvent.HAND_OVER, now, f'handed over by {operator or "an operator"}'
            )
        return refusal

    def _refusal(self, now: float) -> str:
        state, telemetry, authority = self._state, self._state.telemetry, self._state.authority
        if telemetry.link.stale(now) or state.mode is None:
            return 'its link is stale'
        if state.status >= d.MAV_STATE_CRITICAL and not authority.killed:
            return 'a failsafe is active'
        if self._evidence.foreign():
            return 'the mission on board is foreign'
        if authority.state is AuthorityState.SUSPENDED:
            return f'SUSPENDED: {authority.why}'
        if telemetry.battery < LOW_BATTERY:
            return f'battery = {telemetry.battery:.0%}: expected at least {LOW_BATTERY:.0%}'
        if not telemetry.past_boot:
            return telemetry.starting
        if not (telemetry.airborne or telemetry.grounded):
            return 'not known whether it is in the air'
        if authority.killed and (state.armed or not telemetry.grounded):
            return 'after a kill only on the ground and disarmed'
        # one that is disarmed says that it is on the ground while it falls
        if authority.killed and not (self._lies and now - self._lies[0] >= _LIES_TIME):
            return f'after a kill only at rest: it has not been for {_LIES_TIME:g} s'
        if state.status >= d.MAV_STATE_CRITICAL:
            return 'a failsafe is active'
        if telemetry.grounded and not self._policy().takeoff:
            return 'on the ground, and takeoff is false'
        return ''

    def step(self, now: float) -> None:
        """Apply the hand-over by STICK -> HOLD once the vehicle has been at rest long enough."""
        state, telemetry = self._state, self._state.telemetry
        self._watch_killed(now)
        if state.rest is None:
            return
        since, position = state.rest
        moved = math.dist(telemetry.position, position)
        at_rest = (telemetry.speed < REST_SPEED and moved < _REST_DISTANCE and telemetry.airborne
                   and now - telemetry.position_at < 2.0
                   and state.status == d.MAV_STATE_ACTIVE and not state.failsafe_active(now))
        if not at_rest:
            state.rest = None
        elif now - since >= _REST_TIME:
            state.rest = None
            state.apply(AuthorityEvent.STICK_TO_HOLD, now,
                        f'{state.name_of(state.mode)} at rest for {_REST_TIME:g} s')

    def _watch_killed(self, now: float) -> None:
        """Note since when a killed vehicle has been at rest."""
        telemetry = self._state.telemetry
        at_rest = (self._state.authority.killed and not self._state.armed
                   and telemetry.speed < REST_SPEED
                   and now - telemetry.position_at < _LIES_TIME)
        height = telemetry.position[2]
        if not at_rest:
            self._lies = None
        elif self._lies is None or abs(height - self._lies[1]) > REST_SPEED:
            self._lies = now, height
