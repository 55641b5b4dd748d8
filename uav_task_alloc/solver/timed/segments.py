# SPDX-License-Identifier: Apache-2.0
"""Segments of routes: what each node knows of the route before and after it, kept up to date.

START is the earliest start of the service, LATEST the latest one that delays nothing beyond its
window; where a window cannot be kept time is turned back ("time warp": Nagata, Braysy and Dullaert
2010; Vidal et al. 2013), and WARP_BEFORE and WARP_AFTER are its sums. LASTED is the shortest time
in the air from the departure of the trip to the end of the service, LEFT the latest departure that
attains it; LASTS and EARLY are the same from the start of the service to the end of the trip.
"""
from __future__ import annotations

import math

from uav_task_alloc.geometry.outline import Floats
from uav_task_alloc.geometry.pairs import length
from uav_task_alloc.kernel import inline_kernel, inner_kernel
from uav_task_alloc.solver.timed import columns as at
from uav_task_alloc.solver.timed.arrays import TOLERANCE, TimedArrays, TimedRoutes
from uav_task_alloc.solver.timed.path_times import path_seconds
from uav_task_alloc.solver.timed.ways import has_paths, is_task, service_of, way_length


@inline_kernel
def leg_of(a: TimedArrays, r: TimedRoutes, u: int, i: int, j: int) -> tuple[float, float]:
    """Length [m] and time [s] of UAV u's leg from node i to node j. O(1) once known.

    The length counts the path of node i, too.
    """
    own = way_length(a, i)
    if j >= a.ends and j < a.bases:
        if i < a.uavs:
            return a.begin[u, at.EMPTY_LENGTH], a.begin[u, at.EMPTY_TIME]
        if not a.returns:
            return own, 0.0
    if has_paths(a):
        i, j = r.way[i, at.LEAVE], r.way[j, at.ENTER]
    x, y = a.fixed[j, at.X] - a.fixed[i, at.X], a.fixed[j, at.Y] - a.fixed[i, at.Y]
    if a.flat:
        metres = math.sqrt(x * x + y * y)
        if a.grain > 0.0:
            metres = math.floor(metres * a.grain) / a.grain
        return metres + own, metres * a.pace[u, 0]
    z = a.fixed[j, at.Z] - a.fixed[i, at.Z]
    square = x * x + y * y
    metres = math.sqrt(square + z * z)
    up = z * a.pace[u, 1] if z > 0.0 else -z * a.pace[u, 2]
    seconds = max(math.sqrt(square) * a.pace[u, 0], up)
    if a.straight:
        return metres + own, seconds
    found = length(a.pairs, a.point[i], a.point[j])
    if found <= metres * (1.0 + 1e-12):
        return metres + own, seconds
    if found == math.inf:
        return found, found
    return found + own, path_seconds(a.pairs, a.times, a.speeds[u], a.point[i], a.point[j])


@inline_kernel
def slot_of(a: TimedArrays, head: int) -> int:
    """The slot of the trip with that head."""
    return head if head < a.uavs else a.uavs + head - a.bases


@inline_kernel
def after_leg(a: TimedArrays, departure: float, seconds: float, j: int) -> float:
    """Arrival at node j after a leg, not set out on before its release. O(1)."""
    release = a.fixed[j, at.RELEASE]
    return (departure if departure > release else release) + seconds


@inline_kernel
def set_reach(a: TimedArrays, r: TimedRoutes, i: int) -> None:
    """Set TimedRoutes.reach of node i, whose neighbours in its route are known. O(1)."""
    inner = outer = -math.inf
    if r.link[i, at.NEXT] < a.ends:
        inner = r.row[i, at.LEG]
    else:
        outer = r.row[i, at.LEG]
    if is_task(a, r.link[i, at.PREV]):
        inner = max(inner, r.row[i, at.LEG_TO])
    else:
        outer = max(outer, r.row[i, at.LEG_TO])
    if outer > -math.inf and (a.visits > 0 or has_paths(a)):
        outer = math.inf  # a visit of the base may cost less than its way
    r.reach[i, at.INNER], r.reach[i, at.OUTER] = inner, outer


@inline_kernel
def _step_forward(a: TimedArrays, r: TimedRoutes, u: int, i: int, j: int) -> bool:
    """Set START, DEPARTURE and WARP_BEFORE of j after i; returns whether one changed. O(1)."""
    start = after_leg(a, r.row[i, at.DEPARTURE], r.row[i, at.TIME], j)
    if start < a.fixed[j, at.OPENS]:
        start = a.fixed[j, at.OPENS]
    warp = r.row[i, at.WARP_BEFORE]
    if start > a.fixed[j, at.CLOSES]:
        warp += start - a.fixed[j, at.CLOSES]
        start = a.fixed[j, at.CLOSES]
    changed = start != r.row[j, at.START] or warp != r.row[j, at.WARP_BEFORE]
    r.row[j, at.START], r.row[j, at.DEPARTURE] = start, start + service_of(a, r, u, j)
    r.row[j, at.WARP_BEFORE] = warp
    return bool(changed)


@inline_kernel
def _step_backward(a: TimedArrays, r: TimedRoutes, u: int, i: int, j: int, hold: float) -> bool:
    """Set LATEST and WARP_AFTER of i before j; returns whether one changed. O(1).

    hold: [s] before which i is not left in any case, -inf but for heads of trips.
    """
    gate, warp = r.row[j, at.LATEST] - r.row[i, at.TIME], r.row[j, at.WARP_AFTER]
    hold = max(hold, a.fixed[j, at.RELEASE])
    if hold > gate:
        warp += hold - gate
        gate = hold
    latest = gate - service_of(a, r, u, i)
    if latest > a.fixed[i, at.CLOSES]:
        latest = a.fixed[i, at.CLOSES]
    elif latest < a.fixed[i, at.OPENS]:
        warp += a.fixed[i, at.OPENS] - latest
        latest = a.fixed[i, at.OPENS]
    changed = latest != r.row[i, at.LATEST] or warp != r.row[i, at.WARP_AFTER]
    r.row[i, at.LATEST], r.row[i, at.WARP_AFTER] = latest, warp
    return bool(changed)


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
def _update_route(a: TimedArrays, r: TimedRoutes, u: int, before: float) -> None:
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
def update_part(a: TimedArrays, r: TimedRoutes, u: int, first: int, last: int,
                before: float) -> None:
    """Update UAV u's route of one trip after the nodes between `first` and `last` changed.

    Goes on from them in both directions until nothing changes. O(tasks) at worst, O(1) mostly.
    """
    i, passed, end = first, first == last, a.ends + u
    set_reach(a, r, first)
    while i != end:
        j = r.link[i, at.NEXT]
        changed = _step_forward(a, r, u, i, j)
        if not passed:
            set_reach(a, r, j)
        if passed and not changed:
            break
        passed = passed or j == last
        i = j
    j, passed = last, first == last
    while j != u:
        i = r.link[j, at.PREV]
        changed = _step_backward(a, r, u, i, j, -math.inf)
        if passed and not changed:
            break
        passed = passed or i == first
        j = i
    _update_route(a, r, u, before)


@inline_kernel
def _trip_hold(a: TimedArrays, r: TimedRoutes, head: int) -> float:
    """The time before which the trip with that head does not depart: its releases. O(tasks)."""
    hold, i = -math.inf, r.link[head, at.NEXT]
    while i < a.ends:
        hold = max(hold, a.fixed[i, at.TRIP_RELEASE])
        i = r.link[i, at.NEXT]
    return hold


@inline_kernel
def _trip_forward(a: TimedArrays, r: TimedRoutes, u: int, head: int) -> int:
    """Set what is known from before for all nodes of a trip; returns the node after. O(tasks).

    The departure of the head is set already.
    """
    i, load, metres, slot = head, 0.0, 0.0, slot_of(a, head)
    while True:
        j = r.link[i, at.NEXT]
        _step_forward(a, r, u, i, j)
        seconds = r.row[i, at.TIME]
        metres += r.row[i, at.LEG]
        lasted = r.row[i, at.LASTED] + seconds
        if j >= a.ends:
            break
        opened = max(a.fixed[j, at.OPENS], a.fixed[j, at.RELEASE] + seconds)
        wait = max(0.0, opened - lasted - r.row[i, at.LEFT])
        load += a.fixed[j, at.LOAD]
        r.row[j, at.LEFT] = min(r.row[i, at.LEFT], a.fixed[j, at.CLOSES] - lasted)
        r.row[j, at.LASTED] = lasted + wait + service_of(a, r, u, j)
        r.row[j, at.LOAD_BEFORE], r.row[j, at.LENGTH_BEFORE] = load, metres
        r.link[j, at.HEAD] = head
        set_reach(a, r, j)
        i = j
    r.trip[slot, at.CARRIED], r.trip[slot, at.FLOWN] = load, metres
    r.trip[slot, at.AIRBORNE] = lasted
    return int(j)


@inline_kernel
def _depart(a: TimedArrays, r: TimedRoutes, head: int) -> None:
    """Set the earliest departure of a trip and what its head knows. O(tasks)."""
    r.row[head, at.LOAD_BEFORE] = r.row[head, at.LENGTH_BEFORE] = 0.0
    r.link[head, at.HEAD] = head
    if head < a.uavs:
        r.row[head, at.DEPARTURE] = a.begin[head, at.READY]
        r.row[head, at.LASTED] = a.begin[head, at.IN_AIR]
        r.row[head, at.LEFT] = a.begin[head, at.LAST_DEPARTURE]
        if a.begin[head, at.GROUNDED] == 0.0:
            return
    else:
        r.row[head, at.DEPARTURE] = r.row[head, at.START] + a.fixed[head, at.SERVICE]
        r.row[head, at.LASTED], r.row[head, at.LEFT] = 0.0, math.inf
    hold = _trip_hold(a, r, head) + r.row[head, at.LASTED]
    r.row[head, at.DEPARTURE] = max(r.row[head, at.DEPARTURE], hold)


@inline_kernel
def _trip_backward(a: TimedArrays, r: TimedRoutes, u: int, last: int) -> int:
    """Set what is known from after for all nodes of the trip that ends at `last`; its head."""
    j = last
    r.row[j, at.LASTS], r.row[j, at.EARLY] = 0.0, -math.inf
    while True:
        i = r.link[j, at.PREV]
        if i < a.uavs or i >= a.ends:
            break
        _step_backward(a, r, u, i, j, -math.inf)
        seconds = r.row[i, at.TIME]
        passed = service_of(a, r, u, i) + seconds
        early = max(r.row[j, at.EARLY], a.fixed[j, at.RELEASE] + seconds)
        wait = max(0.0, early - passed - a.fixed[i, at.CLOSES])
        r.row[i, at.LASTS] = passed + r.row[j, at.LASTS] + wait
        r.row[i, at.EARLY] = max(early - passed, a.fixed[i, at.OPENS]) - wait
        j = i
    hold = -math.inf
    if i >= a.uavs or a.begin[i, at.GROUNDED] > 0.0:
        hold = _trip_hold(a, r, i) + r.row[i, at.LASTED]
    _step_backward(a, r, u, i, j, hold)
    return int(i)


@inner_kernel
def update_whole(a: TimedArrays, r: TimedRoutes, u: int, before: float) -> None:
    """Update UAV u's route from end to end. O(tasks)."""
    head, end = u, a.ends + u
    while True:
        _depart(a, r, head)
        j = _trip_forward(a, r, u, head)
        if a.timed_cost and (head >= a.uavs or a.begin[head, at.GROUNDED] > 0.0):
            most, slot = a.limit[slot_of(a, head), at.AIRBORNE], slot_of(a, head)
            late = r.row[j, at.START] - most + r.row[head, at.LASTED]
            if r.row[head, at.DEPARTURE] < late and r.trip[slot, at.AIRBORNE] <= most + TOLERANCE:
                r.row[head, at.DEPARTURE] = late  # as long on the ground as endurance needs
                _trip_forward(a, r, u, head)
        if j == end:
            break
        head = j
    last = end
    while True:
        head = _trip_backward(a, r, u, last)
        if head == u:
            break
        last = head
    _update_route(a, r, u, before)


@inline_kernel
def update(a: TimedArrays, r: TimedRoutes, u: int, first: int, last: int, before: float) -> None:
    """Update UAV u's route after the nodes between `first` and `last` changed. O(tasks)."""
    if a.whole:
        update_whole(a, r, u, before)
    else:
        update_part(a, r, u, first, last, before)


@inline_kernel
def join(a: TimedArrays, r: TimedRoutes, u: int, i: int, j: int) -> None:
    """Make node j follow node i in UAV u's route. O(1)."""
    r.link[i, at.NEXT], r.link[j, at.PREV] = j, i
    r.row[i, at.LEG], r.row[i, at.TIME] = leg_of(a, r, u, i, j)
    r.row[j, at.LEG_TO] = r.row[i, at.LEG]


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
