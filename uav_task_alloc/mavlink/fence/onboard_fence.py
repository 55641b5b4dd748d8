# SPDX-License-Identifier: Apache-2.0
"""The fence on board of one vehicle compared with the wanted one: transfers and state; no socket.

A fence that no upload of the bridge explains is of another station: it is never replaced.
"""
from __future__ import annotations

import random
from collections.abc import Callable, Iterable, Sequence
from enum import Enum

from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.mavlink.fence.shapes import fences_alike
from uav_task_alloc.mavlink.mission.horizon import SPACE_TEXT
from uav_task_alloc.mavlink.mission.items import Item
from uav_task_alloc.mavlink.mission.outcomes import Downloaded, Failed, Mission, Verified
from uav_task_alloc.mavlink.mission.peer import Peer
from uav_task_alloc.mavlink.mission.upload import Upload
from uav_task_alloc.mavlink.mission.upload_states import UploadState
from uav_task_alloc.mavlink.transport.codec import Message

ItemKey = tuple[int, float, int, int]  # command, p1, x, y
_CLEARED = 1.5  # [s] for the ACK of MISSION_CLEAR_ALL
_RETRY = (5.0, 60.0)  # [s] after a failure, doubled up to the second
_RECHECK = 60.0  # [s] after which a fence is read again: another station may have changed it
_AFTER_READ = 0.5  # [s] PX4 refuses an upload that overtakes the end of the readback
_REFIT = 1.5  # [s] in which a smaller fence is chosen
_LEAST_BUDGET = 3  # points
_INVALID = 'Geofence invalid'  # PX4 stores such a fence and does not enforce it
_PAUSED = frozenset({UploadState.BACKOFF, UploadState.DRAINING})


class FenceState(Enum):
    """State of the fence on board; the values are those of UavState.fence_state."""

    UNKNOWN = 0
    UPLOADING = 1
    VERIFIED = 2
    MIXED = 3
    FOREIGN = 4
    OFF = 5
    UNSUPPORTED = 6
    REFUSED = 7


def item_key(item: Item) -> ItemKey:
    """What identifies a fence item over an upload and a readback."""
    return item.command, round(item.params[0], 2), item.x, item.y


class OnboardFence:
    """The fence of one vehicle.

    Args:
        peer: the vehicle, with the mission type of fences or rally points.
        idle_after: returns the time [s] after which it has given up a transfer.
        rng: draws back-off times.
        budget: points of its store, as far as known.
        own: items of earlier uploads of the bridge.
        remember: called with all items of the bridge that may be on board, before an upload.
        same: whether items read back are those sent.

    Arguments of methods:
        now: steady time [s].
        may_upload: whether the authority and the flight allow an upload.
        message: of the vehicle.
    """

    def __init__(self, peer: Peer, idle_after: Callable[[], float], rng: random.Random,
                 budget: int, own: Iterable[ItemKey] = (),
                 remember: Callable[[frozenset[ItemKey]], None] = lambda own: None,
                 same: Callable[[Sequence[Item], Sequence[Item]], bool] = fences_alike) -> None:
        self._peer, self._remember, self._own = peer, remember, frozenset(own)
        self._same = same
        self.upload = Upload(peer, idle_after=idle_after, rng=rng, same=same)
        self.budget = budget
        self.wanted: tuple[Item, ...] | None = None  # None: not known yet
        self.held: tuple[Item, ...] | None = None  # on board; None: not known
        self.possible: tuple[tuple[Item, ...], ...] = ()  # fences of which one is on board
        self.reason = ''  # of the last failure or refusal; '': none
        self.reset()

    def reset(self) -> None:
        """Start over after a restart of the vehicle."""
        self.upload.reset()
        self.held, self.reason, self.unsupported = None, '', False
        self.rejected = False  # stored, but the vehicle says that it is not enforced
        self._clearing_until: float | None = None
        self._due = self._checked_at = -1e9  # [s]
        self._failures = 0
        self._no_space = False  # the last upload was refused for it

    @property
    def busy(self) -> bool:
        """Whether a transfer is under way."""
        return self.upload.busy or self._clearing_until is not None

    @property
    def failures(self) -> int:
        """Transfers in a row that failed."""
        return self._failures

    @property
    def is_own(self) -> bool:
        """Whether what is on board is of the bridge, or nothing."""
        return self.held is not None and (
            self._is_wanted or all(item_key(item) in self._own for item in self.held))

    @property
    def _is_wanted(self) -> bool:
        return (self.held is not None and self.wanted is not None
                and self._same(self.wanted, self.held))

    @property
    def state(self) -> FenceState:
        """The state as published."""
        if self.unsupported:
            return FenceState.UNSUPPORTED
        if (self.upload.busy and self.upload.progress[2]) or self._clearing_until is not None:
            return FenceState.UPLOADING
        if self.held is None or self.wanted is None:
            return FenceState.REFUSED if self.reason else FenceState.UNKNOWN
        if not self.is_own:
            return FenceState.FOREIGN
        if self._is_wanted:
            return FenceState.REFUSED if self.rejected else FenceState.VERIFIED
        return FenceState.REFUSED if self.reason else FenceState.MIXED

    def begin(self, now: float, may_upload: bool) -> list[Message]:
        """Begin the transfer that is due, if any; only while no other transfer runs."""
        if self.busy or self.unsupported or now < self._due:
            return []
        if self.held is None or (now - self._checked_at >= _RECHECK):
            return self._read(now)
        if not may_upload or self.wanted is None or not self.is_own:
            return []
        if self._is_wanted and not self.rejected:
            return []
        if self.held and (self.rejected or not self.wanted):
            self._clearing_until = now + _CLEARED
            return [self._peer.clear()]
        if not self.wanted:
            return []
        self._own = frozenset(map(item_key, (*self.held, *self.wanted)))
        self._remember(self._own)
        self.possible = (self.held, self.wanted)
        self._no_space, self.reason, self.rejected = False, '', False
        return self.upload.replace(Mission(self.wanted), now)

    def cancel(self) -> list[Message]:
        """End a transfer, as a mission has to be transferred."""
        if not self.busy:
            return []
        if self.state is FenceState.UPLOADING:
            self.held = self._clearing_until = None
        self.upload.reset()
        return [self._peer.ack(d.MAV_MISSION_OPERATION_CANCELLED)]

    def receive(self, message: Message, now: float) -> list[Message]:
        """Process a message of the vehicle; returns messages to send."""
        kind = message.get_type()
        if kind == 'STATUSTEXT':
            self._note(str(message.text), now)
            return []
        if not kind.startswith('MISSION_') or not self._peer.is_from_vehicle(message) or (
                not hasattr(message, 'mission_type')):
            return []
        if kind == 'MISSION_ACK' and self._clearing_until is not None:
            return self._cleared(now)
        if (kind == 'MISSION_ACK' and self.upload.state is UploadState.READING
                and message.type == d.MAV_MISSION_UNSUPPORTED):
            self.upload.reset()
            self.unsupported = True
            return []
        out = self.upload.receive(message, now)
        self._settle(now)
        return out

    def step(self, now: float) -> list[Message]:
        """Advance time; returns messages to send."""
        if self._clearing_until is not None:
            return self._cleared(now) if now >= self._clearing_until else []
        out = self.upload.step(now)
        if self.upload.state in _PAUSED:  # meanwhile a mission may be transferred
            held = None if self.upload.progress[0] else self.held  # no item was sent
            self.upload.reset()
            self._fail('the vehicle refuses it for now', now)
            self.held = held
        self._settle(now)
        return out

    def _read(self, now: float) -> list[Message]:
        self._checked_at = now
        return self.upload.read(now)

    def _cleared(self, now: float) -> list[Message]:
        self._clearing_until, self.rejected = None, False
        self._due = now + _CLEARED  # it may have refused
        return self._read(now)

    def _note(self, text: str, now: float) -> None:
        space = SPACE_TEXT.search(text)
        if space and now < self._due and self._no_space:  # it follows the refusal
            self.budget = max(_LEAST_BUDGET, int(space[1]))
            self.reason = f'the store holds at most {self.budget} points'
        if text.startswith(_INVALID) and self._peer.mission_type == d.MAV_MISSION_TYPE_FENCE:
            self.rejected, self.reason, self._due = True, text, now + _RETRY[0]

    def _settle(self, now: float) -> None:
        while self.upload.events:
            event = self.upload.events.popleft()
            if isinstance(event, Verified):
                self._hold(event.mission.items, now)
            elif isinstance(event, Downloaded) and event.items is not None:
                self._hold(event.items, now)
                self._due = max(self._due, now + _AFTER_READ)
            elif isinstance(event, Downloaded):
                self._fail('it cannot be read back', now)
            elif isinstance(event, Failed):
                self._on_failure(event, now)

    def _hold(self, items: tuple[Item, ...], now: float) -> None:
        self.held, self._checked_at, self.possible = items, now, (items,)
        if self._is_wanted:
            self._failures = 0
            self.reason = self.reason if self.rejected else ''
            own = frozenset(map(item_key, items))
            if own != self._own:
                self._own = own
                self._remember(own)

    def _on_failure(self, event: Failed, now: float) -> None:
        if event.result in (d.MAV_MISSION_UNSUPPORTED,):
            self.unsupported = True
        elif event.result == d.MAV_MISSION_NO_SPACE:
            sent = len(event.mission.items)
            self.budget, self._no_space = max(_LEAST_BUDGET, 3 * sent // 4), True
            self.reason, self.held = f'the store holds at most {self.budget} points', None
            self._due = now + _REFIT
        else:
            self._fail(event.reason, now)

    def _fail(self, reason: str, now: float) -> None:
        """Retry later; what is on board is read before."""
        self.reason, self.held = reason, None
        self._due = now + min(_RETRY[1], _RETRY[0] * 2.0**self._failures)
        self._failures += 1
