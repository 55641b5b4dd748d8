# SPDX-License-Identifier: Apache-2.0
"""Warm starts: replays an earlier plan as far as it is still feasible, inserts other tasks."""
from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from uav_task_alloc.kernel import kernel
from uav_task_alloc.model import Leg, Plan
from uav_task_alloc.solver.insertion import insert_cheapest_first
from uav_task_alloc.solver.problem import Problem
from uav_task_alloc.solver.rng import rng_state
from uav_task_alloc.solver.routes import (
    NODE,
    Arrays,
    Ints,
    Routes,
    empty_routes,
    insert,
    leg_length,
    lengthening_cost,
)


@dataclass(frozen=True, slots=True)
class WarmState:
    """What a plan carries for the next warm start."""

    problem: Problem | None = None  # its known lengths are reused
    learnt: Any = None  # what the solver returned
    routes: Mapping[str, tuple[str, ...]] = field(default_factory=dict)  # task ids by UAV id
    legs: Mapping[str, tuple[Leg, ...]] = field(default_factory=dict)  # by UAV id
    # task ids of each trip, by UAV id, where the problem had time
    trips: Mapping[str, tuple[tuple[str, ...], ...]] = field(default_factory=dict)
    reversed: frozenset[str] = frozenset()  # ids of tasks flown from their last points
    timed: Any = None  # the TimedProblem, whose neighbours are used again

    def __reduce__(self) -> tuple[Any, ...]:
        """How to pickle a state: without the problems, which have pointers to kernels."""
        return WarmState, (None, self.learnt, dict(self.routes), dict(self.legs),
                           dict(self.trips), self.reversed)

    @classmethod
    def of(cls, warm: Plan | WarmState | None) -> WarmState:
        """Return the state of a plan, with its routes and legs.

        Args:
            warm: a plan or its state; None: there is none.

        Returns:
            An empty state for None.
        """
        if not isinstance(warm, Plan):
            return warm or cls()
        state = warm.state if isinstance(warm.state, WarmState) else cls()
        return replace(state, routes=warm.routes, legs=warm.legs, reversed=warm.reversed)

    def trips_of(self, uav: str) -> tuple[tuple[str, ...], ...]:
        """Return the trips of a UAV.

        Args:
            uav: its id.

        Returns:
            Task ids of each trip; a single trip where they are not known.
        """
        row, trips = self.routes.get(uav, ()), self.trips.get(uav, ())
        same = tuple(name for trip in trips for name in trip) == tuple(row)
        return trips if trips and same else (tuple(row),)

    def flown(self) -> dict[str, tuple[tuple[str, ...], tuple[Leg, ...]]]:
        """Task ids and legs by UAV id."""
        return {uav_id: (tasks, tuple(self.legs.get(uav_id, ())))
                for uav_id, tasks in self.routes.items()}


def repair(problem: Problem, before: Mapping[str, tuple[str, ...]]) -> Routes:
    """Feasible routes from earlier ones.

    Args:
        problem: the current problem.
        before: earlier routes, task ids by UAV id; unknown ids are ignored.

    Returns:
        The earlier routes without tasks that are removed, not allowed or out of range, and with
        all other tasks inserted where they cost least.
    """
    a, routes = problem.arrays, empty_routes(problem.arrays)
    nodes: list[int] = []
    bounds = [0]
    index = problem.index
    for uav in problem.uavs:
        nodes += [a.uavs + index[t] for t in before.get(uav.id, ()) if t in index]
        bounds.append(len(nodes))
    replay(a, routes, np.array(nodes, np.int64), np.array(bounds, np.int64))
    insert_cheapest_first(a, routes, rng_state(0))
    return routes


@kernel
def replay(a: Arrays, r: Routes, nodes: Ints, bounds: Ints) -> None:
    """Append tasks to the routes of their UAVs, as far as allowed. O(n).

    Args:
        a: arrays of the problem.
        r: routes, which are changed.
        nodes: int64 task nodes, UAV by UAV.
        bounds: int64 (m + 1); those of UAV u are nodes[bounds[u]:bounds[u + 1]].
    """
    for u in range(a.uavs):
        last = r.prev[a.ends + u]
        for i in range(bounds[u], bounds[u + 1]):
            t, end = NODE(nodes[i]), NODE(a.ends + u)
            if r.uav_of[t] >= 0 or not a.compatible[u, t - a.uavs]:
                continue
            delta = leg_length(a, last, t) + leg_length(a, t, end) - r.leg[last]
            if lengthening_cost(a, r, u, delta) < np.inf:
                insert(a, r, t, last)
                last = t
