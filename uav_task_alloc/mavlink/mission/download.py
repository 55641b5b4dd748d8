# SPDX-License-Identifier: Apache-2.0
"""Mission download as a state machine: messages and time in, messages and items out."""
from __future__ import annotations

from enum import Enum

from pymavlink.dialects.v20 import ardupilotmega as dialect

from uav_task_alloc.mavlink.mission.items import Item
from uav_task_alloc.mavlink.mission.peer import Peer, received_item
from uav_task_alloc.mavlink.transport.codec import Message

_PERIOD = 1.0  # [s] until a request is repeated
_RELIST_AFTER = 4  # unanswered requests for one item: PX4 may have ended the transfer
_MAX_RELISTS = 3  # MISSION_REQUEST_LIST sent again after that
_TRIES = 12  # of one request; ArduPilot denies a list for 8 s after a broken upload


class DownloadState(Enum):
    """State of a mission download."""

    LISTING = 'listing'
    GETTING = 'getting'
    DONE = 'done'
    FAILED = 'failed'


class Download:
    """One download of the whole mission; send `first` to begin it.

    Protocol: https://mavlink.io/en/services/mission.html#download_mission

    Args:
        peer: the vehicle.
        now: steady time [s].
    """

    def __init__(self, peer: Peer, now: float) -> None:
        self._peer = peer
        self.state = DownloadState.LISTING
        self.items: list[Item] = []
        self._count = 0
        self._tries, self._due = 1, now + _PERIOD
        self._relists = 0

    @property
    def first(self) -> Message:
        """MISSION_REQUEST_LIST."""
        return self._peer.request_list()

    def receive(self, message: Message, now: float) -> list[Message]:
        """Handle MISSION_COUNT and MISSION_ITEM(_INT); other messages are ignored.

        Returns:
            Messages to send.
        """
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
        """Repeat the request that is due, or give up; returns the messages to send."""
        if self.state not in (DownloadState.LISTING, DownloadState.GETTING) or now < self._due:
            return []
        if self._tries >= _TRIES:
            self.state = DownloadState.FAILED
            return []
        if (self.state is DownloadState.GETTING and self._tries >= _RELIST_AFTER
                and self._relists < _MAX_RELISTS):
            self.state, self._tries = DownloadState.LISTING, 0
            self._relists += 1
            self.items.clear()
        self._tries += 1
        self._due = now + _PERIOD
        return [self.first if self.state is DownloadState.LISTING
                else self._peer.request(len(self.items))]

    def _next(self, now: float) -> list[Message]:
        if len(self.items) == self._count:
            self.state = DownloadState.DONE
            return [self._peer.ack(dialect.MAV_MISSION_ACCEPTED)]
        self._tries, self._due = 1, now + _PERIOD
        return [self._peer.request(len(self.items))]
