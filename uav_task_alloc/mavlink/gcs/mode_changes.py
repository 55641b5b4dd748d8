# SPDX-License-Identifier: Apache-2.0
"""Finds the cause of a mode change: our command, a pilot, a failsafe, or the vehicle itself."""
from __future__ import annotations

from collections.abc import Callable

from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.mavlink.gcs.authority import AuthorityEvent, Suspension
from uav_task_alloc.mavlink.gcs.authority_state import AuthorityState
from uav_task_alloc.mavlink.gcs.authority_watch_state import AuthorityWatchState
from uav_task_alloc.mavlink.gcs.climb_check import CLIMBED
from uav_task_alloc.mavlink.gcs.flight_modes import ModeClass, avoids_traffic
from uav_task_alloc.mavlink.gcs.mission_evidence import MissionEvidence
from uav_task_alloc.mavlink.gcs.onboard_mission import LATE_REACHED

_HEARTBEAT_DELAY = 1.5  # [s] on the way, as a rule
_CLOCK_DELAY = 0.5  # [s] of a message with the clock, as a rule
_CONTRADICTED = 2.5  # [s] in which a heartbeat may still show a mode that was acknowledged


class ModeChanges:
    """Applies the authority event of each mode change of one vehicle.

    Args:
        state: of the vehicle; changed by the methods.
        evidence: of its mission.
    """

    def __init__(self, state: AuthorityWatchState, evidence: MissionEvidence) -> None:
        self._state, self._evidence = state, evidence
        self._family = state.profile.family

    def receive_heartbeat(self, before: int, mode: int, now: float) -> None:
        """Compare the custom_mode of a heartbeat with that of the previous one."""
        before = self._mode_before(before, mode, now)
        if mode != before and self._state.class_of(before) is not None:
            self._changed(before, mode, now)

    def resolve(self, now: float) -> None:
        """End the wait for an explanation of a mode change: explained, or too late."""
        state, unexplained = self._state, self._state.unexplained
        if unexplained is None:
            return
        if unexplained.explained(now):
            state.unexplained = None
            if state.is_return(state.mode):
                state.descending = True
            state.apply(AuthorityEvent.EXPLAINED, now, unexplained.why)
        elif now >= unexplained.until:
            state.unexplained = None
            if state.unconfirmed:
                state.unconfirmed = False
                state.apply(AuthorityEvent.LINK_CHANGED, now, unexplained.why)
            else:
                state.apply_taken(unexplained.why, now)

    def _mode_before(self, before: int, mode: int, now: float) -> int:
        """The mode before this heartbeat, also one that no heartbeat has shown.

        A mode that was acknowledged and is not shown suspends authority until the next
        heartbeat: PX4 may acknowledge a moment before its heartbeat shows the new mode.
        """
        state, sent = self._state, self._state.sent
        if state.unexplained is not None and state.unexplained.ours == mode:
            self.resolve(now)
            return mode
        entered = sent.acks.mode_entered_by(state.telemetry.frame)
        if entered is None:
            return before
        sent.acks.clear()
        if mode in (entered, *sent.pending_modes(now), before):
            sent.modes = [each for each in sent.modes
                          if each[0] == entered == mode != before][-1:]
            if mode != entered and state.authority.held and state.unexplained is None:
                if self._has_climbed(entered, mode):
                    return entered
                why = f'{state.name_of(entered)} -> {state.name_of(mode)}'
                state.suspend_until_explained(
                    lambda t: state.mode == entered or self._has_climbed(entered, mode), why, now,
                    within=_CONTRADICTED, ours=entered)
                before = mode
        return before

    def _has_climbed(self, entered: int, mode: int) -> bool:
        """Whether it may be in HOLD since the end of our take-off, which no heartbeat showed."""
        state, climb = self._state, self._state.sent.climb
        return (climb is not None and entered == state.profile.takeoff_mode
                and state.class_of(mode) is ModeClass.HOLD
                and state.telemetry.height >= CLIMBED * climb)

    def _changed(self, before: int, mode: int, now: float) -> None:
        state = self._state
        was, new = state.class_of(before), state.class_of(mode)
        state.forget_mode()
        why = f'{state.name_of(before)} -> {state.name_of(mode)}'
        if self._apply_known_cause(before, mode, now, why):
            return
        if new is ModeClass.MISSION:
            self._mission_set(before, mode, now, why)
        elif was is ModeClass.MISSION and self._mission_ended(mode, now):
            state.apply(AuthorityEvent.MISSION_ENDED, now, why)
            state.descending = state.is_return(mode)
        elif was is ModeClass.MISSION and self._mission_may_have_ended(mode):
            state.suspend_until_explained(lambda t: self._mission_ended(mode, t), why, now)
        elif new is ModeClass.HOLD and not (
                was is ModeClass.MISSION and state.authority.held
                and not state.telemetry.airborne):  # on the ground it is as any other mode
            self._hold_set(before, mode, now, why)
        elif not (state.flown or state.armed or state.is_return(mode)) and state.authority.held:
            # never armed: a reboot looks the same until a message with its clock is received,
            # but no vehicle boots into its return
            state.suspend_until_explained(self._rebooted_by(now), why, now)
        elif state.authority.state is not AuthorityState.NONE or state.telemetry.past_boot:
            state.apply_taken(why, now)

    def _apply_known_cause(self, before: int, mode: int, now: float, why: str) -> bool:
        """Apply the event where the cause does not depend on the mode classes; False: unknown."""
        state = self._state
        if state.unexplained is not None:
            state.unexplained = None
            state.apply(AuthorityEvent.TAKEN, now, why)
        elif state.sent.confirm_mode(mode, now):
            state.apply(AuthorityEvent.OWN, now, why)
        elif avoids_traffic(self._family, mode):  # system_status is CRITICAL as well
            state.apply(AuthorityEvent.AVOIDING, now, why)
        elif (state.class_of(mode) is ModeClass.MISSION
                and state.authority.suspended_by(Suspension.AVOID)
                and avoids_traffic(self._family, before)):
            state.apply(AuthorityEvent.AVOIDED, now, why)
        elif state.failsafe_active(now):
            event = (
                AuthorityEvent.REPLACEMENT_TAKEN
                if state.replacing_since is not None
                else AuthorityEvent.FAILSAFE_MODE
            )
            state.apply(event, now, f'failsafe: {why}')
        else:
            return False
        return True

    def _mission_set(self, before: int, mode: int, now: float, why: str) -> None:
        """Apply an unexpected MISSION: set by a pilot, unless our own command was delayed."""
        state = self._state
        if state.sent.was_recently_sent(mode, now):
            state.apply(AuthorityEvent.OWN, now, why)
        elif state.telemetry.airborne:
            state.apply(AuthorityEvent.TO_MISSION, now, f'{why} in flight')
        else:  # it may take off with it
            state.mission_on_ground = not self._left_return(before)

    def _left_return(self, before: int) -> bool:
        """Whether it is disarmed after a return, by which PX4 enters its mode of before that."""
        state = self._state
        return self._family == 'px4' and not state.armed and (
            state.class_of(before) is ModeClass.OWN)

    def _hold_set(self, before: int, mode: int, now: float, why: str) -> None:
        """Apply an unexpected HOLD: the end of a take-off or landing, or set by a pilot."""
        state, telemetry = self._state, self._state.telemetry
        was, climb = state.class_of(before), state.sent.climb
        if state.profile.takeoff_mode == before and climb is not None:
            self._climb_ended(climb, now, why)
        elif state.descending and state.is_return(before):
            # PX4 enters its mode of before the return when it has landed
            if not telemetry.grounded:
                state.suspend_until_explained(lambda t: telemetry.grounded, why, now)
        elif state.sent.was_recently_sent(mode, now):
            # our own command was delayed: no hand-over by the pilot
            if was is ModeClass.MISSION:
                state.apply_taken(why, now)
        elif was is ModeClass.STICK:
            if telemetry.airborne:
                state.rest = now, telemetry.position
        elif telemetry.airborne and (was is ModeClass.MISSION or state.authority.held
                                     or avoids_traffic(self._family, before)):
            state.apply_taken(why, now)

    def _climb_ended(self, climb: float, now: float, why: str) -> None:
        """Apply the end of our take-off; below the height `climb` [m] something else ended it."""
        state, telemetry = self._state, self._state.telemetry

        def climbed(t: float) -> bool:
            return telemetry.height >= CLIMBED * climb

        state.sent.climb = None
        if climbed(now):
            state.apply(AuthorityEvent.OWN, now, why)
        else:
            state.suspend_until_explained(climbed, why, now)

    def _mission_ended(self, mode: int, now: float) -> bool:
        """Whether the vehicle has left MISSION automatically at the end of its mission (PX4)."""
        if self._family != 'px4':
            return False
        if self._state.class_of(mode) is ModeClass.HOLD:
            # what was reported before it entered MISSION is of an earlier mission
            since = self._state.in_mission_since
            return (self._evidence.ended(max(since, now - LATE_REACHED))
                    or self._evidence.rejected(now)
                    or self._state.texts.mission_ended(now, since))
        return self._state.is_return(mode) and (
            self._evidence.returning()
            or self._evidence.returned_before(now, self._state.in_mission_since))

    def _mission_may_have_ended(self, mode: int) -> bool:
        """Whether it may have ended, with the message that reports it delayed (PX4)."""
        return self._family == 'px4' and self._evidence.may_end() and (
            self._state.class_of(mode) is ModeClass.HOLD or self._state.is_return(mode))

    def _rebooted_by(self, now: float) -> Callable[[float], bool]:
        """A predicate: it rebooted between the last heartbeat with the mode before and this one.

        A reboot after this heartbeat does not explain its mode, which another has set before.

        Args:
            now: when the heartbeat with the new mode was received [s].
        """
        state, telemetry, before = self._state, self._state.telemetry, self._state.heartbeat_at
        restarts, booted = telemetry.restarts, state.status >= d.MAV_STATE_STANDBY
        earliest, latest = before - _HEARTBEAT_DELAY, now + _CLOCK_DELAY
        return lambda t: (state.booting and not booted) or (
            telemetry.restarts != restarts and earliest < telemetry.booted_at <= latest)
