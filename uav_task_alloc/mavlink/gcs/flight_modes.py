# SPDX-License-Identifier: Apache-2.0
"""The flight modes of ArduPilot and PX4 by number: their names, and who flies in them."""
from __future__ import annotations

from enum import Enum


class ModeClass(Enum):
    """Who decides where the vehicle goes in a mode."""

    MISSION = 'the stored mission'
    HOLD = 'holds, or goes where a station says'
    STICK = 'a human'
    OWN = 'the vehicle, or whoever sent it'


_COPTER = {
    0: 'STABILIZE', 1: 'ACRO', 2: 'ALT_HOLD', 3: 'AUTO', 4: 'GUIDED', 5: 'LOITER', 6: 'RTL',
    7: 'CIRCLE', 9: 'LAND', 11: 'DRIFT', 13: 'SPORT', 14: 'FLIP', 15: 'AUTOTUNE', 16: 'POSHOLD',
    17: 'BRAKE', 18: 'THROW', 19: 'AVOID_ADSB', 20: 'GUIDED_NOGPS', 21: 'SMART_RTL',
    22: 'FLOWHOLD', 23: 'FOLLOW', 24: 'ZIGZAG', 25: 'SYSTEMID', 26: 'AUTOROTATE', 27: 'AUTO_RTL',
    28: 'TURTLE', 29: 'RATE_ACRO'}
_PLANE = {
    0: 'MANUAL', 1: 'CIRCLE', 2: 'STABILIZE', 3: 'TRAINING', 4: 'ACRO', 5: 'FBWA', 6: 'FBWB',
    7: 'CRUISE', 8: 'AUTOTUNE', 10: 'AUTO', 11: 'RTL', 12: 'LOITER', 13: 'TAKEOFF',
    14: 'AVOID_ADSB', 15: 'GUIDED', 17: 'QSTABILIZE', 18: 'QHOVER', 19: 'QLOITER', 20: 'QLAND',
    21: 'QRTL', 22: 'QAUTOTUNE', 23: 'QACRO', 24: 'THERMAL', 25: 'LOITER_ALT_QLAND',
    26: 'AUTOLAND'}
_PX4_MAIN = {1: 'Manual', 2: 'Altitude', 3: 'Position', 5: 'Acro', 6: 'Offboard',
             7: 'Stabilized', 8: 'Rattitude', 10: 'Termination'}
_PX4_AUTO = {1: 'Ready', 2: 'Takeoff', 3: 'Hold', 4: 'Mission', 5: 'Return', 6: 'Land',
             8: 'Follow', 9: 'Precision Land', 10: 'VTOL Takeoff'}
_AUTO = 4  # PX4's main mode with sub modes

# family -> (mission, hold, flown by stick); every other mode is OWN
_ARDUPILOT = {
    'copter': (3, 4, frozenset({0, 1, 2, 5, 11, 13, 14, 15, 16, 18, 22, 24, 25, 26, 28, 29})),
    'plane': (10, 15, frozenset({0, *range(2, 9), 17, 18, 19, 23}))}
_PX4_STICK = frozenset({1, 2, 3, 5, 7, 8})  # main modes
_AVOIDS = {'copter': 19, 'plane': 14}
_NAMES = {'copter': _COPTER, 'plane': _PLANE}


def _px4_parts(custom_mode: int) -> tuple[int, int]:
    return custom_mode >> 16 & 0xff, custom_mode >> 24 & 0xff


def mode_class(family: str, custom_mode: int) -> ModeClass | None:
    """Classify a mode.

    Args:
        family: 'copter', 'plane', 'px4', or '' for an autopilot of unknown kind.
        custom_mode: HEARTBEAT.custom_mode.

    Returns:
        The class; None for an autopilot of unknown kind.

    Source: ArduPilot mode.h (Number), PX4 px4_custom_mode.h.
    """
    if family == 'px4':
        main, sub = _px4_parts(custom_mode)
        if main == _AUTO:
            return {4: ModeClass.MISSION, 3: ModeClass.HOLD}.get(sub, ModeClass.OWN)
        return ModeClass.STICK if main in _PX4_STICK else ModeClass.OWN
    if family not in _ARDUPILOT:
        return None
    mission, hold, stick = _ARDUPILOT[family]
    if custom_mode in (mission, hold):
        return ModeClass.MISSION if custom_mode == mission else ModeClass.HOLD
    return ModeClass.STICK if custom_mode in stick else ModeClass.OWN


def mode_name(family: str, custom_mode: int) -> str:
    """The name of a mode as its own ground station shows it; its number where it has none."""
    if family == 'px4':
        main, sub = _px4_parts(custom_mode)
        name = _PX4_AUTO.get(sub) if main == _AUTO else _PX4_MAIN.get(main)
    else:
        name = _NAMES.get(family, {}).get(custom_mode)
    return name or f'mode {custom_mode}'


def avoids_traffic(family: str, custom_mode: int) -> bool:
    """Whether the autopilot is getting out of the way of another aircraft (AVOID_ADSB)."""
    return _AVOIDS.get(family) == custom_mode
