# SPDX-License-Identifier: Apache-2.0
"""Routes with time as a whole: empty, written as an order of nodes, and set from one."""
from __future__ import annotations

import math

from uav_task_alloc.kernel import inline_kernel, kernel
from uav_task_alloc.solver.timed.arrays import (
    BY_DISTANCE,
    BY_EXCESS,
    BY_FINISH,
    CARRIED,
    CLOSES,
    DEPARTURE,
    EMPTY_LENGTH,
    ENDURANCE_EXCESS,
    FINISH,
    FLOWN,
    HEAD,
    LATEST,
    LEG,
    LINK,
    LOAD,
    METRES,
    NEXT,
    RANGE_EXCESS,
    READY,
    SERVED,
    SERVED_WORTH,
    START,
    TASKS,
    TIME_COST,
    UAV,
    UNSERVED,
    WORTH,
    Links,
    TimedArrays,
    TimedRoutes,
)
from uav_task_alloc.solver.timed.segments import is_task, join, update


@kernel
def reset(a: TimedArrays, r: TimedRoutes) -> None:
    """Make all routes empty. O(nodes)."""
    r.sums[:] = 0.0
    r.count[:] = 0
    r.empty[:] = 0
    r.route[:] = 0.0
    r.trip[:] = 0.0
    r.link[:, UAV] = a.uavs
    for i in range(a.ends - a.uavs):
        r.sums[UNSERVED] += a.unserved[i]
    for u in range(a.uavs):
        end = a.ends + u
        r.row[u, :], r.row[end, :] = 0.0, 0.0
        r.link[u, UAV] = r.link[end, UAV] = r.link[u, HEAD] = r.link[end, HEAD] = u
        r.row[u, START] = r.row[u, DEPARTURE] = a.begin[u, READY]
        r.row[end, LATEST] = a.fixed[end, CLOSES]
        join(a, r, LINK(u), LINK(u), LINK(end))
        r.route[u, METRES] = r.trip[u, FLOWN] = a.begin[u, EMPTY_LENGTH]
        r.sums[METRES] += a.begin[u, EMPTY_LENGTH]
        r.empty[a.class_of[u]] += 1
        update(a, r, LINK(u), LINK(u), LINK(end), 0.0)


@kernel
def route_order(a: TimedArrays, r: TimedRoutes, order: Links) -> None:
    """Write the node after each node of a route into order (nodes); itself where in none."""
    for i in range(order.size):
        order[i] = i if r.link[i, UAV] == a.uavs else r.link[i, NEXT]
    for u in range(a.uavs):
        order[a.ends + u] = a.ends + u


@kernel
def set_order(a: TimedArrays, r: TimedRoutes, order: Links) -> None:
    """Set all routes as `route_order` wrote them. O(nodes)."""
    reset(a, r)
    for u in range(a.uavs):
        i, end = LINK(u), a.ends + u
        metres, load, tasks = 0.0, 0.0, 0.0
        if order[u] == end:
            continue
        while i != end:
            j = order[i]
            join(a, r, LINK(u), i, j)
            r.link[j, UAV] = u
            r.link[j, HEAD] = u
            metres += r.row[i, LEG]
            if is_task(a, j):
                load, tasks = load + a.fixed[j, LOAD], tasks + 1.0
                r.sums[UNSERVED] -= a.unserved[j - a.uavs]
                r.sums[SERVED_WORTH] += a.fixed[j, WORTH]
            i = j
        r.sums[METRES] += metres - r.route[u, METRES]
        r.route[u, METRES] = metres
        if not a.whole:
            r.trip[u, CARRIED], r.trip[u, FLOWN] = load, metres
        r.route[u, TASKS] = tasks
        r.count[SERVED] += int(tasks)
        update(a, r, LINK(u), LINK(u), LINK(end), 0.0)


@inline_kernel
def true_cost(a: TimedArrays, r: TimedRoutes) -> float:
    """The objective, with the price of excess that is allowed, without unserved tasks. O(1)."""
    cost = (a.weight[BY_DISTANCE] * r.sums[METRES] + r.sums[TIME_COST]
            + a.weight[BY_FINISH] * r.sums[FINISH])
    if a.weight[BY_EXCESS] < math.inf:
        cost += a.weight[BY_EXCESS] * (r.sums[RANGE_EXCESS] + r.sums[ENDURANCE_EXCESS])
    return float(cost)
