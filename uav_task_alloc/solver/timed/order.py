# SPDX-License-Identifier: Apache-2.0
"""Routes with time as a whole: empty, written as an order of nodes, and set from one."""
from __future__ import annotations

import math

from uav_task_alloc.kernel import inline_kernel, inner_kernel, kernel
from uav_task_alloc.solver.timed import columns as at
from uav_task_alloc.solver.timed.arrays import LINK, Links, TimedArrays, TimedRoutes
from uav_task_alloc.solver.timed.legs import join
from uav_task_alloc.solver.timed.segments import update
from uav_task_alloc.solver.timed.ways import TURN_BIT, face, has_paths, is_task, is_turned


@inline_kernel
def _reset(a: TimedArrays, r: TimedRoutes) -> None:
    """Make all routes empty. O(nodes)."""
    r.sums[:] = 0.0
    r.counts[:] = 0
    r.empty[:] = 0
    r.route[:] = 0.0
    r.trip[:] = 0.0
    r.link[:, at.OF_UAV] = a.uavs
    r.reach[:] = -math.inf
    for i in range(a.ends - a.uavs):
        r.sums[at.UNSERVED_COST] += a.unserved[i]
    for u in range(a.uavs):
        end = a.ends + u
        r.row[u, :], r.row[end, :] = 0.0, 0.0
        for i in (u, end):
            r.link[i, at.OF_UAV] = r.link[i, at.HEAD] = u
        r.row[u, at.START] = r.row[u, at.DEPARTURE] = a.begin[u, at.READY]
        r.row[end, at.LATEST] = a.fixed[end, at.CLOSES]
        join(a, r, LINK(u), LINK(u), LINK(end))
        r.route[u, at.METRES] = r.trip[u, at.FLOWN] = a.begin[u, at.EMPTY_LENGTH]
        r.sums[at.METRES] += a.begin[u, at.EMPTY_LENGTH]
        r.empty[a.class_of[u]] += 1
        update(a, r, LINK(u), LINK(u), LINK(end), 0.0)


@inner_kernel
def route_order(a: TimedArrays, r: TimedRoutes, order: Links) -> None:
    """Write the node after each node of a route into order (nodes); itself where in none.

    With TURN_BIT where the node is flown from its last point.
    """
    for i in range(order.size):
        order[i] = i if r.link[i, at.OF_UAV] == a.uavs else r.link[i, at.NEXT]
        if is_turned(a, r, i) and order[i] != i:
            order[i] |= TURN_BIT
    for u in range(a.uavs):
        order[a.ends + u] = a.ends + u


@kernel
def set_order(a: TimedArrays, r: TimedRoutes, order: Links) -> None:
    """Set all routes as `route_order` wrote them. O(nodes)."""
    _reset(a, r)
    for u in range(a.uavs):
        i, end = LINK(u), a.ends + u
        metres, load, tasks = 0.0, 0.0, 0.0
        if order[u] == end:
            continue
        while i != end:
            j = LINK(order[i] & ~TURN_BIT)
            if has_paths(a) and is_task(a, j):
                face(a, r, j, order[j] >= TURN_BIT)
            join(a, r, LINK(u), i, j)
            r.link[j, at.OF_UAV] = u
            r.link[j, at.HEAD] = u
            metres += r.row[i, at.LEG]
            if is_task(a, j):
                load, tasks = load + a.fixed[j, at.LOAD], tasks + 1.0
                r.sums[at.UNSERVED_COST] -= a.unserved[j - a.uavs]
                r.sums[at.SERVED_WORTH] += a.fixed[j, at.WORTH]
            i = j
        r.sums[at.METRES] += metres - r.route[u, at.METRES]
        r.route[u, at.METRES] = metres
        if not a.whole:
            r.trip[u, at.CARRIED], r.trip[u, at.FLOWN] = load, metres
        r.route[u, at.TASKS] = tasks
        r.counts[at.SERVED] += int(tasks)
        update(a, r, LINK(u), LINK(u), LINK(end), 0.0)


@inline_kernel
def true_cost(a: TimedArrays, r: TimedRoutes) -> float:
    """The objective, with the price of excess that is allowed, without unserved tasks.

    Times count from 0 on, not from when tasks were announced. O(1).
    """
    cost = (a.weight[at.BY_DISTANCE] * r.sums[at.METRES] + r.sums[at.TIME_COST]
            + a.weight[at.BY_FINISH] * r.sums[at.FINISH])
    if a.weight[at.BY_EXCESS] < math.inf:
        cost += a.weight[at.BY_EXCESS] * (r.sums[at.RANGE_EXCESS] + r.sums[at.ENDURANCE_EXCESS])
    return float(cost)
