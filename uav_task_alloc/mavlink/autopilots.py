# SPDX-License-Identifier: Apache-2.0
"""What differs between autopilots: stored items, modes, whether a swap is atomic, commands."""
from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import Enum
from typing import Protocol

from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.mavlink.transport.codec import Message

OFF_GROUND = 2.0  # [m] above home: it flies, whatever landed_state said a second ago


class ModeFunction(Enum):
    """What an autopilot's mode means to the bridge."""

    MISSION = 'mission'
    HOLD = 'hold'  # commanded, not by a stick
    RETURN = 'return'
    TAKEOFF = 'takeoff'
    LAND = 'land'
    PILOT = 'pilot'  # a human flies, or wants it to wait
    UNKNOWN = 'unknown'


class CommandTarget(Protocol):
    """A vehicle that commands are addressed to."""

    def command(self, command: int, *params: float) -> Message:
        """COMMAND_LONG; parameters left out are 0."""


@dataclass(frozen=True, slots=True)
class ItemRules:
    """What the mission store of an autopilot keeps and takes."""

    home_first: bool = False  # seq 0 is home, not an item
    whole_seconds: bool = False  # a hold is cut to whole seconds: round up
    keeps_radius: bool = True  # p2 of a waypoint is its acceptance radius
    radius: float = 0.0  # [m] accepted around a point that says none; 0: the autopilot's own
    yaw: float = math.nan  # p4 of a waypoint where the yaw is left to the autopilot
    command_frame: int = d.MAV_FRAME_MISSION  # of items without a position
    loiters: bool = False  # fixed wing: it cannot hold, it loiters
    capacity: int = 500  # items


@dataclass(frozen=True, slots=True)
class Profile:
    """One kind of autopilot."""

    name: str
    rules: ItemRules
    atomic: bool  # a mission is swapped at the end of an upload; else it is mixed until then
    idle_after: float  # [s] until a stale transfer is forgotten
    modes: Mapping[int, ModeFunction]  # by custom_mode
    set_mode: Mapping[ModeFunction, int]  # custom_mode
    family: str = ''  # whose mode numbers these are, see `modes`; '': unknown
    jump_command: bool = True  # knows DO_SET_MISSION_CURRENT
    amsl_takeoff: bool = False  # NAV_TAKEOFF takes AMSL; else height above home
    farthest_first: float = math.inf  # [m] from home to the first item, else it is refused

    def mode_function(self, custom_mode: int) -> ModeFunction:
        return self.modes.get(
            custom_mode, ModeFunction.PILOT if self.modes else ModeFunction.UNKNOWN
        )

    @property
    def takeoff_mode(self) -> int | None:
        """The custom_mode that a take-off command brings; None: it changes no mode."""
        return next((number for number, flight in self.modes.items()
                     if flight is ModeFunction.TAKEOFF), None) if self.amsl_takeoff else None

    def commanded_mode(self, message: Message) -> int | None:
        """The custom_mode that a DO_SET_MODE asks for; None for other messages."""
        if message.get_type() != 'COMMAND_LONG' or message.command != d.MAV_CMD_DO_SET_MODE:
            return None
        main, sub = int(message.param2), int(message.param3)
        return _px4(main, sub) if self.family == 'px4' else main

    def mode_command(self, peer: CommandTarget, flight: ModeFunction) -> Message:
        """The command that brings it there."""
        if flight not in self.set_mode:
            number = {ModeFunction.MISSION: d.MAV_CMD_MISSION_START,
                      ModeFunction.HOLD: d.MAV_CMD_DO_PAUSE_CONTINUE,
                      ModeFunction.RETURN: d.MAV_CMD_NAV_RETURN_TO_LAUNCH}[flight]
            return peer.command(number)
        mode = self.set_mode[flight]
        main, sub = (mode >> 16 & 0xff, mode >> 24) if mode > 0xffff else (mode, 0)
        return peer.command(d.MAV_CMD_DO_SET_MODE, d.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED, main, sub)

    def takeoff_command(self, peer: CommandTarget, height: float, home_amsl: float) -> Message:
        """Climb to `height` [m] above home, where it is."""
        altitude = home_amsl + height if self.amsl_takeoff else height
        free = math.nan if self.amsl_takeoff else 0.0
        return peer.command(d.MAV_CMD_NAV_TAKEOFF, 0.0, 0.0, 0.0, free, free, free, altitude)


def _px4(main: int, sub: int = 0) -> int:
    return main << 16 | sub << 24


_COPTER = {
    3: ModeFunction.MISSION,
    4: ModeFunction.HOLD,
    6: ModeFunction.RETURN,
    21: ModeFunction.RETURN,
    27: ModeFunction.RETURN,
    9: ModeFunction.LAND,
}
_PLANE = {
    10: ModeFunction.MISSION,
    15: ModeFunction.HOLD,
    11: ModeFunction.RETURN,
    21: ModeFunction.RETURN,
    13: ModeFunction.TAKEOFF,
    20: ModeFunction.LAND,
}
_PX4 = {
    _px4(4, 2): ModeFunction.TAKEOFF,
    _px4(4, 3): ModeFunction.HOLD,
    _px4(4, 4): ModeFunction.MISSION,
    _px4(4, 5): ModeFunction.RETURN,
    _px4(4, 6): ModeFunction.LAND,
    _px4(4, 1): ModeFunction.HOLD,
}

ARDUPILOT = Profile(
    'ardupilot', ItemRules(home_first=True, whole_seconds=True, keeps_radius=False, yaw=0.0,
                           command_frame=3, capacity=650),
    atomic=False, idle_after=9.0, modes=_COPTER, family='copter',
    set_mode={ModeFunction.MISSION: 3, ModeFunction.HOLD: 4, ModeFunction.RETURN: 6})
ARDUPLANE = replace(
    ARDUPILOT, rules=replace(ARDUPILOT.rules, loiters=True), modes=_PLANE,
    family='plane',
    set_mode={ModeFunction.MISSION: 10, ModeFunction.HOLD: 15, ModeFunction.RETURN: 11})
PX4 = Profile(
    # NAV_ACC_RAD is 10 m since 2026: it would fly past a task at 2 m/s and call it reached
    'px4',
    ItemRules(radius=2.0),
    atomic=True,
    idle_after=6.0,
    modes=_PX4,
    family='px4',
    jump_command=False,
    amsl_takeoff=True,
    farthest_first=10_000.0,  # MIS_DIST_1WP
    set_mode={
        ModeFunction.MISSION: _px4(4, 4),
        ModeFunction.HOLD: _px4(4, 3),
        ModeFunction.RETURN: _px4(4, 5),
    },
)
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
