# SPDX-License-Identifier: Apache-2.0
"""A problem with time, loads or trips as the arrays that kernels take."""
from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from operator import attrgetter
from typing import Any

import numpy as np

from uav_task_alloc.geometry.flight_time import flight_time, service_seconds
from uav_task_alloc.geometry.outline import Floats, Ints
from uav_task_alloc.model import Task, Uav
from uav_task_alloc.solver.answer import leg_between
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
from uav_task_alloc.solver.timed.order import set_order
from uav_task_alloc.solver.timed.path_times import Speeds, path_times
from uav_task_alloc.solver.timed.ways import first_ways

WINDOW_NEIGHBOURS = 60  # nearest tasks of a task that may precede or follow it
NEAR_CLASSES = 6  # nearest classes of UAVs that are alike
UNSERVED_LEGS = 20.0  # first price of an average task, in mean legs
MAX_UNSERVED_GROWTH = 300.0  # highest price of a task over the first
_TASK_NUMBERS = attrgetter('earliest', 'latest', 'payload', 'value', 'announced', 'release')


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
    held = [_after_locked(problem, u, aboard) for u in range(m)]
    begin = np.array([each.begin for each in held]).reshape(m, at.BEGIN_COLUMNS)
    limit = _limits(problem, visits, held)
    fixed = _fixed(problem, visits, aboard)
    class_of = _classes(problem, begin, limit, aboard)
    order = np.argsort(class_of, kind='stable')
    classes = int(class_of.max(initial=-1)) + 1
    rules, classes_of_speeds = problem.rules, list(dict.fromkeys(map(_speeds, uavs)))
    paths = np.empty((0, 0) if any(task.path for task in tasks) else 0, np.bool_)
    far, way_length, along = _ways(problem, len(_points(problem, visits)), classes_of_speeds)
    arrays = TimedArrays(
        m, m + n, 2 * m + n, visits, rules.returns, not problem.distances.zones,
        _is_flat(problem), _counts_time(problem), _is_whole(problem, visits), rules.grain,
        problem.distances.pairs,
        path_times(problem.distances, classes_of_speeds), _points_and_ends(problem, visits), fixed,
        paths, far, np.array([bool(task.path) and task.reversible for task in tasks], np.bool_),
        way_length, along,
        _paces(uavs),
        np.array([classes_of_speeds.index(_speeds(uav)) for uav in uavs], np.int64), begin, limit,
        _compatible_trips(problem, aboard),
        np.zeros(n, np.bool_), np.full(4, math.inf), np.empty(n), _weights(problem),
        np.empty((n, min(WINDOW_NEIGHBOURS, max(0, n - 1))), LINK),
        np.empty((n, min(WINDOW_NEIGHBOURS, max(0, n - 1)))), np.zeros(n, np.int64),
        np.full((n, min(NEAR_CLASSES, classes)), -1, np.int64), order.astype(np.int64),
        np.searchsorted(class_of[order], np.arange(classes + 1)).astype(np.int64), class_of,
        *_least_pace(problem), False)
    arrays.restricted[:] = ~arrays.compatible.all(axis=(0, 1)) if m else False
    scale = _fill(problem, arrays, known)
    _set_prices(problem, arrays, scale)
    return TimedProblem(problem, arrays, aboard, scale)


def _visits(problem: Problem) -> int:
    """Base visits of a UAV at most."""
    able = any(uav.turnaround < math.inf for uav in problem.uavs)
    return problem.rules.trips - 1 if able else 0


def _is_flat(problem: Problem) -> bool:
    """Whether length and time of a leg follow from x and y alone."""
    z = problem.distances.points[:, 2]
    return not problem.distances.zones and bool((z == z[:1]).all())


def _counts_time(problem: Problem) -> bool:
    goal = problem.rules.objective
    return goal.finish > 0.0 or goal.response > 0.0 or math.isfinite(goal.lateness)


def _is_whole(problem: Problem, visits: int) -> bool:
    """Whether durations, trips or departures matter, so that routes are computed as a whole."""
    return (visits > 0 or any(uav.endurance < math.inf for uav in problem.uavs)
            or any(task.payload > 0.0 and task.release > 0.0 for task in problem.tasks))


def _least_pace(problem: Problem) -> tuple[float, float]:
    """TimedArrays.least_pace and least_cut."""
    rows = _paces(problem.uavs)
    flat, steep = rows[:, 0], rows[:, 1:].min(axis=1, initial=math.inf)
    if not _is_flat(problem):  # the way climbs as steeply as is fastest
        flat = flat * steep / np.hypot(flat, steep)
    grain = problem.rules.grain
    return (float(flat.min(initial=math.inf)),
            2.0 * float(rows[:, 0].max(initial=0.0)) / grain if grain else 0.0)


def _points(problem: Problem, visits: int) -> Ints:
    """Index in `distances` of each node."""
    m, n = len(problem.uavs), len(problem.tasks)
    homes = np.repeat(np.arange(m) + m + n, visits)
    return np.concatenate([np.arange(2 * m + n), homes]).astype(np.int64)


def _points_and_ends(problem: Problem, visits: int) -> Ints:
    """TimedArrays.point."""
    ends = [problem.ends[task.id] for task in problem.tasks if task.path]
    return np.concatenate([_points(problem, visits), np.array(ends, np.int64)])


def _ways(problem: Problem, nodes: int,
          classes: Sequence[Speeds]) -> tuple[Ints, Floats, Floats]:
    """TimedArrays.far, way_length and along."""
    m, tasks = len(problem.uavs), problem.tasks
    far = np.arange(m, m + len(tasks), dtype=np.int64)
    with_path = [i for i, task in enumerate(tasks) if task.path]
    far[with_path] = nodes + np.arange(len(with_path))
    lengths = np.array([task.path_length if task.path else 0.0 for task in tasks], np.float64)
    if not with_path:
        return far, lengths, np.empty((len(classes), 0))
    along = [[service_seconds(fleet, each) for task in tasks for each in (task, task.turned)]
             for fleet in _one_of_each(problem.uavs, classes)]
    return far, lengths, np.array(along).reshape(len(classes), -1)


def _one_of_each(uavs: Sequence[Uav], classes: Sequence[Speeds]) -> list[Uav]:
    """A UAV of each class of speeds."""
    return [next(uav for uav in uavs if _speeds(uav) == each) for each in classes]


def _paces(uavs: Sequence[Uav]) -> Floats:
    """(m, 3) [s/m] horizontally, up, down."""
    rows = [(1.0 / u.cruise_speed, 1.0 / u.climb_speed, 1.0 / u.descent_speed) for u in uavs]
    return np.array(rows, np.float64).reshape(-1, 3)


def _speeds(uav: Uav) -> Speeds:
    return uav.cruise_speed, uav.climb_speed, uav.descent_speed


def _weights(problem: Problem) -> Floats:
    """The coefficients as TimedArrays.weight has them."""
    rules = problem.rules
    goal = rules.objective
    late = goal.lateness if math.isfinite(goal.lateness) else 0.0
    excess = math.inf if rules.hard else excess_cost(rules.weights) * goal.distance
    return np.array([goal.distance, goal.finish, late, math.inf, excess])


def _fixed(problem: Problem, visits: int, aboard: Mapping[str, frozenset[str]]) -> Floats:
    """What is known of each node (nodes, FIXED)."""
    uavs, tasks = problem.uavs, problem.tasks
    m, n, goal = len(uavs), len(tasks), problem.rules.objective
    points = _points_and_ends(problem, visits)
    fixed = aligned_zeros(len(points), at.FIXED_COLUMNS)
    fixed[:, at.X:at.Z + 1] = problem.distances.points[points]
    fixed[:, [at.OPENS, at.RELEASE, at.TRIP_RELEASE]] = -math.inf
    fixed[:, [at.CLOSES, at.DUE]] = math.inf
    rows = fixed[m:m + n]
    total = math.fsum(task.value for task in (*tasks, *(
        task for held in problem.locked.values() for task in held)))
    hard = math.isinf(goal.lateness)
    loaded = {name for names in aboard.values() for name in names}
    values = np.fromiter(chain.from_iterable(map(_TASK_NUMBERS, tasks)), np.float64,
                         6 * n).reshape(n, 6)
    rows[:, at.SERVICE] = [_least_service(uavs, task) if task.path or task.actions
                           else task.service_time for task in tasks]
    latest = at.CLOSES if hard else at.DUE
    rows[:, [at.OPENS, latest, at.LOAD, at.WORTH, at.ANNOUNCED]] = values[:, :5]
    rows[:, at.WEIGHT] = goal.response * rows[:, at.WORTH] / total
    rows[:, at.WIDTH] = np.minimum(values[:, 1], 1e9) - np.maximum(values[:, 0], -1e9)
    release = np.where(values[:, 5] > 0.0, values[:, 5], -math.inf)
    whole_trip = np.array([task.payload > 0.0 and task.id not in loaded for task in tasks], bool)
    rows[whole_trip, at.TRIP_RELEASE] = release[whole_trip]
    rows[~whole_trip, at.RELEASE] = release[~whole_trip]
    until = np.array([uav.available_until for uav in uavs])
    fixed[m + n:2 * m + n, at.CLOSES] = until
    bases = fixed[2 * m + n:2 * m + n + m * visits]
    bases[:, at.CLOSES] = np.repeat(until, visits)
    bases[:, at.SERVICE] = np.repeat([uav.turnaround for uav in uavs], visits)
    return fixed


def _least_service(uavs: Sequence[Uav], task: Task) -> float:
    """Shortest service [s], with the flight along the path in either direction."""
    return min((service_seconds(uav, each) for uav in uavs for each in (task, task.turned)),
               default=0.0) if task.path else task.stay


@dataclass(frozen=True, slots=True)
class _Begin:
    """Where and how a UAV begins, after its locked tasks."""

    begin: tuple[float, ...]  # a row of TimedArrays.begin
    load: float  # [kg] of locked tasks that it takes on


def _after_locked(problem: Problem, u: int, aboard: Mapping[str, frozenset[str]]) -> _Begin:
    """What UAV u's locked tasks leave; they are flown as soon as possible."""
    uav = problem.uavs[u]
    held = problem.locked.get(uav.id, ())
    loads = [task for task in held if task.payload > 0.0
             and task.id not in aboard.get(uav.id, ())] if uav.at_base else []
    ready = max([uav.available_from, *(task.release for task in loads)])
    if not uav.at_base:
        in_air, last = uav.available_from, 0.0
    else:
        in_air, last = 0.0, math.inf
        if held:
            ready = max(ready, held[0].release)
    for task, (i, j) in zip(held, problem.locked_legs(u), strict=True):
        seconds, service = _seconds(problem, u, i, j), service_seconds(uav, task)
        ready = max(ready, task.release) + seconds
        opened = max(task.earliest, task.release + seconds)
        in_air += seconds  # its latest time is no rule, so only a UAV in the air has to wait
        in_air += max(0.0, opened - in_air - last) + service
        ready = max(ready, task.earliest) + service
    home = problem.arrays.empty_route_length[u]
    return _Begin((ready, in_air, last, home, _home_seconds(problem, u, home), float(uav.at_base),
                   uav.cruise_speed, float(bool(held))), sum(task.payload for task in loads))


def _seconds(problem: Problem, u: int, i: int, j: int) -> float:
    """Flight time [s] of UAV u from point i to point j of the distances."""
    uav, grain = problem.uavs[u], problem.rules.grain
    start, end = (tuple(problem.distances.points[k].tolist()) for k in (i, j))
    if grain > 0.0:
        return math.floor(math.dist(start, end) * grain) / (grain * uav.cruise_speed)
    leg = leg_between(problem.distances, i, j)
    return flight_time(uav, (start, *leg.via, end)) if leg.length < math.inf else math.inf


def _home_seconds(problem: Problem, u: int, metres: float) -> float:
    """Time [s] of UAV u's route without tasks, of that length."""
    return _seconds(problem, u, u, problem.arrays.ends + u) if metres > 0.0 else 0.0


def _limits(problem: Problem, visits: int, held: Sequence[_Begin]) -> Floats:
    """(slots, TRIP) capacity, range and endurance of each trip; what is used already stays."""
    m = len(problem.uavs)
    limit = np.full((m * (1 + visits), at.TRIP_COLUMNS), math.inf)
    for u, uav in enumerate(problem.uavs):
        begin = held[u].begin
        if uav.at_base:
            limit[u, at.CARRIED] = max(0.0, uav.payload_capacity - held[u].load)
        limit[u, at.FLOWN] = max(problem.arrays.range_left[u], begin[at.EMPTY_LENGTH])
        limit[u, at.AIRBORNE] = max(uav.endurance, begin[at.IN_AIR] + begin[at.EMPTY_TIME])
        rows = limit[m + u * visits:m + (u + 1) * visits]
        rows[:, at.CARRIED] = uav.payload_capacity
        rows[:, at.FLOWN] = uav.range if uav.full_range is None else uav.full_range
        rows[:, at.AIRBORNE] = (uav.endurance if uav.full_endurance is None
                             else uav.full_endurance)
    return limit


def _compatible_trips(problem: Problem, aboard: Mapping[str, frozenset[str]]) -> Any:
    """(2, m, n) whether a UAV may serve a task in its first trip, in later ones."""
    able = problem.arrays.compatible
    both = np.stack([able, able])
    loaded = [i for i, task in enumerate(problem.tasks) if task.payload > 0.0]
    if not loaded:
        return both
    holder = {name: uav_id for uav_id, names in aboard.items() for name in names}
    flying = np.array([not uav.at_base for uav in problem.uavs])
    both[0][np.ix_(flying, np.array(loaded))] = False
    index = {uav.id: u for u, uav in enumerate(problem.uavs)}
    for i in loaded:
        uav_id = holder.get(problem.tasks[i].id)
        if uav_id is not None:
            both[:, :, i] = False
            both[0, index[uav_id], i] = able[index[uav_id], i]
    return both


def _classes(problem: Problem, begin: Floats, limit: Floats,
             aboard: Mapping[str, frozenset[str]]) -> Ints:
    """(m) class of each UAV: those of one class are alike."""
    m, points = len(problem.uavs), problem.distances.points
    n, compatible = len(problem.tasks), np.packbits(problem.arrays.compatible, axis=1)
    seen: dict[object, int] = {}
    rows = limit.reshape(m, -1) if m and len(limit) == m else np.hstack(
        [limit[:m], limit[m:].reshape(m, -1)])
    return np.array([seen.setdefault(
        (points[u].tobytes(), points[m + n + u].tobytes(), begin[u].tobytes(), rows[u].tobytes(),
         compatible[u].tobytes(), uav.climb_speed, uav.descent_speed, uav.available_until,
         uav.turnaround, aboard.get(uav.id)), len(seen))
        for u, uav in enumerate(problem.uavs)], np.int64)


def _fill(problem: Problem, a: TimedArrays, known: TimedProblem | None) -> float:
    """Fill in neighbours; returns the mean leg to the nearest one, in cost."""
    if not problem.tasks or not problem.uavs:
        return 1.0
    pace = float(a.pace[:, 0].min())
    index = known.base.index if known else {}
    then = np.array([index.get(task.id, -1) for task in problem.tasks], np.int64)
    fill_near(a, known_near(a, known.arrays if known else None, then), pace,
              np.empty(max(1, a.near_class.shape[1])))
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
    a.price[:] = a.weight[4] if not problem.rules.hard else math.inf
    a.price[:2] = math.inf


def _longest_cost(problem: Problem, a: TimedArrays, far: float) -> float:
    """What the times of one more task could cost at most, about."""
    goal, rows = problem.rules.objective, a.fixed[a.uavs:a.ends]
    if not a.timed_cost:
        return 0.0
    legs = rows[:, at.SERVICE].sum() + far * 2.0 * float(a.pace[:, 0].max()) * len(rows)
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
