# SPDX-License-Identifier: Apache-2.0
"""What differs between autopilots: stored items, modes, whether a swap is atomic, commands."""
from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import Enum

from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.mavlink.codec import Message
from uav_task_alloc.mavlink.peer import Peer
from uav_task_alloc.mission import ItemRules


class Flight(Enum):
    """What an autopilot's mode means to the bridge."""

    MISSION = 'mission'
    HOLD = 'hold'  # commanded, not by a stick
    RETURN = 'return'
    TAKEOFF = 'takeoff'
    LAND = 'land'
    PILOT = 'pilot'  # a human flies, or wants it to wait
    UNKNOWN = 'unknown'


@dataclass(frozen=True, slots=True)
class Profile:
    """One kind of autopilot."""

    name: str
    rules: ItemRules
    atomic: bool  # a mission is swapped at the end of an upload; else it is mixed until then
    idle_after: float  # [s] until a stale transfer is forgotten
    modes: Mapping[int, Flight]  # by custom_mode
    set_mode: Mapping[Flight, int]  # custom_mode
    family: str = ''  # whose mode numbers these are, see `modes`; '': unknown
    jump_command: bool = True  # knows DO_SET_MISSION_CURRENT
    amsl_takeoff: bool = False  # NAV_TAKEOFF takes AMSL; else height above home
    farthest_first: float = math.inf  # [m] from home to the first item, else it is refused

    def flight(self, custom_mode: int) -> Flight:
        return self.modes.get(custom_mode, Flight.PILOT if self.modes else Flight.UNKNOWN)

    @property
    def takeoff_mode(self) -> int | None:
        """The custom_mode that a take-off command brings; None: it changes no mode."""
        return next((number for number, flight in self.modes.items()
                     if flight is Flight.TAKEOFF), None) if self.amsl_takeoff else None

    def commanded_mode(self, message: Message) -> int | None:
        """The custom_mode that a DO_SET_MODE asks for; None for other messages."""
        if message.get_type() != 'COMMAND_LONG' or message.command != d.MAV_CMD_DO_SET_MODE:
            return None
        main, sub = int(message.param2), int(message.param3)
        return _px4(main, sub) if self.family == 'px4' else main

    def mode_command(self, peer: Peer, flight: Flight) -> Message:
        """The command that brings it there."""
        if flight not in self.set_mode:
            number = {Flight.MISSION: d.MAV_CMD_MISSION_START,
                      Flight.HOLD: d.MAV_CMD_DO_PAUSE_CONTINUE,
                      Flight.RETURN: d.MAV_CMD_NAV_RETURN_TO_LAUNCH}[flight]
            return peer.command(number)
        mode = self.set_mode[flight]
        main, sub = (mode >> 16 & 0xff, mode >> 24) if mode > 0xffff else (mode, 0)
        return peer.command(d.MAV_CMD_DO_SET_MODE, d.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED, main, sub)

    def takeoff_command(self, peer: Peer, height: float, home_amsl: float) -> Message:
        """Climb to `height` [m] above home, where it is."""
        altitude = home_amsl + height if self.amsl_takeoff else height
        free = math.nan if self.amsl_takeoff else 0.0
        return peer.command(d.MAV_CMD_NAV_TAKEOFF, 0.0, 0.0, 0.0, free, free, free, altitude)


def _px4(main: int, sub: int = 0) -> int:
    return main << 16 | sub << 24


_COPTER = {3: Flight.MISSION, 4: Flight.HOLD, 6: Flight.RETURN, 21: Flight.RETURN,
           27: Flight.RETURN, 9: Flight.LAND}
_PLANE = {10: Flight.MISSION, 15: Flight.HOLD, 11: Flight.RETURN, 21: Flight.RETURN,
          13: Flight.TAKEOFF, 20: Flight.LAND}
_PX4 = {_px4(4, 2): Flight.TAKEOFF, _px4(4, 3): Flight.HOLD, _px4(4, 4): Flight.MISSION,
        _px4(4, 5): Flight.RETURN, _px4(4, 6): Flight.LAND, _px4(4, 1): Flight.HOLD}

ARDUPILOT = Profile(
    'ardupilot', ItemRules(home_first=True, whole_seconds=True, keeps_radius=False, yaw=0.0,
                           command_frame=3, capacity=650),
    atomic=False, idle_after=9.0, modes=_COPTER, family='copter',
    set_mode={Flight.MISSION: 3, Flight.HOLD: 4, Flight.RETURN: 6})
ARDUPLANE = replace(
    ARDUPILOT, rules=replace(ARDUPILOT.rules, loiters=True), modes=_PLANE,
    family='plane',
    set_mode={Flight.MISSION: 10, Flight.HOLD: 15, Flight.RETURN: 11})
PX4 = Profile(
    # NAV_ACC_RAD is 10 m since 2026: it would fly past a task at 2 m/s and call it reached
    'px4', ItemRules(radius=2.0), atomic=True, idle_after=6.0, modes=_PX4, family='px4',
    jump_command=False, amsl_takeoff=True, farthest_first=10_000.0,  # MIS_DIST_1WP
    set_mode={Flight.MISSION: _px4(4, 4), Flight.HOLD: _px4(4, 3), Flight.RETURN: _px4(4, 5)})
PX4_PLANE = replace(PX4, rules=replace(PX4.rules, loiters=True, radius=0.0))
GENERIC = Profile('generic', ItemRules(yaw=0.0), atomic=False, idle_after=9.0, modes={},
                  set_mode={})

_FIXED_WING = {'ardupilot': ARDUPLANE, 'px4': PX4_PLANE}
_BY_NAME = {'ardupilot': ARDUPILOT, 'px4': PX4, 'generic': GENERIC}
_BY_NUMBER = {d.MAV_AUTOPILOT_ARDUPILOTMEGA: 'ardupilot', d.MAV_AUTOPILOT_PX4: 'px4'}


def profile_of(heartbeat: Message, autopilot: str = 'auto') -> Profile:
    """By the heartbeat, or as set."""
    name = (_BY_NUMBER.get(heartbeat.autopilot, 'generic') if autopilot == 'auto'
            else autopilot)
    if heartbeat.type == d.MAV_TYPE_FIXED_WING:
        return _FIXED_WING.get(name, _BY_NAME[name])
    return _BY_NAME[name]
