# SPDX-License-Identifier: Apache-2.0
"""A mission item, and when one read back may be the one sent: autopilots round some fields."""
from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from pymavlink.dialects.v20 import ardupilotmega as dialect

from uav_task_alloc.geometry.frames import Origin, to_enu
from uav_task_alloc.mavlink.action_commands import ACTION_COMMANDS
from uav_task_alloc.model import Point

GLOBAL_FRAMES = frozenset({  # x, y and z are a position
    dialect.MAV_FRAME_GLOBAL,
    dialect.MAV_FRAME_GLOBAL_RELATIVE_ALT,
    dialect.MAV_FRAME_GLOBAL_INT,
    dialect.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT,
    dialect.MAV_FRAME_GLOBAL_TERRAIN_ALT,
    dialect.MAV_FRAME_GLOBAL_TERRAIN_ALT_INT,
})
MOST_ITEMS = 65535  # of a mission, home included: the range of MISSION_COUNT.count
_FRAME_READ_BACK = {  # ArduPilot returns an _INT frame as the one without it
    dialect.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT: dialect.MAV_FRAME_GLOBAL_RELATIVE_ALT,
    dialect.MAV_FRAME_GLOBAL_INT: dialect.MAV_FRAME_GLOBAL,
    dialect.MAV_FRAME_GLOBAL_TERRAIN_ALT_INT: dialect.MAV_FRAME_GLOBAL_TERRAIN_ALT,
}
_ALTITUDE_STEP = 0.011  # [m] ArduPilot keeps whole centimetres
# commands that fly home and land by themselves, at the end of a mission
ENDS_AT_HOME = frozenset({dialect.MAV_CMD_NAV_RETURN_TO_LAUNCH, dialect.MAV_CMD_NAV_LAND})
# index of the parameter that ArduPilot returns as 1, clockwise, where it was sent as 0
_DIRECTION = {dialect.MAV_CMD_NAV_LAND: 3, dialect.MAV_CMD_NAV_LOITER_TIME: 2}


@dataclass(frozen=True, slots=True)
class Item:
    """The fields of one MISSION_ITEM_INT; those after `params` are not sent.

    Items compare by the fields that are sent.
    """

    command: int  # MAV_CMD
    frame: int = dialect.MAV_FRAME_GLOBAL_INT  # MAV_FRAME
    x: int = 0  # [1e-7 deg] latitude
    y: int = 0  # [1e-7 deg] longitude
    z: float = 0.0  # [m] AMSL
    # param1 to param4 of the command
    params: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    task: str = field(default='', compare=False)  # id of the task that it is flown for
    completes: bool = field(default=False, compare=False)  # the task, once reached
    position: Point | None = field(default=None, compare=False)  # [m] ENU
    radius: float = field(default=0.0, compare=False)  # [m] accepted around it; 0: unknown
    holds: bool = field(default=False, compare=False)  # waits before the task
    along: bool = field(default=False, compare=False)  # of the way, after its first point
    served: Point | None = field(default=None, compare=False)  # `place_of` the task it completes

    @property
    def place(self) -> Point | None:
        """What identifies the place or the way of the task that it completes."""
        return self.position if self.served is None else self.served

    @property
    def is_action(self) -> bool:
        """Whether it is a command on the way, and no point of it."""
        return self.command in ACTION_COMMANDS


def with_position(item: Item, origin: Origin) -> Item:
    """Return an item as read from a vehicle with its position; unchanged where it has none.

    Args:
        item: without a position, as a readback gives it.
        origin: of the ENU frame.

    Returns:
        The item, with position and radius where it is a waypoint in a global frame (AMSL).
    """
    frame = _FRAME_READ_BACK.get(item.frame, item.frame)
    if item.position is not None or frame != dialect.MAV_FRAME_GLOBAL or item.command not in (
            dialect.MAV_CMD_NAV_WAYPOINT, dialect.MAV_CMD_NAV_LOITER_TIME):
        return item
    return replace(item, position=to_enu(origin, item.x * 1e-7, item.y * 1e-7, item.z),
                   radius=item.params[1])


def alike(sent: Item, held: Item) -> bool:
    """Return whether an item read back may be the item sent: autopilots round some fields.

    Args:
        sent: item of the upload.
        held: item of the readback.

    Returns:
        True where command, frame and parameters agree, and coordinates within rounding.
    """
    if sent.command in ACTION_COMMANDS:
        return sent.command == held.command and _same_action(sent, held)
    if sent.command != held.command or not _params_alike(_with_direction(sent, held), held.params):
        return False
    if sent.command == dialect.MAV_CMD_NAV_RETURN_TO_LAUNCH:
        return True
    frames = (_FRAME_READ_BACK.get(item.frame, item.frame) for item in (sent, held))
    return (len(set(frames)) == 1 and abs(sent.x - held.x) <= 1 and abs(sent.y - held.y) <= 1
            and abs(sent.z - held.z) <= _ALTITUDE_STEP)


def _same_action(sent: Item, held: Item) -> bool:
    """Whether the values agree: a dropped one would be another action."""
    return (all(math.isclose(a, b, rel_tol=1e-6, abs_tol=1e-4)
                for a, b in zip(sent.params, held.params, strict=True))
            and abs(sent.x - held.x) <= 1 and abs(sent.y - held.y) <= 1
            and abs(sent.z - held.z) <= _ALTITUDE_STEP)


def _with_direction(sent: Item, held: Item) -> Sequence[float]:
    """The parameters of an item sent, with the direction that ArduPilot returns for none."""
    n = _DIRECTION.get(sent.command)
    if n is None or sent.params[n] != 0.0 or held.params[n] != 1.0:
        return sent.params
    return *sent.params[:n], 1.0, *sent.params[n + 1:]


def _params_alike(sent: Sequence[float], held: Sequence[float]) -> bool:
    hold, others = (sent[0], held[0]), zip(sent[1:], held[1:], strict=True)
    return (math.isnan(hold[0]) or abs(hold[0] - hold[1]) < 1e-3
            or (math.isfinite(hold[0]) and hold[1] == math.floor(hold[0]))) and all(
        b == 0.0 or math.isnan(a) or math.isclose(a, b, rel_tol=1e-6) for a, b in others)


def leg_count(items: Sequence[Item]) -> int:
    """Return how many legs end at items; one along the way of a task, and none for an action.

    Args:
        items: consecutive ones of a mission.
    """
    points = [item for item in items if not item.is_action]
    return sum(not (item.along and before is not None and before.along
                    and item.task == before.task)
               for before, item in zip([None, *points], points, strict=False))


def all_alike(sent: Sequence[Item], held: Sequence[Item]) -> bool:
    """Return whether two missions have the same number of items, all `alike`.

    Args:
        sent: items of the upload, by seq.
        held: items of the readback, by seq.

    Returns:
        False where one is longer.
    """
    return len(sent) == len(held) and all(map(alike, sent, held))
