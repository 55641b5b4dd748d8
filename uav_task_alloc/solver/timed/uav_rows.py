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


def least_pace(problem: Problem, rows: Floats) -> tuple[float, float]:
    """Return TimedArrays.least_pace and least_cut.

    Args:
        problem: with its distances.
        rows: (m, 3) what `paces` gives for its UAVs.
    """
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
    uav, at_base = problem.uavs[u], problem.uavs[u].at_base
    held = problem.locked.get(uav.id, ())
    ready, in_air, last = uav.available_from, 0.0, math.inf
    if not at_base:
        in_air, last = ready, 0.0
    home = float(problem.arrays.empty_route_length[u])
    end = home, _home_seconds(problem, u, home), float(at_base), uav.cruise_speed
    if not held:
        return UavBegin((ready, in_air, last, *end, 0.0, 0.0, math.inf), 0.0)
    loads = [task for task in held if task.payload > 0.0
             and task.id not in aboard.get(uav.id, ())] if at_base else []
    ready = max([ready, *(task.release for task in loads)])
    if at_base:
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
    weight = problem.rules.objective.response * sum(task.value for task in held) / total
    return UavBegin((ready, in_air, last, *end, 1.0, weight, slack),
                    sum(task.payload for task in loads))


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


def trip_limits(problem: Problem, visits: int, begin: Floats, loads: Floats) -> Floats:
    """Return (slots, TRIP) capacity, range and endurance of each trip; what is used stays.

    Args:
        problem: with its distances.
        visits: base visits of a UAV at most.
        begin: (m, BEGIN) how each UAV begins.
        loads: (m) [kg] of locked tasks that each takes on.
    """
    uavs, m = problem.uavs, len(problem.uavs)
    limit = np.full((m * (1 + visits), at.TRIP_COLUMNS), math.inf)
    capacity = np.array([uav.payload_capacity for uav in uavs])
    limit[:m, at.CARRIED] = np.where(begin[:, at.GROUNDED] > 0.0,
                                     np.maximum(0.0, capacity - loads), math.inf)
    limit[:m, at.FLOWN] = np.maximum(problem.arrays.range_left, begin[:, at.EMPTY_LENGTH])
    limit[:m, at.AIRBORNE] = np.maximum([uav.endurance for uav in uavs],
                                        begin[:, at.IN_AIR] + begin[:, at.EMPTY_TIME])
    if visits:
        full = [(uav.payload_capacity, uav.range if uav.full_range is None else uav.full_range,
                 uav.endurance if uav.full_endurance is None else uav.full_endurance)
                for uav in uavs]
        limit[m:, [at.CARRIED, at.FLOWN, at.AIRBORNE]] = np.repeat(full, visits, axis=0)
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
    flying = np.array([not uav.at_base for uav in problem.uavs], np.bool_)
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
    uavs, m, points = problem.uavs, len(problem.uavs), problem.distances.points
    n, compatible = len(problem.tasks), np.packbits(problem.arrays.compatible, axis=1)
    others = [(uav.climb_speed, uav.descent_speed, uav.available_until, uav.turnaround)
              for uav in uavs]
    numbers = np.hstack([points[:m], points[m + n:2 * m + n], begin, limit[:m],
                         limit[m:].reshape(m, (len(limit) - m) * at.TRIP_COLUMNS // max(1, m)),
                         np.array(others, np.float64).reshape(m, 4)])
    seen: dict[object, int] = {}
    return np.array([seen.setdefault((numbers[u].tobytes(), compatible[u].tobytes(),
                                      aboard.get(uav.id)), len(seen))
                     for u, uav in enumerate(uavs)], np.int64)
