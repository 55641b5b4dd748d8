# SPDX-License-Identifier: Apache-2.0
"""Finds who armed, disarmed, landed or launched a vehicle, and applies the authority event."""
from __future__ import annotations

import math
from collections.abc import Callable

from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.mavlink.autopilots import OFF_GROUND, ModeFunction
from uav_task_alloc.mavlink.gcs.authority import AuthorityEvent, HoldStage
from uav_task_alloc.mavlink.gcs.authority_watch_state import AuthorityWatchState
from uav_task_alloc.mavlink.gcs.mission_evidence import MissionEvidence
from uav_task_alloc.mavlink.gcs.policy import Policy
from uav_task_alloc.mavlink.gcs.sent_commands import COMMAND_LIFETIME
from uav_task_alloc.mavlink.gcs.telemetry import DISARM_PAUSE

# [0..1] a battery of at least this, which is fuller than at the landing by that, was changed
_FULL, _RISE = 0.9, 0.05
_AT_REST = 0.3  # [m/s], less than the last part of a descent (LAND_SPEED, MPC_LAND_SPEED)
_FALL = 3.0  # [m] in DISARM_PAUSE; a height changes by less when the propellers stop


class ArmingAndLanding:
    """Applies the authority events of take-off, landing, arming and disarming of one vehicle.

    Args:
        state: of the vehicle; changed by the methods.
        evidence: of its mission.
        policy: returns the present parameters.
    """

    def __init__(self, state: AuthorityWatchState, evidence: MissionEvidence,
                 policy: Callable[[], Policy]) -> None:
        self._state, self._evidence, self._policy = state, evidence, policy
        self._landed_at = -math.inf  # [s] after our RETURN
        self._disarmed_at, self._height = -math.inf, math.nan  # [s], and how high [m] it was then

    def is_returning(self, now: float) -> bool:
        """Whether it returns by our command: the mode, or the last item.

        Args:
            now: steady time [s].
        """
        state = self._state
        if state.mode is None:
            return False
        function = state.profile.mode_function(state.mode)
        in_mission = function is ModeFunction.MISSION or (
            function is ModeFunction.HOLD and self._evidence.has_landed())
        # it may land before our next command arrives
        ours = state.descending or now < state.left_return_at + COMMAND_LIFETIME
        return (ours and state.is_return(state.mode)) or (
            in_mission and self._evidence.returning())

    def armed_changed(self, was_returning: bool, now: float) -> None:
        """Apply an arming or disarming.

        Args:
            was_returning: whether it returned by our command before this heartbeat.
            now: steady time [s].
        """
        state = self._state
        if state.armed:
            if now <= state.sent.arm_until:
                state.flown, state.landed_battery = True, math.nan
                state.apply(AuthorityEvent.OWN, now, 'armed by the bridge')
            else:
                state.apply(AuthorityEvent.ARMED_BY_OTHER, now, 'armed, not by the bridge')
        else:
            self._disarmed(was_returning, now)

    def _disarmed(self, was_returning: bool, now: float) -> None:
        """Apply a disarming: in the air it is a kill, whatever came before."""
        state = self._state
        expected = now <= max(state.sent.disarm_until, self._landed_at + COMMAND_LIFETIME)
        self._landed_at = state.sent.disarm_until = -math.inf  # it explains one disarming
        if self._is_off_ground(may_land=was_returning or expected):
            state.apply(AuthorityEvent.KILLED, now, 'disarmed in the air')
            return
        self._disarmed_at, self._height = now, state.telemetry.height
        if was_returning:
            self._apply_landing(now)
            self._landed_at = -math.inf
        elif expected:
            state.apply(AuthorityEvent.OWN, now, 'disarmed by the bridge, or after its landing')
            self._await_battery_change()
        else:
            state.apply(AuthorityEvent.ARMED_BY_OTHER, now, 'disarmed, not by the bridge')

    def _is_off_ground(self, may_land: bool) -> bool:
        """By height and landed_state: that one comes at 1 Hz, and the ground may not be level.

        Args:
            may_land: whether a landing is expected: before it is disarmed it has been at rest.
        """
        telemetry = self._state.telemetry
        high = (self._state.was_airborne and telemetry.height > OFF_GROUND
                and telemetry.landed != d.MAV_LANDED_STATE_ON_GROUND)
        return high and not (may_land and telemetry.speed < _AT_REST)

    def _check_fall(self, now: float) -> None:
        """Apply a kill where it falls after it was disarmed at rest, well above the ground."""
        may_fall = self._height > OFF_GROUND and now - self._disarmed_at <= DISARM_PAUSE
        if may_fall and not self._state.armed and (
                self._state.telemetry.height < self._height - _FALL):
            self._disarmed_at = -math.inf
            self._state.apply(AuthorityEvent.KILLED, now, 'fell after it was disarmed')

    def _apply_landing(self, now: float) -> None:
        state, relaunches = self._state, self._relaunches()
        state.sent.clear_pending()
        self._landed_at = now
        state.apply(AuthorityEvent.OWN if relaunches else AuthorityEvent.OWN_LANDING, now,
                    'landed')
        self._await_battery_change()

    def _relaunches(self) -> bool:
        """Whether the bridge takes off again without an operator after this landing."""
        policy = self._policy()
        return (policy.relaunch == 'automatic' and policy.takeoff
                and not self._state.authority.until_landing)

    def _await_battery_change(self) -> None:
        """Store the battery, if it may start again without an operator when that is changed."""
        state = self._state
        if self._relaunches() and state.authority.held and not state.armed:
            state.landed_battery, state.rebooted_on_ground = state.telemetry.battery, False

    def _apply_battery_change(self, now: float) -> None:
        """Grant what a reboot has ended, if the battery is fuller than at the landing."""
        state, telemetry = self._state, self._state.telemetry
        if (state.rebooted_on_ground and telemetry.grounded and not state.armed
                and not state.booting and not state.failsafe_active(now) and self._relaunches()
                and telemetry.battery >= max(_FULL, state.landed_battery + _RISE)):
            state.apply(AuthorityEvent.BATTERY_CHANGED, now, 'its battery was changed')
            state.landed_battery, state.rebooted_on_ground = math.nan, False

    def step(self, now: float) -> None:
        """Apply a landing, or a take-off in a MISSION mode that another station has set."""
        state, telemetry = self._state, self._state.telemetry
        self._check_fall(now)
        self._apply_battery_change(now)
        if state.hold_due and (telemetry.airborne or telemetry.grounded):
            state.hold_due = False
            if telemetry.airborne and state.authority.held:
                state.authority.hold = HoldStage.FIRST
        if telemetry.airborne:
            if state.mission_on_ground:
                state.mission_on_ground = False
                if not state.failsafe_active(now) and self._evidence.verified():
                    state.apply(AuthorityEvent.TO_MISSION, now, 'took off with our mission')
            state.was_airborne = True
        elif state.was_airborne and telemetry.grounded and not state.unconfirmed:
            state.was_airborne = False
            if state.authority.held and (self.is_returning(now) or state.authority.until_landing):
                self._apply_landing(now)
