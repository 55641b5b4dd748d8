# SPDX-License-Identifier: Apache-2.0
"""The flight modes of ArduPilot and PX4 by number: their names and their classes."""
from __future__ import annotations

from enum import Enum

from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.mavlink.autopilots import px4_mode_parts


class ModeClass(Enum):
    """What controls the path of the vehicle in a mode."""

    MISSION = 'the onboard mission'
    HOLD = 'holds, or flies to the point that a ground station sets'
    STICK = 'the pilot'
    OWN = 'the autopilot, or another station'


_COPTER_RATE_ACRO = 29  # newer than the dialect
_COPTER = {
    d.COPTER_MODE_STABILIZE: 'STABILIZE', d.COPTER_MODE_ACRO: 'ACRO',
    d.COPTER_MODE_ALT_HOLD: 'ALT_HOLD', d.COPTER_MODE_AUTO: 'AUTO',
    d.COPTER_MODE_GUIDED: 'GUIDED', d.COPTER_MODE_LOITER: 'LOITER', d.COPTER_MODE_RTL: 'RTL',
    d.COPTER_MODE_CIRCLE: 'CIRCLE', d.COPTER_MODE_LAND: 'LAND', d.COPTER_MODE_DRIFT: 'DRIFT',
    d.COPTER_MODE_SPORT: 'SPORT', d.COPTER_MODE_FLIP: 'FLIP', d.COPTER_MODE_AUTOTUNE: 'AUTOTUNE',
    d.COPTER_MODE_POSHOLD: 'POSHOLD', d.COPTER_MODE_BRAKE: 'BRAKE', d.COPTER_MODE_THROW: 'THROW',
    d.COPTER_MODE_AVOID_ADSB: 'AVOID_ADSB', d.COPTER_MODE_GUIDED_NOGPS: 'GUIDED_NOGPS',
    d.COPTER_MODE_SMART_RTL: 'SMART_RTL', d.COPTER_MODE_FLOWHOLD: 'FLOWHOLD',
    d.COPTER_MODE_FOLLOW: 'FOLLOW', d.COPTER_MODE_ZIGZAG: 'ZIGZAG',
    d.COPTER_MODE_SYSTEMID: 'SYSTEMID', d.COPTER_MODE_AUTOROTATE: 'AUTOROTATE',
    d.COPTER_MODE_AUTO_RTL: 'AUTO_RTL', d.COPTER_MODE_TURTLE: 'TURTLE',
    _COPTER_RATE_ACRO: 'RATE_ACRO'}
_PLANE = {
    d.PLANE_MODE_MANUAL: 'MANUAL', d.PLANE_MODE_CIRCLE: 'CIRCLE',
    d.PLANE_MODE_STABILIZE: 'STABILIZE', d.PLANE_MODE_TRAINING: 'TRAINING',
    d.PLANE_MODE_ACRO: 'ACRO', d.PLANE_MODE_FLY_BY_WIRE_A: 'FBWA',
    d.PLANE_MODE_FLY_BY_WIRE_B: 'FBWB', d.PLANE_MODE_CRUISE: 'CRUISE',
    d.PLANE_MODE_AUTOTUNE: 'AUTOTUNE', d.PLANE_MODE_AUTO: 'AUTO', d.PLANE_MODE_RTL: 'RTL',
    d.PLANE_MODE_LOITER: 'LOITER', d.PLANE_MODE_TAKEOFF: 'TAKEOFF',
    d.PLANE_MODE_AVOID_ADSB: 'AVOID_ADSB', d.PLANE_MODE_GUIDED: 'GUIDED',
    d.PLANE_MODE_QSTABILIZE: 'QSTABILIZE', d.PLANE_MODE_QHOVER: 'QHOVER',
    d.PLANE_MODE_QLOITER: 'QLOITER', d.PLANE_MODE_QLAND: 'QLAND', d.PLANE_MODE_QRTL: 'QRTL',
    d.PLANE_MODE_QAUTOTUNE: 'QAUTOTUNE', d.PLANE_MODE_QACRO: 'QACRO',
    d.PLANE_MODE_THERMAL: 'THERMAL', d.PLANE_MODE_LOITER_ALT_QLAND: 'LOITER_ALT_QLAND',
    d.PLANE_MODE_AUTOLAND: 'AUTOLAND'}
# PX4's modes are not in the dialect: px4_custom_mode.h
_PX4_MAIN = {1: 'Manual', 2: 'Altitude', 3: 'Position', 5: 'Acro', 6: 'Offboard',
             7: 'Stabilized', 8: 'Rattitude', 10: 'Termination'}
_PX4_AUTO = {1: 'Ready', 2: 'Takeoff', 3: 'Hold', 4: 'Mission', 5: 'Return', 6: 'Land',
             8: 'Follow', 9: 'Precision Land', 10: 'VTOL Takeoff'}
_AUTO = 4  # PX4's main mode with sub modes

# family -> (MISSION, HOLD, STICK); every other mode is OWN
_ARDUPILOT = {
    'copter': (d.COPTER_MODE_AUTO, d.COPTER_MODE_GUIDED, frozenset({
        d.COPTER_MODE_STABILIZE, d.COPTER_MODE_ACRO, d.COPTER_MODE_ALT_HOLD,
        d.COPTER_MODE_LOITER, d.COPTER_MODE_DRIFT, d.COPTER_MODE_SPORT, d.COPTER_MODE_FLIP,
        d.COPTER_MODE_AUTOTUNE, d.COPTER_MODE_POSHOLD, d.COPTER_MODE_THROW,
        d.COPTER_MODE_FLOWHOLD, d.COPTER_MODE_ZIGZAG, d.COPTER_MODE_SYSTEMID,
        d.COPTER_MODE_AUTOROTATE, d.COPTER_MODE_TURTLE, _COPTER_RATE_ACRO})),
    'plane': (d.PLANE_MODE_AUTO, d.PLANE_MODE_GUIDED, frozenset({
        d.PLANE_MODE_MANUAL, d.PLANE_MODE_STABILIZE, d.PLANE_MODE_TRAINING, d.PLANE_MODE_ACRO,
        d.PLANE_MODE_FLY_BY_WIRE_A, d.PLANE_MODE_FLY_BY_WIRE_B, d.PLANE_MODE_CRUISE,
        d.PLANE_MODE_AUTOTUNE, d.PLANE_MODE_QSTABILIZE, d.PLANE_MODE_QHOVER,
        d.PLANE_MODE_QLOITER, d.PLANE_MODE_QACRO}))}
_PX4_STICK = frozenset({1, 2, 3, 5, 7, 8})  # main modes
_AVOIDS = {'copter': d.COPTER_MODE_AVOID_ADSB, 'plane': d.PLANE_MODE_AVOID_ADSB}
_NAMES = {'copter': _COPTER, 'plane': _PLANE}



def mode_class(family: str, custom_mode: int) -> ModeClass | None:
    """Classify a mode (ArduPilot mode.h, PX4 px4_custom_mode.h).

    Args:
        family: 'copter', 'plane', 'px4', or '' for an autopilot of unknown kind.
        custom_mode: HEARTBEAT.custom_mode.

    Returns:
        The class; None for an autopilot of unknown kind.
    """
    if family == 'px4':
        main, sub = px4_mode_parts(custom_mode)
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
    """Name a mode as the vehicle's own ground station shows it.

    Args:
        family: as in `mode_class`.
        custom_mode: HEARTBEAT.custom_mode.

    Returns:
        The name; 'mode NUMBER' where it has none.
    """
    if family == 'px4':
        main, sub = px4_mode_parts(custom_mode)
        name = _PX4_AUTO.get(sub) if main == _AUTO else _PX4_MAIN.get(main)
    else:
        name = _NAMES.get(family, {}).get(custom_mode)
    return name or f'mode {custom_mode}'


def avoids_traffic(family: str, custom_mode: int) -> bool:
    """Whether the autopilot avoids another aircraft in this mode (AVOID_ADSB)."""
    return _AVOIDS.get(family) == custom_mode
