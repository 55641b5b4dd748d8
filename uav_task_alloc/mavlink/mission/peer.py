# SPDX-License-Identifier: Apache-2.0
"""The addresses of a mission transfer: builds our messages and filters the vehicle's."""
from __future__ import annotations

from dataclasses import dataclass

from pymavlink.dialects.v20 import ardupilotmega as dialect

from uav_task_alloc.mavlink.mission.items import Item
from uav_task_alloc.mavlink.transport.codec import Message


@dataclass(frozen=True, slots=True)
class Peer:
    """A vehicle's ids, and ours on its link; builds each message of the mission protocol.

    Arguments of methods:
        message: as received.
        count: number of items.
        seq: of an item.
        command: MAV_CMD.
        params: param1 to param7 of the command.
        name: of a parameter.
        result: MAV_MISSION_RESULT.
    """

    system: int  # id of the vehicle
    component: int = dialect.MAV_COMP_ID_AUTOPILOT1  # id of its autopilot
    our_system: int = 245  # id of the ground station
    our_component: int = dialect.MAV_COMP_ID_MISSIONPLANNER  # id of the ground station
    mission_type: int = dialect.MAV_MISSION_TYPE_MISSION  # MAV_MISSION_TYPE

    def is_from_vehicle(self, message: Message) -> bool:
        """Whether a message is sent by this vehicle to us or to all, of our mission type."""
        return (message.get_srcSystem() == self.system
                and message.get_srcComponent() == self.component
                and getattr(message, 'target_system', 0) in (0, self.our_system)
                and getattr(message, 'target_component', 0) in (0, self.our_component)
                and getattr(message, 'mission_type', self.mission_type) == self.mission_type)

    def changed_by_another(self, message: Message) -> bool:
        """Whether a MISSION_ACK ends a transfer that another station began on a shared link."""
        return (message.get_type() == 'MISSION_ACK' and message.mission_type == self.mission_type
                and message.type != dialect.MAV_MISSION_DENIED
                and not (message.target_system in (0, self.our_system)
                         and message.target_component in (0, self.our_component)))

    def count(self, count: int) -> Message:
        """MISSION_COUNT: begin an upload of so many items."""
        return dialect.MAVLink_mission_count_message(
            self.system, self.component, count, self.mission_type)

    def item(self, seq: int, item: Item, current: bool) -> Message:
        """MISSION_ITEM_INT."""
        return dialect.MAVLink_mission_item_int_message(
            self.system, self.component, seq, item.frame, item.command, int(current), 1,
            *item.params, item.x, item.y, item.z, self.mission_type)

    def clear(self) -> Message:
        """MISSION_CLEAR_ALL of our mission type."""
        return dialect.MAVLink_mission_clear_all_message(
            self.system, self.component, self.mission_type)

    def read_parameter(self, name: str) -> Message:
        """PARAM_REQUEST_READ by name."""
        return dialect.MAVLink_param_request_read_message(
            self.system, self.component, name.encode(), -1)

    def ack(self, result: int) -> Message:
        """MISSION_ACK."""
        return dialect.MAVLink_mission_ack_message(
            self.system, self.component, result, self.mission_type)

    def request_list(self) -> Message:
        """MISSION_REQUEST_LIST."""
        return dialect.MAVLink_mission_request_list_message(
            self.system, self.component, self.mission_type)

    def request(self, seq: int) -> Message:
        """MISSION_REQUEST_INT."""
        return dialect.MAVLink_mission_request_int_message(
            self.system, self.component, seq, self.mission_type)

    def set_current(self, seq: int) -> Message:
        """MISSION_SET_CURRENT; `seq` counts home where the autopilot stores it."""
        return dialect.MAVLink_mission_set_current_message(self.system, self.component, seq)

    def command(self, command: int, *params: float) -> Message:
        """COMMAND_LONG; parameters left out are 0."""
        filled = (*params, *(0.0,) * (7 - len(params)))
        return dialect.MAVLink_command_long_message(
            self.system, self.component, command, 0, *filled)


def received_item(message: Message) -> Item:
    """Convert a MISSION_ITEM_INT [1e-7 deg], or the older MISSION_ITEM [deg], to an Item."""
    scale = 1 if message.get_type() == 'MISSION_ITEM_INT' else 1e7
    return Item(message.command, message.frame, round(message.x * scale),
                round(message.y * scale), message.z,
                (message.param1, message.param2, message.param3, message.param4))
