# SPDX-License-Identifier: Apache-2.0
"""Autopilot profiles: mission item rules, custom modes, atomic replacement, mode commands."""
from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import Enum, IntEnum
from typing import Protocol

from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.mavlink.action_commands import (
    ARDUCOPTER_ACTIONS,
    ARDUPLANE_ACTIONS,
    GENERIC_ACTIONS,
    PX4_ACTIONS,
    ActionRow,
)
from uav_task_alloc.mavlink.transport.codec import Message

OFF_GROUND = 2.0  # [m] above home: airborne, whatever the latest landed_state is


class ModeFunction(Enum):
    """The function of an autopilot's custom mode, as far as the bridge distinguishes them."""

    MISSION = 'mission'
    HOLD = 'hold'  # position hold without stick input
    RETURN = 'return'
    TAKEOFF = 'takeoff'
    LAND = 'land'
    PILOT = 'pilot'  # flown or held by a human
    UNKNOWN = 'unknown'


class Px4MainMode(IntEnum):
    """Main modes of PX4 (PX4_CUSTOM_MAIN_MODE of px4_custom_mode.h), not in the dialect.

    https://github.com/PX4/PX4-Autopilot/blob/main/src/modules/commander/px4_custom_mode.h
    """

    MANUAL = 1
    ALTCTL = 2
    POSCTL = 3
    AUTO = 4
    ACRO = 5
    OFFBOARD = 6
    STABILIZED = 7
    RATTITUDE = 8
    TERMINATION = 10


class Px4AutoMode(IntEnum):
    """Sub modes of PX4's AUTO (PX4_CUSTOM_SUB_MODE_AUTO of px4_custom_mode.h)."""

    READY = 1
    TAKEOFF = 2
    LOITER = 3
    MISSION = 4
    RTL = 5
    LAND = 6
    FOLLOW_TARGET = 8
    PRECLAND = 9
    VTOL_TAKEOFF = 10


class CommandTarget(Protocol):
    """The addressee of a command, see `mission.peer.Peer`."""

    def command(self, command: int, *params: float) -> Message:
        """COMMAND_LONG to it; omitted parameters are 0."""


@dataclass(frozen=True, slots=True)
class ItemRules:
    """How an autopilot stores mission items."""

    home_first: bool = False  # seq 0 is home, not an item
    whole_seconds: bool = False  # a hold is truncated to whole seconds: round up
    keeps_radius: bool = True  # p2 of a waypoint is its acceptance radius
    radius: float = 0.0  # [m] default acceptance radius; 0: that of the autopilot
    yaw: float = math.nan  # p4 of a waypoint whose yaw the autopilot chooses
    command_frame: int = d.MAV_FRAME_MISSION  # MAV_FRAME of items without a position
    loiters: bool = False  # fixed wing: loiters in place of a hold
    lands: bool = False  # NAV_LAND comes straight down: multicopters
    capacity: int = 500  # items
    fence_points: int = 64  # of the fence store
    turns_by_waypoint: bool = True  # p4 of a waypoint is a heading; else CONDITION_YAW
    # how it carries out the named actions; all of them are here
    actions: Mapping[str, ActionRow] = field(default_factory=lambda: GENERIC_ACTIONS, repr=False,
                                             compare=False)


@dataclass(frozen=True, slots=True)
class Profile:
    """How one kind of autopilot is commanded, and how it stores missions.

    Arguments of methods:
        custom_mode: of a HEARTBEAT.
        message: from any station.
    """

    name: str  # 'ardupilot', 'px4' or 'generic'
    rules: ItemRules  # frames and commands of items
    atomic: bool  # an upload replaces the mission at its end; else item by item
    idle_after: float  # [s] until the autopilot drops a stale transfer
    modes: Mapping[int, ModeFunction]  # by custom_mode
    set_mode: Mapping[ModeFunction, int]  # custom_mode by function
    family: str = ''  # the set of custom mode numbers: 'copter', 'plane', 'px4'; '': unknown
    jump_command: bool = True  # supports DO_SET_MISSION_CURRENT
    amsl_takeoff: bool = False  # NAV_TAKEOFF altitude is AMSL; else above home
    farthest_first: float = math.inf  # [m] largest distance from home to the first item

    def mode_function(self, custom_mode: int) -> ModeFunction:
        """The function of a custom mode; PILOT for a mode that the profile does not list."""
        return self.modes.get(
            custom_mode, ModeFunction.PILOT if self.modes else ModeFunction.UNKNOWN
        )

    @property
    def takeoff_mode(self) -> int | None:
        """The custom_mode that NAV_TAKEOFF enters; None: it changes no mode."""
        return next((number for number, function in self.modes.items()
                     if function is ModeFunction.TAKEOFF), None) if self.amsl_takeoff else None

    def commanded_mode(self, message: Message) -> int | None:
        """The custom_mode requested by a DO_SET_MODE; None for other messages."""
        if message.get_type() != 'COMMAND_LONG' or message.command != d.MAV_CMD_DO_SET_MODE:
            return None
        main, sub = int(message.param2), int(message.param3)
        return px4_custom_mode(main, sub) if self.family == 'px4' else main

    def mode_command(self, peer: CommandTarget, function: ModeFunction) -> Message:
        """The command that enters a mode.

        Args:
            peer: the vehicle.
            function: a key of `set_mode`, or MISSION, HOLD or RETURN.

        Returns:
            DO_SET_MODE; where the profile has no mode number, MISSION_START, DO_PAUSE_CONTINUE
            or NAV_RETURN_TO_LAUNCH.
        """
        if function not in self.set_mode:
            number = {ModeFunction.MISSION: d.MAV_CMD_MISSION_START,
                      ModeFunction.HOLD: d.MAV_CMD_DO_PAUSE_CONTINUE,
                      ModeFunction.RETURN: d.MAV_CMD_NAV_RETURN_TO_LAUNCH}[function]
            return peer.command(number)
        mode = self.set_mode[function]
        main, sub = px4_mode_parts(mode) if self.family == 'px4' else (mode, 0)
        return peer.command(d.MAV_CMD_DO_SET_MODE, d.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED, main, sub)

    def takeoff_command(self, peer: CommandTarget, height: float, home_amsl: float) -> Message:
        """NAV_TAKEOFF at the present position.

        Args:
            peer: the vehicle.
            height: [m] above home.
            home_amsl: [m] altitude of home.
        """
        altitude = home_amsl + height if self.amsl_takeoff else height
        unset = math.nan if self.amsl_takeoff else 0.0
        return peer.command(d.MAV_CMD_NAV_TAKEOFF, 0.0, 0.0, 0.0, unset, unset, unset, altitude)


def px4_custom_mode(main: int, sub: int = 0) -> int:
    """Combine PX4's main and sub mode into a custom_mode (px4_custom_mode.h)."""
    return main << 16 | sub << 24


def px4_mode_parts(custom_mode: int) -> tuple[int, int]:
    """Split a custom_mode of PX4 into its main and sub mode.

    Args:
        custom_mode: of a HEARTBEAT or DO_SET_MODE (px4_custom_mode.h).

    Returns:
        (main mode, sub mode).
    """
    return custom_mode >> 16 & 0xff, custom_mode >> 24 & 0xff


def _auto(sub: Px4AutoMode) -> int:
    return px4_custom_mode(Px4MainMode.AUTO, sub)


_COPTER = {
    d.COPTER_MODE_AUTO: ModeFunction.MISSION,
    d.COPTER_MODE_GUIDED: ModeFunction.HOLD,
    d.COPTER_MODE_RTL: ModeFunction.RETURN,
    d.COPTER_MODE_SMART_RTL: ModeFunction.RETURN,
    d.COPTER_MODE_AUTO_RTL: ModeFunction.RETURN,
    d.COPTER_MODE_LAND: ModeFunction.LAND,
}
_PLANE = {
    d.PLANE_MODE_AUTO: ModeFunction.MISSION,
    d.PLANE_MODE_GUIDED: ModeFunction.HOLD,
    d.PLANE_MODE_RTL: ModeFunction.RETURN,
    d.PLANE_MODE_QRTL: ModeFunction.RETURN,
    d.PLANE_MODE_TAKEOFF: ModeFunction.TAKEOFF,
    d.PLANE_MODE_QLAND: ModeFunction.LAND,
}
_PX4 = {
    _auto(Px4AutoMode.TAKEOFF): ModeFunction.TAKEOFF,
    _auto(Px4AutoMode.LOITER): ModeFunction.HOLD,
    _auto(Px4AutoMode.MISSION): ModeFunction.MISSION,
    _auto(Px4AutoMode.RTL): ModeFunction.RETURN,
    _auto(Px4AutoMode.LAND): ModeFunction.LAND,
    _auto(Px4AutoMode.READY): ModeFunction.HOLD,
}

ARDUPILOT = Profile(
    'ardupilot', ItemRules(home_first=True, whole_seconds=True, keeps_radius=False, yaw=0.0,
                           command_frame=d.MAV_FRAME_GLOBAL_RELATIVE_ALT, capacity=650,
                           fence_points=70, lands=True, turns_by_waypoint=False,
                           actions=ARDUCOPTER_ACTIONS),
    atomic=False, idle_after=9.0, modes=_COPTER, family='copter',
    set_mode={ModeFunction.MISSION: d.COPTER_MODE_AUTO, ModeFunction.HOLD: d.COPTER_MODE_GUIDED,
              ModeFunction.RETURN: d.COPTER_MODE_RTL})
ARDUPLANE = replace(
    ARDUPILOT, rules=replace(ARDUPILOT.rules, loiters=True, lands=False,
                             actions=ARDUPLANE_ACTIONS), modes=_PLANE,
    family='plane',
    set_mode={ModeFunction.MISSION: d.PLANE_MODE_AUTO, ModeFunction.HOLD: d.PLANE_MODE_GUIDED,
              ModeFunction.RETURN: d.PLANE_MODE_RTL})
PX4 = Profile(
    # NAV_ACC_RAD is 10 m since 2026: a task would count as reached when passed at that distance
    'px4',
    ItemRules(radius=2.0, lands=True, actions=PX4_ACTIONS),
    atomic=True,
    idle_after=6.0,
    modes=_PX4,
    family='px4',
    jump_command=False,
    amsl_takeoff=True,
    farthest_first=10_000.0,  # MIS_DIST_1WP
    set_mode={
        ModeFunction.MISSION: _auto(Px4AutoMode.MISSION),
        ModeFunction.HOLD: _auto(Px4AutoMode.LOITER),
        ModeFunction.RETURN: _auto(Px4AutoMode.RTL),
    },
)
PX4_PLANE = replace(PX4, rules=replace(
    PX4.rules, loiters=True, lands=False, radius=0.0, turns_by_waypoint=False))
PX4_VTOL = replace(PX4, rules=replace(PX4.rules, lands=False))  # it would land as a plane
GENERIC = Profile('generic', ItemRules(yaw=0.0), atomic=False, idle_after=9.0, modes={},
                  set_mode={})

_FIXED_WING = {'ardupilot': ARDUPLANE, 'px4': PX4_PLANE}
_VTOL = frozenset(number for number, each in d.enums['MAV_TYPE'].items()
                  if each.name.startswith('MAV_TYPE_VTOL_'))
_BY_NAME = {'ardupilot': ARDUPILOT, 'px4': PX4, 'generic': GENERIC}
_BY_NUMBER = {d.MAV_AUTOPILOT_ARDUPILOTMEGA: 'ardupilot', d.MAV_AUTOPILOT_PX4: 'px4'}


def profile_of(heartbeat: Message, autopilot: str = 'auto') -> Profile:
    """The profile of a vehicle.

    Args:
        heartbeat: HEARTBEAT of its autopilot.
        autopilot: 'ardupilot', 'px4' or 'generic'; 'auto': by the heartbeat.

    Returns:
        That of fixed wings where the heartbeat's type is one, and 'generic' for an autopilot that
        is neither.
    """
    name = (_BY_NUMBER.get(heartbeat.autopilot, 'generic') if autopilot == 'auto'
            else autopilot)
    if heartbeat.type == d.MAV_TYPE_FIXED_WING:
        return _FIXED_WING.get(name, _BY_NAME[name])
    if name == 'px4' and heartbeat.type in _VTOL:
        return PX4_VTOL
    return _BY_NAME[name]
