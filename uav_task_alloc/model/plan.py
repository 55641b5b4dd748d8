# SPDX-License-Identifier: Apache-2.0
"""Legs, routes and plans: what a solve returns, in SI units and ENU."""
from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, replace
from functools import partial
from typing import Any

from uav_task_alloc.model.task import Point
from uav_task_alloc.separation.rule import Conflict
from uav_task_alloc.timetable import Timetable


@dataclass(frozen=True, slots=True)
class Leg:
    """A flight from one stop to the next: its detour points, and the length of the polyline."""

    via: tuple[Point, ...]  # [m] ENU, without both ends
    length: float  # [m]


@dataclass(frozen=True, slots=True)
class Route:
    """The flight of one UAV: task ids in order, and the legs between them and perhaps home."""

    uav: str  # id
    tasks: tuple[str, ...] = ()  # ids in the order of flight
    legs: tuple[Leg, ...] = ()  # one a task, and one more home where `returns`
    returns: bool = False  # flies home after the last task
    paths_length: float = 0.0  # [m] of the paths of its tasks

    @property
    def distance(self) -> float:
        """Length of all legs and of the paths of its tasks [m]."""
        return math.fsum(leg.length for leg in self.legs) + self.paths_length


@dataclass(frozen=True, slots=True)
class Plan:
    """The result of a solve: routes, unassigned tasks with reasons, terms of the objective.

    Attributes:
        routes: task ids in order by UAV id; each UAV is a key, also one without tasks.
        unassigned: reason by task id.
        distance: [m], D of eq 2.12, with the ways of tasks that have a path.
        value: R of eq 2.12.
        penalty: [m] beyond range, P of eq 2.12.
        fit: of eq 2.12, smaller is better.
        history: ([s], fit) of the incumbent; the objective decides which is better, so the fit may
            rise.
        state: for the next warm start; opaque. Of a plan that was pickled it has the routes and
            what was learnt, not the paths around zones that are known.
        legs: by UAV id, as in Route.
        returns: routes end at home.
        solver: name of the solver.
        solve_time: [s].
        iterations: of the solver.
        warm_started: it started from a previous plan.
        cost: of the objective that the plan was solved for, smaller is better.
        timetable: returns the times of the plan; a function, as they are computed when they are
            first asked for.
        conflicts: of UAVs that would not have been apart, and how each was resolved.
        reversed: ids of the tasks with a path that are flown from their last point.
        path_lengths: [m] by the id of each task with a path.
    """

    routes: dict[str, tuple[str, ...]]
    unassigned: dict[str, str] = field(default_factory=dict)
    distance: float = 0.0  # [m]
    value: float = 0.0
    penalty: float = 0.0  # [m]
    fit: float = 0.0
    history: tuple[tuple[float, float], ...] = ()  # ([s], fit)
    state: Any = None
    legs: Mapping[str, tuple[Leg, ...]] = field(default_factory=dict)
    returns: bool = False
    solver: str = ''
    solve_time: float = 0.0  # [s]
    iterations: int = 0
    warm_started: bool = False
    cost: float = 0.0
    timetable: Callable[[], Timetable] = field(default=Timetable, compare=False, repr=False)
    conflicts: tuple[Conflict, ...] = ()
    reversed: frozenset[str] = frozenset()
    path_lengths: Mapping[str, float] = field(default_factory=dict)  # [m]

    def __reduce__(self) -> tuple[Any, ...]:
        """How to pickle a plan: with its times, as what computes them cannot be pickled."""
        values = {each.name: getattr(self, each.name) for each in fields(self)}
        return partial(Plan, **(values | {'timetable': partial(replace, self.timetable())})), ()

    @property
    def arrivals(self) -> Mapping[str, float]:
        """Arrival at each task served [s] from the moment of the plan, by task id."""
        return self.timetable().arrivals

    @property
    def waits(self) -> dict[str, float]:
        """Waiting at each task served, before the service [s], by task id."""
        times = self.timetable()
        return {name: start - times.arrivals[name] for name, start in times.starts.items()}

    @property
    def trips(self) -> Mapping[str, tuple[tuple[str, ...], ...]]:
        """Task ids of each trip, by UAV id."""
        return self.timetable().trips

    def trips_of(self, uav: str) -> tuple[tuple[str, ...], ...]:
        """Return the trips of one UAV.

        Args:
            uav: id.

        Returns:
            Task ids of each; one trip where the plan has no times.
        """
        return self.trips.get(uav) or (self.routes.get(uav, ()),)

    @property
    def finish(self) -> float:
        """End of the last route [s] from the moment of the plan; 0 without tasks."""
        return max(self.timetable().ends.values(), default=0.0)

    @property
    def response(self) -> float:
        """Value-weighted mean time from the announcements to the starts of the services [s]."""
        return self.timetable().response

    def route(self, uav: str) -> Route:
        """Return the route of one UAV with its legs, and the length of the paths on it.

        Args:
            uav: id.

        Returns:
            Without tasks where the plan does not use it.

        Raises:
            KeyError: the plan has no such UAV.
        """
        return Route(uav, self.routes[uav], tuple(self.legs.get(uav, ())), self.returns,
                     math.fsum(self.path_lengths.get(task, 0.0) for task in self.routes[uav]))
