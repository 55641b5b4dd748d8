# SPDX-License-Identifier: Apache-2.0
"""What kernels take of each UAV of a problem with time: how it begins, its limits, its class."""
from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from uav_task_alloc.geometry.flight_time import flight_time, service_seconds
from uav_task_alloc.geometry.outline import Floats, Ints
from uav_task_alloc.model import Uav
from uav_task_alloc.solver.answer import leg_between
from uav_task_alloc.solver.problem import Problem
from uav_task_alloc.solver.timed import columns as at
from uav_task_alloc.solver.timed.path_times import Speeds


def is_flat(problem: Problem) -> bool:
    """Return whether length and time of a leg follow from x and y alone.

    Args:
        problem: with its distances.
    """
    z = problem.distances.points[:, 2]
    return not problem.distances.zones and bool((z == z[:1]).all())


def least_pace(problem: Problem) -> tuple[float, float]:
    """Return TimedArrays.least_pace and least_cut.

    Args:
        problem: with its distances.
    """
    rows = paces(problem.uavs)
    flat, steep = rows[:, 0], rows[:, 1:].min(axis=1, initial=math.inf)
    if not is_flat(problem):  # the way climbs as steeply as is fastest
        flat = flat * steep / np.hypot(flat, steep)
    grain = problem.rules.grain
    return (float(flat.min(initial=math.inf)),
            2.0 * float(rows[:, 0].max(initial=0.0)) / grain if grain else 0.0)


def paces(uavs: Sequence[Uav]) -> Floats:
    """Return (m, 3) [s/m] horizontally, up, down.

    Args:
        uavs: m of them.
    """
    rows = [(1.0 / u.cruise_speed, 1.0 / u.climb_speed, 1.0 / u.descent_speed) for u in uavs]
    return np.array(rows, np.float64).reshape(-1, 3)


def speeds(uav: Uav) -> Speeds:
    """Return cruise, climb and descent speed [m/s].

    Args:
        uav: any.
    """
    return uav.cruise_speed, uav.climb_speed, uav.descent_speed


@dataclass(frozen=True, slots=True)
class UavBegin:
    """Where and how a UAV begins, after its locked tasks."""

    begin: tuple[float, ...]  # a row of TimedArrays.begin
    load: float  # [kg] of locked tasks that it takes on


def after_locked(problem: Problem, u: int, aboard: Mapping[str, frozenset[str]],
                 total: float) -> UavBegin:
    """Return what UAV u's locked tasks leave; they are flown as soon as possible.

    Args:
        problem: with its distances.
        u: index of the UAV.
        aboard: ids of the tasks whose payload UAVs in the air have on board, by UAV id.
        total: value of all tasks.
    """
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
    slack = math.inf
    for task, (i, j) in zip(held, problem.locked_legs(u), strict=True):
        seconds, service = _seconds(problem, u, i, j), service_seconds(uav, task)
        ready = max(ready, task.release) + seconds
        opened = max(task.earliest, task.release + seconds)
        in_air += seconds  # its latest time is no rule, so only a UAV in the air has to wait
        in_air += max(0.0, opened - in_air - last) + service
        ready = max(ready, task.earliest)
        slack = min(slack, task.latest - ready)
        ready += service
    home = problem.arrays.empty_route_length[u]
    row = (ready, in_air, last, home, _home_seconds(problem, u, home), float(uav.at_base),
           uav.cruise_speed, float(bool(held)),
           problem.rules.objective.response * sum(task.value for task in held) / total, slack)
    return UavBegin(row, sum(task.payload for task in loads))


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


def trip_limits(problem: Problem, visits: int, held: Sequence[UavBegin]) -> Floats:
    """Return (slots, TRIP) capacity, range and endurance of each trip; what is used stays.

    Args:
        problem: with its distances.
        visits: base visits of a UAV at most.
        held: how each UAV begins.
    """
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


def compatible_trips(problem: Problem, aboard: Mapping[str, frozenset[str]]) -> Any:
    """Return (2, m, n) whether a UAV may serve a task in its first trip, in later ones.

    Args:
        problem: with its distances.
        aboard: ids of the tasks whose payload UAVs in the air have on board, by UAV id.
    """
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


def classes_of_uavs(problem: Problem, begin: Floats, limit: Floats,
                    aboard: Mapping[str, frozenset[str]]) -> Ints:
    """Return (m) the class of each UAV: those of one class are alike.

    Args:
        problem: with its distances.
        begin: (m, BEGIN) how each begins.
        limit: (slots, TRIP) of each trip.
        aboard: ids of the tasks whose payload UAVs in the air have on board, by UAV id.
    """
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
