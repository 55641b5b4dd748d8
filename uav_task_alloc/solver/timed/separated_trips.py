# SPDX-License-Identifier: Apache-2.0
"""Trips of a plan with heights and waits: their times and sums, and which limits they keep."""
from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache

from uav_task_alloc.geometry.polyline import polyline_length
from uav_task_alloc.model import Leg, Plan, Task, Uav, turned_tasks
from uav_task_alloc.separation.flight_legs import Flight, FlightLeg, leg_times
from uav_task_alloc.solver.problem import Rules
from uav_task_alloc.solver.timed.evaluator import TimedEvaluation, evaluate_legs, legs_flown
from uav_task_alloc.solver.timed.schedule import (
    ROUNDING,
    GivenWaits,
    Held,
    Trip,
    scheduled_trips,
)


class SeparatedTrips:
    """The trips of a plan, flown with the heights and waits of flights.

    Args:
        plan: without heights and waits.
        uavs: the fleet.
        tasks: all tasks, locked ones included.
        locked: by UAV id the tasks that it serves first.
        rules: how routes end, and the objective.
    """

    def __init__(self, plan: Plan, uavs: Sequence[Uav], tasks: Sequence[Task],
                 locked: Mapping[str, Sequence[Task]], rules: Rules) -> None:
        self._plan, self._uavs, self._tasks, self._rules = plan, uavs, tasks, rules
        self._fleet, self._times = {uav.id: uav for uav in uavs}, plan.timetable()
        self._known = {task.id: task for task in turned_tasks(tasks, plan.reversed)}
        self._held = Held({uav_id: [task.id for task in row] for uav_id, row in locked.items()})
        self._planned = cache(self._planned_trips)

    def legs(self, flight: Flight) -> tuple[Leg, ...]:
        """Return the legs of the plan with the heights of a flight.

        Args:
            flight: of a UAV, with as many legs as the plan and those along paths.

        Returns:
            One to each task, and to each base at the end of a trip.
        """
        flown = [leg.points for leg in flight.legs if not _is_path(leg)]
        return tuple(leg if points[1:-1] == leg.via else Leg(
            points[1:-1], polyline_length(points))
            for leg, points in zip(self._plan.legs.get(flight.uav, ()), flown, strict=True))

    def evaluation(self, flights: Sequence[Flight]) -> TimedEvaluation:
        """Return the times and sums of the plan, flown so.

        Args:
            flights: of all UAVs, see `legs`.

        Returns:
            As `evaluate_legs`.
        """
        rows = {uav.id: self._rows(uav.id) for uav in self._uavs}
        return evaluate_legs(
            self._uavs, self._tasks, self._rules, {name: row for name, row in rows.items() if row},
            {each.uav: self.legs(each) for each in flights}, self._held, self._plan.reversed,
            {each.uav: self._given(each) for each in flights})

    def keeps_limits(self, flight: Flight) -> bool:
        """Return whether a flight keeps each limit of its UAV and tasks that the plan keeps.

        Args:
            flight: of a UAV, see `legs`.

        Returns:
            False where a deadline, the end of the availability, or a hard range or endurance is
            broken that was kept.
        """
        planned, hard = self._planned(flight.uav), self._rules.hard
        legs = {flight.uav: self.legs(flight)}
        flown = self._trips(flight.uav, legs, self._given(flight))
        for old, new in zip(planned, flown, strict=True):
            if hard and (_breaks(old.metres, new.metres, old.range * (1.0 + 1e-9))
                         or _breaks(old.in_air, new.in_air, old.endurance)):
                return False
            if any(_breaks(was, now, stop.task.latest) for was, now, stop in zip(
                    old.starts, new.starts, old.stops, strict=True)):
                return False
        return not planned or not _breaks(planned[-1].end, flown[-1].end,
                                          planned[-1].uav.available_until)

    def _rows(self, uav_id: str) -> tuple[tuple[str, ...], ...]:
        return self._times.trips.get(uav_id, ())

    def _planned_trips(self, uav_id: str) -> list[Trip]:
        """The trips as planned."""
        return self._trips(uav_id, self._plan.legs, GivenWaits(
            self._times.departures.get(uav_id, ()), ()))

    def _trips(self, uav_id: str, legs: Mapping[str, Sequence[Leg]],
               given: GivenWaits) -> list[Trip]:
        rows = [[self._known[name] for name in row] for row in self._rows(uav_id)]
        return scheduled_trips(self._fleet[uav_id], rows, self._rules, legs_flown(legs),
                               self._held, given)

    def _given(self, flight: Flight) -> GivenWaits:
        """What a flight waits beside what it has to wait as planned."""
        waits, ready = list[float](), flight.begin
        for n, leg in enumerate(flight.legs):
            times = leg_times(flight, leg, ready, n == 0)
            if not _is_path(leg):
                free = times if leg.hold_until == -math.inf else leg_times(
                    flight, replace(leg, hold_until=-math.inf), ready, n == 0)
                waits.append(times.begin - free.begin)
            ready = times.end
        return GivenWaits(self._times.departures.get(flight.uav, ()), waits)


def _is_path(leg: FlightLeg) -> bool:
    """Whether a leg is the path of a task, which is no leg of the plan."""
    return not leg.task and not leg.lands


def _breaks(before: float, after: float, limit: float) -> bool:
    """Whether a limit that was kept is broken now."""
    return before <= limit + ROUNDING < after
