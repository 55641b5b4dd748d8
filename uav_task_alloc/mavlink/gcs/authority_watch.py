# SPDX-License-Identifier: Apache-2.0
"""Turns what a vehicle shows, and what was sent to it, into events of the authority table."""
from __future__ import annotations

from collections.abc import Callable

from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.mavlink.autopilots import Profile
from uav_task_alloc.mavlink.gcs.arming_and_landing import ArmingAndLanding
from uav_task_alloc.mavlink.gcs.authority import (
    Authority,
    AuthorityEvent,
    AuthorityRecord,
    TaskMark,
)
from uav_task_alloc.mavlink.gcs.authority_recorder import AuthorityRecorder
from uav_task_alloc.mavlink.gcs.authority_watch_state import AuthorityWatchState
from uav_task_alloc.mavlink.gcs.bridge_restart import BridgeRestart
from uav_task_alloc.mavlink.gcs.hand_over import HandOver
from uav_task_alloc.mavlink.gcs.link_loss import LinkLoss
from uav_task_alloc.mavlink.gcs.mission_evidence import MissionEvidence
from uav_task_alloc.mavlink.gcs.mode_changes import ModeChanges
from uav_task_alloc.mavlink.gcs.policy import Policy
from uav_task_alloc.mavlink.gcs.sent_commands import SentCommands
from uav_task_alloc.mavlink.gcs.suspension_checks import check_foreign, check_status
from uav_task_alloc.mavlink.gcs.takeoff_grant import TakeoffGrant
from uav_task_alloc.mavlink.gcs.telemetry import Telemetry
from uav_task_alloc.mavlink.transport.codec import Message
from uav_task_alloc.model import Point


class AuthorityWatch:
    """Watches one vehicle; `authority` is who has it."""

    def __init__(self, profile: Profile, telemetry: Telemetry, evidence: MissionEvidence,
                 policy: Callable[[], Policy], now: float, record: AuthorityRecord | None = None,
                 save: Callable[[AuthorityRecord], None] = lambda record: None) -> None:
        self.authority = Authority(now, record)
        self._state = state = AuthorityWatchState(
            profile, telemetry, self.authority,
            SentCommands.before_restart(record, now) if record else SentCommands(),
            flown=record.flown if record else False)
        self.notes = state.notes
        self._evidence, self._policy = evidence, policy
        self._restart = BridgeRestart(state, evidence, policy, record)
        self._link = LinkLoss(state)
        self._modes = ModeChanges(state, evidence)
        self._arming = ArmingAndLanding(state, evidence, policy)
        self._hand_over = HandOver(state, evidence, policy)
        self._grant = TakeoffGrant(state, policy)
        self._record = AuthorityRecorder(state, evidence, record, save)

    @property
    def mode(self) -> int | None:
        """custom_mode of the newest heartbeat."""
        return self._state.mode

    @property
    def armed(self) -> bool:
        """As in the newest heartbeat."""
        return self._state.armed

    @property
    def was_lost(self) -> bool:
        """The link was, and the mode is not confirmed yet."""
        return self._link.was_lost

    @property
    def marks(self) -> dict[str, TaskMark]:
        """Tasks that were flown or passed over, by id."""
        return self._record.marks

    @property
    def swap_at(self) -> float | None:
        """Since when we hold it for an upload [s]; None: we do not."""
        return self._state.swap_at

    @swap_at.setter
    def swap_at(self, since: float | None) -> None:
        self._state.swap_at = since

    # what the vehicle shows

    def receive_heartbeat(self, message: Message, now: float) -> None:
        """Take the newest HEARTBEAT of the autopilot."""
        state = self._state
        before, was_armed, descends = state.mode, state.armed, self._arming.descends()
        if state.sent.armed_before(state.telemetry.frame):
            was_armed, state.flown = True, True  # that it is not armed now is news
        state.mode = message.custom_mode
        state.armed = bool(message.base_mode & d.MAV_MODE_FLAG_SAFETY_ARMED)
        state.status = message.system_status
        if before is None or self._restart.pending:
            self._restart.heartbeat(now)
        elif state.unconfirmed:
            self._link.confirm(now)
        else:
            self._modes.heartbeat(before, message.custom_mode, now)
            if state.armed != was_armed:
                self._arming.changed(descends, now)
        check_status(state, now)
        self._keep()

    def receive_command_ack(self, message: Message, frame: int) -> None:
        """Take a COMMAND_ACK that is addressed to us, and the number of its frame."""
        self._state.sent.answered(message, frame)

    def receive_status_text(self, message: Message, now: float) -> None:
        """Take a STATUSTEXT: it may say why the mode changes."""
        if self._state.texts.receive(message, now):
            self._state.apply(AuthorityEvent.KILLED, now, f'the vehicle says: {message.text}')
        self._keep()

    def step(self, now: float) -> None:
        """Let time pass, after each message too."""
        self._link.step(now)
        self._restart.step(now)
        self._modes.resolve(now)
        self._hand_over.step(now)
        self._arming.step(now)
        self._grant.step(now)
        foreign = self._evidence.foreign() and self._policy().when_foreign == 'yield'
        check_foreign(self._state, foreign, now)
        self._keep()

    def address_changed(self, now: float) -> None:
        """It speaks from elsewhere: the same vehicle, or another one with its id."""
        self._link.new_address(now)

    def vehicle_rebooted(self, now: float) -> None:
        """Its clock went back."""
        self._link.rebooted(now)
        self._keep()

    def mark_task(self, task: str, place: Point | None, flown: bool, now: float) -> None:
        """A task was flown, or passed over: a restarted bridge could not see which."""
        self._record.mark(task, place, flown, now)

    # what we do

    def record_command(self, message: Message, now: float) -> None:
        """A command is about to be sent: written down before it is."""
        if message.get_type() != 'COMMAND_LONG':
            return
        state, sent = self._state, self._state.sent
        mode = state.profile.commanded_mode(message)
        if mode is not None:
            sent.climb = None
            sent.acks.sent(mode, now)
            sent.mode(mode, now)
            state.descending = state.returns(mode)
        elif message.command == d.MAV_CMD_COMPONENT_ARM_DISARM:
            sent.arm(message.param1 == 1.0, now)
        elif message.command == d.MAV_CMD_NAV_TAKEOFF:
            state.descending = False
            takes_off = state.profile.takeoff_mode
            if takes_off is not None:
                sent.mode(takes_off, now)
                sent.climb = self._policy().cruise_altitude
        self._keep()

    def hand_over(self, operator: str, now: float) -> str:
        """An operator gives the aircraft to the bridge.

        Args:
            operator: who does, for the log.
            now: steady time [s].

        Returns:
            Why it is refused; '' where the bridge has it now.
        """
        if self.authority.held:
            return ''
        refusal = self._hand_over.ask(operator, now)
        if not refusal:
            self._keep()
        return refusal

    def _keep(self) -> None:
        if not self._restart.pending:
            self._record.keep()
