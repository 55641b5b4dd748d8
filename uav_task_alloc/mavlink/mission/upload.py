# SPDX-License-Identifier: Apache-2.0
"""Mission upload as a state machine: messages and time in, messages and events out; no socket.

One object for each (link, system, mission type). Every upload ends with a readback, which decides.
"""
from __future__ import annotations

import random
from collections import deque
from collections.abc import Callable, Sequence
from enum import Enum

from uav_task_alloc.mavlink.mission import peer as wire
from uav_task_alloc.mavlink.mission.download import Download, DownloadState
from uav_task_alloc.mavlink.mission.items import Item, all_alike
from uav_task_alloc.mavlink.mission.outcomes import (
    Accepted,
    Failed,
    Downloaded,
    Mission,
    Outcome,
    Verified,
)
from uav_task_alloc.mavlink.mission.peer import Peer
from uav_task_alloc.mavlink.transport.codec import Message

COUNT_PERIOD, COUNT_TRIES = 1.0, 5  # [s], only until the first request
INACTIVITY = 10.0  # [s] without a request; the whole transfer has no limit
CONFIRM = 1.5  # [s] for the final ACK, which a radio may lose
GRACE = 2.0  # [s] after an ERROR, in which requests may go on
ERROR_BACKOFF = (5.0, 8.0)  # [s] drawn between
DENIED_BACKOFF = (8.0, 12.0)  # [s] the other ground station has to end first
SUPERSEDED = 'overtaken by what was flown meanwhile, or by a newer list'
_TRIES = 3  # uploads of one mission until it is given up


class UploadState(Enum):
    """Where an upload stands."""

    IDLE = 'idle'
    COUNTING = 'counting'
    SENDING = 'sending'
    CONFIRMING = 'confirming'
    GRACE = 'grace'
    BACKOFF = 'backoff'
    DRAINING = 'draining'
    READING = 'reading'


class UploadEvent(Enum):
    """What moves an upload."""

    START = 'start'
    REQUEST = 'request'  # of any item but the last
    LAST = 'request of the last item'
    STALE = 'request beyond the end'
    ACCEPTED = 'ACK accepted, all sent'
    EARLY = 'ACK accepted too early'
    ERROR = 'ACK error'
    DENIED = 'ACK denied'
    CANCELLED = 'ACK cancelled'
    REFUSED = 'ACK refused for good'
    TIMEOUT = 'time is up'
    EXHAUSTED = 'no tries left'
    MATCH = 'readback alike'
    MISMATCH = 'readback differs'
    UNREAD = 'no readback'


_S, _E = UploadState, UploadEvent
_WHILE_OPEN = {_E.REQUEST: _S.SENDING, _E.LAST: _S.CONFIRMING, _E.STALE: _S.DRAINING,
               _E.ACCEPTED: _S.READING, _E.EARLY: _S.CONFIRMING, _E.ERROR: _S.GRACE,
               _E.DENIED: _S.BACKOFF, _E.CANCELLED: _S.COUNTING, _E.REFUSED: _S.IDLE,
               _E.EXHAUSTED: _S.IDLE}
# An event that a state does not list is ignored there.
TRANSITIONS: dict[UploadState, dict[UploadEvent, UploadState]] = {
    _S.IDLE: {_E.START: _S.COUNTING},
    _S.COUNTING: {**_WHILE_OPEN, _E.TIMEOUT: _S.COUNTING},
    _S.SENDING: {**_WHILE_OPEN, _E.TIMEOUT: _S.READING},
    _S.CONFIRMING: {**_WHILE_OPEN, _E.TIMEOUT: _S.READING},
    _S.GRACE: {**_WHILE_OPEN, _E.ERROR: _S.GRACE, _E.TIMEOUT: _S.BACKOFF},
    _S.BACKOFF: {_E.START: _S.BACKOFF, _E.REQUEST: _S.SENDING, _E.LAST: _S.CONFIRMING,
                _E.ACCEPTED: _S.READING, _E.TIMEOUT: _S.COUNTING, _E.EXHAUSTED: _S.IDLE},
    _S.DRAINING: {_E.START: _S.DRAINING, _E.CANCELLED: _S.COUNTING, _E.TIMEOUT: _S.COUNTING,
                 _E.EXHAUSTED: _S.IDLE},
    _S.READING: {_E.REQUEST: _S.SENDING, _E.LAST: _S.CONFIRMING, _E.MATCH: _S.IDLE,
                _E.MISMATCH: _S.COUNTING, _E.UNREAD: _S.IDLE, _E.EXHAUSTED: _S.IDLE},
}
# What an ACK means; all others are permanent: the mission is never sent again unchanged.
ACKS = {wire.ACCEPTED: _E.ACCEPTED, wire.ERROR: _E.ERROR, wire.INVALID_SEQUENCE: None,
        wire.DENIED: _E.DENIED, wire.CANCELLED: _E.CANCELLED}


class Upload:
    """Brings the latest mission on board, one transfer at a time."""

    def __init__(self, peer: Peer, *, idle_after: float, rng: random.Random) -> None:
        self._peer, self._idle_after, self._rng = peer, idle_after, rng
        self.state = UploadState.IDLE
        self.events: deque[Outcome] = deque()
        self.uploads = 0  # begun so far
        self.is_superseded: Callable[[], bool] = lambda: False  # nobody wants it any more as it is
        self._out: list[Message] = []
        self._pending: Mission | None = None
        self._wants_read = False
        self._mission: Mission | None = None  # None while only reading
        self._readback: Download | None = None
        self._tries = self._counts = 0
        self._due = 0.0
        self._asked: int | None = None
        self._sent_last = self._accepted = False
        self._read_twice = False  # accepted, and then nothing was on board
        self._sent_once = False  # the last item of this mission, in this try or one before

    @property
    def busy(self) -> bool:
        return self.state is not UploadState.IDLE

    @property
    def sent_all(self) -> bool:
        """The last item was sent: the vehicle may have taken the mission."""
        return self._mission is not None and self.busy and self._sent_last

    @property
    def may_be_stored(self) -> bool:
        """The last item was sent, in this try or in one before: it may come late."""
        return self._mission is not None and self.busy and self._sent_once

    @property
    def progress(self) -> tuple[int, int, int]:
        """Items sent, items read back, and items of the mission; all 0 where none is uploaded."""
        if self._mission is None or not self.busy:
            return 0, 0, 0
        count = len(self._mission.items)
        if self.state is UploadState.READING and self._readback is not None:
            return count, min(count, len(self._readback.items)), count
        return 0 if self._asked is None else self._asked + 1, 0, count

    def replace(self, mission: Mission, now: float) -> list[Message]:
        """Upload this; a transfer that runs ends first, and of many only the latest follows."""
        self._pending = mission
        self._begin(now)
        return self._flush()

    def read(self, now: float) -> list[Message]:
        """Read what is on board, after whatever runs."""
        self._wants_read = True
        self._begin(now)
        return self._flush()

    def cancel(self, now: float) -> list[Message]:
        """Tell an atomic vehicle to keep what it has; a new try follows if it is still wanted."""
        self._go(UploadEvent.STALE, now)
        return self._flush()

    def reset(self) -> None:
        """Forget a transfer that the vehicle forgot as well: it was restarted."""
        self.state, self._mission, self._pending, self._readback = (
            UploadState.IDLE,
            None,
            None,
            None,
        )
        self._wants_read = False

    def receive(self, message: Message, now: float) -> list[Message]:
        """Take a message of the vehicle; those for others are ignored."""
        if self._peer.is_from_vehicle(message):
            kind = message.get_type()
            if kind in ('MISSION_REQUEST', 'MISSION_REQUEST_INT'):
                self._request(message.seq, now)
            elif kind == 'MISSION_ACK':
                self._ack(message.type, now)
            elif self.state is UploadState.READING and self._readback:
                self._out += self._readback.receive(message, now)
                self._judge(now)
        return self._flush()

    def step(self, now: float) -> list[Message]:
        """Let time pass."""
        if self.state is UploadState.READING and self._readback:
            self._out += self._readback.step(now)
            self._judge(now)
        elif self.busy and now >= self._due:
            self._go(UploadEvent.TIMEOUT, now)
        return self._flush()

    def _flush(self) -> list[Message]:
        out, self._out = self._out, []
        return out

    def _begin(self, now: float) -> None:
        if self.state in (UploadState.BACKOFF, UploadState.DRAINING) and self._pending:
            self._mission, self._pending = self._pending, None  # nothing runs: nothing to abort
            self._tries, self._sent_once = 0, False
        elif self.state is UploadState.IDLE and self._pending:
            self._mission, self._pending = self._pending, None
            self._tries, self._sent_once = 0, False
            self._go(UploadEvent.START, now)
        elif self.state is UploadState.IDLE and self._wants_read:
            self._mission, self._wants_read = None, False
            self._enter(UploadState.READING, now)

    def _request(self, seq: int, now: float) -> None:
        mission = self._mission
        if mission is None or self.state in (UploadState.IDLE, UploadState.DRAINING) or (
                self.state is UploadState.READING and self._accepted):
            return
        if seq >= len(mission.items):
            self._go(UploadEvent.STALE, now)
            return
        last = seq == len(mission.items) - 1
        self._asked = seq
        self._sent_last = self._sent_last or last
        self._sent_once = self._sent_once or last
        self._out.append(self._peer.item(
            seq, mission.items[seq], mission.flag_start and seq == mission.start))
        self._go(UploadEvent.LAST if last else UploadEvent.REQUEST, now)

    def _ack(self, result: int, now: float) -> None:
        event = ACKS.get(result, UploadEvent.REFUSED)
        if self._mission is None or event is None:
            return
        if event is UploadEvent.ACCEPTED and not self._sent_last:
            event = UploadEvent.EARLY
        if event is UploadEvent.REFUSED and event in TRANSITIONS[self.state]:
            self._fail(f'refused with MAV_MISSION_RESULT {result}', result, self._asked)
        if event is UploadEvent.ACCEPTED and event in TRANSITIONS[self.state]:
            self._accepted = True
            self.events.append(Accepted(self._mission))
        self._go(event, now)

    def _go(self, event: UploadEvent, now: float) -> None:
        new = TRANSITIONS[self.state].get(event)
        if new is None:
            return
        again = new is UploadState.COUNTING and event is not UploadEvent.TIMEOUT
        if (
            self.state in (UploadState.BACKOFF, UploadState.DRAINING)
            and new is UploadState.COUNTING
        ):
            again = True
        if again and self._tries >= _TRIES:
            self._fail(f'given up after {_TRIES} tries, at last: {event.value}')
            new = UploadState.IDLE
        elif again and self._tries and self.is_superseded():
            self._fail(SUPERSEDED)
            new = UploadState.IDLE
        elif again:
            self._tries += 1
            self._counts = 0
        self._enter(new, now, event)

    def _enter(self, new: UploadState, now: float, event: UploadEvent = UploadEvent.START) -> None:
        self.state = new
        if new is UploadState.COUNTING:
            self._count(now)
        elif new is UploadState.READING:
            self._readback = Download(self._peer, now)
            self._out.append(self._readback.first)
        elif new is UploadState.DRAINING and event is UploadEvent.STALE:
            self._out.append(self._peer.ack(wire.CANCELLED))
        elif new is UploadState.IDLE:
            self._begin(now)
            return
        self._due = now + self._limit(new, event)

    def _limit(self, state: UploadState, event: UploadEvent) -> float:
        if state is UploadState.BACKOFF:
            span = DENIED_BACKOFF if event is UploadEvent.DENIED else ERROR_BACKOFF
            return self._rng.uniform(*span)
        return {
            UploadState.COUNTING: COUNT_PERIOD,
            UploadState.SENDING: INACTIVITY,
            UploadState.GRACE: GRACE,
            UploadState.CONFIRMING: CONFIRM,
            UploadState.DRAINING: self._idle_after,
        }.get(state, 0.0)

    def _count(self, now: float) -> None:
        assert self._mission is not None
        if self._counts >= COUNT_TRIES:
            self._fail(f'no answer to {COUNT_TRIES} MISSION_COUNT')
            self._go(UploadEvent.EXHAUSTED, now)
            return
        if self._counts == 0:
            self.uploads += 1
            self._sent_last = self._accepted = self._read_twice = False
            self._asked = None
        self._counts += 1
        self._out.append(self._peer.count(len(self._mission.items)))

    def _judge(self, now: float) -> None:
        assert self._readback is not None
        state, held = self._readback.state, tuple(self._readback.items)
        if state not in (DownloadState.DONE, DownloadState.FAILED):
            return
        done = state is DownloadState.DONE
        self._readback = None
        if self._mission is None:
            self.events.append(Downloaded(held if done else None))
            self._enter(UploadState.IDLE, now)
        elif done and self._alike(held, self._mission):
            self.events.append(Verified(self._mission))
            self._go(UploadEvent.MATCH, now)
        elif done and self._accepted and len(held) <= self._mission.own and not self._read_twice:
            self._read_twice = True  # the answer may be late, to a request before the upload
            self._enter(UploadState.READING, now)
        elif done and self._accepted and len(held) <= self._mission.own:
            self._fail('accepted, and then no mission is on board: infeasible')
            self._go(UploadEvent.UNREAD, now)
        elif done:
            self._go(UploadEvent.MISMATCH, now)
        else:
            self._fail('the mission could not be read back')
            self._go(UploadEvent.UNREAD, now)

    @staticmethod
    def _alike(held: Sequence[Item], mission: Mission) -> bool:
        return (len(held) == len(mission.items)
                and all_alike(mission.items[mission.own:], held[mission.own:]))

    def _fail(self, reason: str, result: int | None = None, seq: int | None = None) -> None:
        assert self._mission is not None
        self.events.append(Failed(self._mission, reason, result, seq))
