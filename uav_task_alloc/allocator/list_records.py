# SPDX-License-Identifier: Apache-2.0
"""The lists of UAVs: tasks in order, legs, times."""
from __future__ import annotations

from dataclasses import dataclass

from uav_task_alloc.model import Leg, Point, Task

# task ids of each trip after the present one, by UAV id
LaterTrips = dict[str, tuple[tuple[str, ...], ...]]


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

    def timed(self, eta: float, wait: float, served: float, path_time: float) -> ListStop:
        """Return the stop with other times; `replace` takes three times as long.

        Args:
            eta, wait, served, path_time: [s], see the class.
        """
        return ListStop(self.task, self.leg, eta, wait, served, self.begin_after, self.reversed,
                        path_time)

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
