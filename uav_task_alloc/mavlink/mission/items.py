# SPDX-License-Identifier: Apache-2.0
"""A task list as mission items that an autopilot can store."""
from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache

from pymavlink.dialects.v20 import ardupilotmega as dialect

from uav_task_alloc.geometry.frames import Origin, to_geodetic_batch
from uav_task_alloc.mavlink.autopilots import ItemRules
from uav_task_alloc.mavlink.mission.item import (
    ENDS_AT_HOME,
    GLOBAL_FRAMES,
    MOST_ITEMS,
    Item,
    alike,
    all_alike,
    with_position,
)
from uav_task_alloc.mavlink.mission.stop_items import PlacedItem, stop_items, waypoint
from uav_task_alloc.mavlink.mission.task_list import Hold, MissionStop, TaskList
from uav_task_alloc.model import Point

__all__ = ['ENDS_AT_HOME', 'GLOBAL_FRAMES', 'MOST_ITEMS', 'Hold', 'Item', 'MissionStop',
           'TaskList', 'alike', 'all_alike', 'home_item', 'lands_by_item', 'located',
           'mission_items', 'with_position']

_ABOVE_HOME = 1.0  # [m] horizontally from home: a way home that ends there ends with NAV_LAND


def mission_items(tasks: TaskList, rules: ItemRules, origin: Origin,
                  home: Point | None = None, cruise: float = math.nan) -> tuple[Item, ...]:
    """Compile a task list into mission items.

    Args:
        tasks: the list; positions ENU [m].
        rules: what the autopilot takes.
        origin: of the ENU frame.
        home: [m] ENU; None: not known.
        cruise: [m/s] own cruise speed of the vehicle, to which it returns after an action
            `speed`; NaN: not known.

    Returns:
        Items without home; none where the list has no point. A return whose last point is above
        the home ends with NAV_LAND below that point, any other one with NAV_RETURN_TO_LAUNCH,
        which climbs to the vehicle's own height. A list without a task that does not return ends
        with NAV_LOITER_UNLIM at its last point.

    Raises:
        MissionError: a service time does not fit into an item, or the autopilot cannot carry out
            an action.
    """
    placed: list[PlacedItem] = []
    before: MissionStop | None = None
    for stop in tasks.stops:
        placed += stop_items(stop, rules, before, cruise)
        before = stop
    placed += (waypoint(point, rules, '') for point in tasks.tail)
    if tasks.waits:
        placed[-1] = _wait_for_tasks(placed[-1], rules)
    if not placed:
        return ()
    items = located(placed, origin)
    if tasks.returns:
        items.append(_landing(items[-1], rules) if lands_by_item(tasks, rules, home) else Item(
            dialect.MAV_CMD_NAV_RETURN_TO_LAUNCH, frame=rules.command_frame))
    return tuple(items)


def _wait_for_tasks(place: PlacedItem, rules: ItemRules) -> PlacedItem:
    """The item with which it stays at a place, without an end, from the waypoint there."""
    yaw = 0.0 if rules.loiters else rules.yaw
    return place._replace(item=replace(
        place.item, command=dialect.MAV_CMD_NAV_LOITER_UNLIM, params=(0.0, 0.0, 0.0, yaw)))


def located(placed: Sequence[PlacedItem], origin: Origin) -> list[Item]:
    """Return items with their coordinates.

    Args:
        placed: items without, and where they are.
        origin: of the ENU frame.
    """
    geodetic = iter(_geodetic(origin, tuple(
        each.place for each in placed if each.place is not None)))
    return [each.item if each.place is None else _at(each.item, *next(geodetic))
            for each in placed]


@lru_cache(maxsize=32)
def _geodetic(origin: Origin, points: tuple[Point, ...]) -> list[list[float]]:
    """The geodetic positions of points; most lists of a flight are asked for several times."""
    places: list[list[float]] = to_geodetic_batch(origin, points).tolist()
    return places


def _at(item: Item, latitude: float, longitude: float, altitude: float) -> Item:
    # round: truncation to 1e-7 deg moves a point by up to a centimetre, always south-west
    return replace(item, x=round(latitude * 1e7), y=round(longitude * 1e7), z=altitude)


def lands_by_item(tasks: TaskList, rules: ItemRules, home: Point | None) -> bool:
    """Return whether the mission of a list ends with NAV_LAND.

    Args:
        tasks: the list.
        rules: what the autopilot takes.
        home: [m] ENU; None: not known.
    """
    return (rules.lands and tasks.returns and bool(tasks.end_via) and home is not None
            and math.dist(tasks.end_via[-1][:2], home[:2]) <= _ABOVE_HOME)


def _landing(above: Item, rules: ItemRules) -> Item:
    """NAV_LAND below a waypoint, at the height that the vehicle itself has for its home."""
    return Item(dialect.MAV_CMD_NAV_LAND, dialect.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT, above.x,
                above.y, params=(0.0, 0.0, 0.0, rules.yaw))


def home_item(home: Point | None, origin: Origin, rules: ItemRules) -> Item:
    """Return the item sent as seq 0 where that is home (ArduPilot).

    The vehicle stores its own home there.

    Args:
        home: ENU [m]; None: not known.
        origin: of the ENU frame.
        rules: what the autopilot takes.

    Returns:
        A waypoint; at the origin where home is not known.
    """
    return located([waypoint(home or (0.0, 0.0, 0.0), rules, '')], origin)[0]
