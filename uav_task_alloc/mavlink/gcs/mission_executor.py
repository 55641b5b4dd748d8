# SPDX-License-Identifier: Apache-2.0
"""Executes the task list of one UAV: compares the wanted state with the actual one, and acts.

Without I/O: messages and steady time in, messages and events out. `_rules` is the whole logic:
the first rule that is not satisfied returns its messages; the following ones wait.
"""
from __future__ import annotations

import random
from collections import deque
from collections.abc import Callable, Sequence

from uav_task_alloc.geometry.frames import Origin
from uav_task_alloc.mavlink.autopilots import ModeFunction, Profile
from uav_task_alloc.mavlink.gcs.authority import OUR_MISSION, HoldStage, SendAction
from uav_task_alloc.mavlink.gcs.authority_state import AuthorityRecord, AuthorityState
from uav_task_alloc.mavlink.gcs.authority_watch import AuthorityWatch
from uav_task_alloc.mavlink.gcs.command_sender import CommandSender, NextMessages
from uav_task_alloc.mavlink.gcs.end_actions import EndActions
from uav_task_alloc.mavlink.gcs.end_of_list import EndOfList
from uav_task_alloc.mavlink.gcs.event_retry import EventRetry
from uav_task_alloc.mavlink.gcs.flown_items import MAX_AGE
from uav_task_alloc.mavlink.gcs.list_execution import ListExecution
from uav_task_alloc.mavlink.gcs.low_battery_return import LowBatteryReturn
from uav_task_alloc.mavlink.gcs.message_rates import MessageRates
from uav_task_alloc.mavlink.gcs.mission_evidence import MissionEvidence
from uav_task_alloc.mavlink.gcs.mission_messages import MissionMessages
from uav_task_alloc.mavlink.gcs.mission_transfers import MissionTransfers
from uav_task_alloc.mavlink.gcs.onboard_mission import OnboardMission
from uav_task_alloc.mavlink.gcs.operator_hold import HoldRule
from uav_task_alloc.mavlink.gcs.policy import Policy
from uav_task_alloc.mavlink.gcs.restored_record import restore_record
from uav_task_alloc.mavlink.gcs.send_gate import allowed_messages
from uav_task_alloc.mavlink.gcs.status_text_log import StatusTextLog
from uav_task_alloc.mavlink.gcs.takeoff import Takeoff
from uav_task_alloc.mavlink.gcs.task_events import passed_over, task_events
from uav_task_alloc.mavlink.gcs.telemetry import Telemetry
from uav_task_alloc.mavlink.gcs.telemetry_messages import HEALTH_REPORTS
from uav_task_alloc.mavlink.gcs.vehicle_energy import VehicleEnergy
from uav_task_alloc.mavlink.gcs.vehicle_fence import FenceMemory, VehicleFence
from uav_task_alloc.mavlink.mission.diff import DiffKind
from uav_task_alloc.mavlink.mission.first_leg import LegStart
from uav_task_alloc.mavlink.mission.items import TaskList
from uav_task_alloc.mavlink.mission.peer import Peer
from uav_task_alloc.mavlink.mission.task_progress import TaskProgress
from uav_task_alloc.mavlink.mission.verified_mission import MissionState
from uav_task_alloc.mavlink.transport.codec import Message
from uav_task_alloc.mavlink.transport.notes import OperatorNote
from uav_task_alloc.model import Task


class MissionExecutor:
    """Executes task lists on one vehicle.

    `events` and `notes` are queues that the caller empties: task progress to publish, and lines
    for the log. `policy` may be replaced at any time.

    Args:
        peer: the vehicle.
        profile: of its autopilot.
        origin: of the local ENU frame.
        policy: of the operator.
        rng: for back-off jitter.
        now: steady time [s], as in all methods.
        record: authority of the previous run; None: first run.
        save: stores a changed authority record.
        fence_memory: fences uploaded by the previous run; None: first run.
    """

    def __init__(self, peer: Peer, profile: Profile, origin: Origin, policy: Policy,
                 rng: random.Random, now: float, record: AuthorityRecord | None = None,
                 save: Callable[[AuthorityRecord], None] = lambda record: None,
                 fence_memory: FenceMemory | None = None) -> None:
        self.profile, self.policy, self._peer = profile, policy, peer
        self.telemetry = Telemetry(profile, origin, now)
        self.onboard = OnboardMission(peer, profile, origin, self.telemetry, rng)
        self.sender = CommandSender(peer, profile, self.telemetry)
        self.onboard.list.leg.locate = self._leg_start
        self.onboard.list.zones = lambda: self.policy.no_fly_zones
        evidence = MissionEvidence(self.onboard, self.telemetry, profile.atomic)
        self.watch = AuthorityWatch(profile, self.telemetry, evidence, lambda: self.policy,
                                    now, record, save)
        self.authority = self.watch.authority
        self.energy = VehicleEnergy(self.telemetry, self.onboard)
        self.events, self.notes = deque[TaskProgress](), deque[OperatorNote]()
        self._rates, self._event_retry = MessageRates(peer, self.telemetry, now), EventRetry()
        self._end_actions, log = EndActions(peer, profile, self.onboard), StatusTextLog()
        self._was_stale, self._restarts = False, 0
        self._messages = MissionMessages(self.onboard, self.telemetry, self.watch, self.sender,
                                         profile.atomic, log, self.notes, peer)
        self.fence = VehicleFence(peer, profile, origin, self.telemetry, self.onboard,
                                 self.authority, lambda: self.policy, rng,
                                 fence_memory or FenceMemory())
        self.energy.read_capacity = self.fence.parameters.capacity
        self._end_of_list = EndOfList(self.sender, self.telemetry, self.onboard, self.watch,
                                      lambda: self.policy, self.notes, profile)
        execution = ListExecution(self.sender, self.telemetry, self.onboard, self.watch, profile,
                                  self._end_of_list, log)
        self.holds = HoldRule(self.sender, self.telemetry, self.watch, profile, self.onboard,
                              execution.update_mission, self.notes)
        self._end_of_list.held_at_zone = lambda: self.holds.at_zone
        restore_record(record, self.onboard, self.watch, profile)
        self.sender.climbing = self.watch.continues_climb
        progress = self.onboard.progress
        self._news = (progress.events, progress.passed_over, progress.uncovered, progress.skipped,
                      self.onboard.list.failed)
        self._notes_of_parts = (self.watch.notes, self.onboard.notes, self.onboard.list.notes,
                                self.sender.notes, self.fence.notes)
        self._rules = self._in_order(execution)

    def _in_order(self, execution: ListExecution) -> tuple[Callable[[float], NextMessages], ...]:
        """The rules: the first that is not satisfied returns its messages."""
        takeoff = Takeoff(self.sender, self.telemetry, self.onboard, self.authority,
                          lambda: self.policy, lambda: self.holds.reason, self.fence.missing)
        transfers = MissionTransfers(self.sender, self.telemetry, self.onboard, self.authority,
                                     self._end_of_list)
        self._low_battery = LowBatteryReturn(
            self.sender, self.telemetry, self.watch, self.profile, self.holds, self.energy,
            self._end_of_list, self.notes)
        return (
            self._linked, self._authority, self.sender.finish, takeoff.continue_takeoff,
            self._low_battery.turn_home, self.holds.hold, self._end_of_list.stop_return,
            transfers.upload, transfers.read, self._has_list, transfers.resume, self._may_act,
            self._hold_first,
            self._end_of_list.held_too_long, self._settled, self.holds.stay,
            self._end_of_list.empty, self._end_of_list.given_up, self.fence.clear_way,
            self.holds.update_mission, takeoff.take_off, execution.fly)

    @property
    def going_home(self) -> bool:
        """Whether it returns as its list has no tasks."""
        return self._end_of_list.going_home

    @property
    def alarm(self) -> str:
        """Text on a condition that requires action by a human; '': none."""
        return self._end_of_list.alarm or self._low_battery.alarm

    def assign(self, tasks: TaskList, now: float) -> list[Message]:
        """Execute a new task list.

        Args:
            tasks: the list; one with an older revision than the present one is ignored.
            now: steady time [s].

        Returns:
            Messages to send to the vehicle.
        """
        if self.onboard.tasks is not None and tasks.revision < self.onboard.tasks.revision:
            self.notes.append(OperatorNote(
                'warning', f'task_list: revision = {tasks.revision}: expected '
                f'at least {self.onboard.tasks.revision}: ignored'))
            return []
        if self.onboard.tasks is None and tasks.revision > 1:  # revision 1: all tasks are new
            for mark in self.watch.marks.values():
                if mark.flown and now - mark.at < MAX_AGE:
                    self.onboard.progress.completed[mark.task] = mark[1:4]
        self.onboard.list.assign(tasks)
        for task in filter(self.onboard.list.repeat, self._event_retry.wanted_again()):
            self.notes.append(OperatorNote(
                'info', f'{task} was announced again: it is flown once more'))
        self._event_retry.set_ended(self.onboard.list.ended_before(), now)
        self.sender.clear_backoff(now)
        return self._gate(self._act(now), now)

    def drop_flown(self, tasks: Sequence[Task], other: str) -> None:
        """Complete tasks of the list that UAV `other` has flown while the bridge was down."""
        self.notes += [OperatorNote('info', f'{task.id} was flown by {other} while the bridge '
                                    'was down') for task in tasks]
        self.onboard.progress.complete_offline(tasks)

    def hand_over(self, operator: str, now: float) -> str:
        """An operator gives control to the bridge; returns why it is refused, '' on success."""
        refusal = self.watch.hand_over(operator, now)
        if not refusal:
            self.sender.clear_backoff(now)
        self._report(now)
        return refusal

    def moved_address(self, now: float) -> None:
        """Start over: its system id is used at a new address, perhaps by another vehicle."""
        self.watch.address_changed(now)
        self.telemetry.restart()
        self._restarts = self.telemetry.restarts
        self._start_over(now)

    def receive(self, message: Message, now: float) -> list[Message]:
        """Process a message of this vehicle; returns the messages to send."""
        if self.telemetry.is_of_before_restart(message, now):
            return []
        mode_before, newest = self.telemetry.mode, self.telemetry.receive(message, now)
        if self.telemetry.restarts != self._restarts:
            self._restarts = self.telemetry.restarts
            self.notes.append(OperatorNote('warning', 'was restarted'))
            self.watch.vehicle_rebooted(now)
            self.onboard.resume.rebooted()
            self._start_over(now)
        if newest:
            self.energy.receive(message)
        heartbeat = newest and message.get_type() == 'HEARTBEAT'
        if heartbeat:
            self.watch.receive_heartbeat(message, now)
            progress = self.onboard.progress
            if mode_before is ModeFunction.MISSION and not self.telemetry.in_mission:
                progress.note_mission_left(now)
            if not self.telemetry.in_mission:
                progress.coverage.note_other_mode(progress.path.newest)
        if not self.telemetry.in_mission:
            self.onboard.progress.note_other_mode(now)  # as COMMAND_ACK shows
        elif heartbeat or self.telemetry.shows_mission:
            self.onboard.progress.note_in_mission(self.telemetry.frame)
        out = self.onboard.receive(message, now) + self.fence.receive(message, now)
        self.sender.receive(message)
        self._end_actions.receive(message)
        if message.get_type() == 'COMMAND_ACK' and self._peer.is_from_vehicle(message):
            self.watch.receive_command_ack(message, self.telemetry.frame)
        self._messages.receive(message, newest, now)
        if not out and message.get_type() in HEALTH_REPORTS:
            return []
        out += self._act(now, saves=False)
        if out or self.events:  # else it is saved at the next step
            self.watch.save_record()
        return self._gate(out, now)

    def step(self, now: float) -> list[Message]:
        """Advance time; returns the messages to send."""
        self.events += self._event_retry.step(now)
        self.onboard.progress.step(now)
        out = self.onboard.step(now) + self._rates.step(now) + (
            self._end_actions.step(now, self.authority.held))
        return self._gate(out + self._act(now), now)

    def _gate(self, messages: list[Message], now: float) -> list[Message]:
        """Drop messages that authority does not allow; every message passes here."""
        return allowed_messages(messages, self.watch, now)

    def _act(self, now: float, saves: bool = True) -> list[Message]:
        self._report(now)  # the marks are saved with the current item that is past their tasks
        self.onboard.check_replaced()
        self.watch.step(now)
        if saves:
            self.watch.save_record()
        self.onboard.complete_flown(now)
        for rule in self._rules:
            if (out := rule(now)) is not None:
                break
        out = self.fence.step(now) + (out or [])
        self._report(now)
        return out

    def _report(self, now: float) -> None:
        if any(self._news):
            self.events += task_events(self.onboard, self.watch, now)
            self.notes += passed_over(self.onboard, self.watch, now)
        if any(self._notes_of_parts):
            for notes in self._notes_of_parts:
                self.notes += notes
                notes.clear()

    def _leg_start(self) -> LegStart | None:
        """Its position, at the height after a take-off if one is due; None: unknown."""
        telemetry, (x, y, z) = self.telemetry, self.telemetry.position
        home = telemetry.home or telemetry.position
        if not telemetry.airborne or self.sender.climbing:
            z = max(z, home[2] + self.policy.cruise_altitude)
        return LegStart((x, y, z), home, telemetry.mode is ModeFunction.MISSION) if (
            telemetry.has_position) else None

    def _start_over(self, now: float) -> None:
        self.onboard.restarted()
        self.fence.restart()
        self.energy.restart()
        self.sender.reset(now)
        self._rates.restart(now)

    # Rules

    def _linked(self, now: float) -> NextMessages:
        """Send nothing while the link is stale."""
        if self.telemetry.link.stale(now):
            self._was_stale, self.sender.waits_for = True, 'its link'
            self.sender.drop()
            return []
        if self._was_stale:
            self._was_stale = False
            self.sender.clear_backoff(now)
        return None

    def _authority(self, now: float) -> NextMessages:
        """Stop commands and uploads of the bridge when another party has the authority."""
        if self.authority.held:
            return None
        if not self.authority.allows(SendAction.COMMAND):
            self.sender.drop()
        if self.authority.state in (AuthorityState.LOST, AuthorityState.NONE):
            self.sender.climbing = False
        if not self.authority.allows(SendAction.READ):
            return self.sender.wait_for(f'authority: {self.authority.why}')
        # begun on the ground, it would replace the mission that a pilot flies now
        ends = self.telemetry.airborne or not self.authority.allows(SendAction.UPLOAD)
        if ends and self.onboard.state is MissionState.UPLOADING:
            self.onboard.abort()
        return None

    def _has_list(self, now: float) -> NextMessages:
        self.sender.waits_for = 'a list' if self.onboard.tasks is None else ''
        return [] if self.onboard.tasks is None else None

    def _may_act(self, now: float) -> NextMessages:
        if self.authority.state is AuthorityState.LOST:
            return self.sender.wait('the pilot to give it back')
        if not self.authority.allows(SendAction.UPLOAD):
            return self.sender.wait_for(f'authority: {self.authority.why}')
        if self.watch.yields:  # never granted
            return self.sender.wait_for(OUR_MISSION)
        if self.authority.held or not self.telemetry.airborne:
            return None
        # a pilot flies the onboard mission: do not replace it
        return self.sender.wait_for('the pilot to hand it over')

    def _hold_first(self, now: float) -> NextMessages:
        """After a hand-over in flight, hold before anything else."""
        authority, mode = self.authority, self.telemetry.mode
        if authority.hold is HoldStage.NO or not self.telemetry.airborne:
            authority.hold = HoldStage.NO
            return None
        unless_verified = authority.hold is HoldStage.UNLESS_VERIFIED and (
            mode is ModeFunction.MISSION)
        if unless_verified and not self.onboard.mission.read_since(authority.since):
            return []  # another may have replaced it
        if mode is ModeFunction.HOLD or (unless_verified and self.onboard.verified()):
            self.sender.must_start = mode is ModeFunction.HOLD
            authority.hold = HoldStage.NO
            return None
        if ModeFunction.HOLD not in self.profile.set_mode:
            authority.hold = HoldStage.NO
            return []
        return [] if self.sender.backing_off(now) else self.sender.set_mode(ModeFunction.HOLD, now)

    def _settled(self, now: float) -> NextMessages:
        """In the air, fly no list before another node that reports its UAV would be found.

        A list that is on board, as after a restart of the bridge, is verified: nothing is sent.
        """
        settling, onboard = self.policy.settling, self.onboard
        if not settling or not self.telemetry.airborne:
            return None
        if onboard.remaining().stops and (diff := onboard.diff()).kind is DiffKind.KEEP:
            onboard.adopt(diff, now)
        return self.sender.wait_for(settling)
