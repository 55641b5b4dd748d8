# SPDX-License-Identifier: Apache-2.0
"""Flies one UAV by its list: compares what is wanted with what is, and does the next thing.

Without I/O: messages and steady time in, messages and events out. `_rules` is the whole of it:
the first rule that is not satisfied acts, and those after it wait.
"""
from __future__ import annotations

import math
import random
import re
from collections import deque
from collections.abc import Callable, Sequence

from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.geometry.frames import Origin
from uav_task_alloc.mavlink import authority as who
from uav_task_alloc.mavlink.authority import Action, Hold, Record
from uav_task_alloc.mavlink.authority_watch import AuthorityWatch
from uav_task_alloc.mavlink.board import Board, MissionState
from uav_task_alloc.mavlink.change import Change, Kind
from uav_task_alloc.mavlink.codec import Message
from uav_task_alloc.mavlink.flown_path import Sample
from uav_task_alloc.mavlink.helm import Helm, Step
from uav_task_alloc.mavlink.mission_evidence import MissionEvidence
from uav_task_alloc.mavlink.peer import Peer
from uav_task_alloc.mavlink.policy import Note, Policy, TaskProgress
from uav_task_alloc.mavlink.profiles import Flight, Profile
from uav_task_alloc.mavlink.rates import Rates
from uav_task_alloc.mavlink.recall import MEMORY
from uav_task_alloc.mavlink.reminder import Reminder
from uav_task_alloc.mavlink.send_gate import allowed
from uav_task_alloc.mavlink.service import Service
from uav_task_alloc.mavlink.telemetry import Telemetry
from uav_task_alloc.mavlink.upload import State
from uav_task_alloc.mavlink.way_home import zone_in_the_way
from uav_task_alloc.mission import TaskList, all_alike
from uav_task_alloc.model import Task

SWAP_HOLD = 30.0  # [s] that a vehicle is held for an upload, at most
TEXT_AGAIN = 60.0  # [s] in which the same words of a vehicle are told once
MOST_TEXTS = 200  # different words in that time
SAYS_NOTHING = re.compile(r'Auto mission changed, restarted command')  # once for each item


class Pilot:
    """One vehicle as the bridge flies it."""

    def __init__(self, peer: Peer, profile: Profile, origin: Origin, policy: Policy,
                 rng: random.Random, now: float, record: Record | None = None,
                 save: Callable[[Record], None] = lambda record: None) -> None:
        self.profile, self.policy, self._peer = profile, policy, peer
        self.telemetry = Telemetry(profile, origin, now)
        self.board = Board(peer, profile, origin, self.telemetry, rng)
        self.helm = Helm(peer, profile, self.telemetry)
        evidence = MissionEvidence(self.board, self.telemetry)
        self.watch = AuthorityWatch(profile, self.telemetry, evidence, lambda: self.policy,
                                    now, record, save)
        self.authority = self.watch.authority
        self.events: deque[TaskProgress] = deque()
        self.notes: deque[Note] = deque()
        self.going_home = False  # by a list without tasks
        self.alarm = ''  # what a human has to see to
        self._rates = Rates(peer, self.telemetry, now)
        self._was_stale = self._aimed = False
        self._service = Service(self.board, self.telemetry, profile)
        self._reminder = Reminder()
        self._restarts = 0
        self._texts: dict[str, float] = {}  # of the vehicle, when told [s]
        self._said = ''  # by the vehicle, last
        if record is not None:
            self.board.recall.known = record.mission, record.current
        for mark in self.watch.marks.values():
            if mark.flown:
                self.board.recall.told.add(mark.task)
            else:
                self.board.recall.unflown[mark.task] = mark[1:4]
        self._rules = (self._linked, self._authority, self.helm.finish, self._lift, self._upload,
                       self._read, self._has_list, self._place, self._may_act, self._hold_first,
                       self._held_too_long, self._empty, self._bring, self._rise, self._fly)

    def assign(self, tasks: TaskList, now: float) -> list[Message]:
        """The latest list for this UAV; an older one that comes late is ignored."""
        if self.board.tasks is not None and tasks.revision < self.board.tasks.revision:
            self.notes.append(Note('warning', f'task_list: revision = {tasks.revision}: expected '
                                   f'at least {self.board.tasks.revision}: ignored'))
            return []
        if self.board.tasks is None and tasks.revision > 1:  # else all of it is new
            for mark in self.watch.marks.values():
                if mark.flown and now - mark.at < MEMORY:
                    self.board.progress.completed[mark.task] = mark[1:4]
        self.board.list.assign(tasks)
        for task in filter(self.board.list.fly_anew, self._reminder.answered()):
            self.notes.append(Note('info', f'{task} was announced anew: it is flown once more'))
        self._reminder.listed(self.board.list.told_before(), now)
        self.helm.encourage(now)
        return self._gate(self._act(now), now)

    def relieve(self, tasks: Sequence[Task], other: str) -> None:
        """Tasks of the list that another UAV has flown before we listened."""
        for task in tasks:
            self.notes.append(Note('info', f'{task.id} was flown by {other}, unheard'))
        self.board.progress.caught_up(tasks)

    def hand_over(self, operator: str, now: float) -> str:
        """An operator gives the aircraft to the bridge; returns why not, '' where it has it."""
        refusal = self.watch.hand_over(operator, now)
        if not refusal:
            self.helm.encourage(now)
        self._report(now)
        return refusal

    def moved_address(self, now: float) -> None:
        """It speaks from a new address: it, or another vehicle with the same id."""
        self.watch.new_address(now)
        self.telemetry.restart()
        self._restarts = self.telemetry.restarts
        self._begin_anew(now)

    def receive(self, message: Message, now: float) -> list[Message]:
        """Take any message of this vehicle."""
        flight = self.telemetry.flight
        newest = self.telemetry.receive(message, now)
        if self.telemetry.restarts != self._restarts:
            self._restarts = self.telemetry.restarts
            self.notes.append(Note('warning', 'was restarted'))
            self.watch.rebooted(now)
            self._begin_anew(now)
            self.board.recall.rebooted()
        if message.get_type() == 'HEARTBEAT' and newest:
            self.watch.heartbeat(message, now)
            if flight is Flight.MISSION and self.telemetry.flight is not Flight.MISSION:
                self.board.progress.stopped()
        out = self.board.receive(message, now)
        self.helm.receive(message)
        if message.get_type() == 'COMMAND_ACK' and self._peer.says(message):
            self.watch.answered(message, self.telemetry.frame)
        self._progress(message, newest, now)
        return self._gate(out + self._act(now), now)

    def step(self, now: float) -> list[Message]:
        """Let time pass."""
        self.events += self._reminder.step(now)
        self.board.progress.step(now)
        out = self.board.step(now) + self._rates.step(now)
        return self._gate(out + self._act(now), now)

    def _gate(self, messages: list[Message], now: float) -> list[Message]:
        """The one way out: what authority does not allow is not sent, retries included."""
        return allowed(messages, self.watch, now)

    def _act(self, now: float) -> list[Message]:
        out: list[Message] = []
        self.watch.step(now)
        self.board.catch_up(now)
        for rule in self._rules:
            step = rule(now)
            if step is not None:
                out = step
                break
        self._report(now)
        return out

    def _report(self, now: float) -> None:
        board, revision = self.board, self.board.revision
        while board.progress.events:
            made = board.progress.events.popleft()
            event = 'COMPLETED' if made.completed else 'STARTED'
            latest = board.tasks.revision if made.unheard and board.tasks else revision
            if made.completed:
                self.watch.mark(made.task, board.progress.completed.get(made.task), True, now)
            self.events.append(TaskProgress(made.task, event, latest))
        while board.failed:
            failed = board.failed.popleft()
            self.events.append(TaskProgress(failed.task, 'FAILED', failed.revision,
                                            failed.reason))
        while board.progress.left:
            item = board.progress.left.popleft()
            if item.task not in board.progress.completed:
                self.watch.mark(item.task, item.position, False, now)
        while board.progress.skipped:
            task = board.progress.skipped.popleft()
            self.notes.append(Note('warning', f'{task} was passed over, not by the bridge: '
                                   'it is still to be flown'))
        for notes in (self.watch.notes, board.notes, board.list.notes, self.helm.notes):
            while notes:
                self.notes.append(notes.popleft())

    # What is heard

    def _progress(self, message: Message, newest: bool, now: float) -> None:
        kind, progress, own = message.get_type(), self.board.progress, self.board.own
        flying = self.telemetry.flight is Flight.MISSION
        if kind == 'GLOBAL_POSITION_INT':
            self._position(message, newest, now)
        elif kind == 'MISSION_ITEM_REACHED':
            self.board.reached(message.seq - own, now)
        elif kind == 'MISSION_CURRENT' and newest and self.board.tells(message):
            seq = max(0, message.seq - own)
            if self.board.must_jump is None:  # else it is left from the mission before
                progress.moved(seq, now, flying, self.telemetry.frame)
            if (message.mission_state == d.MISSION_STATE_COMPLETE and flying
                    and not self.profile.atomic):  # PX4 says so after a take-off too
                progress.ended(seq, now, self.telemetry.frame)
            if not self.helm.busy and not self.board.open:
                self.board.watch(message, now)
        elif kind == 'STATUSTEXT':
            self._text(message, now)

    def _position(self, message: Message, newest: bool, now: float) -> None:
        if self.telemetry.has_position:
            place, velocity = self.telemetry.place_of(message)
            self.board.progress.at(
                Sample(message.time_boot_ms * 1e-3, place, velocity), newest, now,
                self.telemetry.frame)

    def _text(self, message: Message, now: float) -> None:
        text = str(message.text)
        self.watch.text(message, now)
        self.helm.note_refusal(text)
        self.board.list.horizon.note(text)
        if len(self._texts) >= MOST_TEXTS:
            self._texts = {old: at for old, at in self._texts.items() if now - at < TEXT_AGAIN}
        if now - self._texts.get(text, -math.inf) >= TEXT_AGAIN and len(self._texts) < MOST_TEXTS:
            serious = message.severity < d.MAV_SEVERITY_WARNING and not SAYS_NOTHING.search(text)
            self.notes.append(Note('error' if serious else 'info', text))
            self._texts[text] = now
        self._said = text

    def _begin_anew(self, now: float) -> None:
        self.board.restarted()
        self.helm.reset(now)
        self._rates.again(now)

    # The rules

    def _linked(self, now: float) -> Step:
        if self.telemetry.stale(now):
            self._was_stale, self.helm.waits_for = True, 'its link'
            self.helm.drop()
            return []
        if self._was_stale:
            self._was_stale = False
            self.helm.encourage(now)
        return None

    def _authority(self, now: float) -> Step:
        """Whoever has it, nothing that was begun for us goes on."""
        if self.authority.held:
            return None
        if not self.authority.allows(Action.COMMAND):
            self.helm.drop()
        if not self.authority.allows(Action.READ):
            return self.helm.wait_for(f'authority: {self.authority.why}')
        if not self.authority.allows(Action.UPLOAD) and self.board.state is (
                MissionState.UPLOADING):
            self.board.abort()
        return None

    def _lift(self, now: float) -> Step:
        """Armed by us: it takes off before anything else, or is disarmed."""
        if not self.helm.armed_here or self.telemetry.airborne or not self.authority.held:
            return None
        return self._rise(now) if self._wants_to_fly() else self.helm.disarm(now)

    def _upload(self, now: float) -> Step:
        board = self.board
        if board.trouble:
            board.trouble = False
            self.helm.fail(now)
        if not board.upload.busy:
            return None
        beyond = board.beyond_flown()
        if beyond is not None and self.authority.held:
            board.progress.asked(beyond)
            return self.helm.jump(beyond + board.own, now,
                                  lambda t: board.progress.jumped(beyond, t))
        self.helm.waits_for = 'its upload'
        if board.upload.state in (State.BACKOFF, State.DRAINING) and board.outdated and (
                board.held is not None and board.wanted() and not board.upload.maybe_taken):
            return board.begin_upload(board.change(), now)
        return self._held_too_long(now) or []

    def _read(self, now: float) -> Step:
        if self.board.held is not None:
            return None
        if not self.telemetry.past_boot:
            return self.helm.wait_for('the autopilot to start')
        if self.helm.resting(now):
            return self._held_too_long(now) or []
        self.helm.waits_for = 'a readback'
        return self.board.upload.read(now)

    def _has_list(self, now: float) -> Step:
        self.helm.waits_for = 'a list' if self.board.tasks is None else ''
        return [] if self.board.tasks is None else None

    def _place(self, now: float) -> Step:
        """After a restart of the bridge: what was flown meanwhile is not repeated."""
        board, telemetry = self.board, self.telemetry
        assert board.tasks is not None
        if not board.recall.placed and board.held and telemetry.airborne and (
                telemetry.current is None or not telemetry.has_position):
            return []  # what it flies is not known yet
        board.recall.place(board.held or (), board.tasks, now)
        board.catch_up(now)
        return None

    def _may_act(self, now: float) -> Step:
        if self.authority.state is who.State.LOST:
            return self.helm.wait('the pilot to give it back')
        if not self.authority.allows(Action.UPLOAD):
            return self.helm.wait_for(f'authority: {self.authority.why}')
        if self.authority.held or not self.telemetry.airborne:
            return None
        # a pilot flies what is on board: it is not changed under him
        return self.helm.wait_for('the pilot to hand it over')

    def _hold_first(self, now: float) -> Step:
        """After a hand-over in flight nothing else is done before it holds."""
        authority, flight = self.authority, self.telemetry.flight
        if authority.hold is Hold.NO or not self.telemetry.airborne:
            authority.hold = Hold.NO
            return None
        if flight is Flight.HOLD or (authority.hold is Hold.UNLESS_VERIFIED
                                     and flight is Flight.MISSION and self.board.verified()):
            self.helm.must_start = flight is Flight.HOLD
            authority.hold = Hold.NO
            return None
        if self.helm.resting(now) or Flight.HOLD not in self.profile.set_mode:
            authority.hold = Hold.NO if Flight.HOLD not in self.profile.set_mode else (
                authority.hold)
            return []
        return self.helm.set_mode(Flight.HOLD, now)

    def _held_too_long(self, now: float) -> Step:
        """A swap that does not come to its end: home where the way is clear, else stay."""
        since = self.watch.swap_at
        if since is None or now - since <= SWAP_HOLD or not self.authority.held:
            return None
        self.watch.swap_at = None
        blocked = self._blocked_home()
        if blocked:
            self.alarm = f'held for an upload that does not end, and {blocked}: stays'
            self.notes.append(Note('error', self.alarm))
            return None
        self.notes.append(Note('error', f'held for {SWAP_HOLD:g} s for an upload that does not '
                               'end: returns'))
        return self.helm.set_mode(Flight.RETURN, now)

    def _blocked_home(self) -> str:
        """Why it must not fly straight home, in words; '' where it may."""
        home, zones = self.telemetry.home, self.policy.zones
        if home is None or not self.telemetry.has_position:
            return 'its way home is not known' if zones else ''
        zone = zone_in_the_way(self.telemetry.position, home, zones)
        return f'zone {zone.id} is on its way home' if zone else ''

    def _empty(self, now: float) -> Step:
        """Nothing to fly: hold or return, and keep what is on board."""
        board, telemetry = self.board, self.telemetry
        end, tasks = board.wanted(), board.remaining()  # less what cannot be an item
        self.going_home = False
        if tasks.stops:
            return None
        rest = (board.held or ())[board.progress.current or 0:]
        if not board.progress.pending:
            board.revision = tasks.revision
        flying = telemetry.flight is Flight.MISSION and not board.progress.finished
        if flying and end and rest and all_alike(end[-len(rest):], rest):
            self.going_home = True
            return self.helm.content()
        if board.progress.pending or not telemetry.airborne or self.helm.resting(now) or (
                not self.authority.held):
            return []
        returns = tasks.returns or self.policy.when_empty == 'return'
        if tasks.end_via and tasks.returns and telemetry.flight is not Flight.RETURN:
            self.going_home = True
            return None  # the plain way home leads through a zone: fly the list of it
        blocked = self._blocked_home() if returns else ''
        if blocked and telemetry.flight is not Flight.RETURN:
            returns = False
            self.helm.wait(f'a way home: {blocked}')
        if flying or (returns and telemetry.flight in (Flight.HOLD, Flight.MISSION)):
            return self.helm.set_mode(Flight.RETURN if returns else Flight.HOLD, now)
        return []

    def _bring(self, now: float) -> Step:
        """The list on board, by the cheapest way."""
        board, telemetry = self.board, self.telemetry
        found = board.change()
        if found.kind is Kind.KEEP:
            board.adopt(found, now)
            return None
        if self.helm.resting(now):
            return []
        if not telemetry.past_boot:
            return self.helm.wait_for('the autopilot to start')
        if self._chosen_by_another():
            return self.helm.wait_for('the item that another station has chosen')
        if found.kind is Kind.JUMP:
            return self._jump(found, now)
        if self._service.lasts(now):
            self.helm.waits_for = 'the end of the service'
            return []
        if found.kind is Kind.SWAP and telemetry.airborne and not telemetry.good_link(now):
            return self.helm.wait_for('a link without gaps for 10 s')
        if (found.kind is Kind.SWAP and not self.profile.atomic and telemetry.airborne
                and telemetry.flight is Flight.MISSION):
            self.helm.must_start, self.watch.swap_at = True, now
            return self.helm.set_mode(Flight.HOLD, now)
        return board.begin_upload(found, now)

    def _chosen_by_another(self) -> bool:
        """Somebody has set the current item: it is flown, and what was left out later."""
        progress, item = self.board.progress, self.board.progress.active
        return (progress.chosen is not None and progress.chosen == progress.current
                and self.telemetry.airborne
                and self.telemetry.flight is Flight.MISSION and item is not None
                and any(item.task == stop.task.id for stop in self.board.remaining().stops))

    def _jump(self, found: Change, now: float) -> list[Message]:
        if not self.authority.held:
            return self.helm.wait_for('authority to set the current item')
        tasks = self.board.tasks

        def done(t: float) -> None:
            self.board.progress.retag(found.items)
            self.board.progress.jumped(found.start, t)
            self.board.must_jump, self._aimed = None, True
            self.board.adopt(found, t, tasks)

        self.board.progress.asked(found.start)
        return self.helm.jump(found.start + self.board.own, now, done)

    def _rise(self, now: float) -> Step:
        if self.telemetry.airborne and not self.helm.climbing:
            return None
        if not self.authority.held:
            return self.helm.wait('~/hand_over: it has landed' if self.authority.landed else
                                  'a pilot to arm and take off (takeoff is false)')
        if self.policy.grounded and not self.helm.climbing:
            return self.helm.wait(self.policy.grounded)
        home = self.telemetry.home or self.telemetry.position
        zone = zone_in_the_way(home, home, self.policy.zones)
        if zone is not None and not self.helm.climbing:
            return self.helm.wait(f'zone {zone.id} to leave its home')

        return self.helm.rise(self.policy.cruise_altitude, self._wants_to_fly, now)

    def _wants_to_fly(self) -> bool:
        return (self.authority.held and self.board.tasks is not None
                and not (self.policy.grounded and not self.telemetry.airborne)
                and bool(self.board.remaining().stops))

    def _fly(self, now: float) -> Step:
        """In mission mode, at the right item."""
        helm, board = self.helm, self.board
        in_mission = self.telemetry.flight is Flight.MISSION
        flying = in_mission and not helm.must_start
        self._aimed = self._aimed and not flying
        if flying and self._stands():
            board.must_jump = board.progress.current
            helm.must_start = True
            return helm.set_mode(Flight.HOLD, now)  # it would begin at the first item again
        if flying and board.must_jump is None:
            board.progress.started()
            self.watch.swap_at, self.alarm = None, ''
            return helm.content()
        if helm.refused and not in_mission:
            board.list.infeasible(self._said or helm.refused)
            helm.refused = ''
            return []
        if helm.resting(now):
            return []
        if self.telemetry.flight is Flight.TAKEOFF:
            return helm.wait_for('the end of the take-off')
        if not (flying or self._aimed or self.profile.atomic) and board.must_jump is None:
            board.must_jump = board.progress.current  # ArduPilot resumes after what it flew last
        if board.must_jump is not None:
            return self._jump(Change(Kind.JUMP, board.progress.items, board.must_jump), now)
        return helm.set_mode(Flight.MISSION, now)

    def _stands(self) -> bool:
        """ArduPilot has ended the mission that it had, and does not begin what was appended."""
        telemetry, progress = self.telemetry, self.board.progress
        return (not self.profile.atomic and telemetry.current is not None
                and telemetry.mission_state == d.MISSION_STATE_COMPLETE
                and not progress.finished and progress.active is not None
                and telemetry.current_at > self.board.verified_at
                and telemetry.current - self.board.own < len(progress.items) - 1)
