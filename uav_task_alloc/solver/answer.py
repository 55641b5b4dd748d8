# SPDX-License-Identifier: Apache-2.0
"""The recorder's best as a Plan: ids, legs with their detour points, reasons, figures."""
from __future__ import annotations

import math
from itertools import pairwise

import numpy as np

from uav_task_alloc.model import Leg, Plan
from uav_task_alloc.objective import excess, fit
from uav_task_alloc.solver.problem import Problem
from uav_task_alloc.solver.reasons import reasons
from uav_task_alloc.solver.recorder import Recorder
from uav_task_alloc.solver.routes import Routes

ROUNDING = 1e-6  # [m] beyond range that is no excess
STRAIGHT = 1.0 + 1e-12  # a way at most so much longer than the distance has no detour points


def to_plan(problem: Problem, recorder: Recorder, solver: str, warm: bool) -> Plan:
    """What `plan` answers, but for its state."""
    order = nodes_of(recorder.best, len(problem.uavs))
    routes, legs = {}, {}
    for u, uav in enumerate(problem.uavs):
        held = problem.locked.get(uav.id, ())
        routes[uav.id] = (*(task.id for task in held), *(
            problem.tasks[node - len(problem.uavs)].id for node in order[u]))
        legs[uav.id] = _legs(problem, u, order[u])
    lengths = [math.fsum(leg.length for leg in each) for each in legs.values()]
    values = {task.id: task.value for held in (*problem.locked.values(), problem.tasks)
              for task in held}
    value = math.fsum(values[task_id] for row in routes.values() for task_id in row)
    distance, penalty = math.fsum(lengths), excess(problem.uavs, lengths)
    penalty = penalty if penalty > ROUNDING else 0.0
    left = np.flatnonzero(recorder.best.on[len(problem.uavs):problem.arrays.ends] < 0)
    return Plan(
        routes, reasons(problem, left), distance, value,
        penalty, fit(distance, value, penalty, problem.rules.weights),
        tuple(recorder.history), None, legs, problem.rules.returns, solver,
        recorder.elapsed(), recorder.iterations, warm)


def nodes_of(routes: Routes, uavs: int) -> list[list[int]]:
    """Task nodes of each UAV in order."""
    following, found = routes.next.tolist(), []
    ends = len(following) - uavs
    for u in range(uavs):
        row, node = [], following[u]
        while node < ends:
            row.append(node)
            node = following[node]
        found.append(row)
    return found


def _legs(problem: Problem, u: int, nodes: list[int]) -> tuple[Leg, ...]:
    """A leg before each task, the locked ones too, and one home where routes return."""
    places, home = [*problem.locked_places(u), *nodes], problem.arrays.ends + u
    distances = problem.distances
    if problem.rules.returns and len(places) > 1 and distances.length(
            places[-1], home) < math.inf:
        places.append(home)
    points = distances.points[places]
    steps = np.sqrt((np.diff(points, axis=0) ** 2).sum(axis=1)).tolist()
    if not distances.zones:
        return tuple([Leg((), metres) for metres in steps])
    return tuple(Leg((), metres) if distances.length(i, j) <= metres * STRAIGHT
                 else distances.leg(i, j)
                 for metres, (i, j) in zip(steps, pairwise(places), strict=True))
