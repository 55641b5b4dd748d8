# SPDX-License-Identifier: Apache-2.0
"""Mission server of a simulated autopilot: the part common to both autopilots."""
from __future__ import annotations

from collections.abc import Callable

from pymavlink.dialects.v20 import ardupilotmega as dialect

from uav_task_alloc.mavlink.transport.codec import Message
from uav_task_alloc.sim.config import StorageChange
from uav_task_alloc.sim.flight import VehicleFlight
from uav_task_alloc.sim.stored_fence import FENCE_TYPE
from uav_task_alloc.sim.stored_item import StoredItem, to_float_message, to_message

RemoteIds = tuple[int, int]  # system, component
MISSION_TYPE = dialect.MAV_MISSION_TYPE_MISSION
CLEARED_TYPES = (MISSION_TYPE, dialect.MAV_MISSION_TYPE_ALL)  # of MISSION_CLEAR_ALL
AUTOPILOT_COMPONENT = dialect.MAV_COMP_ID_AUTOPILOT1


class MissionServer:
    """Stored items and the running transfer; messages to send are appended to `out`.

    Args:
        system_id: of the vehicle, 1..255.
        capacity: items of the mission storage.

    Arguments of methods:
        mission_type: MAV_MISSION_TYPE of another store.
        message: from any station.
        seq: of an item.
        now: [s].
    """

    flight: VehicleFlight

    def __init__(self, system_id: int, capacity: int) -> None:
        self.items: list[StoredItem] = []
        self.out: list[Message] = []
        self._system_id = system_id
        self.stores = {MISSION_TYPE: self.items}  # by MAV_MISSION_TYPE
        self.capacities = {MISSION_TYPE: capacity}
        self.on_fence: Callable[[], None] = lambda: None  # called when the fence is stored
        self._handlers: dict[str, Callable[[Message, RemoteIds, float], None]] = {
            'MISSION_COUNT': self._count,
            'MISSION_ITEM_INT': self._item,
            'MISSION_REQUEST_LIST': self._request_list,
            'MISSION_REQUEST': self._request,
            'MISSION_REQUEST_INT': self._request,
            'MISSION_CLEAR_ALL': self._clear,
            'MISSION_ACK': self._ack,
        }

    def attach(self, flight: VehicleFlight) -> None:
        """Report every change of `items` to this flight, which flies them."""
        self.flight = flight

    def add_store(self, mission_type: int, capacity: int) -> None:
        """Have a store for fences or rally points."""
        self.stores[mission_type], self.capacities[mission_type] = [], capacity

    def _stored(self, mission_type: int) -> None:
        """Note that a store other than that of the mission has changed."""
        if mission_type == FENCE_TYPE:
            self.on_fence()

    def set_current(self, seq: int) -> bool:
        """MISSION_SET_CURRENT; False where it is refused."""
        return self.flight.set_current(seq)

    def progress(self) -> tuple[int, int, int]:
        """Fields total, mission_state and mission_mode of MISSION_CURRENT."""
        raise NotImplementedError

    def _changed(self, change: StorageChange, flagged: int | None = None) -> None:
        self.flight.storage_changed(change, flagged)

    def handle(self, message: Message, now: float) -> bool:
        """Handle a message of the mission protocol; False where it is none or not for us."""
        self.load()
        handler = self._handlers.get(message.get_type())
        if handler is None or not self._for_us(message):
            return False
        handler(message, (message.get_srcSystem(), message.get_srcComponent()), now)
        return True

    def step(self, now: float) -> None:
        """Repeat requests and give up a transfer as of `now` [s]."""
        raise NotImplementedError

    def reboot(self) -> None:
        """Drop the transfer; the items stay."""
        raise NotImplementedError

    def load(self) -> None:
        """Load the items once the boot is over."""

    @property
    def mission_id(self) -> int | None:
        """The autopilot's id of the stored mission; None where it has none."""
        return None

    def read(self, seq: int) -> StoredItem:
        """An item as a ground station downloads it."""
        return self.items[seq]

    def _for_us(self, message: Message) -> bool:
        return (message.target_system == self._system_id
                and message.target_component in (AUTOPILOT_COMPONENT, 0))

    def _count_of(self, message: Message) -> int:
        """Number of items of the mission type that a message names."""
        return len(self.stores.get(message.mission_type, ()))

    def _takes_type(self, message: Message, peer: RemoteIds) -> bool:
        """Whether there is a store of the mission type; the others are refused."""
        if message.mission_type not in self.stores:
            self._send_ack(peer, dialect.MAV_MISSION_UNSUPPORTED, message.mission_type)
        return message.mission_type in self.stores

    def _send_item(self, seq: int, peer: RemoteIds, as_int: bool,
                   mission_type: int = MISSION_TYPE) -> None:
        make = to_message if as_int else to_float_message
        item = self.stores[mission_type][seq] if mission_type else self.read(seq)
        current = seq == self.flight.seq and mission_type == MISSION_TYPE
        self.out.append(make(item, seq, current, peer, mission_type))

    def _send_ack(self, peer: RemoteIds, result: int, mission_type: int = MISSION_TYPE) -> None:
        self.out.append(dialect.MAVLink_mission_ack_message(*peer, result, mission_type))

    def _send_text(self, severity: int, text: str) -> None:
        self.out.append(dialect.MAVLink_statustext_message(severity, text.encode()))

    def _count(self, message: Message, peer: RemoteIds, now: float) -> None:
        raise NotImplementedError

    def _item(self, message: Message, peer: RemoteIds, now: float) -> None:
        raise NotImplementedError

    def _request_list(self, message: Message, peer: RemoteIds, now: float) -> None:
        raise NotImplementedError

    def _request(self, message: Message, peer: RemoteIds, now: float) -> None:
        raise NotImplementedError

    def _clear(self, message: Message, peer: RemoteIds, now: float) -> None:
        raise NotImplementedError

    def _ack(self, message: Message, peer: RemoteIds, now: float) -> None:
        raise NotImplementedError
