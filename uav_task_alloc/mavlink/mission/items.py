# SPDX-License-Identifier: Apache-2.0
"""A task list as mission items that an autopilot can store, and when two such items are alike."""
from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace

from uav_task_alloc.errors import MissionError
from uav_task_alloc.geometry.frames import Origin, to_geodetic_batch
from uav_task_alloc.mavlink.autopilots import ItemRules
from uav_task_alloc.model import Point, Task

# MAV_CMD and MAV_FRAME; pymavlink has no place in this room
WAYPOINT, LOITER_TIME, RETURN = 16, 19, 20
GLOBAL, MISSION = 5, 2
GLOBAL_FRAMES = frozenset({0, 3, 5, 6, 10, 11})  # x, y and z are a place
MOST_ITEMS = 65535  # of a mission, home included: what MISSION_COUNT holds
_ALIKE_FRAMES = {6: 3, 5: 0, 11: 10}  # ArduPilot gives the _INT frames back without it
_ALTITUDE_STEP = 0.011  # [m] ArduPilot keeps whole centimetres
_LONGEST_HOLD = 65535.0  # [s] ArduPilot keeps 16 bits


@dataclass(frozen=True, slots=True)
class MissionStop:
    """A task and the detour points flown before it."""

    task: Task
    via: tuple[Point, ...] = ()  # [m] ENU


@dataclass(frozen=True, slots=True)
class TaskList:
    """What one UAV has still to fly, in order."""

    revision: int
    stops: tuple[MissionStop, ...] = ()
    returns: bool = False  # home after the last stop, else hold there
    end_via: tuple[Point, ...] = ()  # [m] ENU, flown before the return

    def without(self, tasks: Iterable[str]) -> TaskList:
        """The same list less some tasks."""
        gone = set(tasks)
        return replace(self, stops=tuple(s for s in self.stops if s.task.id not in gone))

    def find(self, task_id: str) -> Task | None:
        """The task of that id, if the list has it."""
        return next((s.task for s in self.stops if s.task.id == task_id), None)

    def first(self, count: int) -> TaskList:
        """A rolling horizon: the first stops only, and no return before the others."""
        if count >= len(self.stops):
            return self
        return replace(self, stops=self.stops[:count], returns=False, end_via=())


@dataclass(frozen=True, slots=True)
class Item:
    """One mission item as sent; `task` is what it is flown for and stays on the ground."""

    command: int
    frame: int = GLOBAL
    x: int = 0  # [1e-7 deg] latitude
    y: int = 0  # [1e-7 deg] longitude
    z: float = 0.0  # [m] AMSL
    params: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    task: str = field(default='', compare=False)
    completes: bool = field(default=False, compare=False)  # the task, once reached
    position: Point | None = field(default=None, compare=False)  # [m] ENU
    radius: float = field(default=0.0, compare=False)  # [m] accepted around it; 0: unknown


def mission_items(tasks: TaskList, rules: ItemRules, origin: Origin) -> tuple[Item, ...]:
    """The items of a list, without home; raise MissionError where one cannot be stored."""
    points = [p for stop in tasks.stops for p in (*stop.via, stop.task.position)]
    points += tasks.end_via if tasks.returns else ()
    if not points:
        return ()
    places = iter(zip(points, to_geodetic_batch(origin, points).tolist(), strict=True))
    items: list[Item] = []
    for stop in tasks.stops:
        items += (_waypoint(*next(places), rules, stop.task.id) for _ in stop.via)
        items.append(_task_item(*next(places), rules, stop.task))
    items += (_waypoint(*place, rules, '') for place in places)
    if tasks.returns:
        items.append(Item(RETURN, frame=rules.command_frame))
    return tuple(items)


def home_item(home: Point | None, origin: Origin, rules: ItemRules) -> Item:
    """What goes to seq 0 where that is home; the vehicle puts the real home there."""
    place = home or (0.0, 0.0, 0.0)
    return _waypoint(place, to_geodetic_batch(origin, [place]).tolist()[0], rules, '')


def _waypoint(point: Point, place: Sequence[float], rules: ItemRules, task: str) -> Item:
    latitude, longitude, altitude = place
    # round, as cutting the seventh digit off moves a point by a centimetre, always south-west
    return Item(WAYPOINT, GLOBAL, round(latitude * 1e7), round(longitude * 1e7), altitude,
                (0.0, rules.radius, 0.0, rules.yaw), task, position=point, radius=rules.radius)


def _task_item(point: Point, place: Sequence[float], rules: ItemRules, task: Task) -> Item:
    hold = math.ceil(task.service_time) if rules.whole_seconds else task.service_time
    if not 0.0 <= hold <= _LONGEST_HOLD:
        raise MissionError(f'task {task.id}: service_time = {task.service_time:g}: expected at '
                           f'most {_LONGEST_HOLD:g} s, which is what a mission item holds',
                           task.id)
    radius = task.acceptance_radius or rules.radius
    item = replace(_waypoint(point, place, rules, task.id), completes=True, radius=radius)
    if rules.loiters and hold > 0.0:  # NaN is refused here
        return replace(item, command=LOITER_TIME, params=(float(hold), 0.0, 0.0, 0.0))
    return replace(item, params=(float(hold), radius if rules.keeps_radius else 0.0, 0.0,
                                 rules.yaw))


def alike(sent: Item, held: Item) -> bool:
    """Whether what is held may be what was sent, after all that autopilots round off."""
    if sent.command != held.command or not _params_alike(sent.params, held.params):
        return False
    if sent.command == RETURN:
        return True
    frames = (_ALIKE_FRAMES.get(item.frame, item.frame) for item in (sent, held))
    return (len(set(frames)) == 1 and abs(sent.x - held.x) <= 1 and abs(sent.y - held.y) <= 1
            and abs(sent.z - held.z) <= _ALTITUDE_STEP)


def _params_alike(sent: Sequence[float], held: Sequence[float]) -> bool:
    hold, others = (sent[0], held[0]), zip(sent[1:], held[1:], strict=True)
    return (math.isnan(hold[0]) or abs(hold[0] - hold[1]) < 1e-3
            or (math.isfinite(hold[0]) and hold[1] == math.floor(hold[0]))) and all(
        b == 0.0 or math.isnan(a) or math.isclose(a, b, rel_tol=1e-6) for a, b in others)


def all_alike(sent: Sequence[Item], held: Sequence[Item]) -> bool:
    """Whether two missions are item by item alike."""
    return len(sent) == len(held) and all(map(alike, sent, held))
