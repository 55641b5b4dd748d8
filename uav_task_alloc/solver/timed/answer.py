# SPDX-License-Identifier: Apache-2.0
"""Converts the best order of nodes to a Plan: trips, legs, times, reasons, sums."""
from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import chain, pairwise

from uav_task_alloc.model import Leg, Plan, Task
from uav_task_alloc.objective import fit
from uav_task_alloc.solver.answer import leg_between
from uav_task_alloc.solver.timed.evaluator import (
    Held,
    TimedEvaluation,
    evaluate_legs,
    evaluate_routes,
)
from uav_task_alloc.solver.timed.problem import TimedProblem
from uav_task_alloc.solver.timed.reasons import timed_reasons
from uav_task_alloc.solver.timed.recorder import TimedRecorder
from uav_task_alloc.solver.timed.search import Incumbent

TripNodes = list[list[int]]  # task nodes of each trip of a UAV


def to_timed_plan(problem: TimedProblem, recorder: TimedRecorder, best: Incumbent, solver: str,
                  warm: bool) -> Plan:
    """The plan of some routes, without the state for a warm start.

    Args:
        problem: what was solved.
        recorder: holds the history and the time.
        best: the routes.
        solver: name of the solver.
        warm: whether the solve started from an earlier plan.
    """
    base = problem.base
    nodes = trips_of_order(problem, best)
    if base.distances.zones:
        _drop_unreachable_nodes(problem, nodes)
    legs = {uav.id: _legs(problem, u, nodes[u]) for u, uav in enumerate(base.uavs)}
    trips = {uav.id: _ids(problem, u, nodes[u]) for u, uav in enumerate(base.uavs)}
    found = evaluate_trips(problem, trips, legs)
    served = {name for rows in trips.values() for row in rows for name in row}
    missing = [i for i, task in enumerate(base.tasks) if task.id not in served]
    routes = {uav_id: tuple(chain.from_iterable(rows)) for uav_id, rows in trips.items()}
    return Plan(
        routes, timed_reasons(problem, missing), found.distance, found.value, found.penalty,
        fit(found.distance, found.value, found.penalty, base.rules.weights),
        tuple(recorder.history), None, legs, base.rules.returns, solver, recorder.elapsed(),
        recorder.iterations, warm, found.cost, lambda: found.timetable)


def trips_of_order(problem: TimedProblem, best: Incumbent) -> list[TripNodes]:
    """Task nodes of each trip of each UAV."""
    a, following, rows = problem.arrays, best.order.tolist(), []
    for u in range(a.uavs):
        trips: TripNodes = [[]]
        node, end = following[u], a.ends + u
        while node not in (u, end):
            if node < a.ends:
                trips[-1].append(node)
            else:
                trips.append([])
            node = following[node]
        rows.append(trips)
    return rows


def _ids(problem: TimedProblem, u: int, trips: TripNodes) -> tuple[tuple[str, ...], ...]:
    """Task ids of each trip, locked ones included; none where there is no task."""
    base, m = problem.base, problem.arrays.uavs
    held = [task.id for task in base.locked.get(base.uavs[u].id, ())]
    rows = [[base.tasks[node - m].id for node in row] for row in trips]
    rows[0] = held + rows[0]
    return tuple(tuple(row) for row in rows) if any(rows) else ()


def evaluate_trips(problem: TimedProblem, trips: Mapping[str, Sequence[Sequence[str]]],
                   legs: Mapping[str, Sequence[Leg]]) -> TimedEvaluation:
    """Evaluate trips by UAV id, along their legs."""
    base = problem.base
    tasks: list[Task] = [*chain.from_iterable(base.locked.values()), *base.tasks]
    held = Held({uav_id: [task.id for task in row] for uav_id, row in base.locked.items()},
                problem.aboard)
    if base.rules.grain > 0.0:
        return evaluate_routes(base.uavs, tasks, base.rules, trips, held=held)
    return evaluate_legs(base.uavs, tasks, base.rules, trips, legs, held)


def _places(problem: TimedProblem, u: int, trips: TripNodes) -> list[int]:
    """Points of UAV u's route: start, tasks, bases between trips, and home where it returns."""
    base, home = problem.base, problem.arrays.ends + u
    places = list(base.locked_places(u))
    for number, row in enumerate(trips):
        places += [home] * (number > 0) + row
    if base.rules.returns and len(places) > 1 and (
            base.distances.length(places[-1], home) < math.inf):
        places.append(home)
    return places


def _legs(problem: TimedProblem, u: int, trips: TripNodes) -> tuple[Leg, ...]:
    """The legs of UAV u's route."""
    return tuple(leg_between(problem.base.distances, i, j)
                 for i, j in pairwise(_places(problem, u, trips)))


def _drop_unreachable_nodes(problem: TimedProblem, nodes: Sequence[TripNodes]) -> None:
    """Remove tasks that no path is known to: where the budget ran out, one may be lost."""
    for u, trips in enumerate(nodes):
        place = problem.base.locked_places(u)[-1]
        for number, row in enumerate(trips):
            place = problem.arrays.ends + u if number else place
            for node in tuple(row):
                if leg_between(problem.base.distances, place, node).length < math.inf:
                    place = node
                else:
                    row.remove(node)
