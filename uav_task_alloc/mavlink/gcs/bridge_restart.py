# SPDX-License-Identifier: Apache-2.0
"""Judges a vehicle that the bridge finds at its start, with a record of it or without one."""
from __future__ import annotations

from collections.abc import Callable

from uav_task_alloc.mavlink.gcs.authority import AuthorityEvent, AuthorityRecord, AuthorityState
from uav_task_alloc.mavlink.gcs.authority_watch_state import AuthorityWatchState
from uav_task_alloc.mavlink.gcs.flight_modes import ModeClass
from uav_task_alloc.mavlink.gcs.hand_over import REST
from uav_task_alloc.mavlink.gcs.mission_evidence import MissionEvidence
from uav_task_alloc.mavlink.gcs.policy import Policy

SWAP_KEPT = 60.0  # [s] that a swap may be under way when the bridge is restarted
BRAKING = 10.0  # [s] after its hold was sent until it is at rest


class BridgeRestart:
    """Compares one vehicle with what the bridge before left."""

    def __init__(self, state: AuthorityWatchState, evidence: MissionEvidence,
                 policy: Callable[[], Policy], record: AuthorityRecord | None) -> None:
        self._state, self._evidence, self._policy = state, evidence, policy
        self._record = record  # of the bridge before, until it is judged
        self._armed_at_start = False  # somebody had armed it before this bridge was there
        if record is None:
            state.authority.undecided = True

    @property
    def pending(self) -> bool:
        """The record is not judged yet."""
        return self._record is not None

    def heartbeat(self, now: float) -> None:
        """The first heartbeat of this bridge: does the vehicle do what it was left to do?"""
        state, record = self._state, self._record
        if record is None:
            state.authority.undecided = self._armed_at_start = state.armed
            return
        if record.state not in (AuthorityState.HELD, AuthorityState.SUSPENDED):
            self._record = None
            return
        agrees = self._agrees(record)
        if agrees and record.swap_at is not None and (
                state.class_of(state.mode) is ModeClass.HOLD):
            rests = self._rests(record.swap_at, now)
            if rests is None:
                return  # the next heartbeat will tell
            agrees = rests
            state.swap_at = record.swap_at if agrees else None
        self._record = None
        self._go_on(record, agrees, now)

    def _agrees(self, record: AuthorityRecord) -> bool:
        state = self._state
        same = state.class_of(state.mode) is None or (
            state.mode in (record.mode, *record.commanded))
        return same and (state.armed == record.armed or (state.armed and record.arming))

    def _rests(self, swap_at: float, now: float) -> bool | None:
        """Whether it is at rest for a swap; None: not known, or it may still be braking."""
        telemetry = self._state.telemetry
        held, known = now - swap_at, telemetry.has_velocity
        rests = known and telemetry.speed < REST
        if not rests and 0.0 <= held < (BRAKING if known else SWAP_KEPT):
            return None
        return rests and 0.0 <= held < SWAP_KEPT

    def _go_on(self, record: AuthorityRecord, agrees: bool, now: float) -> None:
        state = self._state
        state.descending = state.returns(state.mode or 0)
        if agrees and state.mode is not None:
            # a hold that was sent, or was to be sent, and was not seen
            mode_class = state.class_of(state.mode)
            state.hold_due = mode_class is ModeClass.STICK or (
                mode_class is not ModeClass.HOLD
                and ModeClass.HOLD in map(state.class_of, record.commanded))
            state.sent.expects(state.mode, now)
        state.apply(
            AuthorityEvent.RESTART_AGREES if agrees else AuthorityEvent.RESTART_DIFFERS,
            now,
            f'the bridge was restarted, and found {state.name_of(state.mode)}',
        )

    def step(self, now: float) -> None:
        """After a start without a record: on the ground, or in the air?"""
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
                            f'in the air in {state.name_of(state.mode)} when the bridge started')
        if state.maybe_ours and authority.state is AuthorityState.LOST and self._evidence.ours():
            state.maybe_ours = False
            state.apply(AuthorityEvent.RESTART_OURS, now, 'flies our mission')
