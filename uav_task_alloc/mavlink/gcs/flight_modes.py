# SPDX-License-Identifier: Apache-2.0
"""The flight modes of ArduPilot and PX4 by number: their names and their classes."""
from __future__ import annotations

from enum import Enum
from functools import lru_cache

from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.mavlink.autopilots import Px4AutoMode, Px4MainMode, px4_mode_parts


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
_PX4_MAIN: dict[int, str] = {
    Px4MainMode.MANUAL: 'Manual', Px4MainMode.ALTCTL: 'Altitude', Px4MainMode.POSCTL: 'Position',
    Px4MainMode.ACRO: 'Acro', Px4MainMode.OFFBOARD: 'Offboard',
    Px4MainMode.STABILIZED: 'Stabilized', Px4MainMode.RATTITUDE: 'Rattitude',
    Px4MainMode.TERMINATION: 'Termination'}
_PX4_AUTO: dict[int, str] = {
    Px4AutoMode.READY: 'Ready', Px4AutoMode.TAKEOFF: 'Takeoff', Px4AutoMode.LOITER: 'Hold',
    Px4AutoMode.MISSION: 'Mission', Px4AutoMode.RTL: 'Return', Px4AutoMode.LAND: 'Land',
    Px4AutoMode.FOLLOW_TARGET: 'Follow', Px4AutoMode.PRECLAND: 'Precision Land',
    Px4AutoMode.VTOL_TAKEOFF: 'VTOL Takeoff'}

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
_PX4_STICK = frozenset({
    Px4MainMode.MANUAL, Px4MainMode.ALTCTL, Px4MainMode.POSCTL, Px4MainMode.ACRO,
    Px4MainMode.STABILIZED, Px4MainMode.RATTITUDE})
_PX4_CLASSES: dict[int, ModeClass] = {
    Px4AutoMode.MISSION: ModeClass.MISSION, Px4AutoMode.LOITER: ModeClass.HOLD}
_AVOIDS = {'copter': d.COPTER_MODE_AVOID_ADSB, 'plane': d.PLANE_MODE_AVOID_ADSB}
_NAMES = {'copter': _COPTER, 'plane': _PLANE}


@lru_cache(maxsize=256)
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
        if main == Px4MainMode.AUTO:
            return _PX4_CLASSES.get(sub, ModeClass.OWN)
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
        name = _PX4_AUTO.get(sub) if main == Px4MainMode.AUTO else _PX4_MAIN.get(main)
    else:
        name = _NAMES.get(family, {}).get(custom_mode)
    return name or f'mode {custom_mode}'


def avoids_traffic(family: str, custom_mode: int) -> bool:
    """Whether the autopilot avoids another aircraft in this mode (AVOID_ADSB)."""
    return _AVOIDS.get(family) == custom_mode
