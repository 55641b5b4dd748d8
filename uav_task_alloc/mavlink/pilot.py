# SPDX-License-Identifier: Apache-2.0
"""Flies one UAV by its list: compares what is wanted with what is, and does the next thing.

Without I/O: messages and steady time in, messages and events out. `_rules` is the whole of it:
the first rule that is not satisfied acts, and those after it wait.
"""
from __future__ import annotations

import math
import random
from collections import deque
from collections.abc import Sequence

from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.geometry.frames import Origin
from uav_task_alloc.mavlink.board import SETTLE, Board, MissionState
from uav_task_alloc.mavlink.change import Change, Kind
from uav_task_alloc.mavlink.codec import Message
from uav_task_alloc.mavlink.helm import Helm, Note, Step
from uav_task_alloc.mavlink.peer import Peer
from uav_task_alloc.mavlink.policy import Policy, TaskProgress
from uav_task_alloc.mavlink.profiles import Flight, Profile
from uav_task_alloc.mavlink.rates import Rates
from uav_task_alloc.mavlink.reminder import Reminder
from uav_task_alloc.mavlink.service import Service
from uav_task_alloc.mavlink.telemetry import Telemetry
from uav_task_alloc.mavlink.upload import State
from uav_task_alloc.mission import RETURN, TaskList, all_alike
from uav_task_alloc.model import Task

LAST_WORD = 5.0  # [s] for a late REACHED, where the mission seems to end before its last item


class Pilot:
    """One vehicle as the bridge flies it."""

    def __init__(self, peer: Peer, profile: Profile, origin: Origin, policy: Policy,
                 rng: random.Random, now: float) -> None:
        self.profile, self.policy = profile, policy
        self.telemetry = Telemetry(profile, origin, now)
        self.board = Board(peer, profile, origin, self.telemetry, rng)
        self.helm = Helm(peer, profile, self.telemetry)
        self.events: deque[TaskProgress] = deque()
        self.notes: deque[Note] = deque()
        self.yielding = False  # to somebody else's mission
        self.going_home = False  # by a list without tasks
        self._rates = Rates(peer, self.telemetry, now)
        self._was_stale = self._aimed = False
        self._service = Service(self.board, self.telemetry, profile)
        self._wait_until = -math.inf
        self._reminder = Reminder()
        self._restarts = 0
        self._said = ''  # by the vehicle, last
        self._rules = (self._linked, self.helm.finish, self._upload, self._read, self._has_list,
                       self._yield, self._place, self._empty, self._bring, self._rise,
                       self._fly)

    def assign(self, tasks: TaskList, now: float) -> list[Message]:
        """The latest list for this UAV; an older one that comes late is ignored."""
        if self.board.tasks is not None and tasks.revision < self.board.tasks.revision:
            self.notes.append(Note('warning', f'task_list: revision = {tasks.revision}: expected '
                                   f'at least {self.board.tasks.revision}: ignored'))
            return []
        self.board.assign(tasks)
        self._reminder.listed(self.board.told_before(), now)
        self.helm.encourage(now)
        return self._act(now)

    def relieve(self, tasks: Sequence[Task], other: str) -> None:
        """Tasks of the list that another UAV has flown before we listened."""
        for task in tasks:
            self.notes.append(Note('info', f'{task.id} was flown by {other}, unheard'))
        self.board.progress.caught_up(tasks)

    def receive(self, message: Message, now: float) -> list[Message]:
        """Take any message of this vehicle."""
        flight, airborne = self.telemetry.flight, self.telemetry.airborne
        self.telemetry.receive(message, now)
        if self.telemetry.restarts != self._restarts:
            self._restarted(now)
        if message.get_type() == 'HEARTBEAT':
            self._mode(flight, airborne, now)
        out = self.board.receive(message, now)
        self.helm.receive(message)
        self._progress(message, now)
        return out + self._act(now)

    def step(self, now: float) -> list[Message]:
        """Let time pass."""
        self.events += self._reminder.step(now)
        return self.board.step(now) + self._rates.step(now) + self._act(now)

    def _act(self, now: float) -> list[Message]:
        out: list[Message] = []
        self.board.catch_up(now)
        for rule in self._rules:
            step = rule(now)
            if step is not None:
                out = step
                break
        self._report()
        return out

    def _report(self) -> None:
        board, revision = self.board, self.board.revision
        while board.progress.events:
            made = board.progress.events.popleft()
            event = 'COMPLETED' if made.completed else 'STARTED'
            latest = board.tasks.revision if made.unheard and board.tasks else revision
            self.events.append(TaskProgress(made.task, event, latest))
        while board.failed:
            failed = board.failed.popleft()
            self.events.append(TaskProgress(failed.task, 'FAILED', failed.revision,
                                            failed.reason))
        for notes in (board.notes, self.helm.notes):
            while notes:
                self.notes.append(notes.popleft())

    # What is heard

    def _progress(self, message: Message, now: float) -> None:
        kind, progress, own = message.get_type(), self.board.progress, self.board.own
        if kind == 'GLOBAL_POSITION_INT':
            progress.at(self.telemetry.position, now)
        elif kind == 'MISSION_ITEM_REACHED':
            progress.reached(message.seq - own, now)
        elif kind == 'MISSION_CURRENT' and not self.board.open:
            if self.board.must_jump is None:  # else it is left from the mission before
                progress.moved(max(0, message.seq - own), now)
            if (message.mission_state == d.MISSION_STATE_COMPLETE
                    and self.telemetry.flight is Flight.MISSION):
                progress.ended()
            if not self.helm.busy:
                self.board.watch(message, now)
        elif kind == 'STATUSTEXT':
            level = 'error' if message.severity < d.MAV_SEVERITY_WARNING else 'info'
            if str(message.text) != self._said:  # a refusal comes with every try
                self.notes.append(Note(level, str(message.text)))
            self._said = str(message.text)

    def _mode(self, before: Flight, was_airborne: bool, now: float) -> None:
        board, progress = self.board, self.board.progress
        last = progress.current is None or progress.current >= len(progress.items) - 1
        fresh = board.open or now - board.verified_at < SETTLE
        if self.helm.changed(before, was_airborne, excused=last or fresh):
            progress.stopped()
            if self.telemetry.airborne and not progress.finished:
                self._wait_until = now + LAST_WORD
        if was_airborne and not self.telemetry.airborne:
            self.yielding = False

    def _restarted(self, now: float) -> None:
        self._restarts = self.telemetry.restarts
        self.notes.append(Note('warning', 'was restarted'))
        self.board.restarted()
        self.helm.reset(now)
        self._rates.again(now)

    # The rules

    def _linked(self, now: float) -> Step:
        if self.telemetry.stale(now):
            self._was_stale, self.helm.waits_for = True, 'its link'
            return []
        if self._was_stale:
            self._was_stale = False
            self.helm.encourage(now)
        return None

    def _upload(self, now: float) -> Step:
        board = self.board
        if board.trouble:
            board.trouble = False
            self.helm.fail(now)
        if not board.upload.busy:
            return None
        self.helm.waits_for = 'its upload'
        if board.upload.state in (State.BACKOFF, State.DRAINING) and board.outdated and (
                board.held is not None and board.wanted()):
            return board.begin_upload(board.change(), now)
        return []

    def _read(self, now: float) -> Step:
        if self.board.held is not None:
            return None
        if self.helm.resting(now):
            return []
        self.helm.waits_for = 'a readback'
        return self.board.upload.read(now)

    def _has_list(self, now: float) -> Step:
        self.helm.waits_for = 'a list' if self.board.tasks is None else ''
        return [] if self.board.tasks is None else None

    def _yield(self, now: float) -> Step:
        board = self.board
        if board.state is MissionState.FOREIGN and board.read_once and not self.yielding:
            board.read_once = False
            self.yielding = self.policy.when_foreign == 'yield'
            self.notes.append(Note('warning', 'somebody else changed the mission: '
                                   + self.policy.when_foreign))
        if self.yielding and board.state is MissionState.FOREIGN:
            self.helm.waits_for = 'the foreign mission to end'
            return []
        self.yielding = False
        return None

    def _place(self, now: float) -> Step:
        """After a restart of the bridge: what was flown meanwhile is not repeated."""
        board, telemetry = self.board, self.telemetry
        assert board.tasks is not None
        if not board.recall.placed and board.held and telemetry.airborne and (
                telemetry.current is None):
            return []  # what it flies is not known yet
        board.recall.place(board.held or (), board.tasks, now)
        board.catch_up(now)
        return None

    def _empty(self, now: float) -> Step:
        """Nothing to fly: hold or return, and keep what is on board."""
        board, telemetry = self.board, self.telemetry
        end, tasks = board.wanted(), board.remaining()  # less what cannot be an item
        self.going_home = False
        if tasks.stops:
            return None
        rest = (board.held or ())[board.progress.current or 0:]
        board.revision = tasks.revision
        flying = telemetry.flight is Flight.MISSION and not board.progress.finished
        if flying and end and rest and all_alike(end[-len(rest):], rest):
            self.going_home = True
            return self.helm.content()
        if not telemetry.airborne or self.helm.paused or self.helm.resting(now):
            return []
        returns = tasks.returns or self.policy.when_empty == 'return'
        if tasks.end_via and tasks.returns and telemetry.flight is not Flight.RETURN:
            self.going_home = True
            return None  # the plain way home leads through a zone: fly the list of it
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
        if found.kind is Kind.JUMP:
            return self._jump(found, now)
        if self._service.lasts(now):
            self.helm.waits_for = 'the end of the service'
            return []
        if (found.kind is Kind.SWAP and not self.profile.atomic and telemetry.airborne
                and telemetry.flight is Flight.MISSION):
            self.helm.must_start = True
            return self.helm.set_mode(Flight.HOLD, now)
        return board.begin_upload(found, now)

    def _jump(self, found: Change, now: float) -> list[Message]:
        def done(t: float) -> None:
            self.board.progress.retag(found.items)
            self.board.progress.jumped(found.start, t)
            self.board.must_jump, self._aimed = None, True
            self.board.adopt(found, t)

        self.board.progress.asked(found.start)
        return self.helm.jump(found.start + self.board.own, now, done)

    def _rise(self, now: float) -> Step:
        return self.helm.rise(self.policy.cruise_altitude, self.policy.takeoff, now)

    def _fly(self, now: float) -> Step:
        """In mission mode, at the right item."""
        helm, board = self.helm, self.board
        flying = self.telemetry.flight is Flight.MISSION and not helm.must_start
        self._aimed = self._aimed and not flying
        if flying and board.must_jump is None:
            board.progress.started()
            return helm.content()
        if helm.refused and self.telemetry.flight is not Flight.MISSION:
            board.infeasible(self._said or helm.refused)
            helm.refused = ''
            return []
        if helm.resting(now) or now < self._wait_until:
            return []
        if helm.paused or not (flying or self._may_start()):
            return helm.wait('the pilot to give it back')
        if not (flying or self._aimed or self.profile.atomic) and board.must_jump is None:
            board.must_jump = board.progress.current  # ArduPilot resumes after what it flew last
        if board.must_jump is not None:
            return self._jump(Change(Kind.JUMP, board.progress.items, board.must_jump), now)
        return helm.set_mode(Flight.MISSION, now)

    def _may_start(self) -> bool:
        flight, commanded = self.telemetry.flight, self.helm.commanded
        ours = flight is Flight.RETURN and (commanded is Flight.RETURN or any(
            item.command == RETURN for item in self.board.progress.items))
        return ours or flight in (Flight.HOLD, Flight.MISSION, Flight.UNKNOWN) or (
            flight is Flight.TAKEOFF and commanded is Flight.TAKEOFF)
