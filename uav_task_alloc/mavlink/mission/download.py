# SPDX-License-Identifier: Apache-2.0
"""Mission download as a state machine: messages and time in, messages and items out."""
from __future__ import annotations

from enum import Enum

from pymavlink.dialects.v20 import ardupilotmega as dialect

from uav_task_alloc.mavlink.mission.items import Item
from uav_task_alloc.mavlink.mission.peer import Peer, received_item
from uav_task_alloc.mavlink.transport.codec import Message

_PERIOD = 1.0  # [s] until a request is repeated, at most
_LEAST_PERIOD = 0.4  # [s] the same, at least
_RELIST_AFTER = 4.0  # [s] without an answer for one item: PX4 may have ended the transfer
_MAX_RELISTS = 3  # MISSION_REQUEST_LIST sent again after that
# MISSION_REQUEST_LIST sent again after the vehicle has ended the transfer, as PX4 does at a
# request that a link has delayed by two items: long missions take many tries then
_MAX_ABORTS = 12
_PATIENCE = 12.0  # [s] for one answer; ArduPilot denies a list for 8 s after a broken upload


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
        self._period, self._tries = _PERIOD, 0
        self._asked_at = self._due = now
        self._relists = self._aborts = 0
        self._ask(now)

    @property
    def first(self) -> Message:
        """MISSION_REQUEST_LIST."""
        return self._peer.request_list()

    def receive(self, message: Message, now: float) -> list[Message]:
        """Handle MISSION_COUNT, MISSION_ITEM(_INT) and MISSION_ACK; others are ignored.

        Returns:
            Messages to send.
        """
        kind = message.get_type()
        if kind == 'MISSION_COUNT' and self.state is DownloadState.LISTING:
            self._count = message.count
            self._answered(now)
            self.state = DownloadState.GETTING
            return self._next(now)
        if (kind in ('MISSION_ITEM_INT', 'MISSION_ITEM') and self.state is DownloadState.GETTING
                and message.seq == len(self.items)):
            self.items.append(received_item(message))
            self._answered(now)
            return self._next(now)
        if (kind == 'MISSION_ACK' and message.type != dialect.MAV_MISSION_ACCEPTED
                and self.state is DownloadState.GETTING and self._aborts < _MAX_ABORTS):
            self._aborts += 1  # the vehicle answers no request any more
            self._relist(now)
            self._ask(now)
            return [self.first]
        return []

    def _relist(self, now: float) -> None:
        """Begin again with the number of items."""
        self.state, self._tries, self._asked_at = DownloadState.LISTING, 0, now
        self.items.clear()

    def step(self, now: float) -> list[Message]:
        """Repeat the request that is due, or give up; returns the messages to send."""
        if self.state not in (DownloadState.LISTING, DownloadState.GETTING) or now < self._due:
            return []
        waited = now - self._asked_at + 1e-9
        if waited >= _PATIENCE:
            self.state = DownloadState.FAILED
            return []
        if (self.state is DownloadState.GETTING and waited >= _RELIST_AFTER
                and self._relists < _MAX_RELISTS):
            self._relist(now)
            self._relists += 1
        self._ask(now)
        return [self.first if self.state is DownloadState.LISTING
                else self._peer.request(len(self.items))]

    def _next(self, now: float) -> list[Message]:
        if len(self.items) == self._count:
            self.state = DownloadState.DONE
            return [self._peer.ack(dialect.MAV_MISSION_ACCEPTED)]
        self._tries, self._asked_at = 0, now
        self._ask(now)
        return [self._peer.request(len(self.items))]

    def _ask(self, now: float) -> None:
        """Note that a request is sent."""
        self._tries += 1
        self._due = now + self._period

    def _answered(self, now: float) -> None:
        """Repeat the next requests after twice the time that an answer takes."""
        if self._tries == 1:
            self._period = min(_PERIOD, max(_LEAST_PERIOD, 2.0 * (now - self._asked_at)))
