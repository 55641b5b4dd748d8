# SPDX-License-Identifier: Apache-2.0
"""Converts the best order of nodes to a Plan: trips, legs, times, reasons, sums."""
from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import chain
from typing import NamedTuple

import numpy as np

from uav_task_alloc.model import Leg, Plan, Task
from uav_task_alloc.objective import fit
from uav_task_alloc.solver.answer import leg_between
from uav_task_alloc.solver.timed.evaluator import TimedEvaluation, evaluate_legs, evaluate_routes
from uav_task_alloc.solver.timed.problem import TimedProblem
from uav_task_alloc.solver.timed.reasons import timed_reasons
from uav_task_alloc.solver.timed.recorder import TimedRecorder
from uav_task_alloc.solver.timed.schedule import Held
from uav_task_alloc.solver.timed.search import Incumbent
from uav_task_alloc.solver.timed.ways import TURN_BIT

TripNodes = list[list[int]]  # task nodes of each trip of a UAV


class _Flown(NamedTuple):
    """What UAVs fly by an order of nodes."""

    trips: list[TripNodes]  # by UAV
    turned: set[int]  # nodes that are flown from their last points


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
    flown = flown_by(problem, best)
    if base.distances.zones:
        _drop_unreachable_nodes(problem, flown)
    legs = {uav.id: _legs(problem, u, flown) for u, uav in enumerate(base.uavs)}
    trips = {uav.id: _ids(problem, u, flown.trips[u]) for u, uav in enumerate(base.uavs)}
    served = {name for rows in trips.values() for row in rows for name in row}
    turned = frozenset(base.tasks[node - len(base.uavs)].id for node in flown.turned) & served
    found = evaluate_trips(problem, trips, legs, turned)
    missing = [i for i, task in enumerate(base.tasks) if task.id not in served]
    routes = {uav_id: tuple(chain.from_iterable(rows)) for uav_id, rows in trips.items()}
    reasons = timed_reasons(problem, missing, recorder.untried)
    return Plan(
        routes, reasons, found.distance, found.value, found.penalty,
        fit(found.distance, found.value, found.penalty, base.rules.weights),
        tuple(recorder.history), None, legs, base.rules.returns, solver, recorder.elapsed(),
        recorder.iterations, warm, found.cost, lambda: found.timetable, reversed=turned,
        path_lengths=_path_lengths(problem))


def _path_lengths(problem: TimedProblem) -> dict[str, float]:
    """Length [m] of the path of each task that has one, by id."""
    base = problem.base
    return {task.id: task.path_length for task in chain(*base.locked.values(), base.tasks)
            if task.path}


def flown_by(problem: TimedProblem, best: Incumbent) -> _Flown:
    """Task nodes of each trip of each UAV, and which of them are turned."""
    a, rows = problem.arrays, []
    turned = set(np.flatnonzero(best.order & TURN_BIT).tolist())
    following = (best.order & ~TURN_BIT).tolist()
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
    return _Flown(rows, turned)


def _ids(problem: TimedProblem, u: int, trips: TripNodes) -> tuple[tuple[str, ...], ...]:
    """Task ids of each trip, locked ones included; none where there is no task."""
    base, m = problem.base, problem.arrays.uavs
    held = [task.id for task in base.locked.get(base.uavs[u].id, ())]
    rows = [[base.tasks[node - m].id for node in row] for row in trips]
    rows[0] = held + rows[0]
    return tuple(tuple(row) for row in rows) if any(rows) else ()


def evaluate_trips(problem: TimedProblem, trips: Mapping[str, Sequence[Sequence[str]]],
                   legs: Mapping[str, Sequence[Leg]],
                   turned: frozenset[str]) -> TimedEvaluation:
    """Evaluate trips by UAV id, along their legs; turned: ids flown from their last points."""
    base = problem.base
    tasks: list[Task] = [*chain.from_iterable(base.locked.values()), *base.tasks]
    held = Held({uav_id: [task.id for task in row] for uav_id, row in base.locked.items()},
                problem.aboard)
    if base.rules.grain > 0.0:
        return evaluate_routes(base.uavs, tasks, base.rules, trips, held=held, reversed=turned)
    return evaluate_legs(base.uavs, tasks, base.rules, trips, legs, held, turned)


def _ends(problem: TimedProblem, node: int, turned: set[int]) -> tuple[int, int]:
    """Points where a task is entered and left."""
    ends = node, problem.base.ends.get(problem.base.tasks[node - problem.arrays.uavs].id, node)
    return ends[::-1] if node in turned else ends


def _legs(problem: TimedProblem, u: int, flown: _Flown) -> tuple[Leg, ...]:
    """The legs of UAV u's route: to tasks, to bases between trips, and home where it returns."""
    base, home = problem.base, problem.arrays.ends + u
    legs, place = base.locked_legs(u), u
    for number, row in enumerate(flown.trips[u]):
        if number > 0:
            legs.append((place, home))
            place = home
        for node in row:
            first, last = _ends(problem, node, flown.turned)
            legs.append((place, first))
            place = last
    if base.rules.returns and legs and base.distances.length(place, home) < math.inf:
        legs.append((place, home))
    return tuple(leg_between(base.distances, i, j) for i, j in legs)


def _drop_unreachable_nodes(problem: TimedProblem, flown: _Flown) -> None:
    """Remove tasks that no path is known to: where the budget ran out, one may be lost."""
    for u, trips in enumerate(flown.trips):
        place = u
        for number, row in enumerate(trips):
            place = problem.arrays.ends + u if number else place
            for node in tuple(row):
                first, last = _ends(problem, node, flown.turned)
                if leg_between(problem.base.distances, place, first).length < math.inf:
                    place = last
                else:
                    row.remove(node)
