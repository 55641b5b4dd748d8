# SPDX-License-Identifier: Apache-2.0
"""Converts the recorder's best routes to a Plan: ids, legs with detour points, reasons, sums."""
from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from functools import cache
from itertools import chain, pairwise

import numpy as np

from uav_task_alloc.geometry.distances import Distances
from uav_task_alloc.model import Leg, Plan
from uav_task_alloc.objective import excess, fit
from uav_task_alloc.solver.problem import Problem, excess_cost
from uav_task_alloc.solver.reasons import reasons
from uav_task_alloc.solver.recorder import Recorder
from uav_task_alloc.solver.routes import Routes
from uav_task_alloc.solver.timed.evaluator import evaluate_legs
from uav_task_alloc.timetable import Timetable

_RANGE_TOLERANCE = 1e-6  # [m] smaller excess over a range is rounding
_STRAIGHT_RATIO = 1.0 + 1e-12  # a leg up to so much longer than the distance is straight


def to_plan(problem: Problem, recorder: Recorder, solver: str, warm: bool) -> Plan:
    """The plan of the recorder's best routes, without the state for a warm start.

    Args:
        problem: what was solved.
        recorder: holds the best routes and their history.
        solver: name of the solver.
        warm: whether the solve started from an earlier plan.
    """
    order = nodes_of(recorder.best, len(problem.uavs))
    unreachable = _drop_unreachable(problem, order) if problem.distances.zones else []
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
    penalty = penalty if penalty > _RANGE_TOLERANCE else 0.0
    uav_of = recorder.best.uav_of[len(problem.uavs):problem.arrays.ends].copy()
    uav_of[unreachable] = -1
    unassigned = np.flatnonzero(uav_of < 0)
    return Plan(
        routes, reasons(problem, unassigned), distance, value,
        penalty, fit(distance, value, penalty, problem.rules.weights),
        tuple(recorder.history), None, legs, problem.rules.returns, solver,
        recorder.elapsed(), recorder.iterations, warm,
        problem.rules.objective.cost(distance)
        + excess_cost(problem.rules.weights) * problem.rules.objective.distance * penalty,
        cache(lambda: _timetable(problem, routes, legs)))


def _timetable(problem: Problem, routes: Mapping[str, tuple[str, ...]],
               legs: Mapping[str, tuple[Leg, ...]]) -> Timetable:
    """The times of routes of one trip each."""
    tasks = [*chain.from_iterable(problem.locked.values()), *problem.tasks]
    return evaluate_legs(problem.uavs, tasks, problem.rules,
                         {uav: [row] for uav, row in routes.items() if row}, legs).timetable


def nodes_of(routes: Routes, uavs: int) -> list[list[int]]:
    """Task nodes of each of the `uavs` UAVs in order."""
    following, nodes = routes.next.tolist(), []
    ends = len(following) - uavs
    for u in range(uavs):
        row, node = [], following[u]
        while node < ends:
            row.append(node)
            node = following[node]
        nodes.append(row)
    return nodes


def _drop_unreachable(problem: Problem, order: list[list[int]]) -> list[int]:
    """Remove tasks that no path is known to; returns their indices, from 0.

    A safeguard: where the budget ran out, a length may have been estimated, or dropped again.
    """
    distances, lost = problem.distances, []
    for u, nodes in enumerate(order):
        place = problem.locked_places(u)[-1]
        for node in tuple(nodes):
            if leg_between(distances, place, node).length < math.inf:
                place = node
            else:
                nodes.remove(node)
                lost.append(node - len(problem.uavs))
    return lost


def _all_legs(problem: Problem, order: list[list[int]]) -> Iterator[tuple[Leg, ...]]:
    """Legs of each UAV: one before each task, locked ones included, and one home."""
    rows = [_route_places(problem, u, nodes) for u, nodes in enumerate(order)]
    points = problem.distances.points[list(chain.from_iterable(rows))]
    straight, last = np.sqrt((np.diff(points, axis=0) ** 2).sum(axis=1)).tolist(), 0
    for places in rows:
        first, last = last, last + len(places)
        yield _legs(problem, places, straight[first:last - 1])


def _route_places(problem: Problem, u: int, nodes: list[int]) -> list[int]:
    """Points of UAV u's route: start, tasks, and its home where routes return and it can."""
    places, home = [*problem.locked_places(u), *nodes], problem.arrays.ends + u
    if problem.rules.returns and len(places) > 1 and (
            problem.distances.length(places[-1], home) < math.inf):
        places.append(home)
    return places


def _legs(problem: Problem, places: list[int], straight: list[float]) -> tuple[Leg, ...]:
    """The legs between places; `straight` are the distances between them [m]."""
    if not problem.distances.zones:
        return tuple([Leg((), metres) for metres in straight])
    return tuple(leg_between(problem.distances, i, j) for i, j in pairwise(places))


def leg_between(distances: Distances, i: int, j: int) -> Leg:
    """Return the leg from i to j.

    Args:
        distances: the points and the paths between them.
        i, j: indices of points.

    Returns:
        Without detour points where it is straight; of infinite length where there is none.
    """
    metres = math.dist(distances.points[i], distances.points[j])
    if distances.length(i, j) <= metres * _STRAIGHT_RATIO:
        return Leg((), metres)
    return distances.leg(i, j)
