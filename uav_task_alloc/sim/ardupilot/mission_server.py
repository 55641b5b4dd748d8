# SPDX-License-Identifier: Apache-2.0
"""ArduCopter's mission server: each item overwrites the storage at once; nothing is atomic."""
from __future__ import annotations

from pymavlink.dialects.v20 import ardupilotmega as dialect

from uav_task_alloc.mavlink.transport.codec import Message
from uav_task_alloc.sim.ardupilot.flight import ArduPilotFlight, MissionRunState
from uav_task_alloc.sim.ardupilot.geo_server import GeoUpload
from uav_task_alloc.sim.config import FlightMode, StorageChange
from uav_task_alloc.sim.flight import WARNING
from uav_task_alloc.sim.mission_server import (
    CLEARED_TYPES,
    MISSION_TYPE,
    MissionServer,
    RemoteIds,
)
from uav_task_alloc.sim.stored_item import (
    Refusal,
    StoredItem,
    from_message,
    stored_by_ardupilot,
)

_RETRY = 1.0  # [s] between requests for the same item
_GIVE_UP = 8.0  # [s] without an item


class ArduPilotMissionServer(MissionServer):
    """Storage truncated at COUNT and overwritten item by item; seq 0 is home.

    Args:
        system_id: of the vehicle, 1..255.
        capacity: items of the mission storage, with home.
    """

    flight: ArduPilotFlight

    def __init__(self, system_id: int, capacity: int) -> None:
        super().__init__(system_id, capacity)
        self._peer: RemoteIds | None = None  # the uploading station
        self._wanted = 0  # seq of the next item
        self._expected = 0  # items of the upload
        self._received_at = 0.0  # [s]
        self._requested_at = 0.0  # [s]
        self._unloaded: list[StoredItem] | None = None  # the storage, before it is loaded
        self._geo: dict[int, GeoUpload] = {}  # by MAV_MISSION_TYPE

    def add_store(self, mission_type: int, capacity: int) -> None:
        super().add_store(mission_type, capacity)
        self._geo[mission_type] = GeoUpload(
            mission_type, self.stores[mission_type], capacity, self.out, self._stored)

    def handle(self, message: Message, now: float) -> bool:
        geo = self._geo.get(getattr(message, 'mission_type', MISSION_TYPE))
        if geo is not None and self._for_us(message) and geo.receive(
                message, (message.get_srcSystem(), message.get_srcComponent()), now):
            return True
        return super().handle(message, now)

    def reboot(self) -> None:
        self._peer = None
        for geo in self._geo.values():
            geo.reboot()
        if self.flight.boot.booting:
            self._unloaded = [*(self._unloaded or ()), *self.items]
            self.items.clear()
        self.load()

    def load(self) -> None:
        if self._unloaded is not None and not self.flight.boot.booting:
            self.items[:], self._unloaded = self._unloaded, None

    @property
    def _space(self) -> int:
        """Items that can be stored now."""
        return 0 if self.flight.boot.booting else self.capacities[MISSION_TYPE]

    def read(self, seq: int) -> StoredItem:
        return self.flight.home_item() if seq == 0 else self.items[seq]

    def progress(self) -> tuple[int, int, int]:
        in_mission = int(self.flight.mode is FlightMode.MISSION)  # never 2, suspended
        if len(self.items) < 2:
            return 0, dialect.MISSION_STATE_NO_MISSION, in_mission
        return len(self.items) - 1, self.flight.mission_state, in_mission

    def step(self, now: float) -> None:
        self.load()
        for geo in self._geo.values():
            geo.step(now)
        if self._peer is None:
            return
        if now - self._received_at > _GIVE_UP:
            self._send_ack(self._peer, dialect.MAV_MISSION_OPERATION_CANCELLED)
            self._peer = None
        elif now - self._requested_at > _RETRY:
            self._ask(now)

    def _ask(self, now: float) -> None:
        assert self._peer is not None
        self._requested_at = now
        self.out.append(dialect.MAVLink_mission_request_message(
            *self._peer, self._wanted, MISSION_TYPE))

    def _count(self, message: Message, peer: RemoteIds, now: float) -> None:
        if not self._takes_type(message, peer):
            return
        if self._peer not in (None, peer):
            self._send_ack(peer, dialect.MAV_MISSION_DENIED)
            return
        self._peer = None
        if message.count > self._space:
            self._send_ack(peer, dialect.MAV_MISSION_NO_SPACE)
            self._send_text(WARNING, f'Only {self._space} items are supported')
            return
        if self._unloaded is not None:
            self._unloaded.clear()
        if message.count < len(self.items):
            del self.items[message.count:]
            self._changed(StorageChange.TRUNCATED)
        if message.count == 0:
            self._send_ack(peer, dialect.MAV_MISSION_ACCEPTED)
            return
        self._peer, self._wanted, self._expected = peer, 0, message.count
        self._received_at = now
        self._ask(now)

    def _item(self, message: Message, peer: RemoteIds, now: float) -> None:
        if not self._takes_type(message, peer):
            return
        if self._peer is None:
            self._send_ack(peer, dialect.MAV_MISSION_ERROR)
        elif message.seq != self._wanted:
            self._send_ack(peer, dialect.MAV_MISSION_INVALID_SEQUENCE)
        elif peer != self._peer:
            self._send_ack(peer, dialect.MAV_MISSION_DENIED)
        else:
            self._write(message, peer, now)

    def _write(self, message: Message, peer: RemoteIds, now: float) -> None:
        stored = (stored_by_ardupilot(from_message(message)) if message.seq
                  else self.flight.home_item())
        if isinstance(stored, Refusal):  # what came before stays overwritten
            self._send_ack(peer, stored.result)
            self._peer = None
            return
        self.items[message.seq:message.seq + 1] = [stored]
        self._changed(StorageChange.WRITTEN)
        self._received_at = now
        self._wanted += 1
        if self._wanted == self._expected:
            self._peer = None
            self._send_ack(peer, dialect.MAV_MISSION_ACCEPTED)
        else:
            self._ask(now)

    def _request_list(self, message: Message, peer: RemoteIds, now: float) -> None:
        if message.mission_type not in self.stores:
            self._send_ack(peer, dialect.MAV_MISSION_UNSUPPORTED, message.mission_type)
            return
        if self._peer is not None and message.mission_type == MISSION_TYPE:
            self._send_ack(peer, dialect.MAV_MISSION_DENIED, message.mission_type)
            return
        self.out.append(dialect.MAVLink_mission_count_message(
            *peer, self._count_of(message), message.mission_type))

    def _request(self, message: Message, peer: RemoteIds, now: float) -> None:
        if message.mission_type != MISSION_TYPE:
            self._request_geo(message, peer)
        elif self._peer is not None:
            self._send_ack(peer, dialect.MAV_MISSION_DENIED, message.mission_type)
        elif message.seq != 0 and message.seq >= len(self.items):
            self._request_list(message, peer, now)  # for the count
            self._send_ack(peer, dialect.MAV_MISSION_ERROR)
        else:
            self._send_item(message.seq, peer, message.get_type().endswith('_INT'))

    def _request_geo(self, message: Message, peer: RemoteIds) -> None:
        if message.seq < self._count_of(message):
            self._send_item(message.seq, peer, message.get_type().endswith('_INT'),
                            message.mission_type)
        else:
            self._send_ack(peer, dialect.MAV_MISSION_ERROR, message.mission_type)

    def _clear(self, message: Message, peer: RemoteIds, now: float) -> None:
        if self._peer is not None:
            self._send_ack(peer, dialect.MAV_MISSION_DENIED, message.mission_type)
        elif (message.mission_type in CLEARED_TYPES
              and self.flight.run is MissionRunState.ACTIVE):
            self._send_ack(peer, dialect.MAV_MISSION_ERROR, message.mission_type)
        else:
            if message.mission_type in CLEARED_TYPES:
                self.items.clear()
                if self._unloaded is not None:
                    self._unloaded.clear()
                self._changed(StorageChange.CLEARED)
            self._send_ack(peer, dialect.MAV_MISSION_ACCEPTED, message.mission_type)

    def _ack(self, message: Message, peer: RemoteIds, now: float) -> None:
        """Ignored, even a cancel."""
