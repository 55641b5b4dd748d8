# SPDX-License-Identifier: Apache-2.0
"""A mission item as each autopilot stores it: which it refuses, and which fields it changes."""
from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Iterable
from typing import NamedTuple

from pymavlink.dialects.v20 import ardupilotmega as dialect

from uav_task_alloc.mavlink.transport.codec import Message

WAYPOINT = dialect.MAV_CMD_NAV_WAYPOINT
LOITER_UNLIMITED = dialect.MAV_CMD_NAV_LOITER_UNLIM
_LOITER_TIME = dialect.MAV_CMD_NAV_LOITER_TIME
RETURN = dialect.MAV_CMD_NAV_RETURN_TO_LAUNCH
LAND = dialect.MAV_CMD_NAV_LAND
TAKEOFF = dialect.MAV_CMD_NAV_TAKEOFF
DELAY = dialect.MAV_CMD_NAV_DELAY
CHANGE_SPEED = dialect.MAV_CMD_DO_CHANGE_SPEED
ROI = dialect.MAV_CMD_DO_SET_ROI_LOCATION
YAW = dialect.MAV_CMD_CONDITION_YAW
FLOWN_TO = {WAYPOINT, LOITER_UNLIMITED, _LOITER_TIME, LAND, TAKEOFF}
POSITIONAL = FLOWN_TO | {ROI}
# carried out at once, on the way; and how many bits ArduPilot keeps of each parameter: 0 none,
# 32 a float, below 0 with a sign
_ARDUPILOT_BITS: dict[int, tuple[int, int, int, int]] = {
    CHANGE_SPEED: (8, 32, 32, 0),
    YAW: (32, 32, -8, 8),
    dialect.MAV_CMD_DO_SET_SERVO: (8, 16, 0, 0),
    dialect.MAV_CMD_DO_GRIPPER: (8, 8, 0, 0),
    dialect.MAV_CMD_DO_MOUNT_CONTROL: (32, 32, 32, 0),
    dialect.MAV_CMD_DO_SET_CAM_TRIGG_DIST: (32, 0, 8, 0),
    dialect.MAV_CMD_DO_SET_ROI_NONE: (16, 0, 0, 0),
    dialect.MAV_CMD_IMAGE_START_CAPTURE: (8, 32, 16, 16),
    dialect.MAV_CMD_IMAGE_STOP_CAPTURE: (16, 0, 0, 0),
    dialect.MAV_CMD_VIDEO_START_CAPTURE: (8, 0, 0, 0),
    dialect.MAV_CMD_VIDEO_STOP_CAPTURE: (8, 0, 0, 0),
}
AT_ONCE = {*_ARDUPILOT_BITS, ROI}
_DELAY_BITS = 32, -8, -8, -8
_FLOWN = FLOWN_TO | {RETURN, DELAY}
_KNOWN = _FLOWN | AT_ONCE
_PX4_KNOWN = _KNOWN - {YAW, dialect.MAV_CMD_DO_SET_SERVO}

_NAN_ALLOWED = {WAYPOINT, LAND, TAKEOFF}  # ArduPilot, in param4
_ARDUPILOT_FRAMES = {  # sent -> read back
    dialect.MAV_FRAME_GLOBAL: dialect.MAV_FRAME_GLOBAL,
    dialect.MAV_FRAME_MISSION: dialect.MAV_FRAME_GLOBAL,
    dialect.MAV_FRAME_GLOBAL_INT: dialect.MAV_FRAME_GLOBAL,
    dialect.MAV_FRAME_GLOBAL_RELATIVE_ALT: dialect.MAV_FRAME_GLOBAL_RELATIVE_ALT,
    dialect.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT: dialect.MAV_FRAME_GLOBAL_RELATIVE_ALT,
    dialect.MAV_FRAME_GLOBAL_TERRAIN_ALT: dialect.MAV_FRAME_GLOBAL_TERRAIN_ALT,
    dialect.MAV_FRAME_GLOBAL_TERRAIN_ALT_INT: dialect.MAV_FRAME_GLOBAL_TERRAIN_ALT,
}
POSITION_FRAMES = {  # of items with a position, for PX4 and of fences
    dialect.MAV_FRAME_GLOBAL,
    dialect.MAV_FRAME_GLOBAL_RELATIVE_ALT,
    dialect.MAV_FRAME_GLOBAL_INT,
    dialect.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT,
}
RELATIVE_FRAMES = {  # height above home, or above the terrain, which is flat here
    dialect.MAV_FRAME_GLOBAL_RELATIVE_ALT,
    dialect.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT,
    dialect.MAV_FRAME_GLOBAL_TERRAIN_ALT,
    dialect.MAV_FRAME_GLOBAL_TERRAIN_ALT_INT,
}


class StoredItem(NamedTuple):
    """The fields of MISSION_ITEM_INT that a vehicle keeps."""

    frame: int  # MAV_FRAME
    command: int  # MAV_CMD
    p1: float  # param1 of the command
    p2: float  # param2
    p3: float  # param3
    p4: float  # param4
    x: int  # [1e-7 deg]
    y: int  # [1e-7 deg]
    z: float  # [m]
    autocontinue: int = 1  # 0 or 1


class Refusal(NamedTuple):
    """The refusal of an item."""

    result: int  # MAV_MISSION_RESULT of the MISSION_ACK


def from_message(m: Message) -> StoredItem:
    """Return the stored fields of an item.

    Args:
        m: MISSION_ITEM_INT.

    Returns:
        As sent, not yet checked.
    """
    return StoredItem(m.frame, m.command, m.param1, m.param2, m.param3, m.param4, m.x, m.y, m.z,
                      m.autocontinue)


def to_message(item: StoredItem, seq: int, current: bool, peer: tuple[int, int],
               mission_type: int = 0) -> Message:
    """Return a stored item as MISSION_ITEM_INT.

    Args:
        item: as stored.
        seq: its place in the mission.
        current: whether it is being flown.
        peer: (system, component) that asks for it.
        mission_type: MAV_MISSION_TYPE.

    Returns:
        Ready to be packed.
    """
    return dialect.MAVLink_mission_item_int_message(
        *peer, seq, item.frame, item.command, int(current), item.autocontinue, item.p1, item.p2,
        item.p3, item.p4, item.x, item.y, item.z, mission_type)


def to_float_message(item: StoredItem, seq: int, current: bool, peer: tuple[int, int],
                     mission_type: int = 0) -> Message:
    """Return a stored item as MISSION_ITEM, which answers an old MISSION_REQUEST.

    Args:
        item: as stored.
        seq: its place in the mission.
        current: whether it is being flown.
        peer: (system, component) that asks for it.
        mission_type: MAV_MISSION_TYPE.

    Returns:
        Ready to be packed; degrees are float32, so metres off.
    """
    scale = 1e-7 if item.command in POSITIONAL or mission_type else 1.0
    return dialect.MAVLink_mission_item_message(
        *peer, seq, item.frame, item.command, int(current), item.autocontinue, item.p1, item.p2,
        item.p3, item.p4, item.x * scale, item.y * scale, item.z, mission_type)


def stored_by_ardupilot(item: StoredItem) -> StoredItem | Refusal:
    """Return the lossy copy ArduCopter keeps: whole seconds, centimetres, no yaw, three frames.

    Args:
        item: as sent.

    Returns:
        The copy, or why it is refused.
    """
    bad = _ardupilot_nan(item)
    if bad:
        return Refusal(bad)
    if item.command not in _KNOWN:
        return Refusal(dialect.MAV_MISSION_UNSUPPORTED)
    if item.command not in POSITIONAL:
        bits = _ARDUPILOT_BITS.get(
            item.command, _DELAY_BITS if item.command == DELAY else (0, 0, 0, 0))
        p1, p2, p3, p4 = (_kept(value, width) for value, width in zip(
            (item.p1, item.p2, item.p3, item.p4), bits, strict=True))
        z = (float(dialect.MAV_MOUNT_MODE_MAVLINK_TARGETING)
             if item.command == dialect.MAV_CMD_DO_MOUNT_CONTROL else 0.0)
        return StoredItem(dialect.MAV_FRAME_GLOBAL, item.command, p1, p2, p3, p4, 0, 0, z)
    if item.frame not in _ARDUPILOT_FRAMES:
        return Refusal(dialect.MAV_MISSION_UNSUPPORTED_FRAME)
    if abs(item.x) > 90 * 10**7:
        return Refusal(dialect.MAV_MISSION_INVALID_PARAM5_X)
    if abs(item.y) > 180 * 10**7:
        return Refusal(dialect.MAV_MISSION_INVALID_PARAM6_Y)
    centimetres = math.trunc(item.z * 100.0 + math.copysign(1e-3, item.z))
    p1, p3, p4 = _ardupilot_point(item)
    return StoredItem(_ARDUPILOT_FRAMES[item.frame], item.command, p1, 0.0, p3, p4, item.x, item.y,
                      centimetres / 100.0)


def _ardupilot_point(item: StoredItem) -> tuple[float, float, float]:
    """What ArduPilot keeps of param1, param3 and param4 of an item with a position."""
    whole = float(math.trunc(item.p1) % 2**16)
    if item.command == LOITER_UNLIMITED:
        return 0.0, float(math.trunc(item.p3)), 0.0  # the radius, below 0 counter-clockwise
    if item.command == _LOITER_TIME:
        return whole, -1.0 if item.p3 < 0.0 else 1.0, float(item.p4 > 0.0)
    if item.command == LAND:
        return whole, 0.0, -1.0 if item.p4 < 0.0 else 1.0
    return whole, 0.0, 0.0


def _kept(value: float, bits: int) -> float:
    """A parameter as ArduPilot keeps it in so many bits."""
    if bits == 32:
        return value
    if bits < 0:
        return float((math.trunc(value) + 2**(-bits - 1)) % 2**-bits - 2**(-bits - 1))
    return float(math.trunc(value) % 2**bits) if bits else 0.0


def _ardupilot_nan(item: StoredItem) -> int:
    """The MAV_MISSION_RESULT that names the first NaN ArduPilot refuses; 0: none."""
    for number, value in enumerate((item.p1, item.p2, item.p3, item.p4), start=1):
        if math.isnan(value) and not (number == 4 and item.command in _NAN_ALLOWED):
            return int(dialect.MAV_MISSION_INVALID_PARAM1) + number - 1
    return int(dialect.MAV_MISSION_INVALID_PARAM7) if math.isnan(item.z) else 0


def stored_by_px4(item: StoredItem) -> StoredItem | Refusal:
    """Return the exact copy PX4 keeps; the frame must fit the command.

    Args:
        item: as sent.

    Returns:
        The copy, or why it is refused.
    """
    if item.frame != dialect.MAV_FRAME_MISSION and item.frame not in POSITION_FRAMES:
        return Refusal(dialect.MAV_MISSION_UNSUPPORTED_FRAME)
    if item.command not in _PX4_KNOWN:
        return Refusal(dialect.MAV_MISSION_UNSUPPORTED)
    if (item.command in POSITIONAL) == (item.frame == dialect.MAV_FRAME_MISSION):
        return Refusal(dialect.MAV_MISSION_UNSUPPORTED)
    return item


def px4_crc(items: Iterable[StoredItem]) -> int:
    """Return PX4's id of a mission: NuttX's crc32part over the packed items.

    Args:
        items: by seq.

    Returns:
        uint32; 0 for no items.
    """
    crc = 0
    for item in items:
        raw = struct.pack('<BHB4fiif', item.frame, item.command, item.autocontinue, item.p1,
                          item.p2, item.p3, item.p4, item.x, item.y, item.z)
        crc = zlib.crc32(raw, crc ^ 0xFFFFFFFF) ^ 0xFFFFFFFF  # no inversion at start and end
    return crc
