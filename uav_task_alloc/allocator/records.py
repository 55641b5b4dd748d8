# SPDX-License-Identifier: Apache-2.0
"""What the allocator knows of tasks, UAVs and lists: frozen values, SI units, ENU."""
from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum

from uav_task_alloc.model import (
    Leg,
    Plan,
    Point,
    Task,
    ThreatZone,
    Uav,
    check_id,
    check_names,
    check_number,
    check_point,
)


class TaskState(Enum):
    """Where a task stands; the numbers are those of the TaskStatus message."""

    PENDING = 0
    ASSIGNED = 1
    ACTIVE = 2
    COMPLETED = 3
    FAILED = 4
    CANCELLED = 5
    REJECTED = 6
    UNASSIGNED = 7


OPEN = frozenset({TaskState.PENDING, TaskState.ASSIGNED, TaskState.ACTIVE,
                  TaskState.UNASSIGNED})
ENDED = frozenset({TaskState.COMPLETED, TaskState.FAILED, TaskState.CANCELLED})


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
    """One accepted task and its fate."""

    task: Task
    announced: Task  # as first added: a replay of that announcement is known again
    state: TaskState = TaskState.PENDING
    uav: str = ''  # who has it, or had it when it ended
    reason: str = ''
    stamp: float = 0.0  # [s] of the last change of state
    failed_on: tuple[str, ...] = ()  # UAVs that could not do it

    @property
    def open(self) -> bool:
        """It is still to be done."""
        return self.state in OPEN


@dataclass(frozen=True, slots=True)
class TaskVerdict:
    """The answer to one task of an announcement."""

    task_id: str
    accepted: bool
    reason: str = ''  # why not; where accepted: that it changes nothing

    @property
    def unchanged(self) -> bool:
        """It was accepted before."""
        return self.accepted and bool(self.reason)


@dataclass(frozen=True, slots=True)
class TaskEvent:
    """A UAV says what became of a task."""

    task_id: str
    uav_id: str
    revision: int  # of the list it was flown from; 0: not told
    kind: TaskEventKind
    reason: str = ''


@dataclass(frozen=True, slots=True)
class UavReport:
    """What one UAV says of itself; None where it does not know. Raises InvalidValue."""

    uav_id: str
    position: Point  # [m] ENU
    home: Point | None = None  # [m] ENU
    range: float | None = None  # [m] it can still fly
    cruise_speed: float | None = None  # [m/s]
    capabilities: frozenset[str] = frozenset()
    battery: float | None = None  # [0..1]
    available: bool = True  # and not in FAULT
    active_task: str = ''  # being flown
    list_revision: int = 0  # last list verified on board
    standby: bool = False  # on the ground

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
        if self.battery is not None:
            check_number(place + 'battery', self.battery, 0.0, 1.0)
        put(self, 'capabilities', check_names(place + 'capabilities', self.capabilities))


@dataclass(frozen=True, slots=True)
class ListStop:
    """A task in a list, the way to it, and when the UAV is there."""

    task: Task
    leg: Leg
    eta: float  # [s] from the stamp of the list to the arrival


@dataclass(frozen=True, slots=True)
class UavList:
    """What one UAV has still to fly, in order."""

    uav: str
    revision: int  # strictly rising
    stops: tuple[ListStop, ...] = ()
    returns: bool = False  # home after the last task
    end_via: tuple[Point, ...] = ()  # [m] ENU, flown before the return home
    distance: float = 0.0  # [m] of all legs, with the way home where it returns
    stamp: float = 0.0  # [s] when it was planned

    @property
    def task_ids(self) -> tuple[str, ...]:
        """The ids in the order flown."""
        return tuple(stop.task.id for stop in self.stops)

    def flies_as(self, other: UavList) -> bool:
        """The same tasks by the same ways to the same end: nothing to tell the UAV."""
        return (self.returns, self.end_via) == (other.returns, other.end_via) and [
            (stop.task, stop.leg.via) for stop in self.stops] == [
            (stop.task, stop.leg.via) for stop in other.stops]


@dataclass(frozen=True, slots=True)
class ReplanProblem:
    """The world as a worker solves it, apart from the world that goes on meanwhile."""

    version: int
    trigger: str
    background: bool  # nothing happened: publish only what is better by the margin
    budget: float  # [s]
    uavs: tuple[Uav, ...]
    tasks: tuple[Task, ...]
    zones: tuple[ThreatZone, ...]
    locked: Mapping[str, tuple[str, ...]]
    held: Plan  # the lists as they are out
    warm: Plan  # the best found so far, from which the search goes on


@dataclass(frozen=True, slots=True)
class ReplanAnswer:
    """What a worker found: the held lists repaired, and the best plan."""

    problem: ReplanProblem
    base: Plan
    fresh: Plan


@dataclass(frozen=True, slots=True)
class Allocation:
    """The plan in force, as it is told to everybody."""

    revision: int  # strictly rising
    lists: tuple[UavList, ...]
    plan: Plan
    trigger: str
    stamp: float  # [s]


@dataclass(frozen=True, slots=True)
class LogNote:
    """A line for the log."""

    warning: bool
    text: str


@dataclass(slots=True)
class Outbox:
    """What has to be told since it was last emptied."""

    lists: dict[str, UavList] = field(default_factory=dict)
    forgotten: set[str] = field(default_factory=set)  # UAVs, before the lists
    allocation: Allocation | None = None
    statuses: bool = False
    notes: list[LogNote] = field(default_factory=list)
