# SPDX-License-Identifier: Apache-2.0
"""Flies one UAV by its list: compares what is wanted with what is, and does the next thing.

Without I/O: messages and steady time in, messages and events out. `_RULES` is the whole of it:
the first rule that is not satisfied acts, and those after it wait.
"""
from __future__ import annotations

import math
import random
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.geometry.frames import Origin
from uav_task_alloc.mavlink.board import Board, MissionState, Note
from uav_task_alloc.mavlink.change import Change, Kind
from uav_task_alloc.mavlink.codec import Message, plan_id
from uav_task_alloc.mavlink.command import Answer, Command
from uav_task_alloc.mavlink.peer import Peer
from uav_task_alloc.mavlink.profiles import Flight, Profile
from uav_task_alloc.mavlink.telemetry import RATES, Telemetry
from uav_task_alloc.mavlink.upload import State
from uav_task_alloc.mission import RETURN, TaskList, all_alike

RETRY, RETRIES = 10.0, 5  # [s] after a failure that may pass, until a new list or a new link
SETTLE = 3.0  # [s] in which messages sent before the last change may still come
CHECK = 60.0  # [s] between readbacks of a mission that nobody should have changed
ARM_TRIES = 120  # one a second: a position estimate may take that long
CLIMB = 120.0  # [s] for a take-off
NEAR = 15.0  # [m] from a point, beyond its radius: there
RATE_PERIOD, RATE_TRIES = 2.0, 5  # [s] between requests for messages that do not come


@dataclass(frozen=True, slots=True)
class Policy:
    """What the operator wants of the bridge."""

    takeoff: bool = False  # arm and take off
    cruise_altitude: float = 50.0  # [m] above home, to take off to
    when_empty: str = 'hold'  # or 'return': an empty list in flight
    when_foreign: str = 'yield'  # or 'reassert': a mission that somebody else put there


@dataclass(frozen=True, slots=True)
class TaskProgress:
    """STARTED, COMPLETED or FAILED, of a task on this UAV."""

    task: str
    event: str
    revision: int
    reason: str = ''


Step = list[Message] | None  # None: satisfied, the next rule may act


class Pilot:
    """One vehicle as the bridge flies it."""

    def __init__(self, peer: Peer, profile: Profile, origin: Origin, policy: Policy,
                 rng: random.Random, now: float) -> None:
        self.peer, self.profile, self.policy = peer, profile, policy
        self.telemetry = Telemetry(profile, origin, now)
        self.board = Board(peer, profile, origin, self.telemetry, rng)
        self.events: deque[TaskProgress] = deque()
        self.notes: deque[Note] = deque()
        self.waits_for = ''  # why nothing is done, for a human
        self._command: Command | None = None
        self._then: Callable[[float], None] | None = None  # once the command is done
        self._commanded: Flight | None = None  # by us, last
        self._must_start = False  # held for a swap
        self._paused = self.yielding = self.climbing = self._was_stale = False
        self._climb_until = self._serving_until = math.inf
        self._restarts, self._said = 0, ''
        self._retry_at, self._retries = -math.inf, 0
        self._rate_at, self._rates_asked = now, 0
        self._rules = (self._linked, self._finish_command, self._finish_upload, self._read,
                       self._has_list, self._yield, self._empty, self._bring, self._rise,
                       self._fly)

    def assign(self, tasks: TaskList, now: float) -> list[Message]:
        """The latest list for this UAV."""
        if self.board.tasks is not None and tasks.revision < self.board.tasks.revision:
            return []
        self.board.assign(tasks)
        self._retry_at, self._retries = now, 0
        return self._act(now)

    def receive(self, message: Message, now: float) -> list[Message]:
        """Take any message of this vehicle."""
        flight, airborne = self.telemetry.flight, self.telemetry.airborne
        self.telemetry.receive(message, now)
        if self.telemetry.restarts != self._restarts:
            self._restarted(now)
        if message.get_type() == 'HEARTBEAT':
            self._flight_changed(flight, airborne)
        out = self.board.receive(message, now)
        if self._command:
            self._command.receive(message)
        self._progress(message, now)
        return out + self._act(now)

    def step(self, now: float) -> list[Message]:
        """Let time pass."""
        return self.board.step(now) + self._rates(now) + self._act(now)

    def _act(self, now: float) -> list[Message]:
        out: list[Message] = []
        for rule in self._rules:
            done = rule(now)
            if done is not None:
                out = done
                break
        self._report()
        return out

    def _report(self) -> None:
        board, revision = self.board, self.board.revision
        while board.progress.events:
            made = board.progress.events.popleft()
            event = 'COMPLETED' if made.completed else 'STARTED'
            self.events.append(TaskProgress(made.task, event, revision))
        while board.failed:
            failed = board.failed.popleft()
            self.events.append(TaskProgress(failed.task, 'FAILED', revision, failed.reason))
        while board.notes:
            self.notes.append(board.notes.popleft())

    # What is heard

    def _progress(self, message: Message, now: float) -> None:
        kind, progress, own = message.get_type(), self.board.progress, self.board.own
        if kind == 'GLOBAL_POSITION_INT':
            progress.at(self.telemetry.position, now)
        elif kind == 'MISSION_ITEM_REACHED':
            progress.reached(message.seq - own, now)
        elif kind == 'MISSION_CURRENT' and not self.board.open:
            progress.moved(max(0, message.seq - own), now)
            if (message.mission_state == d.MISSION_STATE_COMPLETE
                    and self.telemetry.flight is Flight.MISSION):
                progress.ended()
            self._watch(message, now)
        elif kind == 'STATUSTEXT':
            self.notes.append(Note('error' if message.severity < d.MAV_SEVERITY_WARNING
                                   else 'info', str(message.text)))

    def _watch(self, message: Message, now: float) -> None:
        """Has somebody else changed the mission? What the vehicle says is doubt, not proof."""
        board = self.board
        if board.held is None or now - board.verified_at < SETTLE or self._command:
            return
        ours, plan = board.plan_id, plan_id(message)
        changed = (plan != ours if plan and ours else message.total not in (
            0, 65535, len(board.held), len(board.held) + board.own))
        gone = message.mission_state == d.MISSION_STATE_NO_MISSION and board.held
        if changed or gone or now - board.verified_at > CHECK:
            board.doubt()

    def _flight_changed(self, before: Flight, airborne: bool) -> None:
        flight, progress = self.telemetry.flight, self.board.progress
        if flight is Flight.MISSION:
            self._paused = False
        elif before is Flight.MISSION and flight is not self._commanded:
            last = progress.current is None or progress.current >= len(progress.items) - 1
            self._paused = not last and self.telemetry.airborne
            progress.stopped()
        if airborne and not self.telemetry.airborne:
            self._paused = self.yielding = self.climbing = False
            progress.stopped()

    def _restarted(self, now: float) -> None:
        self._restarts = self.telemetry.restarts
        self.notes.append(Note('warning', 'was restarted'))
        self.board.restarted()
        self._command = None
        self.climbing = self._must_start = self._paused = False
        self._rate_at, self._rates_asked = now, 0

    def _rates(self, now: float) -> list[Message]:
        missing = [number for number in RATES if number not in self.telemetry.heard]
        if now < self._rate_at or not missing or self._rates_asked >= RATE_TRIES:
            return []
        self._rates_asked += 1
        self._rate_at = now + RATE_PERIOD
        out = [self.peer.command(d.MAV_CMD_SET_MESSAGE_INTERVAL, number, 1e6 / RATES[number])
               for number in (RATES if self._rates_asked == 1 else missing)]
        if self.telemetry.home is None:
            out.append(self.peer.command(d.MAV_CMD_REQUEST_MESSAGE,
                                         d.MAVLINK_MSG_ID_HOME_POSITION))
        return out

    # The rules

    def _linked(self, now: float) -> Step:
        if self.telemetry.stale(now):
            self._was_stale, self.waits_for = True, 'its link'
            return []
        if self._was_stale:
            self._was_stale = False
            self._retry_at, self._retries = now, 0
        return None

    def _finish_command(self, now: float) -> Step:
        command = self._command
        if command is None:
            return None
        out = command.step(now)
        if command.answer is Answer.OPEN:
            self.waits_for = command.name
            return out
        self._command, then = None, self._then
        if command.answer is Answer.DONE and then:
            then(now)
        elif command.answer is Answer.FAILED:
            self.notes.append(Note('error', f'{command.name}: {command.reason}'))
            self._fail(now)
        return None

    def _finish_upload(self, now: float) -> Step:
        upload = self.board.upload
        if self.board.trouble:
            self.board.trouble = False
            self._fail(now)
        if not upload.busy:
            return None
        self.waits_for = 'its upload'
        if upload.state in (State.BACKOFF, State.DRAINING) and self.board.outdated:
            return self.board.begin_upload(self.board.change(), now)
        return []

    def _read(self, now: float) -> Step:
        if self.board.held is not None:
            return None
        self.waits_for = 'a readback'
        return [] if now < self._retry_at else self.board.upload.read(now)

    def _has_list(self, now: float) -> Step:
        self.waits_for = 'a list' if self.board.tasks is None else ''
        return [] if self.waits_for else None

    def _yield(self, now: float) -> Step:
        board = self.board
        if board.state is MissionState.FOREIGN and board.read_once and not self.yielding:
            board.read_once = False
            self.yielding = self.policy.when_foreign == 'yield'
            self.notes.append(Note('warning', 'somebody else changed the mission: '
                                   + self.policy.when_foreign))
        if self.yielding and board.state is MissionState.FOREIGN:
            self.waits_for = 'the foreign mission to end'
            return []
        self.yielding = False
        return None

    def _empty(self, now: float) -> Step:
        """Nothing to fly: hold or return, and keep what is on board."""
        board, tasks = self.board, self.board.remaining()
        if tasks.stops:
            return None
        held, current, end = board.held or (), board.progress.current, board.wanted()
        if end and current is not None and held[current:] and all_alike(
                end[-len(held[current:]):], held[current:]):
            return None  # on its way home already
        board.revision = tasks.revision
        returns = tasks.returns or self.policy.when_empty == 'return'
        goal = Flight.RETURN if returns else Flight.HOLD
        if self.telemetry.airborne and not self._paused and now >= self._retry_at and (
                (self.telemetry.flight is Flight.MISSION and not board.progress.finished)
                or (returns and self.telemetry.flight is Flight.HOLD)):
            return self._set_mode(goal, now)
        return []

    def _bring(self, now: float) -> Step:
        """The list on board, by the cheapest way."""
        board = self.board
        if self.telemetry.airborne and board.progress.current is None and board.held:
            if self.telemetry.current is None:
                return []  # what it flies is not known yet
            board.progress.begin(board.held, max(0, self.telemetry.current - board.own), now)
        found = board.change()
        found = self._caught_up(found, now)
        if found.kind is Kind.KEEP:
            board.adopt(found, now)
            return None
        if now < self._retry_at:
            self.waits_for = 'the next try'
            return []
        if found.kind is Kind.JUMP:
            return self._jump(found.start, now, lambda t: board.adopt(found, t), found)
        if self._serving(now):
            self.waits_for = 'the end of the service'
            return []
        if (found.kind is Kind.SWAP and not self.profile.atomic and self.telemetry.airborne
                and self.telemetry.flight is Flight.MISSION):
            self._must_start = True
            return self._set_mode(Flight.HOLD, now)
        return board.begin_upload(found, now)

    def _caught_up(self, found: Change, now: float) -> Change:
        """After a restart of the bridge: what was flown meanwhile is completed, not repeated."""
        board, current = self.board, self.board.progress.current
        if board.read_once or found.kind is not Kind.JUMP or current is None:
            return found
        ended = self._ended(found)
        if current < found.start or (current == found.start and not ended):
            return found
        board.progress.begin(found.items, found.start, now)
        board.progress.caught_up(len(found.items) if ended else current)
        board.held = found.items
        return board.change() if board.remaining().stops else Change(
            Kind.KEEP, found.items, len(found.items))

    def _ended(self, found: Change) -> bool:
        telemetry, last = self.telemetry, found.items[-1]
        if telemetry.mission_state == d.MISSION_STATE_COMPLETE:
            return True
        return (self.profile.atomic and telemetry.airborne and telemetry.flight is Flight.HOLD
                and self.board.progress.current == len(found.items) - 1
                and last.position is not None
                and math.dist(telemetry.position, last.position) < last.radius + NEAR)

    def _serving(self, now: float) -> bool:
        """An upload would start the hold of the task anew."""
        item = self.board.progress.active
        place = self.telemetry.position
        wanted = self.board.wanted()
        if (item is None or not item.completes or item.position is None or item.params[0] <= 0.0
                or self.telemetry.flight is not Flight.MISSION
                or not any(w.task == item.task for w in wanted[:1])
                or not math.dist(place, item.position) < item.radius + NEAR):
            self._serving_until = math.inf
            return False
        if math.isinf(self._serving_until):
            self._serving_until = now + item.params[0] + RETRY
        return now < self._serving_until

    def _rise(self, now: float) -> Step:
        """Off the ground, where that is ours to do."""
        telemetry, policy = self.telemetry, self.policy
        if telemetry.airborne and not self.climbing:
            return None
        if not policy.takeoff and not self.climbing:
            self._wait('a pilot to arm and take off (takeoff is false)')
            return []
        if now < self._retry_at:
            return []
        if self.climbing:
            return self._climb(now)
        if telemetry.flight is not Flight.HOLD and Flight.HOLD in self.profile.set_mode and (
                not self.profile.atomic):
            return self._set_mode(Flight.HOLD, now)
        if not telemetry.armed:
            arm = self.peer.command(d.MAV_CMD_COMPONENT_ARM_DISARM, 1.0)
            return self._do(Command('arm', arm, lambda: telemetry.armed, tries=ARM_TRIES,
                                    patient=True), now, self._armed)
        home = telemetry.altitude - (0.0 if math.isnan(telemetry.height) else telemetry.height)
        up = self.profile.takeoff_command(self.peer, policy.cruise_altitude, home)
        return self._do(Command('take off', up, lambda: telemetry.flight is Flight.TAKEOFF), now,
                        self._took_off)

    def _armed(self, now: float) -> None:
        self.telemetry.armed = True

    def _took_off(self, now: float) -> None:
        self.climbing, self._climb_until = True, now + CLIMB
        self._commanded = Flight.TAKEOFF

    def _climb(self, now: float) -> Step:
        if self.telemetry.height >= 0.9 * self.policy.cruise_altitude:
            self.climbing, self._must_start = False, True
            return None
        self.waits_for = 'its height'
        if now > self._climb_until or not self.telemetry.armed:
            self.climbing = False
            self._fail(now)
        return []

    def _fly(self, now: float) -> Step:
        """In mission mode, at the right item."""
        telemetry, board = self.telemetry, self.board
        flying = telemetry.flight is Flight.MISSION and not self._must_start
        if flying and board.must_jump is None:
            board.progress.started()
            self.waits_for = self._said = ''
            return []
        if now < self._retry_at:
            return []
        if self._paused or not (flying or self._may_start()):
            self._wait('the pilot to give it back')
            return []
        if board.must_jump is not None:
            return self._jump(board.must_jump, now, lambda t: None, None)
        return self._set_mode(Flight.MISSION, now)

    def _may_start(self) -> bool:
        flight = self.telemetry.flight
        ours = flight is Flight.RETURN and (self._commanded is Flight.RETURN or any(
            item.command == RETURN for item in self.board.progress.items))
        return ours or flight in (Flight.HOLD, Flight.MISSION, Flight.UNKNOWN) or (
            flight is Flight.TAKEOFF and self._commanded is Flight.TAKEOFF)

    # What is done

    def _jump(self, start: int, now: float, then: Callable[[float], None],
              found: Change | None) -> list[Message]:
        seq, telemetry, asked = start + self.board.own, self.telemetry, now

        def seen() -> bool:
            return telemetry.current == seq and telemetry.current_at > asked

        def done(t: float) -> None:
            if found is not None:
                self.board.progress.retag(found.items)
            self.board.progress.jumped(start, t)
            self.board.must_jump = None
            then(t)

        old_way = Command('set current', self.peer.set_current(seq), seen)
        new_way = Command('set current', self.peer.command(
            d.MAV_CMD_DO_SET_MISSION_CURRENT, seq), seen, tries=2, fallback=old_way)
        return self._do(new_way if self.profile.jump_command else old_way, now, done)

    def _set_mode(self, flight: Flight, now: float) -> list[Message]:
        telemetry = self.telemetry

        def done(t: float) -> None:
            telemetry.flight = flight  # a heartbeat sent before may say otherwise for a moment
            if flight is Flight.MISSION:
                self._must_start = False

        self._commanded = flight
        return self._do(Command(f'mode {flight.value}', self.profile.mode_command(
            self.peer, flight), lambda: telemetry.flight is flight), now, done)

    def _do(self, command: Command, now: float,
            then: Callable[[float], None]) -> list[Message]:
        self._command, self._then = command, then
        self.waits_for = command.name
        return command.step(now)

    def _fail(self, now: float) -> None:
        self._retries += 1
        self._retry_at = now + RETRY if self._retries <= RETRIES else math.inf

    def _wait(self, what: str) -> None:
        if self._said != what:
            self.notes.append(Note('warning', f'waits for {what}'))
        self.waits_for = self._said = what
