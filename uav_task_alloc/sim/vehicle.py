# SPDX-License-Identifier: Apache-2.0
"""A simulated autopilot without I/O: messages and time in, messages out."""
from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from pymavlink.dialects.v20 import ardupilotmega as dialect

from uav_task_alloc.mavlink.transport.codec import Message, with_plan_id
from uav_task_alloc.sim.ardupilot.flight import ArduPilotFlight
from uav_task_alloc.sim.ardupilot.mission_server import ArduPilotMissionServer
from uav_task_alloc.sim.batteries import SimBatteries
from uav_task_alloc.sim.battery_change import BatteryChange
from uav_task_alloc.sim.commands import ArduPilotCommands, Commands, Px4Commands
from uav_task_alloc.sim.config import FlightMode, TruthEvent, VehicleConfig
from uav_task_alloc.sim.estimate import Estimate
from uav_task_alloc.sim.failsafe import Interventions
from uav_task_alloc.sim.fence_monitor import FenceMonitor
from uav_task_alloc.sim.flight import VehicleFlight
from uav_task_alloc.sim.mission_server import AUTOPILOT_COMPONENT, MissionServer
from uav_task_alloc.sim.parameters import SimParameters
from uav_task_alloc.sim.px4.flight import Px4Flight
from uav_task_alloc.sim.px4.mission_server import Px4MissionServer
from uav_task_alloc.sim.stored_fence import CAPACITIES, FENCE_TYPE, RALLY_TYPE
from uav_task_alloc.sim.streams import Streams
from uav_task_alloc.sim.telemetry import TelemetryMessages

_CURRENT = dialect.MAVLINK_MSG_ID_MISSION_CURRENT
_CENTRE, _DEAD_ZONE = 1500, 50  # [us] of a stick


@dataclass(frozen=True, slots=True)
class Autopilot:
    """The classes and figures in which the autopilots differ."""

    name: str
    number: int  # MAV_AUTOPILOT
    flight: type[VehicleFlight]
    mission: type[MissionServer]
    commands: type[Commands]
    capacity: int  # items
    rates: dict[int, float]  # [Hz] by message id, without a request
    streams_current: bool  # MISSION_CURRENT is a stream; else it is sent at 1 Hz anyway


_ARDUPILOT = Autopilot(
    'ardupilot', dialect.MAV_AUTOPILOT_ARDUPILOTMEGA, ArduPilotFlight, ArduPilotMissionServer,
    ArduPilotCommands, 650, {dialect.MAVLINK_MSG_ID_HEARTBEAT: 1.0}, streams_current=True)
_PX4 = Autopilot(
    'px4', dialect.MAV_AUTOPILOT_PX4, Px4Flight, Px4MissionServer, Px4Commands, 500, {
        dialect.MAVLINK_MSG_ID_HEARTBEAT: 1.0,
        dialect.MAVLINK_MSG_ID_ATTITUDE: 100.0,
        dialect.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: 50.0,
        dialect.MAVLINK_MSG_ID_LOCAL_POSITION_NED: 30.0,
        dialect.MAVLINK_MSG_ID_VFR_HUD: 10.0,
        dialect.MAVLINK_MSG_ID_SYS_STATUS: 5.0,
        dialect.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: 5.0,
        dialect.MAVLINK_MSG_ID_GPS_RAW_INT: 1.0,
        dialect.MAVLINK_MSG_ID_ESTIMATOR_STATUS: 1.0,
        dialect.MAVLINK_MSG_ID_BATTERY_STATUS: 0.5,
        dialect.MAVLINK_MSG_ID_HOME_POSITION: 0.5,
    }, streams_current=False)
AUTOPILOTS = {row.name: row for row in (_ARDUPILOT, _PX4)}


class Vehicle(Interventions):
    """One simulated system: flight, mission server, commands and telemetry.

    Args:
        config: of the vehicle.
        autopilot: one of AUTOPILOTS.
        now: vehicle time of power-up [s].
    """

    def __init__(self, config: VehicleConfig, autopilot: Autopilot, now: float = 0.0) -> None:
        self.config, self.autopilot = config, autopilot
        self.alive = True
        capacity = autopilot.capacity if config.capacity is None else config.capacity
        self.mission = autopilot.mission(config.system_id, capacity)
        self.flight = autopilot.flight(config, self.mission.items)
        self.mission.attach(self.flight)
        self._add_fence()
        self.estimate = Estimate(self.flight)
        self._batteries = SimBatteries(self.flight, self.parameters, self._is_ardupilot)
        self._telemetry = TelemetryMessages(self.flight, self.estimate, autopilot.number,
                                    config.system_id, self._batteries)
        makers = self._telemetry.makers
        rates = autopilot.rates
        if not config.floods:
            rates = {number: min(rate, 2.0) for number, rate in rates.items()}
        if autopilot.streams_current:
            makers = {**makers, _CURRENT: lambda: [self._mission_current()]}
        self._streams = Streams(makers, rates)
        self._commands = autopilot.commands(self.flight, self._streams)
        self._battery_change = BatteryChange(self.flight)
        self._handlers: dict[str, Callable[[Message], list[Message]]] = {
            'COMMAND_LONG': self._command_long, 'COMMAND_INT': self._command_int,
            'SET_MODE': self._set_mode, 'MISSION_SET_CURRENT': self._set_current,
            'PARAM_REQUEST_READ': self.parameters.receive, 'PARAM_SET': self._set_parameter,
            'RC_CHANNELS_OVERRIDE': self._override_sticks,
        }
        self.reboot(now)
        self.flight.truth.take()

    def _add_fence(self) -> None:
        """Have stores for a fence and rally points, unless the capacity is 0."""
        config, name = self.config, self.autopilot.name
        speed = (('WPNAV_SPEED', 100.0 * config.cruise_speed),) if self._is_ardupilot else ()
        self.parameters = SimParameters(name, (*speed, *config.parameters))
        self.flight.return_height = self.parameters.return_height
        for mission_type, capacity in CAPACITIES[name].items():
            if config.fence_capacity is not None:
                capacity = min(capacity, config.fence_capacity)
            if capacity:
                self.mission.add_store(mission_type, capacity)
        self.fence = FenceMonitor(
            self.flight, self.mission.stores.get(FENCE_TYPE, ()), self.parameters,
            self._is_ardupilot, lambda mode: self.failsafe('fence', mode))
        self.mission.on_fence = self.fence.update
        self.flight.way_home = self.fence.way_around
        self.flight.rally_points = lambda: self.fence.places_of(
            self.mission.stores.get(RALLY_TYPE, ()))

    def reboot(self, now: float) -> None:
        """Power-cycle: boot time, rates and transfers are lost, the stored mission is not.

        In the air it falls.
        """
        self.flight.reboot(now)
        self.estimate.reboot()
        self._batteries.reboot()
        self.mission.reboot()
        self._streams.reboot(now)
        self._reported: tuple[int, int] = (self.flight.seq, 0)  # current item, item count
        self._report_current_at = now

    @property
    def silent(self) -> bool:
        """Whether it sends and receives nothing: it is lost, or its battery is out."""
        return not self.alive or self._battery_change.unpowered

    def kill(self) -> None:
        """Stop all messages and motion."""
        if self.alive:
            self.alive = False
            self.flight.truth.note('died')

    def revive(self, now: float) -> None:
        """Boot on the ground below the position where it died."""
        self.alive = True
        self._battery_change.cancel()
        self.flight.settle_on_ground()
        self.reboot(now)

    @property
    def mode(self) -> FlightMode:
        """The flight mode."""
        return self.flight.mode

    def take_events(self) -> list[TruthEvent]:
        """Return the events since the last call, and clear them."""
        return self.flight.truth.take()

    def receive(self, message: Message, now: float) -> list[Message]:
        """Handle a message at vehicle time `now` [s]; returns the messages to send."""
        if self.silent:
            return []
        self.flight.step(now)
        handler = self._handlers.get(message.get_type())
        if handler is None:
            self.mission.handle(message, now)
            return self._drain()
        if message.target_system not in (self.config.system_id, 0):
            return []
        with self.flight.truth.caused_by(_station(message)):
            answers = handler(message)
        return answers + self._drain()

    def step(self, now: float) -> list[Message]:
        """Fly until vehicle time `now` [s]; returns the messages to send."""
        if not self.alive:
            return []
        self._change_battery(now)
        if self.silent:
            return []
        self.flight.step(now)
        self.fence.step()
        self.mission.step(now)
        out = self._drain()
        if not self.autopilot.streams_current and now >= self._report_current_at:
            self._report_current_at = now + 1.0
            out.append(self._mission_current())
        return out + self._streams.step(now)

    def _change_battery(self, now: float) -> None:
        power = self._battery_change.step(now)
        if power == 'off':
            self.flight.truth.note('power_off')
        elif power == 'on':
            self.flight.body.battery = 1.0
            self.flight.now = now
            self.flight.truth.note('battery_changed')
            self.reboot(now)

    def _drain(self) -> list[Message]:
        flight = self.flight
        out = [dialect.MAVLink_statustext_message(severity, text[:50].encode())
               for severity, text in flight.texts]
        out += [dialect.MAVLink_mission_item_reached_message(seq) for seq in flight.reached]
        current = (flight.seq, len(self.mission.items))
        if current != self._reported:
            self._reported = current
            if not self.autopilot.streams_current:
                out.append(self._mission_current())
        out += self.mission.out
        flight.texts.clear()
        flight.reached.clear()
        self.mission.out.clear()
        return out

    def _mission_current(self) -> Message:
        total, state, mode = self.mission.progress()
        message = dialect.MAVLink_mission_current_message(self.flight.seq, total, state, mode)
        mission_id = self.mission.mission_id
        return message if mission_id is None else with_plan_id(message, mission_id)

    def _command_long(self, m: Message) -> list[Message]:
        return self._command(m, (m.param1, m.param2, m.param3, m.param4, m.param5, m.param6,
                                 m.param7))

    def _command_int(self, m: Message) -> list[Message]:
        return self._command(m, (m.param1, m.param2, m.param3, m.param4, m.x, m.y, m.z))

    def _command(self, m: Message, params: tuple[float, ...]) -> list[Message]:
        if m.target_component not in (AUTOPILOT_COMPONENT, 0):
            return []
        self._commands.note(m.command, params, _station(m))  # type: ignore[arg-type]
        result = self._commands.run(m.command, params)  # type: ignore[arg-type]
        ack = dialect.MAVLink_command_ack_message(
            m.command, result, 0, 0, m.get_srcSystem(), m.get_srcComponent())
        requested, self._commands.out = self._commands.out, []
        if m.command == dialect.MAV_CMD_DO_SET_MISSION_CURRENT and result == 0:
            requested.append(self._mission_current())
        return [ack, *requested]

    def _set_mode(self, m: Message) -> list[Message]:
        self.flight.truth.note('command', command='mode', mode=m.custom_mode, cause=_station(m))
        self.flight.set_custom_mode(m.custom_mode)
        return []

    def _set_parameter(self, m: Message) -> list[Message]:
        out = self.parameters.receive(m)
        self.flight.return_height = self.parameters.return_height
        return out

    def _override_sticks(self, m: Message) -> list[Message]:
        sticks = m.chan1_raw, m.chan2_raw, m.chan3_raw, m.chan4_raw
        if all(abs(pulse - _CENTRE) <= _DEAD_ZONE for pulse in sticks):
            self.flight.override_sticks()
        return []

    def _set_current(self, m: Message) -> list[Message]:
        if m.target_component not in (AUTOPILOT_COMPONENT, 0):
            return []
        self.flight.truth.note('command', command='set current', seq=m.seq, cause=_station(m))
        return [self._mission_current()] if self.mission.set_current(m.seq) else []


def _station(m: Message) -> str:
    return f'station {m.get_srcSystem()}/{m.get_srcComponent()}'
