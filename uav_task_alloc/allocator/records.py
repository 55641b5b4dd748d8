# SPDX-License-Identifier: Apache-2.0
"""Values of the allocator: tasks, UAV reports, task lists, problems, plans; SI units, ENU."""
from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import TYPE_CHECKING, Any

from uav_task_alloc.allocator.order_records import OperatorHold, OrderRows
from uav_task_alloc.allocator.work_records import WorkRecord
from uav_task_alloc.checks import check_id, check_names, check_number, check_point
from uav_task_alloc.geometry.frames import Origin
from uav_task_alloc.model import Leg, Plan, Point, Task, ThreatZone, Uav
from uav_task_alloc.objective import Objective

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

# limits of a UavReport that are None where they are unknown, named as in model.Uav
REPORTED_LIMITS = ('endurance', 'payload_capacity', 'climb_speed', 'descent_speed', 'full_range',
              'turnaround')


# task ids of each trip after the present one, by UAV id
LaterTrips = dict[str, tuple[tuple[str, ...], ...]]


class TaskState(Enum):
    """State of a task; the numbers are those of the TaskStatus message."""

    PENDING = 0
    ASSIGNED = 1
    ACTIVE = 2
    COMPLETED = 3
    FAILED = 4
    CANCELLED = 5
    REJECTED = 6
    UNASSIGNED = 7


OPEN_STATES = frozenset({TaskState.PENDING, TaskState.ASSIGNED, TaskState.ACTIVE,
                         TaskState.UNASSIGNED})
ENDED_STATES = frozenset({TaskState.COMPLETED, TaskState.FAILED, TaskState.CANCELLED})


class AnnouncementAction(Enum):
    """What an announcement does; the numbers are those of the message."""

    ADD = 0
    UPDATE = 1
    CANCEL = 2


class TaskEventKind(Enum):
    """What happened to a task; the numbers are those of the TaskEvent message."""

    STARTED = 0
    COMPLETED = 1
    FAILED = 2


@dataclass(frozen=True, slots=True)
class TaskRecord:
    """One accepted task, its state, and the UAV that has it; times are [s] of the ROS clock."""

    task: Task  # with its latest values
    announced: Task  # as first added, to recognise a replay of that announcement
    state: TaskState = TaskState.PENDING  # changed by task_state_machine only
    uav: str = ''  # that has it, or had it when it ended
    reason: str = ''  # of the state, for users
    stamp: float = 0.0  # [s] of the last change of state
    failed_on: tuple[str, ...] = ()  # UAVs that could not do it
    since: float = 0.0  # [s] when it was first announced

    @property
    def open(self) -> bool:
        """Whether it is still to be done."""
        return self.state in OPEN_STATES


@dataclass(frozen=True, slots=True)
class TaskVerdict:
    """Whether one task of an announcement was accepted."""

    task_id: str  # as announced
    accepted: bool  # or already known
    reason: str = ''  # why it was rejected; where accepted: that it changes nothing

    @property
    def unchanged(self) -> bool:
        """Whether it was accepted before, with the same content."""
        return self.accepted and bool(self.reason)


@dataclass(frozen=True, slots=True)
class TaskEvent:
    """Progress of a task as a UAV reports it."""

    task_id: str  # of an accepted task
    uav_id: str  # that reports it
    revision: int  # of the list it was flown from; 0: unknown
    kind: TaskEventKind  # STARTED, COMPLETED or FAILED
    reason: str = ''  # why it failed


@dataclass(frozen=True, slots=True)
class UavReport:
    """State of one UAV as it reports it; None where it is unknown.

    Raises:
        InvalidValue: a field is out of bounds.
    """

    uav_id: str  # unique in the fleet
    position: Point  # [m] ENU
    home: Point | None = None  # [m] ENU
    range: float | None = None  # [m] remaining
    cruise_speed: float | None = None  # [m/s]
    capabilities: frozenset[str] = frozenset()  # that tasks may require
    battery: float | None = None  # [0..1]
    available: bool = True  # for tasks, and not in FAULT
    active_task: str = ''  # id of the task being flown
    list_revision: int = 0  # of the last list verified on board
    standby: bool = False  # on the ground
    velocity: Point | None = None  # [m/s] ENU, over ground
    endurance: float | None = None  # [s] in the air, remaining
    payload_capacity: float | None = None  # [kg]
    climb_speed: float | None = None  # [m/s]
    descent_speed: float | None = None  # [m/s]
    full_range: float | None = None  # [m] with a full battery
    turnaround: float | None = None  # [s] of a battery change at its home
    mode: str = ''  # name of the constant of UavState; '': unknown
    authority: str = ''  # the same
    foreign: bool = False  # the mission on board is not of its bridge
    hold_radius: float = 0.0  # [m] of the circle in which it holds; 0: it hovers
    return_height: float | None = None  # [m] above its home that its own return climbs to
    takeoff_height: float | None = None  # [m] above its home to which it takes off
    reason: str = ''  # why it is not available

    @property
    def flown_by_other(self) -> bool:
        """Whether it flies and its bridge may not command it."""
        return self.authority in ('SUSPENDED', 'LOST') or (
            self.authority == 'NONE' and not self.standby)

    def __post_init__(self) -> None:
        check_id('uav_id', self.uav_id)
        place = f'uav {self.uav_id}: '
        put = object.__setattr__
        put(self, 'position', check_point(place + 'position', self.position))
        if self.home is not None:
            put(self, 'home', check_point(place + 'home', self.home))
        if self.range is not None:
            check_number(place + 'range_remaining', self.range, 0.0)
        if self.cruise_speed is not None:
            check_number(place + 'cruise_speed', self.cruise_speed, 0.0, 1e4)
        if self.velocity is not None:
            put(self, 'velocity', check_point(place + 'velocity', self.velocity))
        if self.battery is not None:
            check_number(place + 'battery', self.battery, 0.0, 1.0)
        check_number(place + 'hold_radius', self.hold_radius, 0.0, 1e5)
        for name in ('return_height', 'takeoff_height'):
            if getattr(self, name) is not None:
                check_number(place + name, getattr(self, name), -1e4, 1e5)
        for name in REPORTED_LIMITS:
            if getattr(self, name) is not None:
                most = 1e6 if name == 'payload_capacity' else math.inf  # as model.Uav
                check_number(place + name, getattr(self, name), 0.0, most, open_low=True)
        put(self, 'capabilities', check_names(place + 'capabilities', self.capabilities))


@dataclass(frozen=True, slots=True)
class ListStop:
    """A task in a list, the leg to it, and the estimated arrival."""

    task: Task  # with its position and service time
    leg: Leg  # from the stop before, with its detour points
    eta: float  # [s] from the stamp of the list to the arrival
    wait: float = 0.0  # [s] from the arrival to the start of the service
    served: float = 0.0  # [s] of the service that are over at the stamp
    begin_after: float = 0.0  # [s] ROS clock: the service waits until then, for the separation
    reversed: bool = False  # the path of the task is flown from its last point
    path_time: float = 0.0  # [s] that its path still takes

    @property
    def way(self) -> tuple[Point, ...]:
        """What is flown at the stop [m] ENU, in order: the path of the task, or its position."""
        path = self.task.path or (self.task.position,)
        return path[::-1] if self.reversed else path

    @property
    def entry(self) -> Point:
        """Where the leg to it ends [m] ENU."""
        return self.way[0]

    @property
    def exit(self) -> Point:
        """Where the next leg begins [m] ENU."""
        return self.way[-1]

    @property
    def line(self) -> tuple[Point, ...]:
        """Detour points of the leg, and the way [m] ENU."""
        return *self.leg.via, *self.way

    @property
    def through(self) -> Leg:
        """The leg to its exit, with the points of its way as detour points."""
        return Leg(self.line[:-1], self.length)

    @property
    def length(self) -> float:
        """Length of the leg and of the path [m]."""
        return self.leg.length + self.task.path_length

    @property
    def start(self) -> float:
        """Start of the service [s] from the stamp of the list; negative once it has begun."""
        return self.eta + self.wait - self.served

    @property
    def finish(self) -> float:
        """End of the service [s] from the stamp of the list."""
        service = max(0.0, self.task.stay - self.served)
        return self.eta + self.wait + self.path_time + service


@dataclass(frozen=True, slots=True)
class UavList:
    """The tasks one UAV has still to fly, in order."""

    uav: str  # id
    revision: int  # strictly increasing
    stops: tuple[ListStop, ...] = ()  # in the order of flight
    returns: bool = False  # returns home after the last task
    # [m] ENU, flown before the return home; of an empty list that holds to its waiting place
    end_via: tuple[Point, ...] = ()
    distance: float = 0.0  # [m] of all legs and paths, with the leg home where it returns
    stamp: float = 0.0  # [s] of the plan

    @property
    def task_ids(self) -> tuple[str, ...]:
        """The task ids in the order flown."""
        return tuple(stop.task.id for stop in self.stops)

    @property
    def waiting_place(self) -> Point | None:
        """Where the UAV waits for tasks [m] ENU; None: it has tasks, returns, or stays."""
        return self.end_via[-1] if self.end_via and not (self.stops or self.returns) else None

    def same_route(self, other: UavList) -> bool:
        """Whether tasks, detour points, waits and end are equal: there is nothing to publish.

        Args:
            other: list of the same UAV.
        """
        return (self.returns, self.end_via) == (other.returns, other.end_via) and [
            (stop.task, stop.leg.via, stop.begin_after, stop.reversed) for stop in self.stops] == [
            (stop.task, stop.leg.via, stop.begin_after, stop.reversed) for stop in other.stops]


@dataclass(frozen=True, slots=True)
class ReplanProblem:
    """A snapshot of the world for the worker; the world goes on while it is solved."""

    version: int  # of the world when it was copied
    trigger: str  # what asked for the plan
    background: bool  # without an event: only what is better by the margin is published
    budget: float  # [s]
    uavs: tuple[Uav, ...]  # usable
    tasks: tuple[Task, ...]  # open
    zones: tuple[ThreatZone, ...]  # in force
    locked: Mapping[str, tuple[str, ...]]  # by UAV: first tasks of its route
    published: Plan  # the lists in force
    warm: Plan  # the best plan so far, from which the search continues
    objective: Objective = field(default_factory=Objective)  # what is minimised
    trips: int = 1  # of a UAV
    stamp: float = 0.0  # [s] of the copy, of the published clock
    since: Mapping[str, float] = field(default_factory=dict)  # [s] announcements, by task id
    stop_time: float = 0.0  # [s] that braking and accelerating cost at each task
    outlook: FleetOutlook | None = None  # None: the next tasks do not count


@dataclass(frozen=True, slots=True)
class FleetOutlook:
    """Where the next task is expected, at k places, and where UAVs without tasks wait for it."""

    x: NDArray[np.float64]  # (k) [m] east
    y: NDArray[np.float64]  # (k) [m] north
    weight: NDArray[np.float64]  # (k) probability of the task, times its value; the sum is 1
    value: float  # mean value of a task, > 0
    waiting: Mapping[str, Point]  # [m] ENU by UAV id; of others their positions


@dataclass(frozen=True, slots=True)
class ReplanAnswer:
    """Result of the worker."""

    problem: ReplanProblem  # that was solved
    repaired: Plan  # the published lists, repaired by insertion
    best: Plan  # the best plan within the budget
    covered: Plan | None = None  # the plan to publish, where the next tasks count


@dataclass(frozen=True, slots=True)
class Allocation:
    """The plan in force, as it is published."""

    revision: int  # strictly increasing
    lists: tuple[UavList, ...]  # one for each UAV
    plan: Plan  # its sums and unassigned tasks
    trigger: str  # what asked for the plan
    stamp: float  # [s]


@dataclass(frozen=True, slots=True)
class Proposal:
    """Lists that wait for the approval of an operator."""

    revision: int  # of the allocation that it would be
    base_revision: int  # of the allocation that it changes
    lists: tuple[UavList, ...]  # those that change; none: it is closed
    trigger: str  # what asked for the plan
    stamp: float  # [s] when it was made
    deadline: float  # [s] when it is decided without an operator
    accepted_on_timeout: bool  # it is accepted then, else rejected
    changes: tuple[str, ...]  # a sentence each
    distance: float = 0.0  # [m] that the routes get longer
    finish: float = 0.0  # [s] that the last UAV ends later
    late: tuple[str, ...] = ()  # ids of tasks that are too late with it


@dataclass(frozen=True, slots=True)
class LogNote:
    """A line for the log."""

    level: str  # 'debug', 'info' or 'warning'
    text: str  # a sentence


@dataclass(slots=True)
class Outbox:
    """What is to be published since it was last collected."""

    lists: dict[str, UavList] = field(default_factory=dict)  # by UAV
    forgotten: set[str] = field(default_factory=set)  # UAVs; applied before the lists
    allocation: Allocation | None = None  # None: unchanged
    statuses: bool = False  # they have changed
    holds: dict[str, OperatorHold] = field(default_factory=dict)  # by UAV
    proposal: Proposal | None = None  # opened or closed; None: unchanged
    notes: list[LogNote] = field(default_factory=list)  # in the order of their events


@dataclass(slots=True)
class SavedState:
    """What the journal restores after a restart."""

    tasks: list[TaskRecord] = field(default_factory=list)  # accepted, also ended ones
    lists: list[UavList] = field(default_factory=list)  # last published
    zones: list[ThreatZone] = field(default_factory=list)  # in force
    switched_off: list[str] = field(default_factory=list)  # UAVs, by an operator
    change_from: dict[str, float] = field(default_factory=dict)  # see `UavRecord`, by UAV
    revision: int = 0  # of the allocation
    learned: Any = None  # body of the row with the learned state
    origin: Origin | None = None  # of all coordinates; None: the journal has none
    unreadable: list[str] = field(default_factory=list)  # rows that were left out, and why
    orders: OrderRows = field(default_factory=OrderRows)  # of operators
    works: list[WorkRecord] = field(default_factory=list)  # accepted, also ended ones
    proposal: Proposal | None = None  # that waits for approval
    # announcements from which the demand is learnt: [s], [m] east, [m] north, value; by block
    seen_tasks: dict[int, list[tuple[float, float, float, float]]] = field(default_factory=dict)
