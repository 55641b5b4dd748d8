# SPDX-License-Identifier: Apache-2.0
"""Values of the allocator: tasks, UAV reports, allocations, proposals; SI units, ENU."""
from __future__ import annotations

import math
from dataclasses import dataclass, field
from enum import Enum
from typing import Any

from uav_task_alloc.allocator.list_records import LaterTrips, UavList
from uav_task_alloc.allocator.order_records import OperatorHold, OrderRows
from uav_task_alloc.allocator.work_records import WorkRecord
from uav_task_alloc.checks import check_id, check_names, check_number, check_point
from uav_task_alloc.geometry.frames import Origin
from uav_task_alloc.model import Plan, Point, Task, ThreatZone

# limits of a UavReport that are None where they are unknown, named as in model.Uav
REPORTED_LIMITS = ('endurance', 'payload_capacity', 'climb_speed', 'descent_speed', 'full_range',
              'turnaround')
_SLOWEST = 0.01  # [m/s] a lower speed is no speed of a vehicle; times would exceed any message


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
    turnaround: float | None = None  # [s] of a battery change at its home; inf, no change: None
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
            check_number(place + 'cruise_speed', self.cruise_speed, _SLOWEST, 1e4)
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
                least = _SLOWEST if name.endswith('_speed') else 0.0
                check_number(place + name, getattr(self, name), least, most, open_low=not least)
        if self.turnaround == math.inf:
            put(self, 'turnaround', None)
        put(self, 'capabilities', check_names(place + 'capabilities', self.capabilities))


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
    later: LaterTrips = field(default_factory=dict)  # of the UAVs of the lists


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
