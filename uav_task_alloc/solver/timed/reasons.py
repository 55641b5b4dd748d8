# SPDX-License-Identifier: Apache-2.0
"""Texts for users: why a task is unassigned where windows, loads or batteries count."""
from __future__ import annotations

import math
from collections.abc import Collection, Sequence

import numpy as np

from uav_task_alloc.errors import counted
from uav_task_alloc.geometry.outline import Floats
from uav_task_alloc.kernel import kernel
from uav_task_alloc.solver.reasons import lasting_reason
from uav_task_alloc.solver.timed import columns as at
from uav_task_alloc.solver.timed.arrays import LINK, TimedArrays, TimedRoutes
from uav_task_alloc.solver.timed.legs import leg_of
from uav_task_alloc.solver.timed.places import cost_at
from uav_task_alloc.solver.timed.problem import TimedProblem, empty_timed_routes
from uav_task_alloc.solver.timed.visits import BASE_BEFORE, free_visit, split_cost
from uav_task_alloc.solver.timed.ways import directions, face, has_paths, service_of
from uav_task_alloc.solver.way_reasons import WayReasons

_ARRIVAL, _LATE, _LENGTH, _SECONDS, _END = range(5)  # columns of needs_alone
NO_PLACE_IN_TIME = ('left out: no place in a route was found in the time; searched for again with '
                    'the next plan')
_NAMED = 3  # UAVs that a text names


@kernel
def can_serve(a: TimedArrays, r: TimedRoutes, t: int) -> bool:
    """Whether a UAV could serve t if it served no other tasks but locked ones. O(m).

    r: empty routes.
    """
    for k in range(a.uavs * directions(a, t)):
        u = k % a.uavs
        if has_paths(a):
            face(a, r, t, k >= a.uavs)
        if cost_at(a, r, LINK(u), LINK(t), LINK(u)) < math.inf:
            return True
        base = free_visit(a, r, LINK(u))
        if base >= 0 and split_cost(a, r, LINK(u), LINK(t), LINK(u), BASE_BEFORE, LINK(base),
                                    math.inf) < math.inf:
            return True
    return False


@kernel
def needs_alone(a: TimedArrays, r: TimedRoutes, t: int, turned: bool, needs: Floats) -> None:
    """What each UAV needs for t alone, after its locked tasks, on its first trip. O(m).

    turned: t is flown from its last point; needs: (m, 5) start of the service, its lateness [s],
    length [m], time in the air [s], end of the route [s].
    """
    if has_paths(a):
        face(a, r, t, turned)
    for u in range(a.uavs):
        service = service_of(a, r, LINK(u), t)
        metres, seconds = leg_of(a, r, LINK(u), LINK(u), LINK(t))
        more, further = leg_of(a, r, LINK(u), LINK(t), LINK(a.ends + u))
        hold = max(a.fixed[t, at.RELEASE], a.fixed[t, at.TRIP_RELEASE] + a.begin[u, at.IN_AIR])
        start = max(max(a.begin[u, at.READY], hold) + seconds, a.fixed[t, at.OPENS])
        lasted = a.begin[u, at.IN_AIR] + seconds
        opened = max(a.fixed[t, at.OPENS], a.fixed[t, at.RELEASE] + seconds)
        lasted += max(0.0, opened - lasted - a.begin[u, at.LAST_DEPARTURE])
        needs[u, 0], needs[u, 1] = start, max(0.0, start - a.fixed[t, at.CLOSES])
        needs[u, 2] = metres + more
        needs[u, 3] = lasted + service + further
        needs[u, 4] = start + service + further


def timed_reasons(problem: TimedProblem, missing: Sequence[int],
                  untried: Collection[int] = ()) -> dict[str, str]:
    """Why each of these tasks is in no route.

    Args:
        problem: what was solved.
        missing: indices of the tasks.
        untried: indices of tasks for which there was no time to try all places.

    Returns:
        A text for each task id.
    """
    if not missing:
        return {}
    routes, ways, scarce = (empty_timed_routes(problem.arrays), WayReasons(problem.base),
                            _scarce(problem))
    return {problem.base.tasks[i].id: _reason(problem, routes, ways,
                                              '' if i in untried else scarce, i) for i in missing}


def _reason(problem: TimedProblem, routes: TimedRoutes, ways: WayReasons, scarce: str,
            i: int) -> str:
    a, base = problem.arrays, problem.base
    fixed = lasting_reason(base, i) or ways.reason(i)
    if fixed:
        return fixed
    if can_serve(a, routes, a.uavs + i):
        if not scarce:
            return NO_PLACE_IN_TIME
        if problem.prizes:
            return 'left out: it is not worth its way'
        return f'left out: {scarce} do not suffice for all tasks'
    return _load_reason(problem, i) or _needs_reason(problem, routes, i)


def _scarce(problem: TimedProblem) -> str:
    """What limits the plan."""
    uavs, tasks = problem.base.uavs, problem.base.tasks
    limits = [('windows', any(task.latest < math.inf for task in tasks)),
              ('loads', any(task.payload > 0.0 for task in tasks)),
              ('endurances', any(uav.endurance < math.inf for uav in uavs)),
              ('availabilities', any(uav.available_until < math.inf for uav in uavs)),
              ('ranges', any(uav.range < math.inf for uav in uavs))]
    names = [name for name, given in limits if given] or ['ranges']
    return ' and '.join([', '.join(names[:-1]), names[-1]]) if len(names) > 1 else names[0]


def _load_reason(problem: TimedProblem, i: int) -> str:
    """The reason of a task whose payload no UAV can take; else empty."""
    base, task, a = problem.base, problem.base.tasks[i], problem.arrays
    if task.payload <= 0.0 or any(task.id in names for names in problem.aboard.values()):
        return ''
    able = [uav for u, uav in enumerate(base.uavs) if base.arrays.compatible[u, i]]
    most = max(able, key=lambda uav: uav.payload_capacity)
    if task.payload > most.payload_capacity:
        return (f'payload {task.payload:g} kg; the largest capacity is '
                f'{most.payload_capacity:g} kg ({most.id})')
    if not a.visits and all(not uav.at_base for uav in able
                            if uav.payload_capacity >= task.payload):
        return f'payload {task.payload:g} kg; every UAV that could carry it is in the air'
    return ''


def _least_needs(problem: TimedProblem, routes: TimedRoutes, i: int) -> Floats:
    """`needs_alone` of a task; of each column the less of both directions."""
    a = problem.arrays
    both = []
    for turned in (False, True)[:1 + int(a.turnable[i])]:
        needs = np.empty((a.uavs, 5))
        needs_alone(a, routes, a.uavs + i, turned, needs)
        both.append(needs)
    least: Floats = np.minimum.reduce(both)
    return least


def _needs_reason(problem: TimedProblem, routes: TimedRoutes, i: int) -> str:
    """The reason of a task that windows, ranges, endurances or availabilities prevent."""
    a, base, task = problem.arrays, problem.base, problem.base.tasks[i]
    needs = _least_needs(problem, routes, i)
    able = np.flatnonzero(a.compatible[0, :, i])
    if not able.size:
        return f'payload {task.payload:g} kg: no UAV on the ground may serve it'
    if (needs[able, _LATE] > 0.0).all() and not a.visits:
        first = int(able[np.argmin(needs[able, _ARRIVAL])])
        return (f'latest {task.latest:.0f} s; the earliest arrival is '
                f'{needs[first, _ARRIVAL]:.0f} s ({base.uavs[first].id})')
    able = able[np.argsort(needs[able, _LENGTH], kind='stable')]
    texts = [_lack(problem, i, u, needs[u]) for u in able[:_NAMED].tolist()]
    more = f'; nor {counted(len(able) - _NAMED, "other")}' if len(able) > _NAMED else ''
    return 'no UAV can serve it: ' + '; '.join(texts) + more


def _lack(problem: TimedProblem, i: int, u: int, need: Floats) -> str:
    """What UAV u lacks for the i-th task alone."""
    a, uav, task = problem.arrays, problem.base.uavs[u], problem.base.tasks[i]
    _, most_metres, most_seconds = a.limit[u, :3].tolist()
    if need[_LATE] > 0.0:
        return f'{uav.id} arrives at {need[_ARRIVAL]:.0f} s, its latest is {task.latest:.0f} s'
    if need[_LENGTH] > most_metres:
        return f'{uav.id} needs {need[_LENGTH]:.0f} m and has {most_metres:.0f} m left'
    if need[_SECONDS] > most_seconds:
        return f'{uav.id} needs {need[_SECONDS]:.0f} s in the air and has {most_seconds:.0f} s'
    if need[_END] > uav.available_until:
        return (f'{uav.id} would end at {need[_END]:.0f} s and is available until '
                f'{uav.available_until:.0f} s')
    if task.payload > a.limit[u, 0]:
        return f'{uav.id} has {a.limit[u, 0]:g} kg of capacity left for {task.payload:g} kg'
    return f'{uav.id} cannot serve it after its locked tasks'
