# SPDX-License-Identifier: Apache-2.0
"""Texts for users: why a task is unassigned."""
from __future__ import annotations

import math

import numpy as np

from uav_task_alloc.model import Task
from uav_task_alloc.solver.problem import Problem
from uav_task_alloc.solver.routes import Floats, Ints
from uav_task_alloc.solver.way_reasons import NOT_IN_TIME, WayReasons


def reasons(problem: Problem, unassigned: Ints) -> dict[str, str]:
    """Why each of these tasks is in no route.

    Args:
        problem: what was solved.
        unassigned: indices of the unassigned tasks.

    Returns:
        A text for each task id.
    """
    short, ways = _short_at_least(problem, unassigned), WayReasons(problem)
    return {problem.tasks[i].id: _reason(problem, ways, i, short[row])
            for row, i in enumerate(unassigned.tolist())}


def load_reasons(problem: Problem) -> None:
    """Call each kernel that finds reasons, so that it is loaded.

    Args:
        problem: with a UAV and a task.
    """
    reasons(problem, np.zeros(1, np.int64))
    WayReasons(problem).without_way(0)


def _short_at_least(problem: Problem, unassigned: Ints) -> Floats:
    """(tasks, m) Euclidean distance [m] needed beyond the range; inf: the UAV may not serve it."""
    a, xyz = problem.arrays, problem.distances.points

    def lengths(points: Floats) -> Floats:
        rows = [np.sqrt(((points - xyz[a.uavs + i]) ** 2).sum(axis=1)) for i in unassigned]
        return np.array(rows).reshape(len(unassigned), a.uavs)

    need = lengths(xyz[:a.uavs])
    if problem.rules.returns:
        need += lengths(xyz[a.ends:a.ends + a.uavs])
    return np.where(a.compatible[:, unassigned].T, need - a.range_left, math.inf)


def _reason(problem: Problem, ways: WayReasons, i: int, short: Floats) -> str:
    """Why the i-th task is in no route."""
    a, fixed = problem.arrays, lasting_reason(problem, i)
    if fixed:
        return fixed
    need, nearest = ways.least_shortage(i, short)
    if need == math.inf:
        return ways.without_way(i)
    if need > a.range_left[nearest]:
        return (f'beyond the range of every UAV: {problem.uavs[nearest].id} needs '
                f'{need:.0f} m and has {max(0.0, a.range_left[nearest]):.0f} m left')
    if problem.distances.zones and a.range_left[nearest] == math.inf:
        return NOT_IN_TIME  # of a path from or to a task of its list
    return 'left out: the ranges do not suffice for all tasks'


def lasting_reason(problem: Problem, i: int) -> str:
    """Return why no plan could serve a task: a zone, what it requires.

    Args:
        problem: what was solved.
        i: index of the task.

    Returns:
        Empty where there is no such reason.
    """
    if not problem.uavs:
        return 'there are no UAVs'
    around = problem.distances.zones_around(problem.arrays.uavs + i)
    if around:
        return f'inside zone {", ".join(around)}'
    crossed = problem.crossed.get(problem.tasks[i].id)
    if crossed:
        return f'its way crosses zone {", ".join(crossed)}'
    if not problem.arrays.compatible[:, i].any():
        return _unable(problem, problem.tasks[i])
    return ''


def _unable(problem: Problem, task: Task) -> str:
    """The reason of a task that no UAV may serve."""
    allowed = [uav for uav in problem.uavs
               if task.allowed_uavs is None or uav.id in task.allowed_uavs]
    if not allowed:
        names = ', '.join(sorted(task.allowed_uavs or ()))
        return f'not allowed: only {names or "no UAV"} may serve it'
    lacking = task.required_capabilities - frozenset().union(*(u.capabilities for u in allowed))
    names = ', '.join(sorted(lacking or task.required_capabilities))
    fleet = 'UAV' if len(allowed) == len(problem.uavs) else 'allowed UAV'
    return f'no {fleet} has the capabilities {names}' if lacking else (
        f'no {fleet} has all the capabilities {names}')
