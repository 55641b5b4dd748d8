# SPDX-License-Identifier: Apache-2.0
"""The custom modes of ArduCopter and PX4: number, name, and the simulated flight mode."""
from __future__ import annotations

from typing import NamedTuple

from uav_task_alloc.sim.config import FlightMode


class CustomMode(NamedTuple):
    """One custom mode of an autopilot."""

    name: str  # as the autopilot spells it
    mode: FlightMode
    stick: bool = False  # the pilot's stick flies it


def px4_mode(main: int, sub: int = 0) -> int:
    """Return the custom_mode of PX4 (px4_custom_mode.h).

    Args:
        main: main mode.
        sub: sub mode of AUTO; 0: none.

    Returns:
        As in HEARTBEAT.custom_mode.
    """
    return sub << 24 | main << 16


def _stick(name: str) -> CustomMode:
    return CustomMode(name, FlightMode.MANUAL, stick=True)


AVOID_ADSB = 19
COPTER_MODES = {
    0: _stick('STABILIZE'),
    1: _stick('ACRO'),
    2: _stick('ALT_HOLD'),
    3: CustomMode('AUTO', FlightMode.MISSION),
    4: CustomMode('GUIDED', FlightMode.GUIDED),
    5: CustomMode('LOITER', FlightMode.HOLD, stick=True),
    6: CustomMode('RTL', FlightMode.RETURN),
    7: CustomMode('CIRCLE', FlightMode.OTHER),
    9: CustomMode('LAND', FlightMode.LAND),
    11: _stick('DRIFT'),
    13: _stick('SPORT'),
    14: _stick('FLIP'),
    15: _stick('AUTOTUNE'),
    16: _stick('POSHOLD'),
    17: CustomMode('BRAKE', FlightMode.BRAKE),
    18: _stick('THROW'),
    AVOID_ADSB: CustomMode('AVOID_ADSB', FlightMode.OTHER),
    20: CustomMode('GUIDED_NOGPS', FlightMode.OTHER),
    21: CustomMode('SMART_RTL', FlightMode.RETURN),
    22: _stick('FLOWHOLD'),
    23: CustomMode('FOLLOW', FlightMode.OTHER),
    24: _stick('ZIGZAG'),
    25: _stick('SYSTEMID'),
    26: _stick('AUTOROTATE'),
    27: CustomMode('AUTO RTL', FlightMode.RETURN),
    28: _stick('TURTLE'),
    29: _stick('RATE_ACRO'),
}
COPTER_NOT_ARMABLE = {14, 15, 25, 26}  # of the stick modes

PX4_MODES = {
    px4_mode(1): _stick('Manual'),
    px4_mode(2): _stick('Altitude'),
    px4_mode(3): _stick('Position'),
    px4_mode(3, 1): _stick('Orbit'),
    px4_mode(3, 2): _stick('Position Slow'),
    px4_mode(5): _stick('Acro'),
    px4_mode(7): _stick('Stabilized'),
    px4_mode(8): _stick('Rattitude'),
    px4_mode(4, 1): CustomMode('Ready', FlightMode.OTHER),
    px4_mode(4, 2): CustomMode('Takeoff', FlightMode.TAKEOFF),
    px4_mode(4, 3): CustomMode('Hold', FlightMode.HOLD),
    px4_mode(4, 4): CustomMode('Mission', FlightMode.MISSION),
    px4_mode(4, 5): CustomMode('Return', FlightMode.RETURN),
    px4_mode(4, 6): CustomMode('Land', FlightMode.LAND),
    px4_mode(4, 8): CustomMode('Follow Target', FlightMode.OTHER),
    px4_mode(4, 9): CustomMode('Precision Landing', FlightMode.LAND),
    px4_mode(4, 10): CustomMode('VTOL Takeoff', FlightMode.OTHER),
    px4_mode(6): CustomMode('Offboard', FlightMode.OTHER),
    px4_mode(10): CustomMode('Termination', FlightMode.OTHER),
}
