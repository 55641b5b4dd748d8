# SPDX-License-Identifier: Apache-2.0
"""An earlier plan brought into the world as it is: what still holds stays, new tasks go in."""
from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from uav_task_alloc.kernel import kernel
from uav_task_alloc.model import Leg, Plan
from uav_task_alloc.solver import routes as of
from uav_task_alloc.solver.insertion import cheapest_first
from uav_task_alloc.solver.problem import Problem
from uav_task_alloc.solver.rng import chance
from uav_task_alloc.solver.routes import Arrays, Ints, Routes, insert, lengthened, step


@dataclass(frozen=True, slots=True)
class WarmState:
    """What a plan carries for the next warm start."""

    problem: Problem | None = None  # lengths that are known
    learnt: Any = None  # what the solver wants back
    routes: Mapping[str, tuple[str, ...]] = field(default_factory=dict)  # by UAV
    legs: Mapping[str, tuple[Leg, ...]] = field(default_factory=dict)  # of them

    @classmethod
    def of(cls, warm: Plan | WarmState | None) -> WarmState:
        """The state of a plan, with the plan's routes; an empty one where there is none."""
        if not isinstance(warm, Plan):
            return warm or cls()
        found = warm.state if isinstance(warm.state, WarmState) else cls()
        return replace(found, routes=warm.routes, legs=warm.legs)

    def flown(self) -> dict[str, tuple[tuple[str, ...], tuple[Leg, ...]]]:
        """Tasks and legs by UAV."""
        return {uav_id: (tasks, tuple(self.legs.get(uav_id, ())))
                for uav_id, tasks in self.routes.items()}


def repaired(problem: Problem, before: Mapping[str, tuple[str, ...]]) -> Routes:
    """Earlier routes without what is gone, forbidden or too far, and all else put in."""
    a, routes = problem.arrays, of.empty_routes(problem.arrays)
    nodes: list[int] = []
    bounds = [0]
    index = problem.index
    for uav in problem.uavs:
        nodes += [a.uavs + index[t] for t in before.get(uav.id, ()) if t in index]
        bounds.append(len(nodes))
    replay(a, routes, np.array(nodes, np.int64), np.array(bounds, np.int64))
    cheapest_first(a, routes, chance(0))
    return routes


@kernel
def replay(a: Arrays, r: Routes, nodes: Ints, bounds: Ints) -> None:
    """Give UAV u the task nodes bounds[u]..bounds[u + 1] in order, if it may. O(n)"""
    for u in range(a.uavs):
        last = r.prev[a.ends + u]
        for i in range(bounds[u], bounds[u + 1]):
            t, end = nodes[i], a.ends + u
            if r.on[t] >= 0 or not a.may[u, t - a.uavs]:
                continue
            delta = step(a, last, t) + step(a, t, end) - r.leg[last]
            if lengthened(a, r, u, delta) < np.inf:
                insert(a, r, t, last)
                last = t
