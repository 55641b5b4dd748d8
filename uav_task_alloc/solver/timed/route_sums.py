# SPDX-License-Identifier: Apache-2.0
"""What each route adds to the cost of the search: its excess, its times, its end."""
from __future__ import annotations

import math

from uav_task_alloc.geometry.outline import Floats
from uav_task_alloc.kernel import inline_kernel
from uav_task_alloc.solver.timed import columns as at
from uav_task_alloc.solver.timed.arrays import TOLERANCE, TimedArrays, TimedRoutes
from uav_task_alloc.solver.timed.legs import after_leg, slot_of


@inline_kernel
def _cost_of_held(a: TimedArrays, u: int, delay: float) -> float:
    """Cost of UAV u's locked tasks as it departs later, without waits that absorb that. O(1).

    Exact for one locked task; of several only the lateness of the first to be late counts.
    """
    slack = a.begin[u, at.HELD_SLACK]
    late = max(0.0, delay - slack) - max(0.0, -slack)
    return float(a.begin[u, at.HELD_RATE] * delay + a.weight[at.BY_LATENESS] * late)


@inline_kernel
def _cost_of_time(a: TimedArrays, r: TimedRoutes, u: int) -> float:
    """Cost of the times of UAV u's route; sets RATE and WAITS of all its nodes. O(tasks)."""
    j = a.ends + u
    if r.route[u, at.TASKS] == 0.0:
        r.row[j, at.RATE] = r.row[j, at.WAITS] = r.row[u, at.WAITS] = 0.0
        r.row[u, at.RATE] = 0.0
        return 0.0
    rate = waits = cost = 0.0
    while True:
        r.row[j, at.RATE], r.row[j, at.WAITS] = rate, waits
        i = r.link[j, at.PREV]
        arrival = after_leg(a, r.row[i, at.DEPARTURE], r.row[i, at.TIME], j)
        wait = r.row[j, at.START] - arrival
        if wait > 0.0:
            waits += wait
            rate = 0.0
        if i < a.uavs:
            break
        if i < a.ends:
            rate += a.fixed[i, at.WEIGHT]
            cost += a.fixed[i, at.WEIGHT] * r.row[i, at.START]
            late = r.row[i, at.START] - a.fixed[i, at.DUE]
            if late >= 0.0:
                rate += a.weight[at.BY_LATENESS]
                cost += a.weight[at.BY_LATENESS] * late
        j = i
    r.row[i, at.RATE], r.row[i, at.WAITS] = rate, waits
    if a.begin[u, at.HELD] > 0.0:
        cost += _cost_of_held(a, u, r.row[u, at.DEPARTURE] - a.begin[u, at.READY])
    return float(cost)


@inline_kernel
def set_sums(a: TimedArrays, r: TimedRoutes, u: int, c: int, value: float) -> None:
    """Set column c of UAV u's row of r.route, and the sum of the column. O(1)."""
    r.sums[c] += value - r.route[u, c]
    r.route[u, c] = value


@inline_kernel
def is_infeasible(a: TimedArrays, r: TimedRoutes, u: int) -> bool:
    """Whether UAV u's route has excess that is not allowed. O(1)."""
    excess = max(r.route[u, at.WARP], r.route[u, at.LOAD_EXCESS])
    if a.weight[at.BY_EXCESS] == math.inf:
        excess = max(excess, r.route[u, at.RANGE_EXCESS], r.route[u, at.ENDURANCE_EXCESS])
    return bool(excess > TOLERANCE)


@inline_kernel
def update_route(a: TimedArrays, r: TimedRoutes, u: int, before: float) -> None:
    """Update what r.route, r.sums and r.counts say after a change of UAV u's route. O(m).

    before: tasks of the route before the change.
    """
    end, tasks = a.ends + u, r.route[u, at.TASKS]
    infeasible = is_infeasible(a, r, u)
    set_sums(a, r, u, at.WARP, r.row[end, at.WARP_BEFORE])
    excess = loads = ranges = 0.0
    slot, i = u, u
    while True:
        loads += max(0.0, r.trip[slot, at.CARRIED] - a.limit[slot, at.CARRIED])
        ranges += max(0.0, r.trip[slot, at.FLOWN] - a.limit[slot, at.FLOWN])
        if not a.whole:
            break
        excess += max(0.0, r.trip[slot, at.AIRBORNE] - a.limit[slot, at.AIRBORNE])
        while True:
            i = r.link[i, at.NEXT]
            if i >= a.ends:
                break
        if i == end:
            break
        slot = slot_of(a, i)
    set_sums(a, r, u, at.LOAD_EXCESS, loads)
    set_sums(a, r, u, at.RANGE_EXCESS, ranges)
    set_sums(a, r, u, at.ENDURANCE_EXCESS, excess * a.begin[u, at.CRUISE])
    r.counts[at.INFEASIBLE] += int(is_infeasible(a, r, u)) - int(infeasible)
    if a.timed_cost:
        set_sums(a, r, u, at.TIME_COST, _cost_of_time(a, r, u))
        r.route[u, at.END] = (
            r.row[end, at.START] if tasks > 0.0 or a.begin[u, at.HELD] > 0.0 else 0.0)
        if a.weight[at.BY_FINISH] > 0.0:
            last = beyond = 0.0
            for v in range(a.uavs):
                last = max(last, r.route[v, at.END])
                beyond += max(0.0, r.route[v, at.END] - a.weight[at.FINISH_FROM])
            r.sums[at.FINISH], r.sums[at.BEYOND] = last, beyond
    if (before > 0.0) != (tasks > 0.0):
        r.empty[a.class_of[u]] += 1 if before > 0.0 else -1


@inline_kernel
def finish_cost(a: TimedArrays, last: float, beyond: float) -> float:
    """What the ends of routes cost the search, by the last one and `beyond` of sums. O(1)."""
    return float(a.weight[at.BY_FINISH] * (min(last, a.weight[at.FINISH_FROM]) + beyond))


@inline_kernel
def cost_of(a: TimedArrays, sums: Floats) -> float:
    """Cost of the search: the objective, unserved tasks, and excess at its present prices.

    Ends of routes count as in `finish_cost`.
    """
    cost = (a.weight[at.BY_DISTANCE] * sums[at.METRES] + sums[at.TIME_COST]
            + finish_cost(a, sums[at.FINISH], sums[at.BEYOND]) + sums[at.UNSERVED_COST])
    for c in range(4):
        if sums[c] > TOLERANCE:
            cost += a.price[c] * sums[c]
    return float(cost)
