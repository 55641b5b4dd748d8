# SPDX-License-Identifier: Apache-2.0
"""What a simulated vehicle tells unasked and on request: telemetry messages and their rates."""
from __future__ import annotations

import math
from collections.abc import Callable

from pymavlink.dialects.v20 import ardupilotmega as dialect

from uav_task_alloc.mavlink.codec import Message
from uav_task_alloc.mavlink.vehicle_config import Mode
from uav_task_alloc.mavlink.vehicle_flight import Flight

_FASTEST = 0.005  # [s] no stream is faster
_CAPABILITIES = (dialect.MAV_PROTOCOL_CAPABILITY_MISSION_INT
                 | dialect.MAV_PROTOCOL_CAPABILITY_COMMAND_INT
                 | dialect.MAV_PROTOCOL_CAPABILITY_MAVLINK2)


class Streams:
    """Sends each message at its interval; `rates` [Hz] by message id are those of the start."""

    def __init__(self, makers: dict[int, Callable[[], Message]], rates: dict[int, float]) -> None:
        self._makers = makers
        self._rates = rates
        self._interval: dict[int, float] = {}  # [s]
        self._due: dict[int, float] = {}  # [s]

    def reboot(self, now: float) -> None:
        """Back to the rates of the start."""
        self._interval = {number: 1.0 / rate for number, rate in self._rates.items()}
        self._due = dict.fromkeys(self._interval, now)

    def set_interval(self, number: int, microseconds: float, now: float) -> bool:
        """SET_MESSAGE_INTERVAL: -1 stops, 0 is the rate of the start; False where unknown."""
        if number not in self._makers:
            return False
        seconds = microseconds * 1e-6
        if microseconds == 0.0 and number in self._rates:
            seconds = 1.0 / self._rates[number]
        if seconds <= 0.0:
            self._interval.pop(number, None)
            self._due.pop(number, None)
            return True
        self._interval[number], self._due[number] = max(seconds, _FASTEST), now
        return True

    def make(self, number: int) -> Message | None:
        """The message as it would be now; None where it is unknown."""
        maker = self._makers.get(number)
        return None if maker is None else maker()

    def step(self, now: float) -> list[Message]:
        """What is due by now [s]."""
        out = []
        for number, due in self._due.items():
            while due <= now:
                out.append(self._makers[number]())
                due += self._interval[number]
            self._due[number] = due
        return out


class Telemetry:
    """Makes each message from the state of the flight."""

    def __init__(self, flight: Flight, autopilot: int, system_id: int) -> None:
        self._flight = flight
        self._autopilot = autopilot
        self._system_id = system_id
        self.makers: dict[int, Callable[[], Message]] = {
            dialect.MAVLINK_MSG_ID_HEARTBEAT: self.heartbeat,
            dialect.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: self.global_position,
            dialect.MAVLINK_MSG_ID_LOCAL_POSITION_NED: self.local_position,
            dialect.MAVLINK_MSG_ID_ATTITUDE: self.attitude,
            dialect.MAVLINK_MSG_ID_VFR_HUD: self.vfr_hud,
            dialect.MAVLINK_MSG_ID_SYS_STATUS: self.sys_status,
            dialect.MAVLINK_MSG_ID_BATTERY_STATUS: self.battery_status,
            dialect.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: self.extended_sys_state,
            dialect.MAVLINK_MSG_ID_HOME_POSITION: self.home_position,
            dialect.MAVLINK_MSG_ID_AUTOPILOT_VERSION: self.autopilot_version,
        }

    @property
    def _boot_ms(self) -> int:
        return round((self._flight.now - self._flight.booted) * 1000.0)

    def heartbeat(self) -> Message:
        flight = self._flight
        base = dialect.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
        base |= dialect.MAV_MODE_FLAG_SAFETY_ARMED if flight.armed else 0
        base |= dialect.MAV_MODE_FLAG_AUTO_ENABLED if flight.mode is Mode.MISSION else 0
        status = (dialect.MAV_STATE_STANDBY if flight.landed else dialect.MAV_STATE_ACTIVE)
        return dialect.MAVLink_heartbeat_message(
            dialect.MAV_TYPE_QUADROTOR, self._autopilot, base,
            flight.custom_modes[flight.mode], status, 3)

    def global_position(self) -> Message:
        body = self._flight.body
        latitude, longitude, altitude = body.geodetic()
        vx, vy, vz = body.velocity
        return dialect.MAVLink_global_position_int_message(
            self._boot_ms, round(latitude * 1e7), round(longitude * 1e7), round(altitude * 1e3),
            round((altitude - self._flight.home_amsl) * 1e3), round(vy * 100), round(vx * 100),
            round(-vz * 100), self._course() % 360 * 100)

    def _course(self) -> int:
        return round(90.0 - math.degrees(self._flight.body.heading)) % 360

    def local_position(self) -> Message:
        flight = self._flight
        (x, y, z), (vx, vy, vz), home = flight.body.position, flight.body.velocity, flight.home
        return dialect.MAVLink_local_position_ned_message(
            self._boot_ms, y - home[1], x - home[0], home[2] - z, vy, vx, -vz)

    def attitude(self) -> Message:
        yaw = math.radians((self._course() + 180) % 360 - 180)
        return dialect.MAVLink_attitude_message(self._boot_ms, 0.0, 0.0, yaw, 0.0, 0.0, 0.0)

    def vfr_hud(self) -> Message:
        vx, vy, vz = self._flight.body.velocity
        speed = math.hypot(vx, vy)
        return dialect.MAVLink_vfr_hud_message(
            speed, speed, self._course(), 50, self._flight.body.geodetic()[2], vz)

    def sys_status(self) -> Message:
        return dialect.MAVLink_sys_status_message(
            0, 0, 0, 200, round(10500 + 2100 * self._flight.body.battery), 1000,
            self._percent(), 0, 0, 0, 0, 0, 0)

    def _percent(self) -> int:
        return math.floor(100.0 * self._flight.body.battery)

    def battery_status(self) -> Message:
        voltage = round(10500 + 2100 * self._flight.body.battery)
        return dialect.MAVLink_battery_status_message(
            0, dialect.MAV_BATTERY_FUNCTION_ALL, dialect.MAV_BATTERY_TYPE_LIPO, 32767,
            [voltage] + [65535] * 9, 1000, -1, -1, self._percent())

    def extended_sys_state(self) -> Message:
        flight = self._flight
        if flight.landed:
            state = dialect.MAV_LANDED_STATE_ON_GROUND
        elif flight.mode in (Mode.TAKEOFF, Mode.LAND):
            state = (dialect.MAV_LANDED_STATE_TAKEOFF if flight.mode is Mode.TAKEOFF
                     else dialect.MAV_LANDED_STATE_LANDING)
        else:
            state = dialect.MAV_LANDED_STATE_IN_AIR
        return dialect.MAVLink_extended_sys_state_message(0, state)

    def home_position(self) -> Message:
        item = self._flight.home_item()
        return dialect.MAVLink_home_position_message(
            item.x, item.y, round(item.z * 1000), 0.0, 0.0, 0.0, [1.0, 0.0, 0.0, 0.0], 0.0, 0.0,
            0.0)

    def autopilot_version(self) -> Message:
        return dialect.MAVLink_autopilot_version_message(
            _CAPABILITIES, 0x01000000, 0, 0, 0, [0] * 8, [0] * 8, [0] * 8, 0, 0, self._system_id)
