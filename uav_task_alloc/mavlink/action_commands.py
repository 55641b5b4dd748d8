# SPDX-License-Identifier: Apache-2.0
"""The mission commands of named actions, as the mission code of each autopilot accepts them.

ArduPilot: AP_Mission::mavlink_int_to_mission_cmd and AP_Mission_Commands.cpp; PX4:
MavlinkMissionManager::parse_mavlink_mission_item and FeasibilityChecker.
"""
from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.actions import ACTIONS, Action
from uav_task_alloc.model import Point

_GROUND_SPEED, _AIRSPEED = 1.0, 0.0  # param1 of DO_CHANGE_SPEED
_DEFAULT_SPEED, _NO_THROTTLE = -2.0, -1.0  # its param2 and param3
_TARGETING = float(d.MAV_MOUNT_MODE_MAVLINK_TARGETING)  # param7 of DO_MOUNT_CONTROL
_Params = tuple[float, float, float, float]


class ActionCommand(NamedTuple):
    """One command of a mission that is no point of the path."""

    command: int  # MAV_CMD
    params: _Params = (0.0, 0.0, 0.0, 0.0)  # param1 to param4
    z: float = 0.0  # param7
    place: Point | None = None  # [m] ENU, of a command with a position


@dataclass(frozen=True, slots=True)
class ActionRow:
    """How an autopilot carries out one named action."""

    begin: Callable[[Action], ActionCommand] | None = None  # None: it is a hold of a waypoint
    # the command that ends it, from the vehicle's own cruise speed [m/s]; None: it does not last
    end: Callable[[float], ActionCommand] | None = None
    stays: bool = True  # begun again where a way is continued after a break
    needs_speed: bool = False  # `end` needs the cruise speed
    refusal: str = ''  # why the autopilot cannot; '': it can


def compass(heading: float) -> float:
    """Return a heading in degrees clockwise from north.

    Args:
        heading: ENU [rad], counter-clockwise from east.

    Returns:
        In [0, 360).
    """
    return round((90.0 - math.degrees(heading)) % 360.0, 4) % 360.0


def hold_of(action: Action) -> float:
    """Return how long the vehicle stays where an action begins, on account of it [s].

    Args:
        action: any.

    Returns:
        The seconds of `wait`, the time until the last of several photos; 0 for all others.
    """
    if action.name == 'wait':
        return action['seconds']
    return (action['count'] - 1.0) * action['interval'] if action.name == 'photo' else 0.0


def _photo(action: Action) -> ActionCommand:
    count = action['count']
    return ActionCommand(d.MAV_CMD_IMAGE_START_CAPTURE, (
        0.0, action['interval'] if count > 1.0 else 0.0, count, 0.0))


def _trigger(action: Action) -> ActionCommand:
    return ActionCommand(d.MAV_CMD_DO_SET_CAM_TRIGG_DIST, (action['distance'], 0.0, 1.0, 0.0))


def _gimbal(action: Action) -> ActionCommand:
    return ActionCommand(d.MAV_CMD_DO_MOUNT_CONTROL, (
        math.degrees(action['pitch']), 0.0, math.degrees(action['yaw']), 0.0), _TARGETING)


def _roi(action: Action) -> ActionCommand:
    return ActionCommand(d.MAV_CMD_DO_SET_ROI_LOCATION,
                         place=(action['x'], action['y'], action['z']))


def _servo(action: Action) -> ActionCommand:
    return ActionCommand(d.MAV_CMD_DO_SET_SERVO, (
        action['channel'], float(round(action['pwm'])), 0.0, 0.0))


def _gripper(action: Action) -> ActionCommand:
    released = action['release'] > 0.5
    return ActionCommand(d.MAV_CMD_DO_GRIPPER, (1.0, float(
        d.GRIPPER_ACTION_RELEASE if released else d.GRIPPER_ACTION_GRAB), 0.0, 0.0))


def _speed(kind: float) -> Callable[[Action], ActionCommand]:
    return lambda action: _change_speed(kind, action['speed'])


def _change_speed(kind: float, speed: float) -> ActionCommand:
    return ActionCommand(d.MAV_CMD_DO_CHANGE_SPEED, (kind, speed, _NO_THROTTLE, 0.0))


def _plain(command: int) -> Callable[[float], ActionCommand]:
    return lambda cruise: ActionCommand(command)


_COMMON: Mapping[str, ActionRow] = {
    'photo': ActionRow(_photo, stays=False),
    'video': ActionRow(lambda action: ActionCommand(d.MAV_CMD_VIDEO_START_CAPTURE),
                       _plain(d.MAV_CMD_VIDEO_STOP_CAPTURE)),
    'trigger': ActionRow(_trigger, _plain(d.MAV_CMD_DO_SET_CAM_TRIGG_DIST)),
    'gimbal': ActionRow(_gimbal),
    'roi': ActionRow(_roi, _plain(d.MAV_CMD_DO_SET_ROI_NONE)),
    'gripper': ActionRow(_gripper, stays=False),
    'wait': ActionRow(stays=False),
    # the default speed: PX4 resets it
    'speed': ActionRow(_speed(_GROUND_SPEED),
                       lambda cruise: _change_speed(_GROUND_SPEED, _DEFAULT_SPEED)),
}
ARDUCOPTER_ACTIONS: Mapping[str, ActionRow] = {
    **_COMMON,
    'servo': ActionRow(_servo),
    # ArduCopter takes no default speed: it is set to what its parameters say
    'speed': ActionRow(_speed(_GROUND_SPEED),
                       lambda cruise: _change_speed(_GROUND_SPEED, cruise), needs_speed=True),
}
ARDUPLANE_ACTIONS: Mapping[str, ActionRow] = {
    **ARDUCOPTER_ACTIONS,
    'speed': ActionRow(_speed(_AIRSPEED), lambda cruise: _change_speed(_AIRSPEED,
                                                                      _DEFAULT_SPEED)),
}
PX4_ACTIONS: Mapping[str, ActionRow] = {
    **_COMMON,
    'servo': ActionRow(refusal='PX4 takes no DO_SET_SERVO in missions'),
}
GENERIC_ACTIONS: Mapping[str, ActionRow] = {**_COMMON, 'servo': ActionRow(_servo)}
# all commands of actions and headings: they are compared exactly
ACTION_COMMANDS = frozenset({
    d.MAV_CMD_IMAGE_START_CAPTURE, d.MAV_CMD_VIDEO_START_CAPTURE, d.MAV_CMD_VIDEO_STOP_CAPTURE,
    d.MAV_CMD_DO_SET_CAM_TRIGG_DIST, d.MAV_CMD_DO_MOUNT_CONTROL, d.MAV_CMD_DO_SET_ROI_LOCATION,
    d.MAV_CMD_DO_SET_ROI_NONE, d.MAV_CMD_DO_SET_SERVO, d.MAV_CMD_DO_GRIPPER,
    d.MAV_CMD_DO_CHANGE_SPEED, d.MAV_CMD_CONDITION_YAW})


def action_table() -> str:
    """The commands of each action as Markdown, for docs/mavlink.md."""
    columns = {'ArduCopter': ARDUCOPTER_ACTIONS, 'ArduPlane': ARDUPLANE_ACTIONS,
               'PX4': PX4_ACTIONS}
    lines = [f'| action | {" | ".join(columns)} |', '|---' * (len(columns) + 1) + '|']
    for name, keys in ACTIONS.items():
        example = Action(name, tuple((key, bounds.high) for key, bounds in keys.items()))
        cells = (_cell(rows[name], example) for rows in columns.values())
        given = f'`{name}`' + (f' ({", ".join(keys)})' if keys else '')
        lines.append(f'| {given} | {" | ".join(cells)} |')
    return '\n'.join(lines) + '\n'


def _cell(row: ActionRow, example: Action) -> str:
    """The commands of one action, and that by which it ends."""
    if row.refusal:
        return f'refused: {row.refusal}'
    names = [_name(row.begin(example))] if row.begin is not None else []
    if hold_of(example) > 0.0:
        names.append('hold of a waypoint')
    end = '' if row.end is None else _name(row.end(0.0))
    return ', '.join(names) + (f'; end: {end}' if end else '')


def _name(command: ActionCommand) -> str:
    values = ', '.join(f'{value:g}' for value in command.params[:3])
    shown = f' ({values})' if command.command == d.MAV_CMD_DO_CHANGE_SPEED and (
        command.params[1] < 0.0) else ''
    return str(d.enums['MAV_CMD'][command.command].name).removeprefix('MAV_CMD_') + shown
