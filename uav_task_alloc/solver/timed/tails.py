# SPDX-License-Identifier: Apache-2.0
"""Exchange of the ends of two routes, and of their UAVs, where many tasks are on each.

Strings of a few tasks, removed and inserted one by one, seldom do what one exchange of two long
ends does (2-opt*: Potvin and Rousseau, An Exchange Heuristic for Routeing Problems with Time
Windows, Journal of the Operational Research Society 46 (1995)).
"""
from __future__ import annotations

import math

from uav_task_alloc.kernel import inline_kernel, inner_kernel, kernel
from uav_task_alloc.solver.timed import columns as at
from uav_task_alloc.solver.timed.arrays import LINK, TOLERANCE, TimedArrays, TimedRoutes
from uav_task_alloc.solver.timed.insertion import idle_uav
from uav_task_alloc.solver.timed.legs import join, leg_of
from uav_task_alloc.solver.timed.round import Round, begin_round, save_route, take_back
from uav_task_alloc.solver.timed.route_sums import cost_of
from uav_task_alloc.solver.timed.segments import update


@inner_kernel
def _metres_after(a: TimedArrays, r: TimedRoutes, u: int, i: int, v: int, j: int) -> float:
    """New legs [m] of UAV u's route if what follows node j of UAV v's follows node i. O(1)."""
    then = r.link[j, at.NEXT]
    if then == a.ends + v:
        metres, _ = leg_of(a, r, u, i, LINK(a.ends + u))
        return metres
    metres, _ = leg_of(a, r, u, i, then)
    more, _ = leg_of(a, r, u, r.link[a.ends + v, at.PREV], LINK(a.ends + u))
    return metres + more


@inline_kernel
def _metres_now(a: TimedArrays, r: TimedRoutes, u: int, i: int) -> float:
    """The legs [m] in place of which they would be. O(1)."""
    metres = r.row[i, at.LEG]
    if r.link[i, at.NEXT] != a.ends + u:
        metres += r.row[r.link[a.ends + u, at.PREV], at.LEG]
    return float(metres)


@inner_kernel
def _is_late(a: TimedArrays, r: TimedRoutes, u: int, i: int, v: int, j: int) -> bool:
    """Whether what follows node j of UAV v's route could not be reached in time from node i."""
    then = r.link[j, at.NEXT]
    if then == a.ends + v or a.price[at.WARP] < math.inf:
        return False
    _, seconds = leg_of(a, r, u, i, then)
    return bool(r.row[i, at.DEPARTURE] + seconds > r.row[then, at.LATEST] + TOLERANCE)


@inner_kernel
def _tail_load(a: TimedArrays, r: TimedRoutes, u: int, i: int) -> float:
    """The load [kg] of the tasks after node i; inf where UAV u may not serve one. O(tasks)."""
    load, t = 0.0, r.link[i, at.NEXT]
    while t < a.ends:
        load += a.fixed[t, at.LOAD]
        if a.restricted[t - a.uavs] and not a.compatible[0, u, t - a.uavs]:
            load = math.inf
        t = r.link[t, at.NEXT]
    return load


@inline_kernel
def _carries(a: TimedArrays, r: TimedRoutes, u: int, i: int, v: int, j: int) -> bool:
    """Whether UAV u may serve what follows node j, in place of what follows its node i."""
    load = _tail_load(a, r, u, j)
    if a.price[at.LOAD_EXCESS] < math.inf:
        return load < math.inf
    kept = r.trip[u, at.CARRIED] - _tail_load(a, r, v, i)
    return bool(kept + load <= a.limit[u, at.CARRIED] + TOLERANCE)


@inner_kernel
def _attach(a: TimedArrays, r: TimedRoutes, u: int, i: int, t: int) -> None:
    """Make node t and all that follows it follow node i of UAV u's route. O(tasks)."""
    while t < a.ends:
        join(a, r, u, i, t)
        r.link[t, at.OF_UAV] = r.link[t, at.HEAD] = u
        i, t = t, r.link[t, at.NEXT]
    join(a, r, u, i, LINK(a.ends + u))


@inner_kernel
def _sum_up(a: TimedArrays, r: TimedRoutes, u: int) -> None:
    """Set what UAV u's route sums up. O(tasks)."""
    metres, load, tasks, before = r.row[u, at.LEG], 0.0, 0.0, r.route[u, at.TASKS]
    t = r.link[u, at.NEXT]
    while t < a.ends:
        metres, load, tasks = metres + r.row[t, at.LEG], load + a.fixed[t, at.LOAD], tasks + 1.0
        t = r.link[t, at.NEXT]
    r.sums[at.METRES] += metres - r.route[u, at.METRES]
    r.route[u, at.METRES], r.route[u, at.TASKS] = metres, tasks
    if not a.whole:
        r.trip[u, at.CARRIED], r.trip[u, at.FLOWN] = load, metres
    update(a, r, LINK(u), LINK(u), LINK(a.ends + u), before)


@inner_kernel
def _exchange(a: TimedArrays, r: TimedRoutes, w: Round, i: int, j: int) -> bool:
    """Exchange what follows nodes i and j of two routes if that costs less; whether. O(tasks)."""
    u, v = r.link[i, at.OF_UAV], r.link[j, at.OF_UAV]
    before = cost_of(a, r.sums)
    begin_round(r, w)
    for each in (u, v):
        save_route(a, r, w, each)
    first, then = r.link[i, at.NEXT], r.link[j, at.NEXT]
    _attach(a, r, u, i, then)
    _attach(a, r, v, j, first)
    _sum_up(a, r, u)
    _sum_up(a, r, v)
    if cost_of(a, r.sums) < before - TOLERANCE:
        return True
    take_back(a, r, w)
    return False


@inner_kernel
def _try_exchange(a: TimedArrays, r: TimedRoutes, w: Round, i: int, j: int) -> bool:
    """As _exchange, where the length falls and nothing speaks against it. O(1) mostly."""
    u, v = r.link[i, at.OF_UAV], r.link[j, at.OF_UAV]
    now = _metres_now(a, r, u, i) + _metres_now(a, r, v, j)
    if _metres_after(a, r, u, i, v, j) + _metres_after(a, r, v, j, u, i) >= now - TOLERANCE:
        return False
    if _is_late(a, r, u, i, v, j) or _is_late(a, r, v, j, u, i):
        return False
    if not (_carries(a, r, u, i, v, j) and _carries(a, r, v, j, u, i)):
        return False
    return bool(_exchange(a, r, w, i, j))


@inline_kernel
def _may_pay(a: TimedArrays, r: TimedRoutes, t: int, s: int, apart: float) -> bool:
    """Whether the end from task s on, `apart` [m] from t, may pay after t. O(1)."""
    j = r.link[s, at.PREV]
    gain = r.row[t, at.LEG] + r.row[j, at.LEG] - apart
    if gain <= TOLERANCE:
        return False
    if a.price[at.WARP] == math.inf and (r.row[t, at.DEPARTURE] + apart * a.least_pace
                                         - a.least_cut > r.row[s, at.LATEST] + TOLERANCE):
        return False
    u, v = r.link[t, at.OF_UAV], r.link[s, at.OF_UAV]
    if a.class_of[u] != a.class_of[v]:
        return True
    then = r.link[t, at.NEXT]
    metres, _ = leg_of(a, r, v, j, LINK(a.ends + v) if then >= a.ends else then)
    return bool(metres < gain)


@inline_kernel
def _change_uav(a: TimedArrays, r: TimedRoutes, w: Round, t: int) -> int:
    """Give the route that begins with t to an idle UAV if that costs less; whether. O(classes)."""
    u = r.link[t, at.OF_UAV]
    for m in range(a.near_class.shape[1]):
        k = a.near_class[t - a.uavs, m]
        v = idle_uav(a, r, k) if k >= 0 and k != a.class_of[u] else -1
        if v >= 0 and _try_exchange(a, r, w, LINK(u), LINK(v)):
            return 1
    return 0


@kernel
def exchange_tails(a: TimedArrays, r: TimedRoutes, w: Round, first: int, tasks: int) -> int:
    """Exchange ends of routes beside some tasks and their neighbours where that costs less.

    For problems without visits of the base and without paths.

    Args:
        a: the problem.
        r: its routes; are changed.
        w: of rounds; is overwritten.
        first: index of the first of the tasks.
        tasks: how many follow each other.

    Returns:
        The number of exchanges.
    """
    n, count = a.ends - a.uavs, 0
    for index in range(first, first + tasks):
        t = LINK(a.uavs + index % n)
        if r.link[t, at.OF_UAV] == a.uavs:
            continue
        if r.link[t, at.PREV] < a.uavs:
            count += _change_uav(a, r, w, t)
        for m in range(a.near_count[t - a.uavs]):
            s = a.near[t - a.uavs, m]
            v = r.link[s, at.OF_UAV]
            if v == a.uavs or v == r.link[t, at.OF_UAV]:
                continue
            j = r.link[s, at.PREV]
            if _may_pay(a, r, t, s, a.near_length[t - a.uavs, m]):
                count += int(_try_exchange(a, r, w, t, j))
            j, u = r.link[s, at.PREV], r.link[t, at.OF_UAV]
            if (j < a.uavs and r.link[t, at.PREV] < a.uavs
                    and a.class_of[r.link[s, at.OF_UAV]] != a.class_of[u]):
                count += int(_try_exchange(a, r, w, r.link[t, at.PREV], j))
    return count
