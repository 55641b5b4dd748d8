# SPDX-License-Identifier: Apache-2.0
"""The recorder's best as a Plan: ids, legs with their detour points, reasons, figures."""
from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import chain, pairwise

import numpy as np

from uav_task_alloc.geometry.distances import Distances
from uav_task_alloc.model import Leg, Plan
from uav_task_alloc.objective import excess, fit
from uav_task_alloc.solver.problem import Problem
from uav_task_alloc.solver.reasons import reasons
from uav_task_alloc.solver.recorder import Recorder
from uav_task_alloc.solver.routes import Routes

_ROUNDING = 1e-6  # [m] beyond range that is no excess
_STRAIGHT = 1.0 + 1e-12  # a way at most so much longer than the distance has no detour points


def to_plan(problem: Problem, recorder: Recorder, solver: str, warm: bool) -> Plan:
    """What `plan` answers, but for its state."""
    order = nodes_of(recorder.best, len(problem.uavs))
    lost = _drop_lost(problem, order) if problem.distances.zones else []
    ids, routes = [task.id for task in problem.tasks], {}
    for uav, nodes in zip(problem.uavs, order, strict=True):
        held = problem.locked.get(uav.id, ())
        routes[uav.id] = (*(task.id for task in held),
                          *[ids[node - len(problem.uavs)] for node in nodes])
    legs = dict(zip(routes, _all_legs(problem, order), strict=True))
    lengths = [math.fsum(leg.length for leg in each) for each in legs.values()]
    values = {task.id: task.value for held in (*problem.locked.values(), problem.tasks)
              for task in held}
    value = math.fsum(values[task_id] for row in routes.values() for task_id in row)
    distance, penalty = math.fsum(lengths), excess(problem.uavs, lengths)
    penalty = penalty if penalty > _ROUNDING else 0.0
    on = recorder.best.on[len(problem.uavs):problem.arrays.ends].copy()
    on[lost] = -1
    left = np.flatnonzero(on < 0)
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


def _drop_lost(problem: Problem, order: list[list[int]]) -> list[int]:
    """Take tasks out of the order that no way is known to after all; returns those, from 0.

    A safety net: where time was over a length may have been believed, or forgotten again.
    """
    ways, lost = problem.distances, []
    for u, nodes in enumerate(order):
        place = problem.locked_places(u)[-1]
        for node in tuple(nodes):
            if _leg(ways, place, node).length < math.inf:
                place = node
            else:
                nodes.remove(node)
                lost.append(node - len(problem.uavs))
    return lost


def _all_legs(problem: Problem, order: list[list[int]]) -> Iterator[tuple[Leg, ...]]:
    """Of each UAV a leg before each task, locked ones too, and one home where routes return."""
    rows = [_places(problem, u, nodes) for u, nodes in enumerate(order)]
    points = problem.distances.points[list(chain.from_iterable(rows))]
    steps, last = np.sqrt((np.diff(points, axis=0) ** 2).sum(axis=1)).tolist(), 0
    for places in rows:
        first, last = last, last + len(places)
        yield _legs(problem, places, steps[first:last - 1])


def _places(problem: Problem, u: int, nodes: list[int]) -> list[int]:
    """Where UAV u comes by, from its start to its home where routes return and it can."""
    places, home = [*problem.locked_places(u), *nodes], problem.arrays.ends + u
    if problem.rules.returns and len(places) > 1 and (
            problem.distances.length(places[-1], home) < math.inf):
        places.append(home)
    return places


def _legs(problem: Problem, places: list[int], steps: list[float]) -> tuple[Leg, ...]:
    if not problem.distances.zones:
        return tuple([Leg((), metres) for metres in steps])
    return tuple(_leg(problem.distances, i, j) for i, j in pairwise(places))


def _leg(ways: Distances, i: int, j: int) -> Leg:
    """The leg from i to j; without detour points where it is straight."""
    metres = math.dist(ways.points[i], ways.points[j])
    return Leg((), metres) if ways.length(i, j) <= metres * _STRAIGHT else ways.leg(i, j)
