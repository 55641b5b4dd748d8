# SPDX-License-Identifier: Apache-2.0
"""Flies one UAV by its list: compares what is wanted with what is, and does the next thing.

Without I/O: messages and steady time in, messages and events out. `_rules` is the whole of it:
the first rule that is not satisfied acts, and those after it wait.
"""
from __future__ import annotations

import random
from collections import deque
from collections.abc import Callable, Sequence

from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.geometry.frames import Origin
from uav_task_alloc.mavlink.autopilots import ModeFunction, Profile
from uav_task_alloc.mavlink.gcs import authority as who
from uav_task_alloc.mavlink.gcs.authority import AuthorityRecord, HoldStage, SendAction
from uav_task_alloc.mavlink.gcs.authority_watch import AuthorityWatch
from uav_task_alloc.mavlink.gcs.command_sender import CommandSender, NextMessages
from uav_task_alloc.mavlink.gcs.end_of_list import EndOfList
from uav_task_alloc.mavlink.gcs.event_retry import EventRetry
from uav_task_alloc.mavlink.gcs.list_execution import ListExecution
from uav_task_alloc.mavlink.gcs.message_rates import MessageRates
from uav_task_alloc.mavlink.gcs.mission_evidence import MissionEvidence
from uav_task_alloc.mavlink.gcs.onboard_mission import OnboardMission
from uav_task_alloc.mavlink.gcs.policy import Policy
from uav_task_alloc.mavlink.gcs.resume import MEMORY
from uav_task_alloc.mavlink.gcs.send_gate import allowed_messages
from uav_task_alloc.mavlink.gcs.status_text_log import StatusTextLog
from uav_task_alloc.mavlink.gcs.takeoff import Takeoff
from uav_task_alloc.mavlink.gcs.task_events import passed_over, task_events
from uav_task_alloc.mavlink.gcs.telemetry import Telemetry
from uav_task_alloc.mavlink.mission.first_leg import LegStart
from uav_task_alloc.mavlink.mission.flown_path import PositionSample
from uav_task_alloc.mavlink.mission.items import TaskList
from uav_task_alloc.mavlink.mission.peer import Peer
from uav_task_alloc.mavlink.mission.task_progress import TaskProgress
from uav_task_alloc.mavlink.mission.upload import UploadState
from uav_task_alloc.mavlink.mission.verified_mission import MissionState
from uav_task_alloc.mavlink.transport.codec import Message
from uav_task_alloc.mavlink.transport.notes import OperatorNote
from uav_task_alloc.model import Task


class MissionExecutor:
    """One vehicle as the bridge flies it."""

    def __init__(self, peer: Peer, profile: Profile, origin: Origin, policy: Policy,
                 rng: random.Random, now: float, record: AuthorityRecord | None = None,
                 save: Callable[[AuthorityRecord], None] = lambda record: None) -> None:
        self.profile, self.policy, self._peer = profile, policy, peer
        self.telemetry = Telemetry(profile, origin, now)
        self.onboard = OnboardMission(peer, profile, origin, self.telemetry, rng)
        self.sender = CommandSender(peer, profile, self.telemetry)
        self.onboard.list.leg.locate = self._leg_begins
        evidence = MissionEvidence(self.onboard, self.telemetry)
        self.watch = AuthorityWatch(profile, self.telemetry, evidence, lambda: self.policy,
                                    now, record, save)
        self.authority = self.watch.authority
        self.events: deque[TaskProgress] = deque()
        self.notes: deque[OperatorNote] = deque()
        self._rates = MessageRates(peer, self.telemetry, now)
        self._was_stale = False
        self._reminder = EventRetry()
        self._restarts = 0
        self._texts = StatusTextLog()
        take_off = Takeoff(self.sender, self.telemetry, self.onboard, self.authority,
                           lambda: self.policy)
        self._ending = EndOfList(self.sender, self.telemetry, self.onboard, self.watch,
                                    lambda: self.policy, self.notes)
        fly_list = ListExecution(self.sender, self.telemetry, self.onboard, self.watch, profile,
                           self._ending, self._texts)
        if record is not None:
            self.onboard.resume.known = record.mission, record.current
            # the current item may be of the mission before, or set by whoever had it
            self.onboard.resume.doubtful = (
                record.swap_at is not None and not profile.atomic) or (
                record.state is who.AuthorityState.LOST
                and profile.mode_function(record.mode or 0) is not ModeFunction.MISSION)
        for mark in self.watch.marks.values():
            if mark.flown:
                self.onboard.resume.reported.add(mark.task)
            else:
                self.onboard.resume.unflown[mark.task] = mark[1:4]
        self._rules = (
            self._linked, self._authority, self.sender.finish, take_off.continue_takeoff,
            self._upload, self._read, self._has_list, self._place, self._may_act,
            self._hold_first, self._ending.held_too_long, self._ending.empty, fly_list.bring,
            take_off.take_off, fly_list.fly)

    @property
    def going_home(self) -> bool:
        """By a list without tasks."""
        return self._ending.going_home

    @property
    def alarm(self) -> str:
        """What a human has to see to; '' for nothing."""
        return self._ending.alarm

    def assign(self, tasks: TaskList, now: float) -> list[Message]:
        """The latest list for this UAV; an older one that comes late is ignored."""
        if self.onboard.tasks is not None and tasks.revision < self.onboard.tasks.revision:
            self.notes.append(
                OperatorNote(
                    'warning',
                    f'task_list: revision = {tasks.revision}: expected '
                    f'at least {self.onboard.tasks.revision}: ignored',
                )
            )
            return []
        if self.onboard.tasks is None and tasks.revision > 1:  # else all of it is new
            for mark in self.watch.marks.values():
                if mark.flown and now - mark.at < MEMORY:
                    self.onboard.progress.completed[mark.task] = mark[1:4]
        self.onboard.list.assign(tasks)
        for task in filter(self.onboard.list.repeat, self._reminder.answered()):
            self.notes.append(
                OperatorNote('info', f'{task} was announced anew: it is flown once more')
            )
        self._reminder.listed(self.onboard.list.ended_before(), now)
        self.sender.clear_backoff(now)
        return self._gate(self._act(now), now)

    def drop_flown(self, tasks: Sequence[Task], other: str) -> None:
        """Tasks of the list that another UAV has flown before we listened."""
        for task in tasks:
            self.notes.append(OperatorNote('info', f'{task.id} was flown by {other}, unheard'))
        self.onboard.progress.complete_offline(tasks)

    def hand_over(self, operator: str, now: float) -> str:
        """An operator gives the aircraft to the bridge; returns why not, '' where it has it."""
        refusal = self.watch.hand_over(operator, now)
        if not refusal:
            self.sender.clear_backoff(now)
        self._report(now)
        return refusal

    def moved_address(self, now: float) -> None:
        """It speaks from a new address: it, or another vehicle with the same id."""
        self.watch.address_changed(now)
        self.telemetry.restart()
        self._restarts = self.telemetry.restarts
        self._begin_anew(now)

    def receive(self, message: Message, now: float) -> list[Message]:
        """Take any message of this vehicle."""
        flight = self.telemetry.mode
        newest = self.telemetry.receive(message, now)
        if self.telemetry.restarts != self._restarts:
            self._restarts = self.telemetry.restarts
            self.notes.append(OperatorNote('warning', 'was restarted'))
            self.watch.vehicle_rebooted(now)
            self._begin_anew(now)
            self.onboard.resume.rebooted()
        if message.get_type() == 'HEARTBEAT' and newest:
            self.watch.receive_heartbeat(message, now)
            if (
                flight is ModeFunction.MISSION
                and self.telemetry.mode is not ModeFunction.MISSION
            ):
                self.onboard.progress.note_mission_left()
        out = self.onboard.receive(message, now)
        self.sender.receive(message)
        if message.get_type() == 'COMMAND_ACK' and self._peer.is_from_vehicle(message):
            self.watch.receive_command_ack(message, self.telemetry.frame)
        self._progress(message, newest, now)
        return self._gate(out + self._act(now), now)

    def step(self, now: float) -> list[Message]:
        """Let time pass."""
        self.events += self._reminder.step(now)
        self.onboard.progress.step(now)
        out = self.onboard.step(now) + self._rates.step(now)
        return self._gate(out + self._act(now), now)

    def _gate(self, messages: list[Message], now: float) -> list[Message]:
        """The one way out: what authority does not allow is not sent, retries included."""
        return allowed_messages(messages, self.watch, now)

    def _act(self, now: float) -> list[Message]:
        out: list[Message] = []
        self.watch.step(now)
        self.onboard.catch_up(now)
        for rule in self._rules:
            step = rule(now)
            if step is not None:
                out = step
                break
        self._report(now)
        return out

    def _report(self, now: float) -> None:
        onboard = self.onboard
        self.events += task_events(onboard, self.watch, now)
        self.notes += passed_over(onboard, self.watch, now)
        for notes in (self.watch.notes, onboard.notes, onboard.list.notes, self.sender.notes):
            while notes:
                self.notes.append(notes.popleft())

    # What is heard

    def _progress(self, message: Message, newest: bool, now: float) -> None:
        kind, progress, own = message.get_type(), self.onboard.progress, self.onboard.own
        flying = self.telemetry.mode is ModeFunction.MISSION
        if kind == 'GLOBAL_POSITION_INT':
            self._position(message, newest, now)
        elif kind == 'MISSION_ITEM_REACHED':
            self.onboard.reached(message.seq - own, now)
        elif kind == 'MISSION_CURRENT' and newest and self.onboard.is_of_known_mission(message):
            seq = max(0, message.seq - own)
            if self.onboard.must_jump is None:  # else it is left from the mission before
                progress.note_current(seq, now, flying, self.telemetry.frame)
            if (message.mission_state == d.MISSION_STATE_COMPLETE and flying
                    and not self.profile.atomic):  # PX4 says so after a take-off too
                progress.note_mission_complete(seq, now, self.telemetry.frame)
            if not self.sender.busy and not self.onboard.open:
                self.onboard.watch(message, now)
        elif kind == 'STATUSTEXT':
            self.watch.receive_status_text(message, now)
            self.sender.note_arming_refusal(str(message.text))
            self.onboard.list.horizon.note(str(message.text))
            note = self._texts.take(message, now)
            self.notes.extend(() if note is None else (note,))

    def _position(self, message: Message, newest: bool, now: float) -> None:
        if self.telemetry.has_position:
            place, velocity = self.telemetry.place_of(message)
            self.onboard.progress.add_position(
                PositionSample(message.time_boot_ms * 1e-3, place, velocity), newest, now,
                self.telemetry.frame)

    def _leg_begins(self) -> LegStart | None:
        """Where it is, or where the take-off that is due ends; None: not known."""
        telemetry, (x, y, z) = self.telemetry, self.telemetry.position
        home = telemetry.home or telemetry.position
        if not telemetry.airborne or self.sender.climbing:
            z = max(z, home[2] + self.policy.cruise_altitude)
        return LegStart((x, y, z), home, telemetry.mode is ModeFunction.MISSION) if (
            telemetry.has_position) else None

    def _begin_anew(self, now: float) -> None:
        self.onboard.restarted()
        self.sender.reset(now)
        self._rates.again(now)

    # The rules

    def _linked(self, now: float) -> NextMessages:
        if self.telemetry.stale(now):
            self._was_stale, self.sender.waits_for = True, 'its link'
            self.sender.drop()
            return []
        if self._was_stale:
            self._was_stale = False
            self.sender.clear_backoff(now)
        return None

    def _authority(self, now: float) -> NextMessages:
        """Whoever has it, nothing that was begun for us goes on."""
        if self.authority.held:
            return None
        if not self.authority.allows(SendAction.COMMAND):
            self.sender.drop()
        if not self.authority.allows(SendAction.READ):
            return self.sender.wait_for(f'authority: {self.authority.why}')
        if not self.authority.allows(SendAction.UPLOAD) and self.onboard.state is (
                MissionState.UPLOADING):
            self.onboard.abort()
        return None

    def _upload(self, now: float) -> NextMessages:
        onboard = self.onboard
        if onboard.trouble:
            onboard.trouble = False
            self.sender.fail(now)
        if not onboard.upload.busy:
            return None
        beyond = onboard.beyond_flown()
        if beyond is not None and self.authority.held:
            onboard.progress.begin_set_current(beyond)
            return self.sender.set_current(beyond + onboard.own, now,
                                  lambda t: onboard.progress.note_set_current(beyond, t))
        self.sender.waits_for = 'its upload'
        if (
            onboard.upload.state in (UploadState.BACKOFF, UploadState.DRAINING)
            and onboard.outdated
            and (onboard.held is not None and onboard.wanted() and not onboard.upload.may_be_stored)
        ):
            return onboard.begin_upload(onboard.change(), now)
        return self._ending.held_too_long(now) or []

    def _read(self, now: float) -> NextMessages:
        if self.onboard.held is not None:
            return None
        if not self.telemetry.past_boot:
            return self.sender.wait_for('the autopilot to start')
        if self.sender.backing_off(now):
            return self._ending.held_too_long(now) or []
        self.sender.waits_for = 'a readback'
        return self.onboard.upload.read(now)

    def _has_list(self, now: float) -> NextMessages:
        self.sender.waits_for = 'a list' if self.onboard.tasks is None else ''
        return [] if self.onboard.tasks is None else None

    def _place(self, now: float) -> NextMessages:
        """After a restart of the bridge: what was flown meanwhile is not repeated."""
        onboard, telemetry = self.onboard, self.telemetry
        assert onboard.tasks is not None
        if not onboard.resume.placed and onboard.held and telemetry.airborne and (
                telemetry.current is None or not telemetry.has_position):
            return []  # what it flies is not known yet
        onboard.resume.place(onboard.held or (), onboard.tasks, now)
        onboard.catch_up(now)
        return None

    def _may_act(self, now: float) -> NextMessages:
        if self.authority.state is who.AuthorityState.LOST:
            return self.sender.wait('the pilot to give it back')
        if not self.authority.allows(SendAction.UPLOAD):
            return self.sender.wait_for(f'authority: {self.authority.why}')
        if self.authority.held or not self.telemetry.airborne:
            return None
        # a pilot flies what is on board: it is not changed under him
        return self.sender.wait_for('the pilot to hand it over')

    def _hold_first(self, now: float) -> NextMessages:
        """After a hand-over in flight nothing else is done before it holds."""
        authority, flight = self.authority, self.telemetry.mode
        if authority.hold is HoldStage.NO or not self.telemetry.airborne:
            authority.hold = HoldStage.NO
            return None
        if flight is ModeFunction.HOLD or (
                authority.hold is HoldStage.UNLESS_VERIFIED
                and flight is ModeFunction.MISSION and self.onboard.verified()):
            self.sender.must_start = flight is ModeFunction.HOLD
            authority.hold = HoldStage.NO
            return None
        if self.sender.backing_off(now) or ModeFunction.HOLD not in self.profile.set_mode:
            authority.hold = HoldStage.NO if ModeFunction.HOLD not in self.profile.set_mode else (
                authority.hold)
            return []
        return self.sender.set_mode(ModeFunction.HOLD, now)
