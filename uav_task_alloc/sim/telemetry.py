# SPDX-License-Identifier: Apache-2.0
"""Telemetry messages of a simulated vehicle, built from its state."""
from __future__ import annotations

import math
from collections.abc import Callable

from pymavlink.dialects.v20 import ardupilotmega as dialect

from uav_task_alloc.mavlink.transport.codec import Message
from uav_task_alloc.sim.batteries import SimBatteries
from uav_task_alloc.sim.config import FlightMode
from uav_task_alloc.sim.estimate import Estimate
from uav_task_alloc.sim.flight import VehicleFlight
from uav_task_alloc.sim.stored_item import LAND
from uav_task_alloc.sim.streams import Maker

_CAPABILITIES = (dialect.MAV_PROTOCOL_CAPABILITY_MISSION_INT
                 | dialect.MAV_PROTOCOL_CAPABILITY_COMMAND_INT
                 | dialect.MAV_PROTOCOL_CAPABILITY_MAVLINK2)
_PREARM = dialect.MAV_SYS_STATUS_PREARM_CHECK
_UNKNOWN = 65535


class TelemetryMessages:
    """Builds each message from the state of the flight; None where it is not sent yet."""

    def __init__(self, flight: VehicleFlight, estimate: Estimate, autopilot: int,
                 system_id: int, batteries: SimBatteries) -> None:
        self.batteries = batteries
        self._flight, self._estimate = flight, estimate
        self._autopilot, self._system_id = autopilot, system_id
        self._px4 = autopilot == dialect.MAV_AUTOPILOT_PX4
        self.makers: dict[int, Maker] = {
            number: _listed(make) for number, make in self._single().items()}
        self.makers[dialect.MAVLINK_MSG_ID_BATTERY_STATUS] = self.batteries.messages

    def _single(self) -> dict[int, Callable[[], Message | None]]:
        estimator = ((dialect.MAVLINK_MSG_ID_ESTIMATOR_STATUS, self.estimator_status)
                     if self._px4 else
                     (dialect.MAVLINK_MSG_ID_EKF_STATUS_REPORT, self.ekf_status_report))
        return dict([estimator]) | {
            dialect.MAVLINK_MSG_ID_HEARTBEAT: self.heartbeat,
            dialect.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: self.global_position,
            dialect.MAVLINK_MSG_ID_LOCAL_POSITION_NED: self.local_position,
            dialect.MAVLINK_MSG_ID_GPS_RAW_INT: self.gps_raw,
            dialect.MAVLINK_MSG_ID_ATTITUDE: self.attitude,
            dialect.MAVLINK_MSG_ID_VFR_HUD: self.vfr_hud,
            dialect.MAVLINK_MSG_ID_SYS_STATUS: self.sys_status,
            dialect.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: self.extended_sys_state,
            dialect.MAVLINK_MSG_ID_HOME_POSITION: self.home_position,
            dialect.MAVLINK_MSG_ID_AUTOPILOT_VERSION: self.autopilot_version,
        }

    @property
    def _boot_ms(self) -> int:
        return round((self._flight.now - self._flight.booted) * 1000.0) % 2**32

    def heartbeat(self) -> Message:
        flight = self._flight
        base = dialect.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
        base |= dialect.MAV_MODE_FLAG_SAFETY_ARMED if flight.armed else 0
        base |= dialect.MAV_MODE_FLAG_AUTO_ENABLED if flight.mode is FlightMode.MISSION else 0
        return dialect.MAVLink_heartbeat_message(
            dialect.MAV_TYPE_QUADROTOR, self._autopilot, base, flight.custom_mode,
            self._system_status(), 3)

    def _system_status(self) -> int:
        """MAV_STATE."""
        flight = self._flight
        if flight.boot.booting:
            return flight.boot_states[0 if flight.boot.initialising else 1]
        if flight.terminated:
            return int(dialect.MAV_STATE_FLIGHT_TERMINATION)
        if flight.failsafes:
            return int(dialect.MAV_STATE_CRITICAL)
        return int(dialect.MAV_STATE_STANDBY if flight.landed else dialect.MAV_STATE_ACTIVE)

    def global_position(self) -> Message | None:
        body, heading = self._flight.body, self._course() % 360 * 100
        if not self._flight.positioned:
            return None if self._px4 else dialect.MAVLink_global_position_int_message(
                self._boot_ms, 0, 0, 0, 0, 0, 0, 0, heading)
        latitude, longitude, altitude = body.geodetic(self._estimate.offset)
        vx, vy, vz = body.velocity
        return dialect.MAVLink_global_position_int_message(
            self._boot_ms, round(latitude * 1e7), round(longitude * 1e7), round(altitude * 1e3),
            round((altitude - self._flight.home_amsl) * 1e3), round(vy * 100), round(vx * 100),
            round(-vz * 100), heading)

    def _course(self) -> int:
        return round(90.0 - math.degrees(self._flight.body.heading)) % 360

    def local_position(self) -> Message | None:
        flight = self._flight
        if not flight.positioned:
            return None
        (x, y, z), (vx, vy, vz), base = flight.body.position, flight.body.velocity, flight.base
        dx, dy, dz = self._estimate.offset
        return dialect.MAVLink_local_position_ned_message(
            self._boot_ms, y + dy - base[1], x + dx - base[0], base[2] - z - dz, vy, vx, -vz)

    def gps_raw(self) -> Message:
        boot_us = self._boot_ms * 1000
        if not self._flight.positioned:
            return dialect.MAVLink_gps_raw_int_message(
                boot_us, dialect.GPS_FIX_TYPE_NO_FIX, 0, 0, 0, _UNKNOWN, _UNKNOWN, 0, _UNKNOWN, 0)
        latitude, longitude, altitude = self._flight.body.geodetic(
            self._estimate.satellite_offset)
        vx, vy, _ = self._flight.body.velocity
        return dialect.MAVLink_gps_raw_int_message(
            boot_us, dialect.GPS_FIX_TYPE_3D_FIX, round(latitude * 1e7), round(longitude * 1e7),
            round(altitude * 1e3), 121, 200, round(math.hypot(vx, vy) * 100),
            self._course() * 100, 10)

    def ekf_status_report(self) -> Message:
        flags = self._estimate.status_flags
        flags |= dialect.EKF_GPS_GLITCHING if self._estimate.glitching else 0
        flags |= 0 if self._flight.positioned else dialect.EKF_CONST_POS_MODE
        if self._flight.boot.booting:
            flags = dialect.EKF_UNINITIALIZED
        return dialect.MAVLink_ekf_status_report_message(flags, *[self._variance()] * 4, 0.0)

    def estimator_status(self) -> Message:
        flags = self._estimate.status_flags
        flags |= dialect.ESTIMATOR_GPS_GLITCH if self._estimate.glitching else 0
        ratio = self._variance()
        return dialect.MAVLink_estimator_status_message(
            self._boot_ms * 1000, flags, ratio, ratio, ratio, ratio, 0.0, 0.0, 1.0, 1.0)

    def _variance(self) -> float:
        bad = self._estimate.glitching or 'ekf' in self._flight.failsafes
        return 1.5 if bad else 0.1  # the estimators reject from 1 on

    def attitude(self) -> Message:
        yaw = math.radians((self._course() + 180) % 360 - 180)
        return dialect.MAVLink_attitude_message(self._boot_ms, 0.0, 0.0, yaw, 0.0, 0.0, 0.0)

    def vfr_hud(self) -> Message:
        vx, vy, vz = self._flight.body.velocity
        speed = math.hypot(vx, vy)
        altitude = self._flight.body.geodetic(self._estimate.offset)[2]
        return dialect.MAVLink_vfr_hud_message(
            speed, speed, self._course(), 50, altitude, vz)

    def sys_status(self) -> Message:
        flight = self._flight
        healthy = _PREARM if flight.armed or not flight.prearm_refusal() else 0
        return dialect.MAVLink_sys_status_message(
            _PREARM, _PREARM, healthy, 200, self.batteries.voltage(0), self.batteries.current(0),
            self.batteries.percent(0), 0, 0, 0, 0, 0, 0)

    def extended_sys_state(self) -> Message:
        return dialect.MAVLink_extended_sys_state_message(0, self._landed_state())

    def _landed_state(self) -> int:
        """MAV_LANDED_STATE.

        ArduCopter: `is_landing` and `is_taking_off` of its mode; PX4: the type of its setpoint.
        """
        flight, track = self._flight, self._flight.track
        if flight.landed:
            return int(dialect.MAV_LANDED_STATE_ON_GROUND)
        if flight.mode is FlightMode.LAND or self._lands_by_item() or (
                track is not None and track.descends):
            return int(dialect.MAV_LANDED_STATE_LANDING)
        if flight.mode is FlightMode.TAKEOFF or (track is not None and track.takes_off):
            return int(dialect.MAV_LANDED_STATE_TAKEOFF)
        return int(dialect.MAV_LANDED_STATE_IN_AIR)

    def _lands_by_item(self) -> bool:
        """Whether it flies a NAV_LAND item."""
        flight = self._flight
        return (flight.mode is FlightMode.MISSION and flight.track is not None
                and flight.seq < len(flight.items)
                and flight.items[flight.seq].command == LAND)

    def home_position(self) -> Message | None:
        if not self._flight.positioned:
            return None
        item = self._flight.home_item()
        return dialect.MAVLink_home_position_message(
            item.x, item.y, round(item.z * 1000), 0.0, 0.0, 0.0, [1.0, 0.0, 0.0, 0.0], 0.0, 0.0,
            0.0)

    def autopilot_version(self) -> Message:
        return dialect.MAVLink_autopilot_version_message(
            _CAPABILITIES, 0x01000000, 0, 0, 0, [0] * 8, [0] * 8, [0] * 8, 0, 0, self._system_id)


def _listed(make: Callable[[], Message | None]) -> Maker:
    def listed() -> list[Message]:
        message = make()
        return [] if message is None else [message]
    return listed
