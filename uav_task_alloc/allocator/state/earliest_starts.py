# SPDX-License-Identifier: Apache-2.0
"""Which UAV could start a task first, for many tasks at one moment: those that cannot are skipped.

Each would fly the task first and straight, and what that takes is predicted in the order of a
lower bound, until no other UAV can be sooner.
"""
from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from uav_task_alloc.allocator.list_records import ListStop
from uav_task_alloc.allocator.records import UavReport
from uav_task_alloc.allocator.state.fleet import Fleet, may_fly
from uav_task_alloc.allocator.state.flight_pace import UavFlight
from uav_task_alloc.allocator.state.flights import Flights
from uav_task_alloc.allocator.state.stop_times import timed_stops
from uav_task_alloc.allocator.state.tasks import TaskRegistry
from uav_task_alloc.model import Leg, Point, Task

_NO_LEG = Leg((), 0.0)


class EarliestStarts:
    """The earliest starts of tasks by the UAVs as they are now.

    Args:
        tasks, fleet, flights: the present state; it may not change meanwhile.
        stamp: [s] published clock.
    """

    def __init__(self, tasks: TaskRegistry, fleet: Fleet, flights: Flights,
                 stamp: float) -> None:
        self._tasks, self._fleet, self._flights, self._stamp = tasks, fleet, flights, stamp
        self._groups: dict[bool, _Group] = {}

    def first(self, task: Task, failed_on: Collection[str], usable: bool) -> tuple[float, str]:
        """Return the earliest start of a task, and by which UAV.

        Args:
            task: with times of the ROS clock.
            failed_on: ids of the UAVs that failed at it.
            usable: of the UAVs that may be given tasks, or of those that may not.

        Returns:
            [s] of the ROS clock, and an id; infinite and '' where no UAV may fly it.
        """
        if usable not in self._groups:
            self._groups[usable] = self._group(usable)
        group, best = self._groups[usable], (math.inf, '')
        places = (task.position, task.end) if task.reversible else (task.position,)
        starts = np.maximum(max(self._stamp, task.release) + group.least_seconds(places),
                            task.earliest)
        for k in np.argsort(starts, kind='stable').tolist():  # the first id of equal ones
            if starts[k] >= best[0]:
                break
            report, flight = group.reports[k], group.flights[k]
            if may_fly(task, failed_on, report) and self._has_payload(task, report):
                best = min(best, (self._start(task, flight), report.uav_id))
        return best

    def _group(self, usable: bool) -> _Group:
        flights = [(record.report, flight) for uav_id, record in sorted(
            self._fleet.records.items()) if self._fleet.usable(uav_id) == usable and (
                flight := self._flights.of(uav_id, self._stamp)) is not None]
        return _Group([report for report, _ in flights], [flight for _, flight in flights])

    def _start(self, task: Task, flight: UavFlight) -> float:
        """When a UAV is predicted to start a task that it flies first and straight."""
        stop = ListStop(task, _NO_LEG, 0.0)
        ways = (stop, replace(stop, reversed=True)) if task.reversible else (stop,)
        return self._stamp + min(timed_stops((way,), flight)[0].start for way in ways)

    def _has_payload(self, task: Task, report: UavReport) -> bool:
        """Whether a UAV has the payload of an accepted task on board, or could take it on."""
        return task.payload == 0.0 or self._tasks.records[task.id].uav == report.uav_id or (
            report.standby and task.payload <= (report.payload_capacity or 0.0))


class _Group:
    """UAVs in the order of their ids, with a lower bound of their flight times."""

    def __init__(self, reports: list[UavReport], flights: list[UavFlight]) -> None:
        self.reports, self.flights = reports, flights
        self._places = np.array([flight.position for flight in flights]).reshape(-1, 3)
        paces = [flight.pace for flight in flights]
        self._fastest = np.array([pace.speed + math.hypot(*pace.wind) for pace in paces])
        self._climb = np.array([pace.climb for pace in paces])
        self._descent = np.array([pace.descent for pace in paces])

    def least_seconds(self, places: Collection[Point]) -> NDArray[np.float64]:
        """Return what each needs at least to the nearest of some places [m], with the wind [s]."""
        return np.asarray(np.minimum.reduce([self._least_seconds(place) for place in places]))

    def _least_seconds(self, place: Point) -> NDArray[np.float64]:
        x, y, z = (np.array(place) - self._places).T
        return np.asarray(np.maximum(np.hypot(x, y) / self._fastest,
                                     np.maximum(z / self._climb, -z / self._descent)))
