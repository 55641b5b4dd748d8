# SPDX-License-Identifier: Apache-2.0
"""What one vehicle has told of itself: where, which mode, how alive, how often restarted."""
from __future__ import annotations

import math
from collections.abc import Callable

from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.geometry.frames import Origin, to_enu
from uav_task_alloc.mavlink.codec import Message, plan_id
from uav_task_alloc.mavlink.profiles import Flight, Profile
from uav_task_alloc.model import Point

STALE, LOST = 3.0, 10.0  # [s] of silence
BACKWARDS = 2000  # [ms] by which time_boot_ms goes back at a restart, not by a late packet
PACE_OVER = 0.3  # [s] over which a pace is measured
OFF_GROUND = 2.0  # [m] above home: it flies, whatever landed_state said a second ago
# message -> rate asked for [Hz]
RATES = {
    d.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: 5.0, d.MAVLINK_MSG_ID_MISSION_CURRENT: 2.0,
    d.MAVLINK_MSG_ID_BATTERY_STATUS: 1.0, d.MAVLINK_MSG_ID_SYS_STATUS: 1.0,
    d.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: 1.0, d.MAVLINK_MSG_ID_HOME_POSITION: 0.2,
}
WANTED = frozenset({*RATES, *(getattr(d, 'MAVLINK_MSG_ID_' + name) for name in (
    'HEARTBEAT', 'MISSION_REQUEST', 'MISSION_REQUEST_INT', 'MISSION_ACK', 'MISSION_COUNT',
    'MISSION_ITEM', 'MISSION_ITEM_INT', 'MISSION_ITEM_REACHED', 'COMMAND_ACK', 'STATUSTEXT',
    'SYSTEM_TIME'))})
UNKNOWN: Point = (math.nan, math.nan, math.nan)


class Telemetry:
    """The latest of each; NaN or None where nothing was heard."""

    def __init__(self, profile: Profile, origin: Origin, now: float) -> None:
        self._profile, self._origin = profile, origin
        self.heard_at = now  # [s] any message
        self.position, self.velocity = UNKNOWN, UNKNOWN  # ENU [m], [m/s]
        self.home: Point | None = None  # ENU [m]
        self.position_at = -math.inf  # [s]
        self.pace = 0.0  # [m/s] between positions as they come: a simulator may run faster
        self._paced: tuple[Point, float] = UNKNOWN, now
        self.height = math.nan  # [m] above home
        self.altitude = math.nan  # [m] AMSL
        self.battery = math.nan  # 0..1
        self.armed = False
        self.flight = Flight.UNKNOWN
        self.landed = d.MAV_LANDED_STATE_UNDEFINED
        self.status = 0  # MAV_STATE
        self.current: int | None = None  # seq as on the wire
        self.current_at = -math.inf  # [s]
        self.reached: int | None = None  # seq, as last told
        self.total: int | None = None  # items as the vehicle counts them
        self.mission_state = 0  # MISSION_STATE
        self.plan_id = 0  # PX4's id of the mission on board
        self.heard: set[int] = set()  # message ids since the start
        self.restarts = 0
        self.boot_ms = self._boot_doubt = 0  # [ms] its clock
        self._boot_at = now
        self._takes: dict[str, Callable[[Message, float], None]] = {
            'HEARTBEAT': self._heartbeat, 'GLOBAL_POSITION_INT': self._global_position,
            'HOME_POSITION': self._home, 'BATTERY_STATUS': self._battery,
            'SYS_STATUS': self._battery, 'EXTENDED_SYS_STATE': self._extended,
            'MISSION_CURRENT': self._current, 'MISSION_ITEM_REACHED': self._reached}

    @property
    def airborne(self) -> bool:
        """Armed and off the ground, as far as it tells."""
        return self.armed and (self.height > OFF_GROUND or self.landed in (
            d.MAV_LANDED_STATE_IN_AIR, d.MAV_LANDED_STATE_TAKEOFF, d.MAV_LANDED_STATE_LANDING))

    @property
    def faulty(self) -> bool:
        return bool(self.status >= d.MAV_STATE_CRITICAL)

    def stale(self, now: float) -> bool:
        return now - self.heard_at > STALE

    def lost(self, now: float) -> bool:
        return now - self.heard_at > LOST

    def receive(self, message: Message, now: float) -> None:
        """Take any message of this vehicle."""
        self.heard_at = now
        self.heard.add(message.get_msgId())
        boot = getattr(message, 'time_boot_ms', None)
        if boot is not None:
            self._clock(boot, now)
        take = self._takes.get(message.get_type())
        if take:
            take(message, now)

    def restart(self, boot_ms: int = 0) -> None:
        """It begins anew, or it is another one: nothing that was heard holds any more."""
        self.boot_ms, self._boot_doubt = boot_ms, 0
        self.restarts += 1
        self.heard = set()
        self.current, self.total, self.plan_id, self.mission_state = None, None, 0, 0
        self.home, self.height, self.reached = None, math.nan, None

    def _clock(self, boot_ms: int, now: float) -> None:
        """One message with an older clock may be late; two in a row are a restart."""
        silence = now - self._boot_at  # in which a running clock goes on
        if boot_ms >= self.boot_ms - BACKWARDS + 500.0 * silence:
            self.boot_ms, self._boot_doubt = max(boot_ms, self.boot_ms), 0
            self._boot_at = now
            return
        self._boot_doubt += 1
        if self._boot_doubt == 2:
            self._boot_at = now
            self.restart(boot_ms)

    def _heartbeat(self, message: Message, now: float) -> None:
        self.armed = bool(message.base_mode & d.MAV_MODE_FLAG_SAFETY_ARMED)
        self.flight = self._profile.flight(message.custom_mode)
        self.status = message.system_status

    def _global_position(self, message: Message, now: float) -> None:
        self.altitude = message.alt * 1e-3
        self.position = to_enu(self._origin, message.lat * 1e-7, message.lon * 1e-7,
                               self.altitude)
        self.position_at = now
        since, when = self._paced
        if now - when >= PACE_OVER:
            moved = math.dist(self.position, since)
            self.pace = 0.0 if math.isnan(moved) else moved / (now - when)
            self._paced = self.position, now
        self.height = message.relative_alt * 1e-3
        # north, east, down [cm/s]; local axes turn by less than 0.1 degrees in 5 km
        self.velocity = (message.vy * 0.01, message.vx * 0.01, -message.vz * 0.01)

    def _home(self, message: Message, now: float) -> None:
        self.home = to_enu(self._origin, message.latitude * 1e-7, message.longitude * 1e-7,
                           message.altitude * 1e-3)

    def _battery(self, message: Message, now: float) -> None:
        if message.battery_remaining >= 0:
            self.battery = message.battery_remaining / 100.0

    def _extended(self, message: Message, now: float) -> None:
        self.landed = message.landed_state

    def _current(self, message: Message, now: float) -> None:
        self.current, self.current_at = message.seq, now
        self.total = message.total if 0 < message.total < 65535 else None
        self.mission_state = message.mission_state
        self.plan_id = plan_id(message)

    def _reached(self, message: Message, now: float) -> None:
        self.reached = message.seq
