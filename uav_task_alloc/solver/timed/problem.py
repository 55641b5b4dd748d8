# SPDX-License-Identifier: Apache-2.0
"""A problem with time, loads or trips as the arrays that kernels take."""
from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from uav_task_alloc.geometry.outline import Floats
from uav_task_alloc.solver.problem import Problem, excess_cost
from uav_task_alloc.solver.timed import columns as at
from uav_task_alloc.solver.timed.arrays import (
    LINK,
    TimedArrays,
    TimedRoutes,
    aligned_zeros,
    node_count,
)
from uav_task_alloc.solver.timed.near import fill_near, known_near
from uav_task_alloc.solver.timed.node_rows import (
    fixed_rows,
    points_and_ends,
    points_of_nodes,
    total_value,
    ways_of_tasks,
)
from uav_task_alloc.solver.timed.order import set_order
from uav_task_alloc.solver.timed.path_times import path_times
from uav_task_alloc.solver.timed.uav_rows import (
    after_locked,
    classes_of_uavs,
    compatible_trips,
    is_flat,
    least_pace,
    paces,
    speeds,
    trip_limits,
)
from uav_task_alloc.solver.timed.ways import first_ways

WINDOW_NEIGHBOURS = 60  # nearest tasks of a task that may precede or follow it
NEAR_CLASSES = 6  # nearest classes of UAVs that are alike
UNSERVED_LEGS = 20.0  # first price of an average task, in mean legs
MAX_UNSERVED_GROWTH = 300.0  # highest price of a task over the first


@dataclass(frozen=True, slots=True)
class TimedProblem:
    """A problem, its arrays, and the tasks whose payload is on board of a UAV in the air."""

    base: Problem
    arrays: TimedArrays
    aboard: Mapping[str, frozenset[str]]  # task ids by UAV id
    scale: float  # mean leg to the nearest neighbour, in cost

    @property
    def prizes(self) -> bool:
        """Whether a task may be left out because it is not worth its way."""
        return math.isfinite(self.base.rules.objective.unserved)


def make_timed(problem: Problem, aboard: Mapping[str, frozenset[str]],
               known: TimedProblem | None = None) -> TimedProblem:
    """Build the arrays of a problem with time.

    Args:
        problem: with its distances.
        aboard: ids of the tasks whose payload UAVs in the air have on board, by UAV id.
        known: an earlier problem, whose neighbours are used again where they are the same.
    """
    uavs, tasks = problem.uavs, problem.tasks
    m, n = len(uavs), len(tasks)
    visits = _visits(problem)
    total = total_value(problem)
    held = [after_locked(problem, u, aboard, total) for u in range(m)]
    begin = np.array([each.begin for each in held]).reshape(m, at.BEGIN_COLUMNS)
    limit = trip_limits(problem, visits, begin, np.array([each.load for each in held]))
    class_of = classes_of_uavs(problem, begin, limit, aboard)
    order = np.argsort(class_of, kind='stable')
    classes = int(class_of.max(initial=-1)) + 1
    rules, speeds_of_uavs, pace = problem.rules, [*map(speeds, uavs)], paces(uavs)
    classes_of_speeds = list(dict.fromkeys(speeds_of_uavs))
    paths = np.empty((0, 0) if any(task.path for task in tasks) else 0, np.bool_)
    nodes = len(points_of_nodes(problem, visits))
    far, way_length, along = ways_of_tasks(problem, nodes, classes_of_speeds)
    fixed = fixed_rows(problem, visits, aboard, total, along)
    arrays = TimedArrays(
        m, m + n, 2 * m + n, visits, rules.returns, not problem.distances.zones,
        is_flat(problem), _counts_time(problem), _is_whole(problem, visits), rules.grain,
        problem.distances.pairs,
        path_times(problem.distances, classes_of_speeds), points_and_ends(problem, visits), fixed,
        paths, far, np.array([bool(task.path) and task.reversible for task in tasks], np.bool_),
        way_length, along,
        pace,
        np.array([*map(classes_of_speeds.index, speeds_of_uavs)], np.int64), begin, limit,
        compatible_trips(problem, aboard),
        np.zeros(n, np.bool_), np.full(4, math.inf), np.empty(n), _weights(problem),
        np.empty((n, min(WINDOW_NEIGHBOURS, max(0, n - 1))), LINK),
        np.empty((n, min(WINDOW_NEIGHBOURS, max(0, n - 1)))), np.zeros(n, np.int64),
        np.full((n, min(NEAR_CLASSES, classes)), -1, np.int64), order.astype(np.int64),
        np.searchsorted(class_of[order], np.arange(classes + 1)).astype(np.int64), class_of,
        *least_pace(problem, pace), False)
    arrays.restricted[:] = ~arrays.compatible.all(axis=(0, 1)) if m else False
    scale = _fill(problem, arrays, known)
    _set_prices(problem, arrays, scale)
    return TimedProblem(problem, arrays, aboard, scale)


def _visits(problem: Problem) -> int:
    """Base visits of a UAV at most."""
    able = any(uav.turnaround < math.inf for uav in problem.uavs)
    return problem.rules.trips - 1 if able else 0


def _counts_time(problem: Problem) -> bool:
    goal = problem.rules.objective
    return goal.finish > 0.0 or goal.response > 0.0 or math.isfinite(goal.lateness)


def _is_whole(problem: Problem, visits: int) -> bool:
    """Whether durations, trips or departures matter, so that routes are computed as a whole."""
    return (visits > 0 or any(uav.endurance < math.inf for uav in problem.uavs)
            or any(task.payload > 0.0 and task.release > 0.0 for task in problem.tasks))


def _weights(problem: Problem) -> Floats:
    """The coefficients as TimedArrays.weight has them."""
    rules = problem.rules
    goal = rules.objective
    late = goal.lateness if math.isfinite(goal.lateness) else 0.0
    excess = math.inf if rules.hard else excess_cost(rules.weights) * goal.distance
    return np.array([goal.distance, goal.finish, late, math.inf, excess])


def _fill(problem: Problem, a: TimedArrays, known: TimedProblem | None) -> float:
    """Fill in neighbours; returns the mean leg to the nearest one, in cost."""
    if not problem.tasks or not problem.uavs:
        return 1.0
    pace = float(a.pace[:, 0].min())
    index = known.base.index if known else {}
    then = np.array([index.get(task.id, -1) for task in problem.tasks], np.int64)
    ends = np.array([[task.position for task in problem.tasks],
                     [task.end for task in problem.tasks]][:1 + (a.paths.ndim == 2)])
    fill_near(a, known_near(a, known.arrays if known else None, then), pace,
              ends.reshape(-1, 3), np.empty(max(1, a.near_class.shape[1])))
    some = a.near_count > 0
    legs = a.near_length[some, 0] if some.any() else a.fixed[a.uavs:a.ends, at.REMOTE]
    metres = max(float(legs.mean()), 1e-6)
    goal = problem.rules.objective  # a delay on one route is a share of that of all
    cost = goal.distance + pace * (goal.finish + goal.response) / a.uavs
    if cost == 0.0 and math.isfinite(goal.lateness):
        cost = pace * goal.lateness
    return max(1e-9, metres * cost)


def _set_prices(problem: Problem, a: TimedArrays, scale: float) -> None:
    """Set the first prices of tasks and of excess."""
    goal, tasks = problem.rules.objective, problem.tasks
    if not tasks:
        return
    values = np.array([task.value for task in tasks])
    rows = a.fixed[a.uavs:a.ends]
    announced = rows[:, at.WEIGHT] * rows[:, at.ANNOUNCED]  # served from then on costs nothing
    if math.isfinite(goal.unserved):
        a.unserved[:] = goal.unserved * values + announced
    else:
        far = float(rows[:, at.REMOTE].mean())
        least = max(UNSERVED_LEGS * scale, 2.0 * far * goal.distance)
        price = values / values.mean() * max(least, _longest_cost(problem, a, far))
        a.unserved[:] = np.maximum(0.5 * price, price + announced) + goal.distance * a.way_length
        a.unserved[~a.compatible.any(axis=(0, 1))] = 0.0
    a.price[:] = a.weight[4] if not problem.rules.hard else math.inf
    a.price[:2] = math.inf


def _longest_cost(problem: Problem, a: TimedArrays, far: float) -> float:
    """What the times of one more task could cost at most, about."""
    goal, rows = problem.rules.objective, a.fixed[a.uavs:a.ends]
    if not a.timed_cost:
        return 0.0
    legs = rows[:, at.SERVICE].sum() + far * 2.0 * float(a.pace[:, 0].max(initial=0.0)) * len(rows)
    opened = max(float(rows[:, column][np.isfinite(rows[:, column])].max(initial=0.0))
                 for column in (at.OPENS, at.RELEASE, at.TRIP_RELEASE))
    horizon = opened + a.begin[:, at.READY].max(initial=0.0) + legs / max(1, a.uavs)
    late = goal.lateness if math.isfinite(goal.lateness) else 0.0
    return float(horizon * (goal.finish + goal.response + late))


def empty_timed_routes(a: TimedArrays) -> TimedRoutes:
    """New routes without tasks."""
    nodes = node_count(a)
    routes = TimedRoutes(
        np.zeros((nodes, 4), LINK), aligned_zeros(nodes, at.ROW_COLUMNS),
        np.zeros((len(a.limit), at.TRIP_COLUMNS)),
        np.zeros((a.uavs, at.ROUTE_COLUMNS)), np.zeros(at.SUM_COLUMNS), np.zeros(2, np.int64),
        np.zeros(max(1, a.first_member.size - 1), np.int64),
        first_ways(nodes, a.far, a.uavs), np.full((nodes, 2), -math.inf),
        np.full((nodes, 2), -math.inf), a.first_member.copy())
    order = np.arange(nodes).astype(LINK)
    order[:a.uavs] += LINK(a.ends)
    set_order(a, routes, order)
    return routes
