# SPDX-License-Identifier: Apache-2.0
"""The task list of one vehicle, with the detour points and the waits before each task."""
from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

from uav_task_alloc.model import Point, Task


@dataclass(frozen=True, slots=True)
class Hold:
    """A wait in the air before a task."""

    place: Point  # [m] ENU: the stop before, or the task itself
    seconds: float  # [s]


@dataclass(frozen=True, slots=True)
class MissionStop:
    """A task and the detour points flown before it, ENU [m]."""

    task: Task  # flown at its position, or along its path
    via: tuple[Point, ...] = ()  # [m] ENU
    wait: float = 0.0  # [s] of the plan before the service
    begin: float = 0.0  # [s] ROS time of the service, as planned
    hold: Hold | None = None  # how it waits, see `mission.waits`
    reversed: bool = False  # the path is flown from its last point
    rest: tuple[Point, ...] = ()  # [m] ENU, what is left of a path, as it is flown; (): all
    begun: bool = False  # a part of the path is flown

    @property
    def way(self) -> tuple[Point, ...]:
        """The points of the service in the order of flight, ENU [m]; one for a point."""
        path = self.task.path or (self.task.position,)
        return self.rest or (path[::-1] if self.reversed else path)

    @property
    def start(self) -> Point:
        """Where the service begins, ENU [m]."""
        return self.way[0]

    @property
    def end(self) -> Point:
        """Where the service ends, ENU [m]."""
        return self.way[-1]


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
    end_via: tuple[Point, ...] = ()  # [m] ENU, flown before the return, or to where it waits
    stamp: float = 0.0  # [s] ROS time of the plan

    @property
    def waits(self) -> bool:
        """Whether it has no task, and leads to a place where the UAV waits for one."""
        return bool(self.end_via) and not self.returns and not self.stops

    @property
    def tail(self) -> tuple[Point, ...]:
        """The points flown after the last stop, ENU [m]."""
        return self.end_via if self.returns or not self.stops else ()

    def without(self, tasks: Iterable[str]) -> TaskList:
        """Return the list without the tasks of these ids."""
        removed = set(tasks)
        return replace(self, stops=tuple(s for s in self.stops if s.task.id not in removed),
                       end_via=self.tail)

    def find(self, task_id: str) -> Task | None:
        """Return the task of that id, None where the list has none."""
        return next((s.task for s in self.stops if s.task.id == task_id), None)

    def first(self, count: int) -> TaskList:
        """Return a rolling horizon: the first stops only, and no return before the others."""
        if count >= len(self.stops):
            return self
        return replace(self, stops=self.stops[:count], returns=False, end_via=())
