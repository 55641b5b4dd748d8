# SPDX-License-Identifier: Apache-2.0
"""Why a task is left out, in words for the person who announced it."""
from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from uav_task_alloc.model import Task
from uav_task_alloc.solver.problem import Problem
from uav_task_alloc.solver.routes import Floats, Ints


def reasons(problem: Problem, left: Ints) -> dict[str, str]:
    """Why each of these tasks is in no route, by id."""
    short = _short_at_least(problem, left)
    return {problem.tasks[i].id: _reason(problem, i, short[row])
            for row, i in enumerate(left.tolist())}


def _short_at_least(problem: Problem, left: Ints) -> Floats:
    """Metres that (task, UAV) lack as the crow flies; inf where the UAV may not serve it."""
    a, xyz = problem.arrays, problem.distances.points

    def ways(places: Floats) -> Floats:
        found = [np.sqrt(((places - xyz[a.uavs + i]) ** 2).sum(axis=1)) for i in left]
        return np.array(found).reshape(len(left), a.uavs)

    need = ways(xyz[:a.uavs])
    if problem.rules.returns:
        need += ways(xyz[a.ends:a.ends + a.uavs])
    return np.where(a.may[:, left].T, need - a.reach, math.inf)


def _reason(problem: Problem, i: int, short: Floats) -> str:
    """Why the i-th task is in no route."""
    task, a = problem.tasks[i], problem.arrays
    if not problem.uavs:
        return 'there are no UAVs'
    around = problem.distances.zones_around(a.uavs + i)
    if around:
        return f'inside zone {", ".join(around)}'
    if not a.may[:, i].any():
        return _unable(problem, task)
    need, nearest = _nearest(problem, i, short, np.argsort(short, kind='stable').tolist())
    if need == math.inf and _given_up(problem, i):
        return 'no safe way past the zones found in the time; sought again with the next plan'
    if need == math.inf:
        return _no_way_home(problem, i) or 'unreachable: no safe way past the zones' + (
            '' if a.may[:, i].all() else ' for the UAVs that may serve it')
    if need > a.reach[nearest]:
        return (f'beyond the range of every UAV: {problem.uavs[nearest].id} needs '
                f'{need:.0f} m and has {max(0.0, a.reach[nearest]):.0f} m left')
    return 'left out: the ranges do not suffice for all tasks'


def _nearest(problem: Problem, i: int, short: Floats, order: Iterable[int]) -> tuple[float, int]:
    """Metres needed by the UAV that lacks least for the i-th task alone, and that UAV."""
    a, least, found = problem.arrays, math.inf, (math.inf, -1)
    for u in order:
        if short[u] >= least or not a.may[u, i]:
            break  # the rest lack more, or may not
        need = _need(problem, u, a.uavs + i)
        if need < math.inf and (found[1] < 0 or need - a.reach[u] < least):
            least, found = need - a.reach[u], (need, u)
    return found


def _given_up(problem: Problem, i: int) -> bool:
    """Whether a way to the i-th task, or home from it, was not found in the time."""
    a, ways = problem.arrays, problem.distances
    return any(ways.given_up(int(u), a.uavs + i) or (
        problem.rules.returns and ways.given_up(a.uavs + i, a.ends + int(u)))
        for u in np.flatnonzero(a.may[:, i]))


def _no_way_home(problem: Problem, i: int) -> str:
    """The reason of the i-th task where some UAV gets there, but none back; else empty."""
    a, uavs = problem.arrays, problem.uavs
    able = [u for u in np.flatnonzero(a.may[:, i])
            if problem.distances.length(int(u), a.uavs + i) < math.inf]
    if not problem.rules.returns or not able:
        return ''
    around = {uavs[u].id: problem.distances.zones_around(a.ends + int(u)) for u in able}
    inside = [f'home of {uav_id} lies inside zone {", ".join(zones)}'
              for uav_id, zones in around.items() if zones]
    return '; '.join(['no safe way home', *inside])


def _unable(problem: Problem, task: Task) -> str:
    allowed = [uav for uav in problem.uavs
               if task.allowed_uavs is None or uav.id in task.allowed_uavs]
    if not allowed:
        names = ', '.join(sorted(task.allowed_uavs or ()))
        return f'not allowed: only {names or "no UAV"} may serve it'
    lacking = task.required_capabilities - frozenset().union(*(u.capabilities for u in allowed))
    names = ', '.join(sorted(lacking or task.required_capabilities))
    whom = 'UAV' if len(allowed) == len(problem.uavs) else 'allowed UAV'
    return f'no {whom} has the capabilities {names}' if lacking else (
        f'no {whom} has all the capabilities {names}')


def _need(problem: Problem, u: int, place: int) -> float:
    """Metres that UAV u flies for this task alone, behind its locked ones."""
    there = problem.distances.length(u, place)
    if not problem.rules.returns:
        return there
    return there + problem.distances.length(place, problem.arrays.ends + u)
