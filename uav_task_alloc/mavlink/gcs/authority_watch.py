# SPDX-License-Identifier: Apache-2.0
"""Turns messages from a vehicle and commands to it into events of the authority table."""
from __future__ import annotations

from collections.abc import Callable

from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.mavlink.autopilots import Profile
from uav_task_alloc.mavlink.gcs.arming_and_landing import ArmingAndLanding
from uav_task_alloc.mavlink.gcs.authority import Authority, AuthorityEvent
from uav_task_alloc.mavlink.gcs.authority_recorder import AuthorityRecorder
from uav_task_alloc.mavlink.gcs.authority_state import UNUSABLE, AuthorityRecord, TaskMark
from uav_task_alloc.mavlink.gcs.authority_watch_state import AuthorityWatchState
from uav_task_alloc.mavlink.gcs.bridge_restart import BridgeRestart
from uav_task_alloc.mavlink.gcs.climb_check import ClimbCheck
from uav_task_alloc.mavlink.gcs.flight_modes import ModeClass
from uav_task_alloc.mavlink.gcs.hand_over import HandOver
from uav_task_alloc.mavlink.gcs.link_loss import LinkLoss
from uav_task_alloc.mavlink.gcs.mission_evidence import MissionEvidence
from uav_task_alloc.mavlink.gcs.mode_changes import ModeChanges
from uav_task_alloc.mavlink.gcs.moved_in_hold import MovedInHold
from uav_task_alloc.mavlink.gcs.policy import Policy
from uav_task_alloc.mavlink.gcs.sent_commands import SentCommands
from uav_task_alloc.mavlink.gcs.suspension_checks import check_foreign, check_system_status
from uav_task_alloc.mavlink.gcs.takeoff_grant import TakeoffGrant
from uav_task_alloc.mavlink.gcs.telemetry import Telemetry
from uav_task_alloc.mavlink.transport.codec import Message
from uav_task_alloc.model import Point


class AuthorityWatch:
    """Keeps the authority over one vehicle up to date.

    Args:
        profile: kind of autopilot.
        telemetry: of the vehicle; each message is given to it before it comes here.
        evidence: of its mission.
        policy: returns the present parameters.
        now: steady time [s].
        record: of the previous run; None: there is none.
        save: called with the record when it has changed, before a command is sent.

    Attributes:
        authority: the state, and what may be sent.
        notes: for the operator, oldest first; the caller removes them.
        continues_climb: the previous run has taken it off, and no mode was set since.
    """

    def __init__(self, profile: Profile, telemetry: Telemetry, evidence: MissionEvidence,
                 policy: Callable[[], Policy], now: float, record: AuthorityRecord | None = None,
                 save: Callable[[AuthorityRecord], None] = lambda record: None) -> None:
        found, record = record, None if record is UNUSABLE else record
        self.authority = Authority(now, record)
        self._state = state = AuthorityWatchState(
            profile, telemetry, self.authority,
            SentCommands.from_record(record, now) if record else SentCommands(),
            flown=record.flown if record else False)
        self.notes = state.notes
        self._evidence, self._policy = evidence, policy
        self._restart = BridgeRestart(state, evidence, policy, found)
        self._link = LinkLoss(state)
        self._modes = ModeChanges(state, evidence)
        self._arming = ArmingAndLanding(state, evidence, policy)
        self._hand_over = HandOver(state, evidence, policy)
        self._grant = TakeoffGrant(state, policy)
        self._climb = ClimbCheck(state, evidence)
        self._moved = MovedInHold(state)
        self.continues_climb = False
        # ArduPilot, in GUIDED: nothing else shows that it still climbs
        if record and record.armed and record.climb is not None and profile.takeoff_mode is None:
            self.continues_climb = True
            self._climb.begin(record.climb)
        self._recorder = AuthorityRecorder(state, evidence, record, save)

    @property
    def mode(self) -> int | None:
        """custom_mode of the newest heartbeat."""
        return self._state.mode

    @property
    def armed(self) -> bool:
        """Whether the newest heartbeat shows it armed."""
        return self._state.armed

    @property
    def was_lost(self) -> bool:
        """Whether the link was lost and no heartbeat has confirmed the mode since."""
        return self._link.was_lost

    @property
    def yields(self) -> bool:
        """Whether a mission of another station is on board, and is to be left."""
        return self._evidence.foreign() and self._policy().when_foreign == 'yield'

    @property
    def marks(self) -> dict[str, TaskMark]:
        """Tasks that were flown or skipped, by id."""
        return self._recorder.marks

    @property
    def replacing_since(self) -> float | None:
        """Since when it is held for a mission replacement [s]; None: it is not."""
        return self._state.replacing_since

    @replacing_since.setter
    def replacing_since(self, since: float | None) -> None:
        self._state.replacing_since = since

    # messages from the vehicle

    def receive_heartbeat(self, message: Message, now: float) -> None:
        """Process the newest HEARTBEAT of the autopilot."""
        state = self._state
        before, was_armed = state.mode, state.armed
        was_returning = self._arming.is_returning(now)
        if state.sent.take_armed_before(state.telemetry.frame):
            was_armed, state.flown = True, True  # a heartbeat that shows disarmed is a change
        state.mode = message.custom_mode
        if state.class_of(state.mode) is ModeClass.MISSION is not state.class_of(before) and (
                before is not None):
            state.in_mission_since = now
        state.armed = bool(message.base_mode & d.MAV_MODE_FLAG_SAFETY_ARMED)
        state.status = message.system_status
        if before is None or self._restart.pending:
            self._restart.receive_heartbeat(now)
        elif state.unconfirmed:
            self._link.confirm(now)
        else:
            self._modes.receive_heartbeat(before, message.custom_mode, now)
            if state.armed != was_armed:
                self._arming.armed_changed(was_returning, now)
        state.heartbeat_at = now
        check_system_status(state, now)
        self.save_record()

    def receive_command_ack(self, message: Message, frame: int) -> None:
        """Process a COMMAND_ACK that is addressed to us, and the number of its frame."""
        self._state.sent.receive_command_ack(message, frame)

    def receive_status_text(self, message: Message, now: float) -> None:
        """Process a STATUSTEXT, which may contain the cause of a mode change."""
        if self._state.texts.receive(message, now):
            self._state.apply(AuthorityEvent.KILLED, now,
                              f'the vehicle reports: {message.text}')
        self.save_record()

    def step(self, now: float) -> None:
        """Apply what depends on time and telemetry; called after most messages too.

        What changes is saved by `save_record`.
        """
        self._link.step(now)
        self._restart.step(now)
        self._modes.resolve(now)
        self._hand_over.step(now)
        self._arming.step(now)
        self._climb.step(now)
        self._moved.step(now)
        self._grant.step(now)
        check_foreign(self._state, self.yields, now)

    def address_changed(self, now: float) -> None:
        """Apply that its messages come from a new address: it may be another vehicle."""
        self._link.address_changed(now)

    def vehicle_rebooted(self, now: float) -> None:
        """Apply a reboot of the vehicle, of which its clock went back."""
        self._link.vehicle_rebooted(now)
        self.save_record()

    def mark_task(self, task: str, position: Point | None, flown: bool, now: float) -> None:
        """Record that a task was flown or skipped, for a restarted bridge.

        Args:
            task: its id.
            position: [m] ENU; None: not known, nothing is recorded.
            flown: False: another station has set the current item beyond it.
            now: steady time [s].
        """
        self._recorder.mark_task(task, position, flown, now)

    # commands to the vehicle, and to the bridge

    def record_command(self, message: Message, now: float) -> None:
        """Record a command that is about to be sent; the record is saved when this returns."""
        if message.get_type() != 'COMMAND_LONG':
            return
        state, sent = self._state, self._state.sent
        mode = state.profile.commanded_mode(message)
        if mode is not None:
            sent.climb = None
            self._climb.end()
            self._moved.note_command(state.class_of(mode) is ModeClass.HOLD)
            sent.acks.command_sent(message.command, mode, now)
            sent.add_mode(mode, now)
            if state.descending and not state.is_return(mode):
                state.left_return_at = now
            state.descending = state.is_return(mode)
        elif message.command == d.MAV_CMD_COMPONENT_ARM_DISARM:
            sent.add_arming(message.param1 == 1.0, now)
        elif message.command == d.MAV_CMD_NAV_TAKEOFF:
            state.descending = False
            self._moved.note_command(holds=False)
            self._climb.begin(self._policy().cruise_altitude)
            sent.climb, takeoff_mode = self._policy().cruise_altitude, state.profile.takeoff_mode
            if takeoff_mode is not None:
                sent.acks.command_sent(message.command, takeoff_mode, now)
                sent.add_mode(takeoff_mode, now)
        self.save_record()

    def record_upload(self) -> None:
        """Record an upload that is about to begin; the record is saved when this returns."""
        self.save_record()

    def hand_over(self, operator: str, now: float) -> str:
        """Hand the vehicle over to the bridge, as an operator requests.

        Args:
            operator: name of the operator, for the log.
            now: steady time [s].

        Returns:
            Why it is refused; '' where the vehicle is HELD now.
        """
        if self.authority.held:
            return ''
        refusal = self._hand_over.request(operator, now)
        if not refusal:
            self.save_record()
        return refusal

    def save_record(self) -> None:
        """Save the record where it has changed, unless the one of the previous run is in doubt."""
        if not self._restart.pending:
            self._recorder.save_if_changed()
