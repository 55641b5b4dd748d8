# SPDX-License-Identifier: Apache-2.0
"""Why a task is left out, in words for the person who announced it."""
from __future__ import annotations

import math

from uav_task_alloc.model import Task
from uav_task_alloc.solver.problem import Problem


def reason(problem: Problem, i: int) -> str:
    """Why the i-th task is in no route."""
    task, a = problem.tasks[i], problem.arrays
    if not problem.uavs:
        return 'there are no UAVs'
    around = problem.distances.zones_around(a.uavs + i)
    if around:
        return f'inside zone {", ".join(around)}'
    able = [u for u in range(a.uavs) if a.may[u, i]]
    if not able:
        return _unable(problem, task)
    needs = {u: _need(problem, u, a.uavs + i) for u in able}
    reached = [u for u in able if needs[u] < math.inf]
    if not reached:
        return 'unreachable: no safe way past the zones' + (
            ' for the UAVs that may serve it' if len(able) < a.uavs else '')
    nearest = min(reached, key=lambda u: needs[u] - a.reach[u])
    if needs[nearest] > a.reach[nearest]:
        return (f'beyond the range of every UAV: {problem.uavs[nearest].id} needs '
                f'{needs[nearest]:.0f} m and has {max(0.0, a.reach[nearest]):.0f} m left')
    return 'left out: the ranges do not suffice for all tasks'


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
