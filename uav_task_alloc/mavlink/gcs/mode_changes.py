# SPDX-License-Identifier: Apache-2.0
"""Judges a change of mode: ours, a pilot's, a failsafe's, or the vehicle's own."""
from __future__ import annotations

from collections.abc import Callable

from uav_task_alloc.mavlink.gcs.authority import AuthorityEvent, AuthorityState, Suspension
from uav_task_alloc.mavlink.gcs.authority_watch_state import AuthorityWatchState
from uav_task_alloc.mavlink.gcs.flight_modes import ModeClass, avoids_traffic
from uav_task_alloc.mavlink.gcs.mission_evidence import MissionEvidence

CLIMBED = 0.9  # of the height asked for: the take-off has ended by itself
CONTRADICTED = 2.5  # [s] in which a heartbeat may still show a mode that was acknowledged


class ModeChanges:
    """Judges the modes of one vehicle, heartbeat by heartbeat."""

    def __init__(self, state: AuthorityWatchState, evidence: MissionEvidence) -> None:
        self._state, self._evidence = state, evidence
        self._family = state.profile.family

    def heartbeat(self, before: int, mode: int, now: float) -> None:
        """Compare the mode of a heartbeat with that of the one before."""
        before = self._entered(before, mode, now)
        if mode != before and self._state.class_of(before) is not None:
            self._changed(before, mode, now)

    def resolve(self, now: float) -> None:
        """A change of mode that was not explained: is it by now, or is it too late?"""
        state, doubt = self._state, self._state.doubt
        if doubt is None:
            return
        if doubt.explained(now):
            state.doubt = None
            if state.returns(state.mode):
                state.descending = True
            state.apply(AuthorityEvent.EXPLAINED, now, doubt.why)
        elif now >= doubt.until:
            state.doubt = None
            if state.unconfirmed:
                state.unconfirmed = False
                state.apply(AuthorityEvent.LINK_CHANGED, now, doubt.why)
            else:
                state.take(doubt.why, now)

    def _entered(self, before: int, mode: int, now: float) -> int:
        """The mode before this heartbeat, also one that no heartbeat has shown.

        A mode that was acknowledged and is not there is doubted until the next heartbeat: PX4
        may answer a moment before it tells its new mode.
        """
        state, sent = self._state, self._state.sent
        if state.doubt is not None and state.doubt.ours == mode:
            self.resolve(now)
            return mode
        entered = sent.acks.known_by(state.telemetry.frame)
        if entered is None:
            return before
        sent.acks.clear()
        if mode in (entered, *sent.under_way(now), before):
            sent.modes = [each for each in sent.modes
                          if each[0] == entered == mode != before][-1:]
            if mode != entered and state.authority.held and state.doubt is None:
                why = f'{state.name_of(entered)} -> {state.name_of(mode)}'
                state.wait_for_reason(lambda t: state.mode == entered, why, now,
                                      within=CONTRADICTED, ours=entered)
                before = mode
        return before

    def _changed(self, before: int, mode: int, now: float) -> None:
        state = self._state
        was, new = state.class_of(before), state.class_of(mode)
        state.forget_mode()
        why = f'{state.name_of(before)} -> {state.name_of(mode)}'
        if self._known(before, mode, now, why):
            return
        if new is ModeClass.MISSION:
            self._mission_set(mode, now, why)
        elif was is ModeClass.MISSION and self._explained(mode, now):
            state.apply(AuthorityEvent.MISSION_ENDED, now, why)
            state.descending = state.returns(mode)
        elif was is ModeClass.MISSION and self._explicable(mode):
            state.wait_for_reason(lambda t: self._explained(mode, t), why, now)
        elif new is ModeClass.HOLD:
            self._hold_set(before, mode, now, why)
        elif not state.flown and not state.armed and state.authority.held:
            # never armed: a restart of the autopilot looks alike until its clock is heard
            state.wait_for_reason(self._restarted_since(), why, now)
        elif state.authority.state is not AuthorityState.NONE or state.telemetry.past_boot:
            state.take(why, now)

    def _known(self, before: int, mode: int, now: float, why: str) -> bool:
        """Whether the cause is known, whatever the modes mean; it is applied then."""
        state = self._state
        if state.doubt is not None:
            state.doubt = None
            state.apply(AuthorityEvent.TAKEN, now, why)
        elif state.sent.expects(mode, now):
            state.apply(AuthorityEvent.OWN, now, why)
        elif avoids_traffic(self._family, mode):  # it says CRITICAL as well
            state.apply(AuthorityEvent.AVOIDING, now, why)
        elif (state.class_of(mode) is ModeClass.MISSION
                and state.authority.suspended_by(Suspension.AVOID)
                and avoids_traffic(self._family, before)):
            state.apply(AuthorityEvent.AVOIDED, now, why)
        elif state.failing(now):
            event = (
                AuthorityEvent.SWAP_TAKEN
                if state.swap_at is not None
                else AuthorityEvent.FAILSAFE_MODE
            )
            state.apply(event, now, f'failsafe: {why}')
        else:
            return False
        return True

    def _mission_set(self, mode: int, now: float, why: str) -> None:
        """MISSION, not expected: by a human, unless a command of ours came late."""
        state = self._state
        if state.sent.recently(mode, now):
            state.apply(AuthorityEvent.OWN, now, why)
        elif state.telemetry.airborne:
            state.apply(AuthorityEvent.TO_MISSION, now, f'{why} in flight')
        else:
            state.mission_on_ground = True  # it may take off with it

    def _hold_set(self, before: int, mode: int, now: float, why: str) -> None:
        """HOLD, not expected: at the end of a take-off or a landing, or by a human."""
        state, telemetry = self._state, self._state.telemetry
        was, climb = state.class_of(before), state.sent.climb
        if state.profile.takeoff_mode == before and climb is not None:
            self._climb_ended(climb, now, why)
        elif state.descending and state.returns(before):
            # PX4 goes to Hold when it has landed
            if not telemetry.grounded:
                state.wait_for_reason(lambda t: telemetry.grounded, why, now)
        elif state.sent.recently(mode, now):
            # a command of ours that came late: it hands nothing over
            if was is ModeClass.MISSION:
                state.take(why, now)
        elif was is ModeClass.STICK:
            if telemetry.airborne:
                state.rest = now, telemetry.position
        elif telemetry.airborne and (was is ModeClass.MISSION or state.authority.held
                                     or avoids_traffic(self._family, before)):
            state.take(why, now)

    def _climb_ended(self, climb: float, now: float, why: str) -> None:
        """Of our take-off, by itself where it is high enough [m]."""
        state, telemetry = self._state, self._state.telemetry

        def climbed(t: float) -> bool:
            return telemetry.height >= CLIMBED * climb

        state.sent.climb = None
        if climbed(now):
            state.apply(AuthorityEvent.OWN, now, why)
        else:
            state.wait_for_reason(climbed, why, now)

    def _explained(self, mode: int, now: float) -> bool:
        """The vehicle has left the mission by itself, at its end (PX4)."""
        if self._family != 'px4':
            return False
        if self._state.class_of(mode) is ModeClass.HOLD:
            return (self._evidence.ended(now) or self._evidence.rejected(now)
                    or self._state.texts.mission_over(now))
        return self._state.returns(mode) and self._evidence.returning()

    def _explicable(self, mode: int) -> bool:
        """It may have: the message that says so may be under way."""
        return self._family == 'px4' and self._evidence.may_end() and (
            self._state.class_of(mode) is ModeClass.HOLD or self._state.returns(mode))

    def _restarted_since(self) -> Callable[[float], bool]:
        state, restarts = self._state, self._state.telemetry.restarts
        return lambda now: state.telemetry.restarts != restarts or state.booting
