# SPDX-License-Identifier: Apache-2.0
"""Camera, servos, gripper and gimbal of a simulated vehicle: what a mission commands them to do.

Each picture is an event of the ground truth, at the true position.
"""
from __future__ import annotations

import math
from collections.abc import Callable

from pymavlink.dialects.v20 import ardupilotmega as dialect

from uav_task_alloc.model import Point
from uav_task_alloc.sim.dynamics import metres_between
from uav_task_alloc.sim.stored_item import StoredItem

_NAMES = {
    dialect.MAV_CMD_VIDEO_START_CAPTURE: 'video on',
    dialect.MAV_CMD_VIDEO_STOP_CAPTURE: 'video off',
    dialect.MAV_CMD_DO_SET_ROI_NONE: 'roi off',
}


class Payload:
    """Executes commands, and takes the pictures that they ask for.

    Args:
        note: records an event of the ground truth by its name and a text.

    Arguments of methods:
        position: of the vehicle, ENU [m].
        now: vehicle time [s].
    """

    def __init__(self, note: Callable[[str, str], None]) -> None:
        self._note = note
        self.distance = 0.0  # [m] between pictures; 0: off
        self._last: Point | None = None  # where the last one of these was taken
        self._left, self._interval, self._due = 0, 0.0, math.inf  # pictures by time

    def reset(self) -> None:
        """Stop all, as a restart does."""
        self.distance, self._left, self._due = 0.0, 0, math.inf

    def stop_trigger(self) -> None:
        """Take no more pictures by distance."""
        self.distance = 0.0

    def execute(self, item: StoredItem, place: Point | None, position: Point, now: float) -> bool:
        """Execute an item of a mission, or a command.

        Args:
            item: with its parameters.
            place: ENU [m], of a command that names one.

        Returns:
            Whether it is a command about the payload.
        """
        if item.command == dialect.MAV_CMD_DO_SET_CAM_TRIGG_DIST:
            self._set_distance(item, position)
        elif item.command == dialect.MAV_CMD_IMAGE_START_CAPTURE:
            self._left, self._interval, self._due = max(1, int(item.p3)), item.p2, now
            self.step(position, now)
        elif item.command == dialect.MAV_CMD_DO_SET_SERVO:
            self._note('servo', f'{item.p1:.0f} {item.p2:.0f}')
        elif item.command == dialect.MAV_CMD_DO_GRIPPER:
            self._note('gripper', 'grab' if item.p2 == dialect.GRIPPER_ACTION_GRAB else 'release')
        elif item.command == dialect.MAV_CMD_DO_MOUNT_CONTROL:
            self._note('gimbal', f'{item.p1:.1f} {item.p3:.1f}')
        elif item.command == dialect.MAV_CMD_DO_SET_ROI_LOCATION and place is not None:
            self._note('roi on', ' '.join(f'{value:.1f}' for value in place))
        elif item.command in _NAMES:
            self._note(_NAMES[item.command], '')
        else:
            return False
        return True

    def _set_distance(self, item: StoredItem, position: Point) -> None:
        self.distance, self._last = item.p1, position
        self._note('trigger', f'{item.p1:g}')
        if item.p1 > 0.0 and item.p3 == 1.0:
            self._note('photo', 'trigger')

    def step(self, position: Point, now: float) -> None:
        """Take the pictures that are due."""
        while self._left > 0 and now >= self._due:
            self._note('photo', 'count')
            self._left, self._due = self._left - 1, self._due + self._interval
        if self.distance > 0.0 and self._last is not None and (
                metres_between(position, self._last) >= self.distance):
            self._last = position
            self._note('photo', 'trigger')
