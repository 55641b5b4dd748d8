# SPDX-License-Identifier: Apache-2.0
"""The custom modes of ArduCopter and PX4: number, name, and the simulated flight mode.

ArduCopter's numbers are those of the dialect (COPTER_MODE); PX4's are of its px4_custom_mode.h:
https://github.com/PX4/PX4-Autopilot/blob/main/src/modules/commander/px4_custom_mode.h
"""
from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple

from pymavlink.dialects.v20 import ardupilotmega as dialect

from uav_task_alloc.sim.config import FlightMode


class CustomMode(NamedTuple):
    """One custom mode of an autopilot."""

    name: str  # as the autopilot spells it
    mode: FlightMode
    stick: bool = False  # the pilot's stick flies it


class Px4Main(IntEnum):
    """PX4_CUSTOM_MAIN_MODE."""

    MANUAL = 1
    ALTCTL = 2
    POSCTL = 3
    AUTO = 4
    ACRO = 5
    OFFBOARD = 6
    STABILIZED = 7
    RATTITUDE = 8
    TERMINATION = 10


class Px4Auto(IntEnum):
    """PX4_CUSTOM_SUB_MODE_AUTO."""

    READY = 1
    TAKEOFF = 2
    LOITER = 3
    MISSION = 4
    RTL = 5
    LAND = 6
    FOLLOW_TARGET = 8
    PRECLAND = 9
    VTOL_TAKEOFF = 10


class Px4Position(IntEnum):
    """PX4_CUSTOM_SUB_MODE_POSCTL."""

    ORBIT = 1
    SLOW = 2


def px4_mode(main: int, sub: int = 0) -> int:
    """Return the custom_mode of PX4 (px4_custom_mode.h).

    Args:
        main: main mode.
        sub: sub mode; 0: none.

    Returns:
        As in HEARTBEAT.custom_mode.
    """
    return sub << 24 | main << 16


def px4_auto(sub: Px4Auto) -> int:
    """Return the custom_mode of a sub mode of AUTO.

    Args:
        sub: the sub mode.

    Returns:
        As in HEARTBEAT.custom_mode.
    """
    return px4_mode(Px4Main.AUTO, sub)


def _stick(name: str) -> CustomMode:
    return CustomMode(name, FlightMode.MANUAL, stick=True)


AVOID_ADSB = dialect.COPTER_MODE_AVOID_ADSB
_RATE_ACRO = 29  # newer than the dialect: RATE_ACRO of ArduCopter's mode.h
COPTER_MODES = {
    dialect.COPTER_MODE_STABILIZE: _stick('STABILIZE'),
    dialect.COPTER_MODE_ACRO: _stick('ACRO'),
    dialect.COPTER_MODE_ALT_HOLD: _stick('ALT_HOLD'),
    dialect.COPTER_MODE_AUTO: CustomMode('AUTO', FlightMode.MISSION),
    dialect.COPTER_MODE_GUIDED: CustomMode('GUIDED', FlightMode.GUIDED),
    dialect.COPTER_MODE_LOITER: CustomMode('LOITER', FlightMode.HOLD, stick=True),
    dialect.COPTER_MODE_RTL: CustomMode('RTL', FlightMode.RETURN),
    dialect.COPTER_MODE_CIRCLE: CustomMode('CIRCLE', FlightMode.OTHER),
    dialect.COPTER_MODE_LAND: CustomMode('LAND', FlightMode.LAND),
    dialect.COPTER_MODE_DRIFT: _stick('DRIFT'),
    dialect.COPTER_MODE_SPORT: _stick('SPORT'),
    dialect.COPTER_MODE_FLIP: _stick('FLIP'),
    dialect.COPTER_MODE_AUTOTUNE: _stick('AUTOTUNE'),
    dialect.COPTER_MODE_POSHOLD: _stick('POSHOLD'),
    dialect.COPTER_MODE_BRAKE: CustomMode('BRAKE', FlightMode.BRAKE),
    dialect.COPTER_MODE_THROW: _stick('THROW'),
    AVOID_ADSB: CustomMode('AVOID_ADSB', FlightMode.OTHER),
    dialect.COPTER_MODE_GUIDED_NOGPS: CustomMode('GUIDED_NOGPS', FlightMode.OTHER),
    dialect.COPTER_MODE_SMART_RTL: CustomMode('SMART_RTL', FlightMode.RETURN),
    dialect.COPTER_MODE_FLOWHOLD: _stick('FLOWHOLD'),
    dialect.COPTER_MODE_FOLLOW: CustomMode('FOLLOW', FlightMode.OTHER),
    dialect.COPTER_MODE_ZIGZAG: _stick('ZIGZAG'),
    dialect.COPTER_MODE_SYSTEMID: _stick('SYSTEMID'),
    dialect.COPTER_MODE_AUTOROTATE: _stick('AUTOROTATE'),
    dialect.COPTER_MODE_AUTO_RTL: CustomMode('AUTO RTL', FlightMode.RETURN),
    dialect.COPTER_MODE_TURTLE: _stick('TURTLE'),
    _RATE_ACRO: _stick('RATE_ACRO'),
}
COPTER_NOT_ARMABLE = {  # of the stick modes
    dialect.COPTER_MODE_FLIP, dialect.COPTER_MODE_AUTOTUNE, dialect.COPTER_MODE_SYSTEMID,
    dialect.COPTER_MODE_AUTOROTATE}

PX4_MODES = {
    px4_mode(Px4Main.MANUAL): _stick('Manual'),
    px4_mode(Px4Main.ALTCTL): _stick('Altitude'),
    px4_mode(Px4Main.POSCTL): _stick('Position'),
    px4_mode(Px4Main.POSCTL, Px4Position.ORBIT): _stick('Orbit'),
    px4_mode(Px4Main.POSCTL, Px4Position.SLOW): _stick('Position Slow'),
    px4_mode(Px4Main.ACRO): _stick('Acro'),
    px4_mode(Px4Main.STABILIZED): _stick('Stabilized'),
    px4_mode(Px4Main.RATTITUDE): _stick('Rattitude'),
    px4_auto(Px4Auto.READY): CustomMode('Ready', FlightMode.OTHER),
    px4_auto(Px4Auto.TAKEOFF): CustomMode('Takeoff', FlightMode.TAKEOFF),
    px4_auto(Px4Auto.LOITER): CustomMode('Hold', FlightMode.HOLD),
    px4_auto(Px4Auto.MISSION): CustomMode('Mission', FlightMode.MISSION),
    px4_auto(Px4Auto.RTL): CustomMode('Return', FlightMode.RETURN),
    px4_auto(Px4Auto.LAND): CustomMode('Land', FlightMode.LAND),
    px4_auto(Px4Auto.FOLLOW_TARGET): CustomMode('Follow Target', FlightMode.OTHER),
    px4_auto(Px4Auto.PRECLAND): CustomMode('Precision Landing', FlightMode.LAND),
    px4_auto(Px4Auto.VTOL_TAKEOFF): CustomMode('VTOL Takeoff', FlightMode.OTHER),
    px4_mode(Px4Main.OFFBOARD): CustomMode('Offboard', FlightMode.OTHER),
    px4_mode(Px4Main.TERMINATION): CustomMode('Termination', FlightMode.OTHER),
}
