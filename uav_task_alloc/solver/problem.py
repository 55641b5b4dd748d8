# SPDX-License-Identifier: Apache-2.0
"""A problem as objects and as the arrays that kernels take; nothing is solved here."""
from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from uav_task_alloc.geometry.distances import Distances
from uav_task_alloc.geometry.zones import path_is_clear
from uav_task_alloc.model import Task, ThreatZone, Uav
from uav_task_alloc.objective import Objective, Weights
from uav_task_alloc.solver.neighbours import fill_near_starts, fill_near_tasks, find_nearest
from uav_task_alloc.solver.path_preparation import NEAR_SHARE, PathPreparation
from uav_task_alloc.solver.rng import rng_state
from uav_task_alloc.solver.routes import NODE, Arrays, Floats, Ints

NEIGHBOURS = 24  # nearest tasks of a task
STARTS = 8  # nearest UAV starts of a task
UNASSIGNED_LEGS = 20.0  # first cost of not serving an average task, in mean legs


@dataclass(frozen=True, slots=True)
class Limits:
    """Where UAVs may fly: threat zones and altitudes."""

    zones: tuple[ThreatZone, ...] = ()  # that every leg stays outside of
    clearance: float = 0.0  # [m] beyond the zones' margins
    altitude_min: float = -math.inf  # [m]
    altitude_max: float = math.inf  # [m]

    def same_but_zones(self, other: Limits) -> bool:
        """Whether all but the zones are equal."""
        return replace(self, zones=()) == replace(other, zones=())


@dataclass(frozen=True, slots=True)
class Rules:
    """How routes end and how a plan is evaluated."""

    returns: bool = False  # routes end at home
    hard: bool = True  # ranges are hard constraints
    weights: Weights = field(default_factory=Weights)  # of eq 2.12
    objective: Objective = field(default_factory=Objective)  # what is minimised
    trips: int = 1  # of a UAV in all; 1: no visit of its base
    grain: float = 0.0  # [1/m] lengths are cut to multiples of 1 / grain, for public instances


@dataclass(frozen=True, slots=True)
class Problem:
    """UAVs, tasks, distances, and the arrays of them.

    A UAV effectively starts after the tasks that are locked to it, which are not among `tasks`.
    Points of `distances`: effective starts (m), tasks (n), homes (m), then the start and locked
    tasks of each UAV that has any, then the ends of paths: of locked tasks, and of the others.
    """

    uavs: tuple[Uav, ...]  # the fleet
    tasks: tuple[Task, ...]  # to be assigned
    locked: Mapping[str, tuple[Task, ...]]  # by UAV id, in the order of flight
    limits: Limits  # zones and altitudes
    rules: Rules  # of routes and evaluation
    distances: Distances  # between all points
    arrays: Arrays  # for kernels
    scale: float  # [m] mean leg length to the nearest neighbour
    index: Mapping[str, int]  # task id -> index in tasks
    ends: Mapping[str, int]  # task id -> index in distances of the end of its path
    crossed: Mapping[str, tuple[str, ...]]  # task id -> ids of the zones that its path enters

    def locked_places(self, u: int) -> list[int]:
        """Return where UAV u's start and its locked tasks are.

        Args:
            u: index of the UAV.

        Returns:
            Indices in `distances`.
        """
        if not self.locked:
            return [u]
        place = 2 * len(self.uavs) + len(self.tasks)
        for uav in self.uavs[:u]:
            held = self.locked.get(uav.id, ())
            place += len(held) + 1 if held else 0
        held = self.locked.get(self.uavs[u].id, ())
        return list(range(place, place + len(held) + 1)) if held else [u]

    def locked_legs(self, u: int) -> list[tuple[int, int]]:
        """Return the legs to UAV u's locked tasks.

        Args:
            u: index of the UAV.

        Returns:
            Indices in `distances` of start and end of each.
        """
        start, *places = self.locked_places(u)
        legs = []
        for task, place in zip(self.locked.get(self.uavs[u].id, ()), places, strict=True):
            legs.append((start, place))
            start = self.ends.get(task.id, place)
        return legs


def make_problem(uavs: Sequence[Uav], tasks: Sequence[Task],
                 locked: Mapping[str, tuple[Task, ...]], limits: Limits, rules: Rules,
                 known: Problem | None = None, search: PathPreparation | None = None,
                 near: bool = True) -> Problem:
    """Build a problem.

    Args:
        uavs: the fleet.
        tasks: all tasks, locked ones included.
        locked: by UAV id the tasks that it serves first; those that no safe path leads to are
            assigned like the others.
        limits: zones and altitudes.
        rules: how routes end, ranges, weights.
        known: an earlier problem, of which known lengths and neighbours are reused.
        search: searches for paths around zones within the budget; None: without limit.
        near: False: without zones, arrays have no neighbours and no costs of unassigned tasks.

    Returns:
        The problem, with neighbours and costs filled in.
    """
    unlocked = _not_locked(tasks, locked) if locked else tuple(tasks)
    before = known.distances if known and limits.same_but_zones(known.limits) else None
    distances = _distances(uavs, unlocked, locked, limits, before, search)
    crossed, near = _crossed(tasks, limits), near or bool(limits.zones)
    problem = Problem(tuple(uavs), unlocked, locked, limits, rules, distances,
                      _empty_arrays(uavs, unlocked, rules, distances, near), 1.0,
                      {task.id: i for i, task in enumerate(unlocked)},
                      _ends(uavs, unlocked, locked), crossed)
    if search is not None and limits.zones:
        search.find_flown(distances, _places_by_id(problem), {
            uav.id: problem.arrays.ends + u for u, uav in enumerate(uavs) if rules.returns})
    reached = _reachable(problem) if limits.zones else locked
    if reached != locked:
        unlocked = _not_locked(tasks, reached)
        distances = _distances(uavs, unlocked, reached, limits, distances, search)
        problem = replace(problem, tasks=unlocked, locked=reached, distances=distances,
                          arrays=_empty_arrays(uavs, unlocked, rules, distances),
                          index={task.id: i for i, task in enumerate(unlocked)},
                          ends=_ends(uavs, unlocked, reached))
    for name in crossed:
        problem.arrays.compatible[:, problem.index[name]] = False
    _apply_locks(problem)
    arrays = problem.arrays
    floor = float(np.maximum(0.0, arrays.empty_route_length - arrays.range_left).sum())
    return replace(problem, arrays=arrays._replace(excess_floor=floor),
                   scale=_fill_neighbours(problem, known, search) if near else 1.0)


def _not_locked(tasks: Sequence[Task], locked: Mapping[str, tuple[Task, ...]]) -> tuple[Task, ...]:
    held = {task.id for each in locked.values() for task in each}
    return tuple(task for task in tasks if task.id not in held)


def _places_by_id(problem: Problem) -> dict[str, tuple[int, int]]:
    """Indices in `distances` of the begin and the end of each UAV start and task, by id."""
    places = {task_id: len(problem.uavs) + i for task_id, i in problem.index.items()}
    for u, uav in enumerate(problem.uavs):
        start, *held = problem.locked_places(u)
        places[uav.id] = start
        places.update(zip((task.id for task in problem.locked.get(uav.id, ())), held,
                          strict=True))
    return {name: (place, problem.ends.get(name, place)) for name, place in places.items()}


def _reachable(problem: Problem) -> Mapping[str, tuple[Task, ...]]:
    """Locked tasks without those that no safe path leads to from the one before."""
    reachable = {}
    for u, uav in enumerate(problem.uavs):
        place, *places = problem.locked_places(u)
        row = []
        for task, there in zip(problem.locked.get(uav.id, ()), places, strict=True):
            if (task.id not in problem.crossed
                    and problem.distances.length(place, there) < math.inf):
                row.append(task)
                place = problem.ends.get(task.id, there)
        if row:
            reachable[uav.id] = tuple(row)
    return reachable


def _distances(uavs: Sequence[Uav], tasks: Sequence[Task],
               locked: Mapping[str, tuple[Task, ...]], limits: Limits,
               known: Distances | None, search: PathPreparation | None) -> Distances:
    starts = [locked[u.id][-1].end if locked.get(u.id) else u.position for u in uavs]
    homes = [u.home or u.position for u in uavs]
    extra = [point for u in uavs if locked.get(u.id)
             for point in (u.position, *(t.position for t in locked[u.id]))]
    ends = [task.end for task in _with_path(uavs, tasks, locked)]
    points = np.array([*starts, *(t.position for t in tasks), *homes, *extra, *ends],
                      dtype=np.float64)
    points, budget = points.reshape(-1, 3), search.path_budget if search else None
    if known is not None:
        return known.updated(points, limits.zones, budget)
    return Distances(points, limits.zones, clearance=limits.clearance, budget=budget,
                     altitude_min=limits.altitude_min, altitude_max=limits.altitude_max)


def _with_path(uavs: Sequence[Uav], tasks: Sequence[Task],
               locked: Mapping[str, tuple[Task, ...]]) -> list[Task]:
    """Tasks with a path in the order of their ends in Distances."""
    held = [task for uav in uavs for task in locked.get(uav.id, ())]
    return [task for task in (*held, *tasks) if task.path]


def _ends(uavs: Sequence[Uav], tasks: Sequence[Task],
          locked: Mapping[str, tuple[Task, ...]]) -> dict[str, int]:
    """Problem.ends."""
    held = [len(locked.get(uav.id, ())) for uav in uavs]
    first = 2 * len(uavs) + len(tasks) + sum(many + 1 for many in held if many)
    return {task.id: first + k for k, task in enumerate(_with_path(uavs, tasks, locked))}


def _crossed(tasks: Sequence[Task], limits: Limits) -> dict[str, tuple[str, ...]]:
    """Problem.crossed."""
    found = {}
    if limits.zones:
        for task in tasks:
            names = tuple(zone.id for zone in limits.zones if task.path and not path_is_clear(
                task.path, (zone,), limits.clearance))
            if names:
                found[task.id] = names
    return found


def _compatible(uavs: Sequence[Uav], tasks: Sequence[Task]) -> NDArray[np.bool_]:
    """(m, n) whether a UAV may serve a task, by capabilities and allowed UAVs."""
    compatible = np.ones((len(uavs), len(tasks)), np.bool_)
    for i, task in enumerate(tasks):
        if task.required_capabilities or task.allowed_uavs is not None:
            compatible[:, i] = [task.required_capabilities <= uav.capabilities
                         and (task.allowed_uavs is None or uav.id in task.allowed_uavs)
                         for uav in uavs]
    return compatible


def _empty_arrays(uavs: Sequence[Uav], tasks: Sequence[Task], rules: Rules,
                  distances: Distances, near: bool = True) -> Arrays:
    """Arrays whose neighbours and costs are not filled in yet; near: whether any are. O(m n)."""
    m, n = len(uavs), len(tasks)
    k, s = (min(NEIGHBOURS, max(0, n - 1)), min(STARTS, m)) if near else (0, 0)
    compatible = _compatible(uavs, tasks)
    return Arrays(
        m, m + n, rules.returns, rules.hard,
        0.0, np.full(m, math.inf if rules.hard else excess_cost(rules.weights)),
        distances.pairs, not distances.zones, distances.points,
        np.array([u.range for u in uavs], dtype=np.float64), np.zeros(m), compatible,
        np.any(~compatible, axis=0, keepdims=True)[0],
        np.array([t.value for t in tasks], dtype=np.float64), np.ones(n), np.empty(n),
        np.empty((n, k), NODE), np.empty((n, k)), np.empty((n, s), NODE),
        np.empty((n, s)))


def excess_cost(weights: Weights) -> float:
    """Return the price of a metre beyond range.

    Args:
        weights: of eq 2.12.

    Returns:
        Over that of a metre of distance; at most 1e6.
    """
    limit = 1e6
    return min(weights.penalty / weights.distance, limit) if weights.distance > 0.0 else limit


def _apply_locks(problem: Problem) -> None:
    """Subtract locked legs from the ranges; a UAV with locked tasks returns home in any case."""
    a = problem.arrays
    for u, uav in enumerate(problem.uavs):
        if uav.id in problem.locked:
            a.range_left[u] -= sum(problem.distances.length(i, j)
                                   for i, j in problem.locked_legs(u))
            a.range_left[u] -= sum(task.path_length for task in problem.locked[uav.id])
            if problem.rules.returns:
                leg_home = problem.distances.length(u, a.ends + u)
                # it stays at its last task where no path leads home
                a.empty_route_length[u] = leg_home if leg_home < math.inf else 0.0


def _neighbours(problem: Problem, known: Problem | None) -> tuple[Ints, Ints]:
    """(n, k) near tasks that an earlier problem knows, -1: unknown; indices of new tasks."""
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


def _fill_neighbours(problem: Problem, known: Problem | None,
                     search: PathPreparation | None) -> float:
    """Fill in neighbours and costs; returns the mean leg length [m] to the nearest neighbour."""
    a, n = problem.arrays, len(problem.tasks)
    xyz: Floats = problem.distances.points
    if n == 0:
        return 1.0
    near, new = _neighbours(problem, known)
    squares = find_nearest(xyz[a.uavs:a.ends], near, new)
    if search is not None and not a.straight:
        search.begin(NEAR_SHARE, 0, heeds_stop=False)
        fill_near_starts(a, xyz, rng_state(0))
        search.find_near(problem.distances, a, near)
        search.begin(1.0, 0)  # other paths are searched for when they are needed
    fill_near_tasks(a, near, squares)
    if a.uavs == 0:
        return 1.0
    fill_near_starts(a, xyz, rng_state(0))
    unreachable = np.flatnonzero(a.start_length[:, 0] == math.inf)
    inside = [i for i in unreachable if problem.distances.is_inside(a.uavs + int(i))]
    a.unassigned_cost[inside] = 0.0
    first = a.near_length[:, 0] if a.near.shape[1] else a.start_length[:, 0]
    finite = first[np.isfinite(first)]
    scale = max(float(finite.mean()) if finite.size else 1.0, 1e-6)
    finite = a.start_length[:, 0][np.isfinite(a.start_length[:, 0])]
    far = float(finite.mean()) if finite.size else 0.0
    a.unassigned_cost[:] *= a.value / a.value.mean() * max(UNASSIGNED_LEGS * scale, 2.0 * far)
    a.max_unassigned_cost[:] = a.unassigned_cost  # a colony may raise it
    return scale
