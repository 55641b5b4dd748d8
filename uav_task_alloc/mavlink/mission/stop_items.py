# SPDX-License-Identifier: Apache-2.0
"""The items of one stop of a list: detour points, a wait, the service with its way and actions.

ArduPilot carries out a command that is no waypoint while it flies to the next waypoint, one in
each cycle of its mission, and leaves out those that are not begun when that waypoint is reached;
after the last waypoint it carries out only one. So every command is followed by a waypoint of the
same task, and by a hold of a second where more than one is followed by a point close by; a turn
comes last, as it lasts.
"""
from __future__ import annotations

import math
import zlib
from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

from pymavlink.dialects.v20 import ardupilotmega as dialect

from uav_task_alloc.actions import SETTLE, Action
from uav_task_alloc.errors import MissionError
from uav_task_alloc.mavlink.action_commands import ActionCommand, ActionRow, compass, hold_of
from uav_task_alloc.mavlink.autopilots import ItemRules
from uav_task_alloc.mavlink.mission.item import Item
from uav_task_alloc.mavlink.mission.task_list import MissionStop
from uav_task_alloc.model import Point, Task

_LONGEST_HOLD = 65535.0  # [s] ArduPilot keeps 16 bits
_CLOSE = 2.0  # [m] that a vehicle flies within two cycles of its mission
_SAME = 0.05  # [m] two points that an autopilot may store alike


class PlacedItem(NamedTuple):
    """An item without coordinates, and where it is."""

    item: Item
    place: Point | None  # [m] ENU; None: it has no position


def place_of(task: Task) -> Point:
    """Return what identifies where a task is flown.

    Args:
        task: any.

    Returns:
        [m] ENU: its position; for a way its middle and, in place of a height, a checksum of its
        points, whichever of its ends is the first.
    """
    if not task.path:
        return task.position
    rows = [tuple(round(value, 3) for value in point) for point in task.path]
    count = float(len(rows))
    return (math.fsum(row[0] for row in rows) / count, math.fsum(row[1] for row in rows) / count,
            float(zlib.crc32(repr(min(rows, rows[::-1])).encode())))


def waypoint(point: Point, rules: ItemRules, task: str) -> PlacedItem:
    """Return a waypoint that is passed.

    Args:
        point: [m] ENU.
        rules: what the autopilot takes.
        task: id of the task that it is flown for; '': none.
    """
    return PlacedItem(Item(
        dialect.MAV_CMD_NAV_WAYPOINT, params=(0.0, rules.radius, 0.0, rules.yaw), task=task,
        position=point, radius=rules.radius), point)


def stop_items(stop: MissionStop, rules: ItemRules, before: MissionStop | None,
               cruise: float) -> Iterator[PlacedItem]:
    """The items of a stop.

    Args:
        stop: the detour points to it, its wait and its task.
        rules: what the autopilot takes.
        before: the stop before it; None: it is the first.
        cruise: [m/s] own cruise speed of the vehicle; NaN: not known.

    Raises:
        MissionError: a time does not fit into an item, or the autopilot cannot carry out an
            action or turn to a heading.
    """
    wait, waits_first = stop.hold, stop.hold is not None and stop.hold.place != stop.start
    if wait is not None and waits_first:
        yield _wait(wait.place, rules, stop, wait.seconds, before)
    for point in stop.via:
        yield waypoint(point, rules, stop.task.id)
    if wait is not None and not waits_first:
        yield _wait(stop.start, rules, stop, wait.seconds, stop)
    yield from _Service(stop, rules, cruise).items()


def _wait(place: Point, rules: ItemRules, stop: MissionStop, seconds: float,
          here: MissionStop | None) -> PlacedItem:
    """The item of a wait; unlike that of the stop `here`, as items read back have no names."""
    hold = max(1, round(min(seconds, _LONGEST_HOLD - 1.0)))
    hold += here is None or hold == math.ceil(here.task.service_time)
    item = _hold(place, rules, stop.task.id, float(hold), rules.radius, rules.yaw)
    return PlacedItem(replace(item, holds=True), place)


def _hold(point: Point, rules: ItemRules, task: str, hold: float, radius: float,
          yaw: float) -> Item:
    """A waypoint with a time to stay [s]; a circle for a fixed wing."""
    if rules.loiters and hold > 0.0:  # no NaN: LOITER_TIME is refused with one
        return Item(dialect.MAV_CMD_NAV_LOITER_TIME, params=(float(hold), 0.0, 0.0, 0.0),
                    task=task, position=point, radius=radius)
    return Item(dialect.MAV_CMD_NAV_WAYPOINT, params=(
        float(hold), radius if rules.keeps_radius else 0.0, 0.0, yaw), task=task, position=point,
        radius=radius)


class _Service:
    """The items of a task: where it begins, its way and where it ends."""

    def __init__(self, stop: MissionStop, rules: ItemRules, cruise: float) -> None:
        self._stop, self._task, self._rules, self._cruise = stop, stop.task, rules, cruise
        self._way = stop.way
        self._radius = stop.task.acceptance_radius or rules.radius
        self._resumed = stop.begun
        rows = [self._row(action) for action in stop.task.actions]
        self._actions = [(action, row) for action, row in zip(
            stop.task.actions, rows, strict=True) if row.stays or not self._resumed]
        self._turns = self._heading_command()

    def items(self) -> Iterator[PlacedItem]:
        way, turn = self._way, self._turns
        ends = [row.end(self._cruise) for _, row in reversed(self._actions)
                if row.end is not None]
        hold = self._service_time
        if not self._actions and turn is None and len(way) == 1:
            yield self._last(hold)
            return
        yield self._point(way[0])
        if self._actions:
            yield from self._begin()
        for point in way[1:len(way) if ends else -1]:
            yield from self._turned(turn)
            yield self._point(point, along=True)
        if ends and len(way) == 1:
            yield from self._turned(turn)
            yield self._point(way[0], max(hold, SETTLE), along=True)
        for end in ends:
            yield self._command(end)
        yield from self._turned(turn)
        stays = bool(ends) or len(way) == 1 or any(
            math.dist(point, way[-1]) < _SAME for point in way[:-1])
        yield self._last(max(hold, SETTLE) if stays else hold)

    def _begin(self) -> Iterator[PlacedItem]:
        """The actions where the service begins."""
        open_commands = 0
        for action, row in self._actions:
            if row.begin is not None:
                open_commands += 1
                yield self._command(row.begin(action))
            seconds = hold_of(action)
            if seconds > 0.0:
                open_commands = 0
                yield self._point(self._way[0], self._unlike_last(seconds))
        near = len(self._way) > 1 and math.dist(self._way[0], self._way[1]) < _CLOSE
        if open_commands > 1 and near:
            yield self._point(self._way[0], self._unlike_last(SETTLE))

    def _unlike_last(self, seconds: float) -> float:
        """A hold that is not that of the completing item, as items read back have no names."""
        whole = float(math.ceil(min(seconds, _LONGEST_HOLD - 1.0)))
        last = max(math.ceil(self._task.service_time), SETTLE)
        return whole + (whole == last and math.dist(self._way[0], self._way[-1]) < _SAME)

    def _turned(self, turn: ActionCommand | None) -> Iterator[PlacedItem]:
        if turn is not None:
            yield self._command(turn)

    def _row(self, action: Action) -> ActionRow:
        row = self._rules.actions[action.name]
        if row.refusal:
            raise self._refused(f'action {action.name}: {row.refusal}')
        if row.needs_speed and math.isnan(self._cruise):
            raise self._refused(f'action {action.name}: the cruise speed of the vehicle is not '
                                'known, to which it would return')
        return row

    def _heading_command(self) -> ActionCommand | None:
        """The command before each point by which it keeps the heading of the task."""
        heading, rules = self._task.heading, self._rules
        if heading is None or rules.turns_by_waypoint:
            return None
        if rules.loiters:
            raise self._refused('heading: a fixed wing cannot keep one')
        return ActionCommand(dialect.MAV_CMD_CONDITION_YAW, (compass(heading), 0.0, 0.0, 0.0))

    def _refused(self, reason: str) -> MissionError:
        return MissionError(f'task {self._task.id}: {reason}', self._task.id)

    @property
    def _service_time(self) -> float:
        task, rules = self._task, self._rules
        hold = math.ceil(task.service_time) if rules.whole_seconds else task.service_time
        if not 0.0 <= hold <= _LONGEST_HOLD:
            raise MissionError(
                f'task {task.id}: service_time = {task.service_time:g}: expected at most '
                f'{_LONGEST_HOLD:g} s, which is what a mission item holds', task.id)
        return hold

    @property
    def _yaw(self) -> float:
        heading = self._task.heading
        return self._rules.yaw if heading is None or not self._rules.turns_by_waypoint else (
            compass(heading))

    def _point(self, point: Point, hold: float = 0.0, along: bool = False) -> PlacedItem:
        item = _hold(point, self._rules, self._task.id, hold, self._radius, self._yaw)
        return PlacedItem(replace(item, along=True) if along else item, point)

    def _last(self, hold: float) -> PlacedItem:
        """The item that completes the task."""
        item = _hold(self._way[-1], self._rules, self._task.id, hold, self._radius, self._yaw)
        return PlacedItem(replace(
            item, completes=True, along=bool(self._task.path or self._actions),
            served=place_of(self._task) if self._task.path else None), self._way[-1])

    def _command(self, command: ActionCommand) -> PlacedItem:
        return PlacedItem(Item(
            command.command, self._rules.command_frame if command.place is None
            else dialect.MAV_FRAME_GLOBAL_INT, z=command.z, params=command.params,
            task=self._task.id, along=True), command.place)
