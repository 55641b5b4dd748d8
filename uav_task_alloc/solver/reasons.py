# SPDX-License-Identifier: Apache-2.0
"""Texts for users: why a task is unassigned."""
from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from uav_task_alloc.model import Task
from uav_task_alloc.solver.problem import Problem
from uav_task_alloc.solver.routes import Floats, Ints


def reasons(problem: Problem, unassigned: Ints) -> dict[str, str]:
    """Why each of these tasks is in no route.

    Args:
        problem: what was solved.
        unassigned: indices of the unassigned tasks.

    Returns:
        A text for each task id.
    """
    short = _short_at_least(problem, unassigned)
    return {problem.tasks[i].id: _reason(problem, i, short[row])
            for row, i in enumerate(unassigned.tolist())}


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


def _reason(problem: Problem, i: int, short: Floats) -> str:
    """Why the i-th task is in no route."""
    a, fixed = problem.arrays, lasting_reason(problem, i)
    if fixed:
        return fixed
    need, nearest = _nearest(problem, i, short, np.argsort(short, kind='stable').tolist())
    if need == math.inf:
        return _unreachable(problem, i)
    if need > a.range_left[nearest]:
        return (f'beyond the range of every UAV: {problem.uavs[nearest].id} needs '
                f'{need:.0f} m and has {max(0.0, a.range_left[nearest]):.0f} m left')
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


def way_reason(problem: Problem, i: int) -> str:
    """Return the reason of a task to which, or home from which, there is no safe path.

    Args:
        problem: what was solved.
        i: index of the task.

    Returns:
        Empty where there is one.
    """
    able = np.flatnonzero(problem.arrays.compatible[:, i])
    if not problem.distances.zones or any(
            _need(problem, int(u), problem.arrays.uavs + i) < math.inf for u in able):
        return ''
    return _unreachable(problem, i)


def _unreachable(problem: Problem, i: int) -> str:
    """The reason of a task that no safe way leads to, or back from."""
    if _given_up(problem, i):
        return ('no safe path past the zones found in the time; searched for again with the next '
                'plan')
    return _no_path_home(problem, i) or 'unreachable: no safe path past the zones' + (
        '' if problem.arrays.compatible[:, i].all() else ' for the UAVs that may serve it')


def _nearest(problem: Problem, i: int, short: Floats, order: Iterable[int]) -> tuple[float, int]:
    """Metres that the UAV with the least shortage needs for the i-th task alone; that UAV."""
    a, least, best = problem.arrays, math.inf, (math.inf, -1)
    for u in order:
        if short[u] >= least or not a.compatible[u, i]:
            break  # the others lack more, or may not serve it
        need = _need(problem, u, a.uavs + i)
        if need < math.inf and (best[1] < 0 or need - a.range_left[u] < least):
            least, best = need - a.range_left[u], (need, u)
    return best


def _given_up(problem: Problem, i: int) -> bool:
    """Whether a search for a path to the i-th task, or home from it, ran out of budget."""
    a, distances = problem.arrays, problem.distances
    return any(distances.given_up(int(u), a.uavs + i) or (
        problem.rules.returns and distances.given_up(a.uavs + i, a.ends + int(u)))
        for u in np.flatnonzero(a.compatible[:, i]))


def _no_path_home(problem: Problem, i: int) -> str:
    """The reason of the i-th task where a UAV can reach it, but none returns; else empty."""
    a, uavs = problem.arrays, problem.uavs
    able = [u for u in np.flatnonzero(a.compatible[:, i])
            if problem.distances.length(int(u), a.uavs + i) < math.inf]
    if not problem.rules.returns or not able:
        return ''
    around = {uavs[u].id: problem.distances.zones_around(a.ends + int(u)) for u in able}
    inside = [f'home of {uav_id} is inside zone {", ".join(zones)}'
              for uav_id, zones in around.items() if zones]
    return '; '.join(['no safe path home', *inside])


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


def _need(problem: Problem, u: int, place: int) -> float:
    """Metres that UAV u flies for this task alone, after its locked ones."""
    return min(_need_from(problem, u, first, last) for first, last in ways_of(problem, place))


def ways_of(problem: Problem, place: int) -> list[tuple[int, int]]:
    """Return how a task may be flown.

    Args:
        problem: with its distances.
        place: index of the task in `distances`.

    Returns:
        Indices in `distances` of the begin and the end of its path: one pair a direction.
    """
    task = problem.tasks[place - problem.arrays.uavs]
    end = problem.ends.get(task.id, place)
    return [(place, end), (end, place)] if task.path and task.reversible else [(place, end)]


def _need_from(problem: Problem, u: int, first: int, last: int) -> float:
    """Metres that UAV u flies to a task, along it and home."""
    task = problem.tasks[min(first, last) - problem.arrays.uavs]
    outward = problem.distances.length(u, first) + task.path_length
    if not problem.rules.returns:
        return outward
    return outward + problem.distances.length(last, problem.arrays.ends + u)
