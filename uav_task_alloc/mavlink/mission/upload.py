# SPDX-License-Identifier: Apache-2.0
"""Mission upload as a state machine: messages and time in, messages and events out; no socket.

One object for each (link, system, mission type). Every upload ends with a readback, which decides.
"""
from __future__ import annotations

import math
import random
from collections import deque
from collections.abc import Callable, Sequence

from pymavlink.dialects.v20 import ardupilotmega as dialect

from uav_task_alloc.mavlink.mission.download import Download, DownloadState
from uav_task_alloc.mavlink.mission.items import Item, all_alike
from uav_task_alloc.mavlink.mission.outcomes import (
    Accepted,
    Downloaded,
    Failed,
    Mission,
    Outcome,
    Verified,
)
from uav_task_alloc.mavlink.mission.peer import Peer
from uav_task_alloc.mavlink.mission.upload_states import (
    ACKS,
    TRANSITIONS,
    UploadEvent,
    UploadState,
)
from uav_task_alloc.mavlink.transport.codec import Message

COUNT_PERIOD, COUNT_TRIES = 1.0, 5  # [s], only until the first request
INACTIVITY = 10.0  # [s] without a request; the whole transfer has no limit
CONFIRM = 1.5  # [s] for the final ACK, which a link may lose
GRACE = 2.0  # [s] after an ERROR, in which requests may go on
READ_DELAY = 3.0  # [s] at most until a readback begins, which another command has to precede
ERROR_BACKOFF = (5.0, 8.0)  # [s] drawn between
DENIED_BACKOFF = (8.0, 12.0)  # [s] drawn between; another ground station is uploading
SUPERSEDED = 'superseded by tasks completed meanwhile or by a newer list'
_TRIES = 3  # uploads of one mission until it is given up
_LATE = 4  # empty readbacks that may be answers to requests sent before the upload


class Upload:
    """Uploads the latest mission to one vehicle, one transfer at a time.

    Every method that returns messages returns those to send to the vehicle. Outcomes are appended
    to `events`. Protocol: https://mavlink.io/en/services/mission.html#uploading_mission

    Args:
        peer: the vehicle.
        idle_after: returns the time [s] after which the vehicle has given up a transfer.
        rng: draws the back-off times.
        same: whether items read back are those sent.
        error_when_closed: ERROR after the last item may be the answer to a late copy of an item,
            sent while no transfer is open, so that the mission may be stored (ArduPilot).

    Arguments of methods:
        mission: to be on board.
        message: from any sender.
        now: steady time [s].
    """

    def __init__(self, peer: Peer, *, idle_after: Callable[[], float], rng: random.Random,
                 same: Callable[[Sequence[Item], Sequence[Item]], bool] = all_alike,
                 error_when_closed: bool = False) -> None:
        self._peer, self._idle_after, self._rng, self._same = peer, idle_after, rng, same
        self._error_when_closed = error_when_closed
        self.state = UploadState.IDLE
        self.events: deque[Outcome] = deque()
        self.uploads = 0  # started so far
        self.is_superseded: Callable[[], bool] = lambda: False  # it would not be retried unchanged
        self.may_retry: Callable[[], bool] = lambda: True  # else it ends as a superseded one
        self.may_end: Callable[[], bool] = lambda: True  # its last item may be sent
        self.may_read: Callable[[], bool] = lambda: True  # its readback may begin
        # called with items read back that are not those accepted, and the time [s]
        self.on_difference: Callable[[tuple[Item, ...], float], object] = lambda held, now: None
        self._out: list[Message] = []
        self._pending: Mission | None = None
        self._read_pending = False
        self._mission: Mission | None = None  # None while only reading
        self._readback: Download | None = None
        self._read_by = 0.0  # [s] begin of the readback at the latest
        self._tries = self._counts = 0
        self._due = 0.0
        self._requested: int | None = None
        self._sent_last = self._accepted = False
        self._empty = 0  # readbacks that were empty, though it was accepted
        self._was_empty = False  # so they were in the try before
        self._sent_once = False  # the last item of this mission, in this try or an earlier one
        self.sent_before = False  # the last item, in an earlier try: it may fly that mission
        self._read_at = -math.inf  # [s] end of a readback; it may not know that (ACK lost)

    @property
    def busy(self) -> bool:
        """Whether a transfer is under way."""
        return self.state is not UploadState.IDLE

    @property
    def sent_all(self) -> bool:
        """Whether the last item was sent in this try: the vehicle may have stored the mission."""
        return self._mission is not None and self.busy and self._sent_last

    @property
    def may_be_stored(self) -> bool:
        """Whether the last item was sent in this try or an earlier one, and may arrive late."""
        return self._mission is not None and self.busy and self._sent_once

    @property
    def progress(self) -> tuple[int, int, int]:
        """Items sent, items read back, and items of the mission; all 0 where none is uploaded."""
        if self._mission is None or not self.busy:
            return 0, 0, 0
        count = len(self._mission.items)
        if self.state is UploadState.READING and self._readback is not None:
            return count, min(count, len(self._readback.items)), count
        return 0 if self._requested is None else self._requested + 1, 0, count

    def replace(self, mission: Mission, now: float) -> list[Message]:
        """Upload a mission after the running transfer; of several waiting only the latest is."""
        self._pending = mission
        self._begin(now)
        return self._flush()

    def read(self, now: float) -> list[Message]:
        """Download the mission on board after the running transfer."""
        self._read_pending = True
        self._begin(now)
        return self._flush()

    def cancel(self, now: float) -> list[Message]:
        """Cancel the transfer, after which an atomic vehicle keeps its mission; then retry."""
        self._go(UploadEvent.STALE, now)
        return self._flush()

    def reset(self) -> None:
        """Drop everything after a reboot of the vehicle, which has dropped its transfer too."""
        self.state = UploadState.IDLE
        self._mission = self._pending = self._readback = None
        self._read_pending = False

    def receive(self, message: Message, now: float) -> list[Message]:
        """Handle a message; those not from this vehicle to us are ignored."""
        if self._peer.is_from_vehicle(message):
            kind = message.get_type()
            if kind in ('MISSION_REQUEST', 'MISSION_REQUEST_INT'):
                self._request(message.seq, now)
            elif kind == 'MISSION_ACK':
                self._ack(message.type, now)
            if self.state is UploadState.READING and self._readback:
                self._out += self._readback.receive(message, now)
                self._judge_readback(now)
        return self._flush()

    def step(self, now: float) -> list[Message]:
        """Retry and time out as of `now` [s]."""
        if self.state is UploadState.READING and self._readback:
            self._out += self._readback.step(now)
            self._judge_readback(now)
        elif self.state is UploadState.READING:
            return self.begin_readback(now)
        elif self.busy and now >= self._due:
            unsure = (self.state is UploadState.GRACE and self._sent_last
                      and self._error_when_closed)
            self._go(UploadEvent.UNSURE if unsure else UploadEvent.TIMEOUT, now)
        return self._flush()

    def begin_readback(self, now: float) -> list[Message]:
        """Begin a readback that had to wait, if it may begin now, or has waited for long."""
        if self.state is UploadState.READING and self._readback is None and (
                self.may_read() or now >= self._read_by):
            self._start_readback(now)
        return self._flush()

    def _flush(self) -> list[Message]:
        out, self._out = self._out, []
        return out

    def _begin(self, now: float) -> None:
        if self.state in (UploadState.BACKOFF, UploadState.DRAINING) and self._pending:
            self._mission, self._pending = self._pending, None  # nothing runs: nothing to abort
            self._tries, self._sent_once, self.sent_before = 0, False, False
            self._was_empty = False
        elif self.state is UploadState.IDLE and self._pending:
            self._mission, self._pending = self._pending, None
            self._tries, self._sent_once, self.sent_before = 0, False, False
            self._was_empty = False
            self._go(UploadEvent.START, now)
        elif self.state is UploadState.IDLE and self._read_pending:
            self._mission, self._read_pending = None, False
            self._enter(UploadState.READING, now)

    def _request(self, seq: int, now: float) -> None:
        mission = self._mission
        if mission is None or self.state in (UploadState.IDLE, UploadState.DRAINING) or (
                self.state is UploadState.READING and self._accepted):
            return
        if seq >= len(mission.items):
            self._go(UploadEvent.STALE, now)
            return
        self._read_at = -math.inf
        last = seq == len(mission.items) - 1
        if last and not self._sent_once and not self.may_end():
            self._go(UploadEvent.STALE, now)
            return
        self._requested = seq
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
            self._fail(f'refused with MAV_MISSION_RESULT {result}', result, self._requested)
        if event is UploadEvent.ACCEPTED and event in TRANSITIONS[self.state]:
            self._accepted = True
            self.events.append(Accepted(self._mission))
        self._go(event, now)

    def _go(self, event: UploadEvent, now: float) -> None:
        new = TRANSITIONS[self.state].get(event)
        if new is None:
            return
        retries = new is UploadState.COUNTING and (
            event is not UploadEvent.TIMEOUT
            or self.state in (UploadState.BACKOFF, UploadState.DRAINING))
        if retries and self._tries >= _TRIES:
            self._fail(f'given up after {_TRIES} tries; last event: {event.value}')
            new = UploadState.IDLE
        elif retries and ((self._tries and self.is_superseded()) or (
                event is not UploadEvent.START and not self.may_retry())):
            self._fail(SUPERSEDED)
            new = UploadState.IDLE
        elif retries:
            self._tries += 1
            self._counts = 0
        self._enter(new, now, event)

    def _enter(self, new: UploadState, now: float, event: UploadEvent = UploadEvent.START) -> None:
        self.state = new
        if new is UploadState.COUNTING:
            self._count(now)
        elif new is UploadState.READING:
            self._readback, self._read_by = None, now + READ_DELAY
            if self.may_read():
                self._start_readback(now)
        elif new is UploadState.DRAINING and event is UploadEvent.STALE:
            self._out.append(self._peer.ack(dialect.MAV_MISSION_OPERATION_CANCELLED))
        elif new is UploadState.IDLE:
            self._begin(now)
            return
        self._due = now + self._limit(new, event)

    def _start_readback(self, now: float) -> None:
        self._readback = Download(self._peer, now)
        self._out.append(self._readback.first)

    def _limit(self, state: UploadState, event: UploadEvent) -> float:
        if state is UploadState.BACKOFF:
            return self._rng.uniform(
                *(DENIED_BACKOFF if event is UploadEvent.DENIED else ERROR_BACKOFF))
        return {
            UploadState.COUNTING: COUNT_PERIOD,
            UploadState.SENDING: INACTIVITY,
            UploadState.GRACE: GRACE,
            UploadState.CONFIRMING: CONFIRM,
            UploadState.DRAINING: self._idle_after(),
        }.get(state, 0.0)

    def _count(self, now: float) -> None:
        assert self._mission is not None
        if self._counts >= COUNT_TRIES:
            self._fail(f'no answer to {COUNT_TRIES} MISSION_COUNT')
            self._go(UploadEvent.EXHAUSTED, now)
            return
        if self._counts == 0:
            self.uploads += 1
            self.sent_before = self._sent_once
            self._sent_last, self._accepted, self._empty = False, False, 0
            self._requested = None
        self._counts += 1
        if 0.0 < now - self._read_at < self._idle_after():
            # it may still be sending its mission, and would refuse (PX4)
            self._out.append(self._peer.ack(dialect.MAV_MISSION_ACCEPTED))
        self._out.append(self._peer.count(len(self._mission.items)))

    def _judge_readback(self, now: float) -> None:
        assert self._readback is not None
        state, held = self._readback.state, tuple(self._readback.items)
        if state not in (DownloadState.DONE, DownloadState.FAILED):
            return
        done = state is DownloadState.DONE
        self._readback = None
        self._read_at = now if done else -math.inf
        if self._mission is None:
            self.events.append(Downloaded(held if done else None))
            self._enter(UploadState.IDLE, now)
        elif done and self._alike(held, self._mission):
            self.events.append(Verified(self._mission))
            self._go(UploadEvent.MATCH, now)
        elif done and self._accepted and len(held) <= self._mission.own and self._empty < _LATE:
            self._empty += 1  # perhaps a late answer to a request sent before the upload
            self._enter(UploadState.READING, now)
        elif done and self._accepted and len(held) <= self._mission.own and not self._was_empty:
            self._was_empty = True  # perhaps another station has cleared it: once more
            self._go(UploadEvent.MISMATCH, now)
        elif done and self._accepted and len(held) <= self._mission.own:
            self._fail('accepted, but no mission is on board: infeasible')
            self._go(UploadEvent.UNREAD, now)
        elif done:
            if self._accepted:
                self.on_difference(held, now)
            self._go(UploadEvent.MISMATCH, now)
        else:
            self._fail('the mission could not be read back')
            self._go(UploadEvent.UNREAD, now)

    def _alike(self, held: Sequence[Item], mission: Mission) -> bool:
        return (len(held) == len(mission.items)
                and self._same(mission.items[mission.own:], held[mission.own:]))

    def _fail(self, reason: str, result: int | None = None, seq: int | None = None) -> None:
        assert self._mission is not None
        self.events.append(Failed(self._mission, reason, result, seq))
