# SPDX-License-Identifier: Apache-2.0
"""The telemetry of one vehicle: position, mode, battery, link, restarts."""
from __future__ import annotations

import math
from collections.abc import Callable

from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.geometry.frames import Origin, to_enu
from uav_task_alloc.mavlink.autopilots import OFF_GROUND, ModeFunction, Profile
from uav_task_alloc.mavlink.gcs.battery_level import BatteryLevel
from uav_task_alloc.mavlink.gcs.boot_clock import BootClock
from uav_task_alloc.mavlink.gcs.link_times import LinkTimes
from uav_task_alloc.mavlink.gcs.mission_report import MissionReport
from uav_task_alloc.mavlink.gcs.newest_reports import NewestReports
from uav_task_alloc.mavlink.gcs.position_validity import PositionValidity
from uav_task_alloc.mavlink.gcs.status_texts import failing_checks
from uav_task_alloc.mavlink.gcs.telemetry_messages import ESTIMATE
from uav_task_alloc.mavlink.gcs.two_vehicles import TwoVehicles
from uav_task_alloc.mavlink.transport.codec import Message
from uav_task_alloc.mavlink.transport.frame_log import FrameLog
from uav_task_alloc.model import Point

DISARM_PAUSE = 3.0  # [s] after a disarming in which a fall shows, and nothing is armed
_IN_AIR = frozenset({
    d.MAV_LANDED_STATE_IN_AIR, d.MAV_LANDED_STATE_TAKEOFF, d.MAV_LANDED_STATE_LANDING})
_SIMULATED = 2.0  # seconds of its clock in one of this program: a simulator that runs faster
_PACE_OVER = 0.3  # [s] between two positions that measure the pace
UNKNOWN: Point = (math.nan, math.nan, math.nan)


class Telemetry:
    """The latest state of one vehicle; NaN or None where none was received.

    Args:
        profile: of its autopilot.
        origin: of the local ENU frame.
        now: steady time [s], as in all methods.
    """

    _mission_flown = True  # the mission on board was, or it is not known

    def __init__(self, profile: Profile, origin: Origin, now: float) -> None:
        self._profile, self._origin = profile, origin
        self.link, self.two_vehicles = LinkTimes(now), TwoVehicles()
        self.position, self.velocity = UNKNOWN, UNKNOWN  # ENU [m], [m/s]
        self.home: Point | None = None  # ENU [m]
        self.position_at = self.positions_at = -math.inf  # [s] valid; any GLOBAL_POSITION_INT
        self.pace = 0.0  # [m/s] in time of reception: a simulator may run faster than real time
        self._paced: tuple[Point, float] = UNKNOWN, now
        self._converted: tuple[Message, Point] | None = None  # the latest, and its position [m]
        self.height = math.nan  # [m] above home
        self.altitude = math.nan  # [m] AMSL
        self._level = BatteryLevel()
        # a PX4 in mission mode flies nothing until it is armed, as after a return
        self.disarmed_at = -math.inf  # [s] a heartbeat showed it
        self.armed = self.arms_into_mission = self.disarmed_since_mission = False
        self.mode, self.mode_at = ModeFunction.UNKNOWN, -math.inf  # it was set then [s]
        self.landed = d.MAV_LANDED_STATE_UNDEFINED
        self.status = self.autopilot = 0  # MAV_STATE, MAV_AUTOPILOT
        self.unhealthy = ''  # text on failing prearm checks; '': none reported
        self.mission = MissionReport(profile.atomic)
        self._mode_frame = 0  # number of the one that shows the mode
        self.received_ids: set[int] = set()  # message ids since the start
        self.received_last: dict[int, float] = {}  # [s] by message id
        self.restarts, self.booted_at = 0, -math.inf  # how many; [s] the latest, or earlier
        self._boot_clock = BootClock(now)
        self.clock_rate = self._boot_clock.rate
        self.frames = FrameLog()
        self.frame = 0  # frame number of the latest message
        self._newest, self._validity = NewestReports(), PositionValidity()
        # it has finished booting; was on the ground since it was in mission mode
        self._started = self._landed_since_mission = False
        self.has_position = False  # valid by its estimator or its GPS
        self._handlers = self._message_handlers()

    def _message_handlers(self) -> dict[str, Callable[[Message, float], None]]:
        """The methods that process a message, by its type."""
        return {
            'HEARTBEAT': self._heartbeat, 'GLOBAL_POSITION_INT': self._global_position,
            'HOME_POSITION': self._home, 'BATTERY_STATUS': self._level.take_battery,
            'SYS_STATUS': self._sys_status, 'EXTENDED_SYS_STATE': self._extended,
            'MISSION_CURRENT': self._current, 'GPS_RAW_INT': self._validity.take_gps,
            'EKF_STATUS_REPORT': self._validity.take_estimate,
            'ESTIMATOR_STATUS': self._validity.take_estimate}

    @property
    def boot_ms(self) -> int:
        """The latest time since boot of the vehicle [ms]."""
        return self._boot_clock.boot_ms

    def clock_forecast(self) -> Callable[[float], float] | None:
        """`BootClock.forecast` of the vehicle."""
        return self._boot_clock.forecast()

    @property
    def battery(self) -> float:
        """[0..1] of the battery with least remaining; NaN: unknown."""
        return self._level.remaining

    @property
    def off_ground(self) -> bool:
        """Off the ground, by its height or its landed state."""
        return self.height > OFF_GROUND or self.landed in _IN_AIR

    @property
    def airborne(self) -> bool:
        """Armed and off the ground."""
        return self.armed and self.off_ground

    @property
    def airborne_since_mission(self) -> bool:
        """In the air, and not on the ground since it was in mission mode."""
        return self.airborne and not self._landed_since_mission

    @property
    def ends_by_mission(self) -> bool:
        """Whether an end that PX4 reports can only be that of its mission."""
        return self.airborne_since_mission and (
            self.mode not in (ModeFunction.LAND, ModeFunction.TAKEOFF))

    @property
    def grounded(self) -> bool:
        """Known to be on the ground; both this and `airborne` are False if it is unknown."""
        return not self.armed or (self.landed == d.MAV_LANDED_STATE_ON_GROUND
                                  and not self.height > OFF_GROUND)

    @property
    def has_velocity(self) -> bool:
        """Whether a velocity was received."""
        return not math.isnan(self.velocity[0])

    @property
    def speed(self) -> float:
        """[m/s]; NaN: unknown."""
        return math.hypot(*self.velocity)

    @property
    def in_mission(self) -> bool:
        """Whether it is in mission mode, by the newest heartbeat or MISSION_CURRENT."""
        return (self.mode is ModeFunction.MISSION
                or self.mission.in_mission_frame > self._mode_frame)

    @property
    def shows_mission(self) -> bool:
        """Whether the latest message is a MISSION_CURRENT that shows mission mode."""
        return self.mission.in_mission_frame == self.frame > self._mode_frame

    @property
    def showed_mission(self) -> bool:
        """Whether the latest message is a MISSION_CURRENT sent before mission mode was left."""
        return self.mission.in_mission_frame == self.frame <= self._mode_frame

    @property
    def past_boot(self) -> bool:
        """Whether the autopilot has booted, so that its mission store is available."""
        return self.autopilot not in ESTIMATE or self._started

    @property
    def starting(self) -> str:
        """Why it is not past boot; PX4 reports UNINIT as long as its preflight checks fail."""
        return 'the autopilot is starting' + (f': {self.unhealthy}' if self.unhealthy else '')

    @property
    def faulty(self) -> bool:
        """Whether it reports MAV_STATE_CRITICAL or worse."""
        return bool(self.status >= d.MAV_STATE_CRITICAL)

    def idle_after(self) -> float:
        """Return the time [s] after which the vehicle has given up a transfer, by its clock.

        The rate of the clock counts from `_SIMULATED` on: a slow link makes it uncertain.
        """
        rate = self.clock_rate.value
        return self._profile.idle_after / (rate if rate >= _SIMULATED else 1.0)

    def note_acknowledged(self, mode: ModeFunction) -> None:
        """Take a mode that the vehicle has acknowledged; its heartbeats may be older."""
        self._set_mode(mode, self.link.received_at)
        self.arms_into_mission = False
        self._mode_frame = self.frames.newest

    def note_new_mission(self) -> None:
        """Note that the vehicle has taken another mission, which it has not flown yet."""
        self._mission_flown = self.disarmed_since_mission = False

    def _set_mode(self, mode: ModeFunction, now: float) -> None:
        if mode is not self.mode:
            self.mode, self.mode_at = mode, now

    def is_of_before_restart(self, message: Message, now: float) -> bool:
        """Whether a message was sent before a restart of the vehicle, and comes after it."""
        boot = self._boot_time(message, now)
        return boot is not None and self._boot_clock.is_of_before(boot, now)

    def _boot_time(self, message: Message, now: float) -> int | None:
        """`time_boot_ms` of a message, changed in it to one that does not begin again at 0."""
        if hasattr(message, 'time_boot_ms'):
            message.time_boot_ms = self._boot_clock.unwrapped(message.time_boot_ms, now)
        return getattr(message, 'time_boot_ms', None)

    def receive(self, message: Message, now: float) -> bool:
        """Process a message of this vehicle; False if a newer one of its type was received."""
        self.link.receive(now)
        boot = self._boot_time(message, now)
        if boot is not None:  # first, as a restart begins other frame numbers
            booted_at = self._boot_clock.receive(boot, now)
            if booted_at is not None:
                self._reset(booted_at)
        if skipped := getattr(message, 'skipped', ()):
            self.frames.note_all((seq for system, seq in skipped
                                  if system == message.get_srcSystem()), now)
        self.frame = self.frames.note(message.get_seq(), now)
        self.received_ids.add(message.get_msgId())
        self.received_last[message.get_msgId()] = now
        if self._newest.is_outdated(message, self.frame, now):
            if message.get_type() == 'GLOBAL_POSITION_INT' and self.has_position:
                self._compare(message, now, late=True)
            return False
        handler = self._handlers.get(message.get_type())
        if handler:
            handler(message, now)
        return True

    def restart(self) -> None:
        """Reset when another vehicle uses its system id."""
        self._boot_clock.reset()
        self._reset(self.booted_at)

    def _reset(self, booted_at: float) -> None:
        """Forget what a restart ends."""
        self.booted_at = booted_at
        self.restarts += 1
        self.received_ids = set()
        self.received_last.clear()
        self._mode_frame = 0
        self.home, self.height = None, math.nan
        self.landed = d.MAV_LANDED_STATE_UNDEFINED
        self.has_position = self._started = False
        for part in (self.mission, self._validity, self._newest):
            part.forget()
        self.frames.clear()
        self._level.restart()

    def _heartbeat(self, message: Message, now: float) -> None:
        self.link.heartbeat_at = now
        was_armed = self.armed
        self.armed = bool(message.base_mode & d.MAV_MODE_FLAG_SAFETY_ARMED)
        if was_armed and not self.armed:
            self.disarmed_at = now
        mode = self._profile.mode_function(message.custom_mode)
        self.arms_into_mission = (
            mode is ModeFunction.MISSION and self._profile.atomic and not self.armed)
        self._set_mode(ModeFunction.HOLD if self.arms_into_mission else mode, now)
        if not self.armed:
            self.disarmed_since_mission = self._mission_flown
        elif mode is ModeFunction.MISSION:
            self._mission_flown, self.disarmed_since_mission = True, False
        self._mode_frame = self.frame
        self._landed(self.landed)
        if self.mode is ModeFunction.MISSION:
            self._landed_since_mission = False
        if message.system_status == d.MAV_STATE_BOOT and self._started:
            self._boot_clock.restart(0, now)  # its clock is received later
            self._reset(now)
        self.status, self.autopilot = message.system_status, message.autopilot
        # PX4 reports UNINIT later as well, when its preflight checks fail
        self._started = self._started or self.status >= d.MAV_STATE_STANDBY

    def _global_position(self, message: Message, now: float) -> None:
        self.positions_at = now
        self.has_position = (message.lat, message.lon) != (0, 0) and (
            self._validity.is_valid(self.autopilot, self.received_ids, now))
        if not self.has_position:
            return
        self.altitude = message.alt * 1e-3
        self.position, self.velocity = self.enu_of(message)
        self.position_at = now
        self._compare(message, now)
        start, start_at = self._paced
        if now - start_at >= _PACE_OVER:
            moved = math.dist(self.position, start)
            self.pace = 0.0 if math.isnan(moved) else moved / (now - start_at)
            self._paced = self.position, now
        self.height = message.relative_alt * 1e-3

    def _compare(self, message: Message, now: float, late: bool = False) -> None:
        """Compare a position with the one before: both may be of two vehicles."""
        self.two_vehicles.receive(self.enu_of(message)[0], message.time_boot_ms * 1e-3, now, late,
                                  self.clock_rate.value)

    def enu_of(self, message: Message) -> tuple[Point, Point]:
        """Position [m] and velocity [m/s], both ENU, of a GLOBAL_POSITION_INT."""
        if self._converted is None or self._converted[0] is not message:
            self._converted = message, to_enu(
                self._origin, message.lat * 1e-7, message.lon * 1e-7, message.alt * 1e-3)
        # north, east, down [cm/s]; local axes turn by less than 0.1 degrees in 5 km
        velocity = (message.vy * 0.01, message.vx * 0.01, -message.vz * 0.01)
        return self._converted[1], velocity

    def _home(self, message: Message, now: float) -> None:
        if (message.latitude, message.longitude) == (0, 0):
            return  # not known, as in GLOBAL_POSITION_INT
        self.home = to_enu(self._origin, message.latitude * 1e-7, message.longitude * 1e-7,
                           message.altitude * 1e-3)

    def _sys_status(self, message: Message, now: float) -> None:
        self.unhealthy = failing_checks(message)
        self._level.take_system(message, now)

    def _extended(self, message: Message, now: float) -> None:
        self._landed(message.landed_state)

    def _landed(self, landed: int) -> None:
        # disarmed: sent before it landed, and armed again it is not in the air by that
        self.landed = (landed if self.armed or landed not in _IN_AIR
                       else d.MAV_LANDED_STATE_UNDEFINED)
        self._landed_since_mission = self._landed_since_mission or self.grounded

    def _current(self, message: Message, now: float) -> None:
        self.mission.receive(message, self.frame, now)
