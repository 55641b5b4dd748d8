# SPDX-License-Identifier: Apache-2.0
"""Reading a mission back as a state machine: messages and time in, messages and items out."""
from __future__ import annotations

from enum import Enum

from uav_task_alloc.mavlink.mission.items import Item
from uav_task_alloc.mavlink.mission.peer import ACCEPTED, Peer, received_item
from uav_task_alloc.mavlink.transport.codec import Message

_PERIOD = 1.0  # [s] until a request is repeated
_RELIST_AFTER, _MAX_RELISTS = 4, 3  # requests of one item: PX4 may have ended the transfer; then list again
_TRIES = 12  # of one request; ArduPilot denies a list for 8 s after a broken upload


class DownloadState(Enum):
    """Where a readback stands."""

    LISTING = 'listing'
    GETTING = 'getting'
    DONE = 'done'
    FAILED = 'failed'


class Download:
    """One reading of the whole mission, started when made; `first` is its first message."""

    def __init__(self, peer: Peer, now: float) -> None:
        self._peer = peer
        self.state = DownloadState.LISTING
        self.items: list[Item] = []
        self._count = 0
        self._tries, self._due = 1, now + _PERIOD
        self._again = 0  # listings begun again

    @property
    def first(self) -> Message:
        return self._peer.request_list()

    def receive(self, message: Message, now: float) -> list[Message]:
        """Take a COUNT or an item; anything else is not for us."""
        kind = message.get_type()
        if kind == 'MISSION_COUNT' and self.state is DownloadState.LISTING:
            self._count = message.count
            self.state = DownloadState.GETTING
            return self._next(now)
        if (kind in ('MISSION_ITEM_INT', 'MISSION_ITEM') and self.state is DownloadState.GETTING
                and message.seq == len(self.items)):
            self.items.append(received_item(message))
            return self._next(now)
        return []

    def step(self, now: float) -> list[Message]:
        """Repeat the request that is due, or give up."""
        if self.state not in (DownloadState.LISTING, DownloadState.GETTING) or now < self._due:
            return []
        if self._tries >= _TRIES:
            self.state = DownloadState.FAILED
            return []
        if (self.state is DownloadState.GETTING and self._tries >= _RELIST_AFTER
                and self._again < _MAX_RELISTS):
            self.state, self._tries, self._again = DownloadState.LISTING, 0, self._again + 1
            self.items.clear()
        self._tries += 1
        self._due = now + _PERIOD
        return [self.first if self.state is DownloadState.LISTING
                else self._peer.request(len(self.items))]

    def _next(self, now: float) -> list[Message]:
        if len(self.items) == self._count:
            self.state = DownloadState.DONE
            return [self._peer.ack(ACCEPTED)]
        self._tries, self._due = 1, now + _PERIOD
        return [self._peer.request(len(self.items))]
