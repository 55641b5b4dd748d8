# SPDX-License-Identifier: Apache-2.0
"""A problem once as objects and once as the arrays that kernels take; nothing is solved here."""
from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from uav_task_alloc.geometry.distances import Distances
from uav_task_alloc.model import Task, ThreatZone, Uav
from uav_task_alloc.objective import Weights
from uav_task_alloc.solver.neighbours import near_starts, near_tasks, nearest
from uav_task_alloc.solver.path_preparation import SOUGHT, PathPreparation
from uav_task_alloc.solver.rng import chance
from uav_task_alloc.solver.routes import NODE, Arrays, Floats, Ints

NEIGHBOURS = 24  # tasks a bee looks at around a task
STARTS = 8  # UAVs it looks at
PRICE = 20.0  # leaving an average task out costs so many mean legs
DEAREST = 300.0  # and at most so many times that after it was in vain for long


@dataclass(frozen=True, slots=True)
class Limits:
    """Where UAVs may fly."""

    zones: tuple[ThreatZone, ...] = ()
    clearance: float = 0.0  # [m] beyond the zones' margins
    altitude_min: float = -math.inf  # [m]
    altitude_max: float = math.inf  # [m]

    def same_but_zones(self, other: Limits) -> bool:
        """Whether only the zones may differ."""
        return replace(self, zones=()) == replace(other, zones=())


@dataclass(frozen=True, slots=True)
class Rules:
    """How a plan is judged."""

    returns: bool = False  # routes end at home
    hard: bool = True  # no range is ever exceeded
    weights: Weights = field(default_factory=Weights)


@dataclass(frozen=True, slots=True)
class Problem:
    """Who may serve what and how far things are apart.

    A UAV starts behind the tasks that are locked to it; those are no longer among `tasks`.
    Places of `distances`: effective starts, tasks, homes, then starts and locked tasks of UAVs
    with locks.
    """

    uavs: tuple[Uav, ...]
    tasks: tuple[Task, ...]  # those to be shared out
    locked: Mapping[str, tuple[Task, ...]]
    limits: Limits
    rules: Rules
    distances: Distances
    arrays: Arrays
    scale: float  # [m] mean way to the nearest neighbour
    index: Mapping[str, int]  # task id -> place in tasks

    def locked_places(self, u: int) -> list[int]:
        """Places of UAV u's start and its locked tasks in `distances`."""
        if not self.locked:
            return [u]
        place = 2 * len(self.uavs) + len(self.tasks)
        for uav in self.uavs[:u]:
            held = self.locked.get(uav.id, ())
            place += len(held) + 1 if held else 0
        held = self.locked.get(self.uavs[u].id, ())
        return list(range(place, place + len(held) + 1)) if held else [u]


def make_problem(uavs: Sequence[Uav], tasks: Sequence[Task],
                 locked: Mapping[str, tuple[Task, ...]], limits: Limits, rules: Rules,
                 known: Problem | None = None, search: PathPreparation | None = None) -> Problem:
    """The arrays of a problem; lengths that an earlier one knows are taken over.

    Locked tasks that no safe way leads to are shared out as the others are.
    """
    free = _not_locked(tasks, locked) if locked else tuple(tasks)
    before = known.distances if known and limits.same_but_zones(known.limits) else None
    distances = _distances(uavs, free, locked, limits, before, search)
    problem = Problem(tuple(uavs), free, locked, limits, rules, distances,
                      _blank(uavs, free, rules, distances), 1.0,
                      {task.id: i for i, task in enumerate(free)})
    if search is not None and limits.zones:
        search.find_flown(distances, _places(problem))
    reached = _reachable(problem) if limits.zones else locked
    if reached != locked:
        free = _not_locked(tasks, reached)
        distances = _distances(uavs, free, reached, limits, distances, search)
        problem = replace(problem, tasks=free, locked=reached, distances=distances,
                          arrays=_blank(uavs, free, rules, distances),
                          index={task.id: i for i, task in enumerate(free)})
    _apply_locks(problem)
    arrays = problem.arrays
    floor = float(np.maximum(0.0, arrays.idle - arrays.reach).sum())
    return replace(problem, arrays=arrays._replace(excess_floor=floor),
                   scale=_fill(problem, known, search))


def _not_locked(tasks: Sequence[Task], locked: Mapping[str, tuple[Task, ...]]) -> tuple[Task, ...]:
    held = {task.id for each in locked.values() for task in each}
    return tuple(task for task in tasks if task.id not in held)


def _places(problem: Problem) -> dict[str, int]:
    """Where in `distances` each UAV is, and each task, by id."""
    places = {task_id: len(problem.uavs) + i for task_id, i in problem.index.items()}
    for u, uav in enumerate(problem.uavs):
        start, *held = problem.locked_places(u)
        places[uav.id] = start
        places.update(zip((task.id for task in problem.locked.get(uav.id, ())), held,
                          strict=True))
    return places


def _reachable(problem: Problem) -> Mapping[str, tuple[Task, ...]]:
    """Locked tasks without those that no safe way leads to, from the one before."""
    found = {}
    for u, uav in enumerate(problem.uavs):
        place, *places = problem.locked_places(u)
        row = []
        for task, there in zip(problem.locked.get(uav.id, ()), places, strict=True):
            if problem.distances.length(place, there) < math.inf:
                row.append(task)
                place = there
        if row:
            found[uav.id] = tuple(row)
    return found


def _distances(uavs: Sequence[Uav], tasks: Sequence[Task],
               locked: Mapping[str, tuple[Task, ...]], limits: Limits,
               known: Distances | None, search: PathPreparation | None) -> Distances:
    starts = [locked[u.id][-1].position if locked.get(u.id) else u.position for u in uavs]
    homes = [u.home or u.position for u in uavs]
    extra = [point for u in uavs if locked.get(u.id)
             for point in (u.position, *(t.position for t in locked[u.id]))]
    points = np.array([*starts, *(t.position for t in tasks), *homes, *extra], dtype=np.float64)
    points, budget = points.reshape(-1, 3), search.path_budget if search else None
    if known is not None:
        return known.updated(points, limits.zones, budget)
    return Distances(points, limits.zones, clearance=limits.clearance, budget=budget,
                     altitude_min=limits.altitude_min, altitude_max=limits.altitude_max)


def _may(uavs: Sequence[Uav], tasks: Sequence[Task]) -> NDArray[np.bool_]:
    """Who may serve what, by capabilities and allowed UAVs."""
    may = np.ones((len(uavs), len(tasks)), np.bool_)
    for i, task in enumerate(tasks):
        if task.required_capabilities or task.allowed_uavs is not None:
            may[:, i] = [task.required_capabilities <= uav.capabilities
                         and (task.allowed_uavs is None or uav.id in task.allowed_uavs)
                         for uav in uavs]
    return may


def _blank(uavs: Sequence[Uav], tasks: Sequence[Task], rules: Rules,
           distances: Distances) -> Arrays:
    m, n = len(uavs), len(tasks)
    k, s = min(NEIGHBOURS, max(0, n - 1)), min(STARTS, m)
    may = _may(uavs, tasks)
    return Arrays(
        m, m + n, rules.returns, rules.hard,
        0.0, np.full(m, math.inf if rules.hard else excess_cost(rules.weights)),
        distances.pairs, not distances.zones, distances.points,
        np.array([u.range for u in uavs], dtype=np.float64), np.zeros(m), may,
        np.any(~may, axis=0, keepdims=True)[0],
        np.array([t.value for t in tasks], dtype=np.float64), np.ones(n), np.empty(n),
        np.empty((n, k), NODE), np.empty((n, k)), np.empty((n, s), NODE),
        np.empty((n, s)))


def excess_cost(weights: Weights) -> float:
    """Metres of way that a metre beyond range weighs as much as."""
    most = 1e6
    return min(weights.penalty / weights.distance, most) if weights.distance > 0.0 else most


def _apply_locks(problem: Problem) -> None:
    """Locked tasks use up range; a UAV that flies them returns even when it gets no more."""
    a = problem.arrays
    for u, uav in enumerate(problem.uavs):
        if uav.id in problem.locked:
            places = problem.locked_places(u)
            a.reach[u] -= sum(problem.distances.length(i, j)
                              for i, j in pairwise(places))
            if problem.rules.returns:
                way = problem.distances.length(u, a.ends + u)
                a.idle[u] = way if way < math.inf else 0.0  # it stays behind its last task


def _neighbours(problem: Problem, known: Problem | None) -> tuple[Ints, Ints]:
    """Near tasks as an earlier problem knows them, -1 where it does not; those new to it."""
    n, k = problem.arrays.near.shape
    near = np.full((n, k), -1, np.int64)
    if known is None or known.arrays.near.shape[1] != k or k == 0:
        return near, np.empty(0, np.int64)
    then = np.array([known.index.get(task.id, -1) for task in problem.tasks])
    a, b = problem.arrays, known.arrays
    stay = np.flatnonzero(then >= 0)
    stay = stay[(a.xyz[a.uavs + stay] == b.xyz[b.uavs + then[stay]]).all(axis=1)]
    now = np.full(len(known.tasks), -1, np.int64)
    now[then[stay]] = stay
    rows = now[b.near[then[stay]] - b.uavs]
    whole = (rows >= 0).all(axis=1)
    near[stay[whole]] = rows[whole]
    return near, np.setdiff1d(np.arange(n), stay, assume_unique=True)


def _fill(problem: Problem, known: Problem | None, search: PathPreparation | None) -> float:
    """Neighbours and prices; returns the mean way [m] to the nearest neighbour."""
    a, n = problem.arrays, len(problem.tasks)
    xyz: Floats = problem.distances.points
    if n == 0:
        return 1.0
    found, fresh = _neighbours(problem, known)
    squares = nearest(xyz[a.uavs:a.ends], found, fresh)
    if search is not None and not a.straight:
        search.begin(SOUGHT, 0, heeds_stop=False)
        near_starts(a, xyz, chance(0))
        search.find_near(problem.distances, a, found)
        search.begin(1.0, 0)  # what is not known now is asked for when it is needed
    near_tasks(a, found, squares)
    if a.uavs == 0:
        return 1.0
    near_starts(a, xyz, chance(0))
    lost = np.flatnonzero(a.start_length[:, 0] == math.inf)  # all tasks that zones swallowed
    a.price[[i for i in lost if problem.distances.is_inside(a.uavs + int(i))]] = 0.0
    first = a.near_length[:, 0] if a.near.shape[1] else a.start_length[:, 0]
    finite = first[np.isfinite(first)]
    scale = max(float(finite.mean()) if finite.size else 1.0, 1e-6)
    finite = a.start_length[:, 0][np.isfinite(a.start_length[:, 0])]
    far = float(finite.mean()) if finite.size else 0.0
    a.price[:] *= a.value / a.value.mean() * max(PRICE * scale, 2.0 * far)
    a.dearest[:] = DEAREST * a.price
    return scale
