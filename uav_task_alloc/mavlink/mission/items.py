# SPDX-License-Identifier: Apache-2.0
"""A task list as mission items that an autopilot can store, and when two such items are alike."""
from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace

from pymavlink.dialects.v20 import ardupilotmega as dialect

from uav_task_alloc.errors import MissionError
from uav_task_alloc.geometry.frames import Origin, to_enu, to_geodetic_batch
from uav_task_alloc.mavlink.autopilots import ItemRules
from uav_task_alloc.model import Point, Task

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
_LONGEST_HOLD = 65535.0  # [s] ArduPilot keeps 16 bits
_ABOVE_HOME = 1.0  # [m] horizontally from home: a way home that ends there ends with NAV_LAND
# commands that fly home and land by themselves, at the end of a mission
ENDS_AT_HOME = frozenset({dialect.MAV_CMD_NAV_RETURN_TO_LAUNCH, dialect.MAV_CMD_NAV_LAND})


@dataclass(frozen=True, slots=True)
class Hold:
    """A wait in the air before a task."""

    place: Point  # [m] ENU: the stop before, or the task itself
    seconds: float  # [s]


@dataclass(frozen=True, slots=True)
class MissionStop:
    """A task and the detour points flown before it, ENU [m]."""

    task: Task  # flown at its position
    via: tuple[Point, ...] = ()  # [m] ENU
    wait: float = 0.0  # [s] of the plan before the service
    begin: float = 0.0  # [s] ROS time of the service, as planned
    hold: Hold | None = None  # how it waits, see `mission.waits`
    reversed: bool = False  # the path is flown from its last point


@dataclass(frozen=True, slots=True)
class TaskList:
    """The tasks that one UAV is to fly, in order; as published in TaskList.

    Arguments of methods:
        task_id: of a task.
        count: number of stops.
    """

    revision: int  # strictly increasing for a UAV; 0: none
    stops: tuple[MissionStop, ...] = ()  # in the order of flight
    returns: bool = False  # home after the last stop, else hold there
    end_via: tuple[Point, ...] = ()  # [m] ENU, flown before the return
    stamp: float = 0.0  # [s] ROS time of the plan

    def without(self, tasks: Iterable[str]) -> TaskList:
        """Return the list without the tasks of these ids."""
        removed = set(tasks)
        return replace(self, stops=tuple(s for s in self.stops if s.task.id not in removed))

    def find(self, task_id: str) -> Task | None:
        """Return the task of that id, None where the list has none."""
        return next((s.task for s in self.stops if s.task.id == task_id), None)

    def first(self, count: int) -> TaskList:
        """Return a rolling horizon: the first stops only, and no return before the others."""
        if count >= len(self.stops):
            return self
        return replace(self, stops=self.stops[:count], returns=False, end_via=())


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


def mission_items(tasks: TaskList, rules: ItemRules, origin: Origin,
                  home: Point | None = None) -> tuple[Item, ...]:
    """Compile a task list into mission items.

    Args:
        tasks: the list; positions ENU [m].
        rules: what the autopilot takes.
        origin: of the ENU frame.
        home: [m] ENU; None: not known.

    Returns:
        Items without home; none where the list has no point. A return whose last point is above
        the home ends with NAV_LAND below that point, any other one with NAV_RETURN_TO_LAUNCH,
        which climbs to the vehicle's own height.

    Raises:
        MissionError: a service time does not fit into an item.
    """
    points = [p for stop in tasks.stops for p in _points(stop)]
    points += tasks.end_via if tasks.returns else ()
    if not points:
        return ()
    geodetic = iter(zip(points, to_geodetic_batch(origin, points).tolist(), strict=True))
    items: list[Item] = []
    before: Task | None = None
    for stop in tasks.stops:
        waits = [] if stop.hold is None or stop.hold.place == stop.task.position else [
            _hold_item(*next(geodetic), rules, stop.task, stop.hold.seconds, before)]
        items += waits
        items += (_waypoint(*next(geodetic), rules, stop.task.id) for _ in stop.via)
        if stop.hold is not None and not waits:
            items.append(_hold_item(*next(geodetic), rules, stop.task, stop.hold.seconds,
                                    stop.task))
        items.append(_task_item(*next(geodetic), rules, stop.task))
        before = stop.task
    items += (_waypoint(*pair, rules, '') for pair in geodetic)
    if tasks.returns:
        items.append(_landing(items[-1], rules) if lands_by_item(tasks, rules, home) else Item(
            dialect.MAV_CMD_NAV_RETURN_TO_LAUNCH, frame=rules.command_frame))
    return tuple(items)


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


def _points(stop: MissionStop) -> tuple[Point, ...]:
    """Positions of the items of a stop, in their order."""
    path = (*stop.via, stop.task.position)
    if stop.hold is None:
        return path
    at_task = stop.hold.place == stop.task.position
    return (*path, stop.task.position) if at_task else (stop.hold.place, *path)


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
    point = home or (0.0, 0.0, 0.0)
    return _waypoint(point, to_geodetic_batch(origin, [point]).tolist()[0], rules, '')


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


def _waypoint(point: Point, geodetic: Sequence[float], rules: ItemRules, task: str) -> Item:
    latitude, longitude, altitude = geodetic
    # round: truncation to 1e-7 deg moves a point by up to a centimetre, always south-west
    return Item(dialect.MAV_CMD_NAV_WAYPOINT, x=round(latitude * 1e7), y=round(longitude * 1e7),
                z=altitude, params=(0.0, rules.radius, 0.0, rules.yaw), task=task,
                position=point, radius=rules.radius)


def _hold_item(point: Point, geodetic: Sequence[float], rules: ItemRules, task: Task,
               seconds: float, here: Task | None) -> Item:
    """The item of a wait; unlike that of the task `here`, as items read back have no names."""
    hold = max(1, round(min(seconds, _LONGEST_HOLD - 1.0)))
    hold += here is None or hold == math.ceil(here.service_time)
    return replace(_item_with_hold(point, geodetic, rules, task.id, float(hold), rules.radius),
                   holds=True)


def _task_item(point: Point, geodetic: Sequence[float], rules: ItemRules, task: Task) -> Item:
    hold = math.ceil(task.service_time) if rules.whole_seconds else task.service_time
    if not 0.0 <= hold <= _LONGEST_HOLD:
        raise MissionError(f'task {task.id}: service_time = {task.service_time:g}: expected at '
                           f'most {_LONGEST_HOLD:g} s, which is what a mission item holds',
                           task.id)
    radius = task.acceptance_radius or rules.radius
    return replace(_item_with_hold(point, geodetic, rules, task.id, hold, radius),
                   completes=True)


def _item_with_hold(point: Point, geodetic: Sequence[float], rules: ItemRules, task: str,
                    hold: float, radius: float) -> Item:
    """A waypoint with a time to stay [s]; a circle for a fixed wing."""
    item = replace(_waypoint(point, geodetic, rules, task), radius=radius)
    if rules.loiters and hold > 0.0:  # no NaN: LOITER_TIME is refused with one
        return replace(item, command=dialect.MAV_CMD_NAV_LOITER_TIME,
                       params=(float(hold), 0.0, 0.0, 0.0))
    return replace(item, params=(float(hold), radius if rules.keeps_radius else 0.0, 0.0,
                                 rules.yaw))


def alike(sent: Item, held: Item) -> bool:
    """Return whether an item read back may be the item sent: autopilots round some fields.

    Args:
        sent: item of the upload.
        held: item of the readback.

    Returns:
        True where command, frame and parameters agree, and coordinates within rounding.
    """
    if sent.command != held.command or not _params_alike(sent.params, held.params):
        return False
    if sent.command == dialect.MAV_CMD_NAV_RETURN_TO_LAUNCH:
        return True
    frames = (_FRAME_READ_BACK.get(item.frame, item.frame) for item in (sent, held))
    return (len(set(frames)) == 1 and abs(sent.x - held.x) <= 1 and abs(sent.y - held.y) <= 1
            and abs(sent.z - held.z) <= _ALTITUDE_STEP)


def _params_alike(sent: Sequence[float], held: Sequence[float]) -> bool:
    hold, others = (sent[0], held[0]), zip(sent[1:], held[1:], strict=True)
    return (math.isnan(hold[0]) or abs(hold[0] - hold[1]) < 1e-3
            or (math.isfinite(hold[0]) and hold[1] == math.floor(hold[0]))) and all(
        b == 0.0 or math.isnan(a) or math.isclose(a, b, rel_tol=1e-6) for a, b in others)


def all_alike(sent: Sequence[Item], held: Sequence[Item]) -> bool:
    """Return whether two missions have the same number of items, all `alike`.

    Args:
        sent: items of the upload, by seq.
        held: items of the readback, by seq.

    Returns:
        False where one is longer.
    """
    return len(sent) == len(held) and all(map(alike, sent, held))
