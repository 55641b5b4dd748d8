# SPDX-License-Identifier: Apache-2.0
"""ArduPilot's upload of a fence or of rally points: a transfer of its own for each type."""
from __future__ import annotations

from collections.abc import Callable

from pymavlink.dialects.v20 import ardupilotmega as dialect

from uav_task_alloc.mavlink.transport.codec import Message
from uav_task_alloc.sim.flight import WARNING
from uav_task_alloc.sim.mission_server import RemoteIds
from uav_task_alloc.sim.stored_fence import FENCE_TYPE, complete_polygons, stored_geo_item
from uav_task_alloc.sim.stored_item import Refusal, StoredItem, from_message


class GeoUpload:
    """Receives one type; a fence is checked as a whole and replaced at the end.

    Args:
        mission_type: MAV_MISSION_TYPE.
        store: replaced at the end of an upload.
        capacity: items.
        out: messages to send are appended.
        stored: called with the type when the store has changed.

    Arguments of methods:
        message: of this type, to this vehicle.
        peer: its sender.
        now: [s].
    """

    retry, give_up = 1.0, 8.0  # [s] between requests for an item; without an item

    def __init__(self, mission_type: int, store: list[StoredItem], capacity: int,
                 out: list[Message], stored: Callable[[int], None]) -> None:
        self._type, self._store, self._capacity = mission_type, store, capacity
        self._out, self._stored = out, stored
        self.reboot()

    def reboot(self) -> None:
        """Drop the transfer."""
        self._peer: RemoteIds | None = None
        self._incoming: list[StoredItem] = []
        self._expected, self._received_at, self._requested_at = 0, 0.0, 0.0

    def receive(self, message: Message, peer: RemoteIds, now: float) -> bool:
        """Handle COUNT, ITEM_INT and CLEAR_ALL; whether the message was one of them."""
        kind = message.get_type()
        if kind == 'MISSION_COUNT':
            self._count(message, peer, now)
        elif kind == 'MISSION_ITEM_INT':
            self._item(message, peer, now)
        elif kind == 'MISSION_CLEAR_ALL' and self._peer is not None:
            self._ack(peer, dialect.MAV_MISSION_DENIED)
        elif kind == 'MISSION_CLEAR_ALL':
            self._replace([])
            self._ack(peer, dialect.MAV_MISSION_ACCEPTED)
        elif self._peer is not None and kind.startswith('MISSION_REQUEST'):
            self._ack(peer, dialect.MAV_MISSION_DENIED)
        else:
            return False
        return True

    def step(self, now: float) -> None:
        """Repeat a request, or give up."""
        if self._peer is None:
            return
        if now - self._received_at > self.give_up:
            self._ack(self._peer, dialect.MAV_MISSION_OPERATION_CANCELLED)
            self.reboot()
        elif now - self._requested_at > self.retry:
            self._ask(now)

    def _count(self, message: Message, peer: RemoteIds, now: float) -> None:
        if self._peer not in (None, peer):
            self._ack(peer, dialect.MAV_MISSION_DENIED)
        elif message.count > self._capacity:
            self._ack(peer, dialect.MAV_MISSION_NO_SPACE)
            self._out.append(dialect.MAVLink_statustext_message(
                WARNING, f'Only {self._capacity} items are supported'.encode()))
        elif message.count == 0:  # a fence is not truncated by this
            self._ack(peer, dialect.MAV_MISSION_ACCEPTED)
        else:
            self._peer, self._incoming, self._expected = peer, [], message.count
            self._received_at = now
            self._ask(now)

    def _item(self, message: Message, peer: RemoteIds, now: float) -> None:
        if self._peer is None:
            self._ack(peer, dialect.MAV_MISSION_ERROR)
        elif message.seq != len(self._incoming):
            self._ack(peer, dialect.MAV_MISSION_INVALID_SEQUENCE)
        elif peer != self._peer:
            self._ack(peer, dialect.MAV_MISSION_DENIED)
        else:
            self._take(stored_geo_item(from_message(message), self._type, ardupilot=True), now)

    def _take(self, stored: StoredItem | Refusal, now: float) -> None:
        assert self._peer is not None
        if isinstance(stored, Refusal):
            self._end(stored.result)
            return
        self._incoming.append(stored)
        self._received_at = now
        if len(self._incoming) < self._expected:
            self._ask(now)
        elif self._type == FENCE_TYPE and not complete_polygons(self._incoming):
            self._end(dialect.MAV_MISSION_ERROR)
        else:
            self._replace(self._incoming)
            self._end(dialect.MAV_MISSION_ACCEPTED)

    def _end(self, result: int) -> None:
        assert self._peer is not None
        self._ack(self._peer, result)
        self.reboot()

    def _replace(self, items: list[StoredItem]) -> None:
        self._store[:] = items
        self._stored(self._type)

    def _ask(self, now: float) -> None:
        assert self._peer is not None
        self._requested_at = now
        self._out.append(dialect.MAVLink_mission_request_message(
            *self._peer, len(self._incoming), self._type))

    def _ack(self, peer: RemoteIds, result: int) -> None:
        self._out.append(dialect.MAVLink_mission_ack_message(*peer, result, self._type))
