# SPDX-License-Identifier: Apache-2.0
"""PX4's mission server: a second storage is filled, and replaces the first at the last item."""
from __future__ import annotations

import math
from enum import Enum

from pymavlink.dialects.v20 import ardupilotmega as dialect

from uav_task_alloc.mavlink.transport.codec import Message, with_plan_id
from uav_task_alloc.sim.config import FlightMode, StorageChange
from uav_task_alloc.sim.flight import CRITICAL
from uav_task_alloc.sim.mission_server import (
    CLEARED_TYPES,
    MISSION_TYPE,
    MissionServer,
    RemoteIds,
)
from uav_task_alloc.sim.px4.flight import Px4Flight
from uav_task_alloc.sim.stored_fence import stored_geo_item
from uav_task_alloc.sim.stored_item import (
    Refusal,
    StoredItem,
    from_message,
    px4_crc,
    stored_by_px4,
)

_RETRY = 0.25  # [s] between requests for the same item
_GIVE_UP = 5.0  # [s] without a message


class _State(Enum):
    IDLE = 'idle'
    GETLIST = 'getlist'  # receives
    SENDLIST = 'sendlist'  # is read back


class Px4MissionServer(MissionServer):
    """Atomic: a transfer that fails leaves the old mission; a CRC names the new one.

    Args:
        system_id: of the vehicle, 1..255.
        capacity: items of the mission storage.
    """

    flight: Px4Flight

    def __init__(self, system_id: int, capacity: int) -> None:
        super().__init__(system_id, capacity)
        self._id = 0
        self._mission_state = 0  # MISSION_STATE; kept where no rule applies
        self.reboot()

    def reboot(self) -> None:
        self._state = _State.IDLE
        self._peer: RemoteIds = (0, 0)
        self._type = MISSION_TYPE  # of the transfer: there is one at a time
        self._seq = 0  # expected next, in either direction
        self._expected = 0
        self._incoming: list[StoredItem] = []
        self._flagged: int | None = None
        self._int = False  # until the first MISSION_ITEM_INT
        self._received_at = -math.inf  # [s]
        self._requested_at = -math.inf  # [s]

    @property
    def mission_id(self) -> int:
        return self._id

    def progress(self) -> tuple[int, int, int]:
        total = len(self.items) or 65535
        if not self.flight.config.reports_mission_state:
            return total, dialect.MISSION_STATE_UNKNOWN, 0
        runs = self.flight.mode in (FlightMode.MISSION, FlightMode.TAKEOFF, FlightMode.LAND)
        return total, self._update_mission_state(runs), 1 if runs else 2

    def _update_mission_state(self, runs: bool) -> int:
        """MISSION_STATE as a newer PX4 sends it: also complete after a take-off or a landing."""
        result = self.flight.result
        if not self.items or not self.flight.feasible:
            self._mission_state = dialect.MISSION_STATE_NO_MISSION
        elif result.finished:
            self._mission_state = dialect.MISSION_STATE_COMPLETE
        elif runs:
            self._mission_state = dialect.MISSION_STATE_ACTIVE
        elif result.reached:
            self._mission_state = dialect.MISSION_STATE_PAUSED
        elif self.flight.seq < 1:
            self._mission_state = dialect.MISSION_STATE_NOT_STARTED
        return self._mission_state

    def step(self, now: float) -> None:
        if self._state is _State.IDLE:
            return
        if now - self._received_at > _GIVE_UP:
            self._state = _State.IDLE
        elif self._state is _State.GETLIST and now - self._requested_at > _RETRY:
            self._ask(now)

    def _ask(self, now: float) -> None:
        self._requested_at = now
        kind = (dialect.MAVLink_mission_request_int_message if self._int
                else dialect.MAVLink_mission_request_message)
        self.out.append(kind(*self._peer, self._seq, self._type))

    def _count(self, message: Message, peer: RemoteIds, now: float) -> None:
        self._received_at = now
        if self._state is _State.IDLE:
            self._begin(message, peer, now)
        elif self._state is _State.GETLIST and self._seq == 0:
            self._ask(now)  # our request was probably lost
        else:  # to the station that uploads, from whichever it came; the transfer goes on
            self._send_ack(self._peer, dialect.MAV_MISSION_ERROR, self._type)

    def _begin(self, message: Message, peer: RemoteIds, now: float) -> None:
        if not self._takes_type(message, peer):
            return
        self._peer, self._type = peer, message.mission_type
        if message.count > self.capacities[self._type]:
            self._send_ack(peer, dialect.MAV_MISSION_NO_SPACE, self._type)
            return
        self._incoming, self._flagged = [], None
        self._seq, self._expected = 0, message.count
        if message.count == 0:
            self._store(StorageChange.CLEARED)
            self._send_ack(peer, dialect.MAV_MISSION_ACCEPTED, self._type)
            return
        self._state = _State.GETLIST
        self._ask(now)

    def _item(self, message: Message, peer: RemoteIds, now: float) -> None:
        self._int = True
        if peer != self._peer:
            return
        if message.mission_type != self._type:
            self._send_ack(peer, dialect.MAV_MISSION_ERROR, self._type)
        elif self._state is _State.GETLIST:
            self._received_at = now
            if message.seq == self._seq:
                self._take(message, now)
        elif self._state is _State.IDLE and message.seq + 1 == self._seq:
            self._accept()  # a repeated last item: our ACK was probably lost
        else:
            self._send_ack(peer, dialect.MAV_MISSION_ERROR, self._type)

    def _take(self, message: Message, now: float) -> None:
        item = from_message(message)
        stored = (stored_geo_item(item, self._type, ardupilot=False) if self._type
                  else stored_by_px4(item))
        if isinstance(stored, Refusal):
            self._state = _State.IDLE
            self._send_ack(self._peer, stored.result, self._type)
            return
        self._incoming.append(stored)
        if message.current:
            self._flagged = message.seq
        self._seq += 1
        if self._seq == self._expected:
            self._state = _State.IDLE
            self._store(StorageChange.REPLACED)
            self._accept()
        else:
            self._ask(now)

    def _store(self, change: StorageChange) -> None:
        if self._type != MISSION_TYPE:
            self.stores[self._type][:] = self._incoming
            self._stored(self._type)
            return
        self.items[:] = self._incoming
        self._id = px4_crc(self.items)
        self._changed(change, self._flagged)

    def _accept(self) -> None:
        self.out.append(with_plan_id(dialect.MAVLink_mission_ack_message(
            *self._peer, dialect.MAV_MISSION_ACCEPTED, self._type), self._crc))

    @property
    def _crc(self) -> int:
        """Id of what is stored of the transfer's type."""
        return px4_crc(self.stores[self._type]) if self._type else self._id

    def set_current(self, seq: int) -> bool:
        if self._state is not _State.IDLE:
            self.flight.texts.append((CRITICAL, 'WPM: IGN WP CURR CMD: Busy'))
            return False
        return self.flight.set_current(seq)

    def _request_list(self, message: Message, peer: RemoteIds, now: float) -> None:
        if self._seq == len(self.stores[self._type]):  # all was sent: its ACK may be lost
            self._state = _State.IDLE
        repeated = self._state is _State.SENDLIST and peer == self._peer
        if self._state is not _State.IDLE and not repeated:
            return
        count = self._count_of(message)
        if message.mission_type in self.stores:
            self._state, self._peer, self._seq, self._received_at = _State.SENDLIST, peer, 0, now
            self._type = message.mission_type
        self.out.append(with_plan_id(dialect.MAVLink_mission_count_message(
            *peer, count, message.mission_type), self._crc if count else 0))

    def _request(self, message: Message, peer: RemoteIds, now: float) -> None:
        self._int = message.get_type().endswith('_INT')
        if peer != self._peer or self._state is not _State.SENDLIST:
            return
        self._received_at = now
        count = len(self.stores[self._type])
        if message.mission_type == self._type and message.seq == self._seq < count:
            self._seq += 1
        elif (message.mission_type != self._type or message.seq != self._seq - 1
                or message.seq >= count):
            self._state = _State.IDLE
            self._send_ack(peer, dialect.MAV_MISSION_ERROR, self._type)
            return
        self._send_item(message.seq, peer, self._int, self._type)

    def _clear(self, message: Message, peer: RemoteIds, now: float) -> None:
        if self._state is not _State.IDLE:
            return
        for mission_type in self.stores:
            if message.mission_type in (mission_type, CLEARED_TYPES[1]):
                self._incoming, self._flagged, self._type = [], None, mission_type
                self._store(StorageChange.CLEARED)
        self._send_ack(peer, dialect.MAV_MISSION_ACCEPTED, message.mission_type)

    def _ack(self, message: Message, peer: RemoteIds, now: float) -> None:
        if peer != self._peer:
            return
        cancelled = message.type == dialect.MAV_MISSION_OPERATION_CANCELLED
        if self._state is _State.SENDLIST or (self._state is _State.GETLIST and cancelled):
            self._state = _State.IDLE
