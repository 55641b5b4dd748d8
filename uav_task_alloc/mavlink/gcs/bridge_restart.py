# SPDX-License-Identifier: Apache-2.0
"""Decides the authority over a vehicle after a start of the bridge, with or without a record."""
from __future__ import annotations

from collections.abc import Callable

from uav_task_alloc.mavlink.gcs.authority import AuthorityEvent, AuthorityRecord, AuthorityState
from uav_task_alloc.mavlink.gcs.authority_watch_state import AuthorityWatchState
from uav_task_alloc.mavlink.gcs.flight_modes import ModeClass
from uav_task_alloc.mavlink.gcs.hand_over import REST_SPEED
from uav_task_alloc.mavlink.gcs.mission_evidence import MissionEvidence
from uav_task_alloc.mavlink.gcs.policy import Policy

_REPLACEMENT_KEPT = 60.0  # [s] after which a replacement of the previous run is not continued
_BRAKING_TIME = 10.0  # [s] from the HOLD command until the vehicle is at rest


class BridgeRestart:
    """Compares one vehicle with the record of the previous run.

    Args:
        state: of the vehicle; changed by the methods.
        evidence: of its mission.
        policy: returns the present parameters.
        record: of the previous run; None: there is none.
    """

    def __init__(self, state: AuthorityWatchState, evidence: MissionEvidence,
                 policy: Callable[[], Policy], record: AuthorityRecord | None) -> None:
        self._state, self._evidence, self._policy = state, evidence, policy
        self._record = record  # None once it is compared
        self._armed_at_start = False  # it was armed before the bridge started
        if record is None:
            state.authority.undecided = True

    @property
    def pending(self) -> bool:
        """Whether the record is still to be compared with a heartbeat."""
        return self._record is not None

    def receive_heartbeat(self, now: float) -> None:
        """Compare the first heartbeat of this run with the record."""
        state, record = self._state, self._record
        if record is None:
            state.authority.undecided = self._armed_at_start = state.armed
            return
        if record.state not in (AuthorityState.HELD, AuthorityState.SUSPENDED):
            self._record = None
            return
        agrees = self._agrees(record)
        if agrees and record.replacing_since is not None and (
                state.class_of(state.mode) is ModeClass.HOLD):
            at_rest = self._at_rest(record.replacing_since, now)
            if at_rest is None:
                return  # decided at a later heartbeat
            agrees = at_rest
            state.replacing_since = record.replacing_since if agrees else None
        self._record = None
        self._apply_result(record, agrees, now)

    def _agrees(self, record: AuthorityRecord) -> bool:
        state = self._state
        same = state.class_of(state.mode) is None or (
            state.mode in (record.mode, *record.commanded))
        return same and (state.armed == record.armed or (state.armed and record.arming))

    def _at_rest(self, replacing_since: float, now: float) -> bool | None:
        """Whether it is at rest for a replacement; None: not known, or it may still be braking."""
        telemetry = self._state.telemetry
        held_for, known = now - replacing_since, telemetry.has_velocity
        at_rest = known and telemetry.speed < REST_SPEED
        if not at_rest and 0.0 <= held_for < (_BRAKING_TIME if known else _REPLACEMENT_KEPT):
            return None
        return at_rest and 0.0 <= held_for < _REPLACEMENT_KEPT

    def _apply_result(self, record: AuthorityRecord, agrees: bool, now: float) -> None:
        state = self._state
        state.descending = state.is_return(state.mode or 0)
        if agrees and state.mode is not None:
            # a HOLD that was sent, or due, and that no heartbeat has confirmed
            mode_class = state.class_of(state.mode)
            state.hold_due = mode_class is ModeClass.STICK or (
                mode_class is not ModeClass.HOLD
                and ModeClass.HOLD in map(state.class_of, record.commanded))
            state.sent.confirm_mode(state.mode, now)
        state.apply(
            AuthorityEvent.RESTART_AGREES if agrees else AuthorityEvent.RESTART_DIFFERS,
            now,
            f'the bridge was restarted, the vehicle is in {state.name_of(state.mode)}',
        )

    def step(self, now: float) -> None:
        """Decide after a start without a record: on the ground, or airborne."""
        state, authority = self._state, self._state.authority
        if authority.undecided and state.mode is not None:
            if state.telemetry.grounded:
                authority.undecided = False
                if self._armed_at_start and self._policy().takeoff:
                    authority.landed = True  # `takeoff` alone grants nothing
                    authority.why = 'armed or landing when the bridge started'
            elif state.telemetry.airborne:
                authority.undecided = False
                state.maybe_ours = state.class_of(state.mode) is ModeClass.MISSION
                state.apply(AuthorityEvent.RESTART_AIRBORNE, now,
                            f'airborne in {state.name_of(state.mode)} when the bridge started')
        if state.maybe_ours and authority.state is AuthorityState.LOST and self._evidence.ours():
            state.maybe_ours = False
            state.apply(AuthorityEvent.RESTART_OURS, now, 'flies our mission')
