# SPDX-License-Identifier: Apache-2.0
"""Judges arming, disarming, landing, and a take-off with a mission that another started."""
from __future__ import annotations

import math
from collections.abc import Callable

from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.mavlink.autopilots import OFF_GROUND, ModeFunction
from uav_task_alloc.mavlink.gcs.authority import AuthorityEvent, HoldStage
from uav_task_alloc.mavlink.gcs.authority_watch_state import AuthorityWatchState
from uav_task_alloc.mavlink.gcs.mission_evidence import MissionEvidence
from uav_task_alloc.mavlink.gcs.policy import Policy
from uav_task_alloc.mavlink.gcs.sent_commands import IN_FLIGHT


class ArmingAndLanding:
    """Follows one vehicle from the ground into the air and back."""

    def __init__(self, state: AuthorityWatchState, evidence: MissionEvidence,
                 policy: Callable[[], Policy]) -> None:
        self._state, self._evidence, self._policy = state, evidence, policy
        self._landed_at = -math.inf  # [s] by our descent

    def descends(self) -> bool:
        """We sent it home, by mode or by the last item."""
        state = self._state
        if state.mode is None:
            return False
        return (state.descending and state.returns(state.mode)) or (
            state.profile.mode_function(state.mode) is ModeFunction.MISSION
            and self._evidence.returning()
        )

    def changed(self, descends: bool, now: float) -> None:
        """It was armed or disarmed.

        Args:
            descends: whether it was on its way home before this heartbeat.
            now: steady time [s].
        """
        state = self._state
        if state.armed:
            if now <= state.sent.arm_until:
                state.flown = True
                state.apply(AuthorityEvent.OWN, now, 'armed by the bridge')
            else:
                state.apply(AuthorityEvent.ARMED_BY_OTHER, now, 'armed, not by the bridge')
        elif descends:
            self._landed(now)
        elif now <= max(state.sent.disarm_until, self._landed_at + IN_FLIGHT):
            state.apply(AuthorityEvent.OWN, now, 'disarmed by the bridge, or after its landing')
        elif state.was_airborne and self._falls():
            state.apply(AuthorityEvent.KILLED, now, 'disarmed in the air')
        else:
            state.apply(AuthorityEvent.ARMED_BY_OTHER, now, 'disarmed, not by the bridge')

    def _falls(self) -> bool:
        """Off the ground by both: landed_state is told once a second, and a home may be low."""
        telemetry = self._state.telemetry
        return (telemetry.height > OFF_GROUND
                and telemetry.landed != d.MAV_LANDED_STATE_ON_GROUND)

    def _landed(self, now: float) -> None:
        state, policy = self._state, self._policy()
        again = (policy.relaunch == 'automatic' and policy.takeoff
                 and not state.authority.until_landing)
        state.sent.drop()
        self._landed_at = now
        state.apply(AuthorityEvent.OWN if again else AuthorityEvent.OWN_LANDING, now, 'landed')

    def step(self, now: float) -> None:
        """Landing, and take-off with a mission that somebody started on the ground."""
        state, telemetry = self._state, self._state.telemetry
        if state.hold_due and (telemetry.airborne or telemetry.grounded):
            state.hold_due = False
            if telemetry.airborne and state.authority.held:
                state.authority.hold = HoldStage.FIRST
        if telemetry.airborne:
            if state.mission_on_ground:
                state.mission_on_ground = False
                if not state.failing(now) and self._evidence.verified():
                    state.apply(AuthorityEvent.TO_MISSION, now, 'took off with our mission')
            state.was_airborne = True
        elif state.was_airborne and telemetry.grounded and not state.unconfirmed:
            state.was_airborne = False
            if state.authority.held and (self.descends() or state.authority.until_landing):
                self._landed(now)
