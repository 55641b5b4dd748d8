# SPDX-License-Identifier: Apache-2.0
"""Decides the authority over a vehicle after a start of the bridge, with or without a record."""
from __future__ import annotations

import math
from collections.abc import Callable

from uav_task_alloc.mavlink.gcs.authority import AuthorityEvent
from uav_task_alloc.mavlink.gcs.authority_recorder import LANDING_RADIUS
from uav_task_alloc.mavlink.gcs.authority_state import UNUSABLE, AuthorityRecord, AuthorityState
from uav_task_alloc.mavlink.gcs.authority_watch_state import AuthorityWatchState
from uav_task_alloc.mavlink.gcs.boot_clock import CLOCK_TIME
from uav_task_alloc.mavlink.gcs.flight_modes import ModeClass
from uav_task_alloc.mavlink.gcs.hand_over import REST_SPEED
from uav_task_alloc.mavlink.gcs.mission_evidence import MissionEvidence
from uav_task_alloc.mavlink.gcs.policy import Policy

_REPLACEMENT_KEPT = 60.0  # [s] after which a replacement of the previous run is not continued
_BRAKING_TIME = 10.0  # [s] from the HOLD command until the vehicle is at rest
_CLIMB_ERROR = 0.1  # of the height of a take-off, by which its end differs at most
# vehicle time, and east and north, of the newest position in `AuthorityRecord.seen`
_TIME, _PLACE = -7, slice(-6, -4)
_FRESH = 3.0  # [s] since a heartbeat that still shows the present mode
_DRIFT = 5.0  # [m] from home at most where a take-off ends


class BridgeRestart:
    """Compares one vehicle with the record of the previous run.

    Args:
        state: of the vehicle; changed by the methods.
        evidence: of its mission.
        policy: returns the present parameters.
        record: of the previous run; None: there is none; UNUSABLE: it cannot be used.
    """

    def __init__(self, state: AuthorityWatchState, evidence: MissionEvidence,
                 policy: Callable[[], Policy], record: AuthorityRecord | None) -> None:
        self._state, self._evidence, self._policy = state, evidence, policy
        self._record = None if record is UNUSABLE else record  # None once it is compared
        self._unusable = record is UNUSABLE  # until it is handed over
        self._first_at: float | None = None  # [s] the first heartbeat of this run
        self._awaits_clock = False  # to compare the record with the latest heartbeat
        self._armed_at_start = False  # it was armed before the bridge started
        self._mission: int | None = None  # checksum of one that may have ended while it was down
        self._held_in: int | None = None  # custom_mode, of a HOLD that may be its end
        self._landed_in: int | None = None  # custom_mode, of a landing of its own meanwhile
        self._landing: AuthorityRecord | None = None  # while it came down to land
        if self._record is None:
            state.authority.undecided = True

    @property
    def pending(self) -> bool:
        """Whether the record is still to be compared with a heartbeat."""
        return self._record is not None

    def receive_heartbeat(self, now: float) -> None:
        """Compare the first heartbeat of this run with the record."""
        state, record = self._state, self._record
        self._first_at = now if self._first_at is None else self._first_at
        if record is None:
            state.authority.undecided = self._armed_at_start = state.armed
            return
        if record.state not in (AuthorityState.HELD, AuthorityState.SUSPENDED):
            self._record = None
            self._await_battery_change(record)
            return
        rebooted = self._rebooted(record)
        self._awaits_clock = rebooted is None and now - self._first_at < CLOCK_TIME
        if self._awaits_clock:
            return
        if rebooted is None:
            # the rates that the previous run has asked for end only with a reboot; but a pilot who
            # flies our mission hands it over, and another mission is found when it is read
            rebooted = state.class_of(state.mode) is not ModeClass.MISSION
        agrees = self._agrees(record) and not rebooted
        if agrees and record.replacing_since is not None and (
                state.class_of(state.mode) is ModeClass.HOLD):
            at_rest = self._at_rest(record.replacing_since, now)
            if at_rest is None:
                return  # decided at a later heartbeat
            agrees = at_rest
            state.replacing_since = record.replacing_since if agrees else None
        if not (agrees or rebooted) and self._may_have_climbed(record):
            climbed = self._has_climbed(record.climb or 0.0)
            if climbed is None and now - self._first_at < _BRAKING_TIME:
                return
            agrees = bool(climbed)
            state.sent.climb = None
        self._record = None
        self._apply_result(record, agrees, now)
        self._await_battery_change(record)
        if not (agrees or rebooted) and self._landing is None:
            self._may_have_ended(record)

    def _await_battery_change(self, record: AuthorityRecord) -> None:
        """Continue to wait for a full battery after a landing of its own."""
        state = self._state
        if record.landed_battery is None or state.armed:
            return
        if record.armed:
            self._landing = record if record.seen else None
        else:
            state.landed_battery = record.landed_battery
            state.rebooted_on_ground = not state.authority.held  # else a reboot is still to come
            state.authority.awaits_battery = state.rebooted_on_ground

    def _may_have_ended(self, record: AuthorityRecord) -> None:
        """Note what the end of its mission or of our RETURN explains, once it is confirmed."""
        state = self._state
        if not record.armed:
            return
        if state.armed:
            modes = map(state.class_of, (record.mode, *record.commanded))
            holds = state.profile.atomic and state.class_of(state.mode) is ModeClass.HOLD
            if ModeClass.MISSION in modes and (holds or state.is_return(state.mode)):
                self._mission = record.mission
                self._held_in = state.mode if holds else None
        elif self._keeps_mode(record):
            self._landed_in = state.mode

    def _keeps_mode(self, record: AuthorityRecord) -> bool:
        """Whether it is on the ground in the mode in which it came down."""
        state = self._state
        return state.mode == record.mode or (  # PX4, landed, enters its mode of before the return
            state.is_return(record.mode)
            and state.class_of(state.mode) in (ModeClass.HOLD, ModeClass.MISSION))

    def _agrees(self, record: AuthorityRecord) -> bool:
        state = self._state
        same = state.class_of(state.mode) is None or (
            state.mode in (record.mode, *record.commanded))
        return same and (state.armed == record.armed or (state.armed and record.arming))

    def _rebooted(self, record: AuthorityRecord) -> bool | None:
        """Whether it was rebooted since a flight of the previous run; None: its clock is awaited.

        Another may have flown it since, in the same mode.
        """
        if not (record.flown and record.seen and self._state.armed):
            return False
        boot = 1e-3 * self._state.telemetry.boot_ms
        return boot < record.seen[_TIME] if boot else None

    def _may_have_climbed(self, record: AuthorityRecord) -> bool:
        """Whether our take-off may have ended in HOLD while no bridge ran (PX4)."""
        state = self._state
        return (record.climb is not None and state.armed and (record.armed or record.arming)
                and state.profile.takeoff_mode in (record.mode, *record.commanded)
                and state.class_of(state.mode) is ModeClass.HOLD)

    def _has_climbed(self, climb: float) -> bool | None:
        """Whether it is at rest above its home, `climb` [m] high; None: not known, or not yet."""
        telemetry = self._state.telemetry
        home, known = telemetry.home, telemetry.has_position and telemetry.has_velocity
        if home is None or not known or not telemetry.speed < REST_SPEED:
            return None
        return (abs(telemetry.height - climb) <= _CLIMB_ERROR * climb
                and math.dist(telemetry.position[:2], home[:2]) <= _DRIFT)

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
        """Decide what the first heartbeat alone could not show."""
        if self._awaits_clock and self._state.telemetry.boot_ms:
            self.receive_heartbeat(now)
        self._decide_without_record(now)
        self._await_hand_over()
        state, authority = self._state, self._state.authority
        if authority.state is not AuthorityState.LOST:
            return
        if self._mission is not None and self._mission_has_ended(now):
            self._mission = None
            what = 'returns' if state.is_return(state.mode) else 'holds'
            state.apply(AuthorityEvent.RESTART_OURS, now, f'{what} at the end of our mission')
        if self._landing is not None:
            self._find_landing()
        home, telemetry = state.telemetry.home, state.telemetry
        if self._landed_in is not None and telemetry.battery >= 0.0 and (
                telemetry.has_position and home is not None):
            if (state.mode == self._landed_in and not state.armed and telemetry.grounded
                    and math.dist(telemetry.position[:2], home[:2]) <= LANDING_RADIUS):
                state.landed_battery = telemetry.battery
            self._landed_in = None

    def _find_landing(self) -> None:
        """Await a full battery where it stands at the place to which it was coming down."""
        state, record, telemetry = self._state, self._landing, self._state.telemetry
        if record is None or state.armed or state.authority.killed:
            self._landing = None
        elif telemetry.has_position and telemetry.grounded:
            rebooted = 1e-3 * telemetry.boot_ms < record.seen[_TIME]
            if not rebooted and not self._keeps_mode(record):
                self._landing = None
            elif math.dist(telemetry.position[:2], record.seen[_PLACE]) <= LANDING_RADIUS:
                self._landing = None  # else its first position estimates may still be settling
                state.landed_battery = record.landed_battery or 0.0
                state.rebooted_on_ground = state.authority.awaits_battery = True

    def _mission_has_ended(self, now: float) -> bool:
        """Whether it has returned, or held, since the end of the mission in its record (PX4)."""
        state, evidence = self._state, self._evidence
        holds = self._held_in is not None
        if holds and (state.mode != self._held_in or state.failsafe_active(now)):
            self._mission = None  # somebody else has it
            return False
        if self._mission != evidence.mission_position()[0]:
            return False
        if not holds:
            return state.is_return(state.mode) and evidence.returning()
        return evidence.holds_at_end() and state.telemetry.speed < REST_SPEED

    def _await_hand_over(self) -> None:
        """Keep a vehicle on the ground that may have been taken, or killed, in the last run."""
        authority = self._state.authority
        if self._unusable and not authority.undecided:
            self._unusable = authority.state is AuthorityState.NONE
            if self._unusable and self._policy().takeoff and not authority.landed:
                authority.landed, authority.why = True, UNUSABLE.why

    def _decide_without_record(self, now: float) -> None:
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
        if state.class_of(state.mode) is not ModeClass.MISSION:
            state.maybe_ours = False  # changed in a cut, as by a failsafe
        if state.maybe_ours and authority.state is AuthorityState.LOST and (
                now - state.heartbeat_at < _FRESH and not state.failsafe_active(now)
                and self._evidence.ours()):
            state.maybe_ours = False
            state.apply(AuthorityEvent.RESTART_OURS, now, 'flies our mission')
