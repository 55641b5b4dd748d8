# SPDX-License-Identifier: Apache-2.0
"""What kernels take of each node of a problem with time: its point, its numbers, its path."""
from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import chain
from operator import attrgetter

import numpy as np

from uav_task_alloc.geometry.flight_time import service_seconds
from uav_task_alloc.geometry.outline import Floats, Ints
from uav_task_alloc.model import Uav
from uav_task_alloc.solver.problem import Problem
from uav_task_alloc.solver.timed import columns as at
from uav_task_alloc.solver.timed.arrays import aligned_zeros
from uav_task_alloc.solver.timed.path_times import Speeds
from uav_task_alloc.solver.timed.uav_rows import speeds

_TASK_NUMBERS = attrgetter('earliest', 'latest', 'payload', 'value', 'announced', 'release')


def points_of_nodes(problem: Problem, visits: int) -> Ints:
    """Return the index in `distances` of each node.

    Args:
        problem: with its distances.
        visits: base visits of a UAV at most.
    """
    m, n = len(problem.uavs), len(problem.tasks)
    homes = np.repeat(np.arange(m) + m + n, visits)
    return np.concatenate([np.arange(2 * m + n), homes]).astype(np.int64)


def points_and_ends(problem: Problem, visits: int) -> Ints:
    """Return TimedArrays.point.

    Args:
        problem: with its distances.
        visits: base visits of a UAV at most.
    """
    ends = [problem.ends[task.id] for task in problem.tasks if task.path]
    return np.concatenate([points_of_nodes(problem, visits), np.array(ends, np.int64)])


def ways_of_tasks(problem: Problem, nodes: int,
                  classes: Sequence[Speeds]) -> tuple[Ints, Floats, Floats]:
    """Return TimedArrays.far, way_length and along.

    Args:
        problem: with its distances.
        nodes: number of nodes, from which the ends of paths are numbered.
        classes: speeds that UAVs have, each once.
    """
    m, tasks = len(problem.uavs), problem.tasks
    far = np.arange(m, m + len(tasks), dtype=np.int64)
    with_path = [i for i, task in enumerate(tasks) if task.path]
    far[with_path] = nodes + np.arange(len(with_path))
    lengths = np.array([task.path_length if task.path else 0.0 for task in tasks], np.float64)
    if not with_path:
        return far, lengths, np.empty((len(classes), 0))
    along = [[service_seconds(fleet, task, turned) for task in tasks for turned in (False, True)]
             for fleet in _one_of_each(problem.uavs, classes)]
    return far, lengths, np.array(along, np.float64).reshape(len(classes), 2 * len(tasks))


def _one_of_each(uavs: Sequence[Uav], classes: Sequence[Speeds]) -> list[Uav]:
    """A UAV of each class of speeds."""
    return [next(uav for uav in uavs if speeds(uav) == each) for each in classes]


def total_value(problem: Problem) -> float:
    """Return the value of all tasks, locked ones included; 1 where there are none.

    Args:
        problem: any.
    """
    held = (task for tasks in problem.locked.values() for task in tasks)
    return math.fsum(task.value for task in (*problem.tasks, *held)) or 1.0


def fixed_rows(problem: Problem, visits: int, aboard: Mapping[str, frozenset[str]],
               total: float, along: Floats) -> Floats:
    """Return (nodes, FIXED) what is known of each node.

    Args:
        problem: with its distances.
        visits: base visits of a UAV at most.
        aboard: ids of the tasks whose payload UAVs in the air have on board, by UAV id.
        total: value of all tasks.
        along: TimedArrays.along.
    """
    uavs, tasks = problem.uavs, problem.tasks
    m, n, goal = len(uavs), len(tasks), problem.rules.objective
    points = points_and_ends(problem, visits)
    fixed = aligned_zeros(len(points), at.FIXED_COLUMNS)
    fixed[:, at.X:at.Z + 1] = problem.distances.points[points]
    fixed[:, [at.OPENS, at.RELEASE, at.TRIP_RELEASE]] = -math.inf
    fixed[:, [at.CLOSES, at.DUE]] = math.inf
    rows = fixed[m:m + n]
    hard = math.isinf(goal.lateness)
    loaded = {name for names in aboard.values() for name in names}
    values = np.fromiter(chain.from_iterable(map(_TASK_NUMBERS, tasks)), np.float64,
                         6 * n).reshape(n, 6)
    rows[:, at.SERVICE] = along.reshape(len(along), n, 2).min(axis=(0, 2)) if along.size else [
        task.stay if task.actions else task.service_time for task in tasks]
    latest = at.CLOSES if hard else at.DUE
    rows[:, [at.OPENS, latest, at.LOAD, at.WORTH, at.ANNOUNCED]] = values[:, :5]
    rows[:, at.WEIGHT] = goal.response * rows[:, at.WORTH] / total
    rows[:, at.WIDTH] = np.minimum(values[:, 1], 1e9) - np.maximum(values[:, 0], -1e9)
    release = np.where(values[:, 5] > 0.0, values[:, 5], -math.inf)
    whole_trip = values[:, 2] > 0.0
    whole_trip[[i for i in np.flatnonzero(whole_trip) if tasks[i].id in loaded]] = False
    rows[whole_trip, at.TRIP_RELEASE] = release[whole_trip]
    rows[~whole_trip, at.RELEASE] = release[~whole_trip]
    until = np.array([uav.available_until for uav in uavs])
    fixed[m + n:2 * m + n, at.CLOSES] = until
    bases = fixed[2 * m + n:2 * m + n + m * visits]
    bases[:, at.CLOSES] = np.repeat(until, visits)
    bases[:, at.SERVICE] = np.repeat([uav.turnaround for uav in uavs], visits)
    return fixed
