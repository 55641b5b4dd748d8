# SPDX-License-Identifier: Apache-2.0
"""COMMAND_LONG and COMMAND_INT as a simulated autopilot executes them, with their result."""
from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial

from pymavlink.dialects.v20 import ardupilotmega as dialect

from uav_task_alloc.mavlink.transport.codec import Message
from uav_task_alloc.sim import stored_item as item_
from uav_task_alloc.sim.config import FlightMode
from uav_task_alloc.sim.flight import VehicleFlight
from uav_task_alloc.sim.modes import px4_mode
from uav_task_alloc.sim.stored_item import StoredItem
from uav_task_alloc.sim.streams import Streams

CommandParams = tuple[float, float, float, float, float, float, float]
_ACCEPTED = int(dialect.MAV_RESULT_ACCEPTED)
_DENIED = int(dialect.MAV_RESULT_DENIED)
_FAILED = int(dialect.MAV_RESULT_FAILED)
_UNSUPPORTED = int(dialect.MAV_RESULT_UNSUPPORTED)
_REJECTED = int(dialect.MAV_RESULT_TEMPORARILY_REJECTED)
_FORCE = 21196  # param2 of ARM_DISARM
_MODE_COMMANDS = {
    dialect.MAV_CMD_NAV_RETURN_TO_LAUNCH: FlightMode.RETURN,
    dialect.MAV_CMD_NAV_LAND: FlightMode.LAND,
    dialect.MAV_CMD_NAV_LOITER_UNLIM: FlightMode.HOLD,
}
_PLAIN_COMMANDS = {
    dialect.MAV_CMD_NAV_TAKEOFF: 'takeoff', dialect.MAV_CMD_MISSION_START: 'mission start'}


class Commands:
    """One handler per command; `refused` is the MAV_RESULT of a command not possible now."""

    refused = _FAILED

    def __init__(self, flight: VehicleFlight, streams: Streams) -> None:
        self.flight = flight
        self.streams = streams
        self.out: list[Message] = []  # answers to REQUEST_MESSAGE
        self.handlers: dict[int, Callable[[CommandParams], int]] = {
            dialect.MAV_CMD_COMPONENT_ARM_DISARM: self._arm_disarm,
            dialect.MAV_CMD_NAV_TAKEOFF: self._takeoff,
            dialect.MAV_CMD_DO_SET_MODE: self._set_mode,
            dialect.MAV_CMD_MISSION_START: lambda p: self._result(self.flight.start_mission()),
            dialect.MAV_CMD_SET_MESSAGE_INTERVAL: self._set_message_interval,
            dialect.MAV_CMD_REQUEST_MESSAGE: self._request_message,
            dialect.MAV_CMD_DO_CHANGE_SPEED: self._change_speed,
        }
        for command in item_.AT_ONCE - {item_.CHANGE_SPEED, item_.YAW}:
            self.handlers[command] = partial(self._payload, command)
        for command, mode in _MODE_COMMANDS.items():
            self.handlers[command] = partial(self._enter, mode)

    def run(self, command: int, params: CommandParams) -> int:
        """Execute a command; returns its MAV_RESULT."""
        handler = self.handlers.get(command)
        return _UNSUPPORTED if handler is None else handler(params)

    def note(self, command: int, params: CommandParams, station: str) -> None:
        """Record a command about mode, arming, take-off or mission in the ground truth."""
        truth, modes = self.flight.truth, self.flight.custom_modes
        if command == dialect.MAV_CMD_COMPONENT_ARM_DISARM:
            forced = 'forced ' if params[1] == _FORCE else ''
            name = forced + ('arm' if params[0] == 1.0 else 'disarm')
            truth.note('command', command=name, cause=station)
        elif command == dialect.MAV_CMD_DO_SET_MODE:
            truth.note('command', command='mode', mode=self.custom_mode(params), cause=station)
        elif command in _MODE_COMMANDS:
            truth.note('command', command='mode', mode=modes[_MODE_COMMANDS[command]],
                       cause=station)
        elif command == dialect.MAV_CMD_DO_SET_MISSION_CURRENT:
            truth.note('command', command='set current', seq=int(params[0]), cause=station)
        elif command in _PLAIN_COMMANDS:
            truth.note('command', command=_PLAIN_COMMANDS[command], cause=station)

    def custom_mode(self, params: CommandParams) -> int:
        """The custom mode that DO_SET_MODE commands."""
        raise NotImplementedError

    def _result(self, done: bool) -> int:
        return _ACCEPTED if done else self.refused

    def _enter(self, mode: FlightMode, _: CommandParams) -> int:
        return self._result(self.flight.set_mode(mode))

    def _arm_disarm(self, p: CommandParams) -> int:
        if p[0] == 1.0:
            return self._result(self.flight.arm(p[1] == _FORCE))
        return self._result(p[0] == 0.0 and self.flight.disarm(p[1] == _FORCE))

    def _takeoff(self, p: CommandParams) -> int:
        raise NotImplementedError

    def _set_mode(self, p: CommandParams) -> int:
        return self._result(self.flight.set_custom_mode(self.custom_mode(p)))

    def _set_message_interval(self, p: CommandParams) -> int:
        known = self.streams.set_interval(int(p[0]), p[1], self.flight.now)
        return _ACCEPTED if known else _FAILED

    def _request_message(self, p: CommandParams) -> int:
        messages = self.streams.make(int(p[0]))
        self.out += messages
        return _ACCEPTED if messages else _FAILED

    def _change_speed(self, p: CommandParams) -> int:
        if not p[1] > 0.0:
            return _DENIED
        self.flight.change_speed(p[1])
        return _ACCEPTED

    def _payload(self, command: int, p: CommandParams) -> int:
        self.flight.execute(StoredItem(
            dialect.MAV_FRAME_GLOBAL, command, *p[:4], round(p[4]), round(p[5]), p[6]))
        return _ACCEPTED


class ArduPilotCommands(Commands):
    """Refuses with FAILED; supports DO_SET_MISSION_CURRENT; take-off height is above home."""

    def __init__(self, flight: VehicleFlight, streams: Streams) -> None:
        super().__init__(flight, streams)
        self.handlers[dialect.MAV_CMD_DO_SET_MISSION_CURRENT] = self._set_current

    def custom_mode(self, params: CommandParams) -> int:
        return int(params[1])

    def _set_current(self, p: CommandParams) -> int:
        seq = int(p[0])
        return (_DENIED if seq >= len(self.flight.items)
                else self._result(self.flight.set_current(seq)))

    def _takeoff(self, p: CommandParams) -> int:
        return self._result(self.flight.takeoff(self.flight.home[2] + p[6]))


class Px4Commands(Commands):
    """Refuses with TEMPORARILY_REJECTED; no DO_SET_MISSION_CURRENT; take-off height is AMSL."""

    refused = _REJECTED

    def _change_speed(self, p: CommandParams) -> int:
        self.flight.change_speed(p[1])  # none: the default
        return _ACCEPTED

    def custom_mode(self, params: CommandParams) -> int:
        return px4_mode(int(params[1]), int(params[2]))

    def _takeoff(self, p: CommandParams) -> int:
        flight = self.flight
        low = flight.body.position[2] + flight.takeoff_height
        height = p[6] - flight.home_amsl + flight.home[2]
        return self._result(flight.takeoff(low if math.isnan(height) else max(low, height)))
