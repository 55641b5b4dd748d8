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

from uav_task_alloc.geometry.distances import length
from uav_task_alloc.geometry.outline import Floats
from uav_task_alloc.kernel import inline_kernel, kernel
from uav_task_alloc.solver.timed.arrays import (
    AIRBORNE,
    BY_DISTANCE,
    BY_END,
    BY_EXCESS,
    BY_FINISH,
    BY_LATENESS,
    CARRIED,
    CLOSES,
    CRUISE,
    DEPARTURE,
    DUE,
    EARLY,
    EMPTY_LENGTH,
    EMPTY_TIME,
    END,
    ENDURANCE_EXCESS,
    FINISH,
    FLOWN,
    GROUNDED,
    HEAD,
    HELD,
    IN_AIR,
    INFEASIBLE,
    LAST_DEPARTURE,
    LASTED,
    LASTS,
    LATEST,
    LEFT,
    LEG,
    LENGTH_BEFORE,
    LOAD,
    LOAD_BEFORE,
    LOAD_EXCESS,
    METRES,
    NEXT,
    OPENS,
    PREV,
    RANGE_EXCESS,
    RATE,
    READY,
    RELEASE,
    SERVICE,
    START,
    TASKS,
    TIME,
    TIME_COST,
    TOLERANCE,
    TRIP_RELEASE,
    UNSERVED,
    WAITS,
    WARP,
    WARP_AFTER,
    WARP_BEFORE,
    WEIGHT,
    TimedArrays,
    TimedRoutes,
    X,
    Y,
    Z,
)
from uav_task_alloc.solver.timed.path_times import path_seconds


@inline_kernel
def leg_of(a: TimedArrays, u: int, i: int, j: int) -> tuple[float, float]:
    """Length [m] and time [s] of UAV u's leg from node i to node j. O(1) once known."""
    if j >= a.ends and j < a.bases:
        if i < a.uavs:
            return a.begin[u, EMPTY_LENGTH], a.begin[u, EMPTY_TIME]
        if not a.returns:
            return 0.0, 0.0
    x, y = a.fixed[j, X] - a.fixed[i, X], a.fixed[j, Y] - a.fixed[i, Y]
    if a.flat:
        metres = math.sqrt(x * x + y * y)
        if a.grain > 0.0:
            metres = math.floor(metres * a.grain) / a.grain
        return metres, metres * a.pace[u, 0]
    z = a.fixed[j, Z] - a.fixed[i, Z]
    square = x * x + y * y
    metres = math.sqrt(square + z * z)
    up = z * a.pace[u, 1] if z > 0.0 else -z * a.pace[u, 2]
    seconds = max(math.sqrt(square) * a.pace[u, 0], up)
    if a.straight:
        return metres, seconds
    found = length(a.pairs, a.point[i], a.point[j])
    if found <= metres * (1.0 + 1e-12):
        return metres, seconds
    return found, path_seconds(a.pairs, a.times, a.speeds[u], a.point[i], a.point[j])


@inline_kernel
def slot_of(a: TimedArrays, head: int) -> int:
    """The slot of the trip with that head."""
    return head if head < a.uavs else a.uavs + head - a.bases


@inline_kernel
def is_task(a: TimedArrays, i: int) -> bool:
    """Whether node i is a task."""
    return a.uavs <= i < a.ends


@inline_kernel
def after_leg(a: TimedArrays, departure: float, seconds: float, j: int) -> float:
    """Arrival at node j after a leg, not set out on before its release. O(1)."""
    release = a.fixed[j, RELEASE]
    return (departure if departure > release else release) + seconds


@inline_kernel
def _step_forward(a: TimedArrays, r: TimedRoutes, i: int, j: int) -> bool:
    """Set START, DEPARTURE and WARP_BEFORE of j after i; returns whether one changed. O(1)."""
    start = after_leg(a, r.row[i, DEPARTURE], r.row[i, TIME], j)
    if start < a.fixed[j, OPENS]:
        start = a.fixed[j, OPENS]
    warp = r.row[i, WARP_BEFORE]
    if start > a.fixed[j, CLOSES]:
        warp += start - a.fixed[j, CLOSES]
        start = a.fixed[j, CLOSES]
    changed = start != r.row[j, START] or warp != r.row[j, WARP_BEFORE]
    r.row[j, START], r.row[j, DEPARTURE] = start, start + a.fixed[j, SERVICE]
    r.row[j, WARP_BEFORE] = warp
    return changed


@inline_kernel
def _step_backward(a: TimedArrays, r: TimedRoutes, i: int, j: int, hold: float) -> bool:
    """Set LATEST and WARP_AFTER of i before j; returns whether one changed. O(1).

    hold: [s] before which i is not left in any case, -inf but for heads of trips.
    """
    gate, warp = r.row[j, LATEST] - r.row[i, TIME], r.row[j, WARP_AFTER]
    hold = max(hold, a.fixed[j, RELEASE])
    if hold > gate:
        warp += hold - gate
        gate = hold
    latest = gate - a.fixed[i, SERVICE]
    if latest > a.fixed[i, CLOSES]:
        latest = a.fixed[i, CLOSES]
    elif latest < a.fixed[i, OPENS]:
        warp += a.fixed[i, OPENS] - latest
        latest = a.fixed[i, OPENS]
    changed = latest != r.row[i, LATEST] or warp != r.row[i, WARP_AFTER]
    r.row[i, LATEST], r.row[i, WARP_AFTER] = latest, warp
    return changed


@inline_kernel
def _cost_of_time(a: TimedArrays, r: TimedRoutes, u: int) -> float:
    """Cost of the times of UAV u's route; sets RATE and WAITS of all its nodes. O(tasks)."""
    j = a.ends + u
    if r.route[u, TASKS] == 0.0:
        r.row[j, RATE] = r.row[j, WAITS] = r.row[u, WAITS] = 0.0
        r.row[u, RATE] = 0.0
        r.row[j, RATE] = a.weight[BY_END]
        return 0.0
    rate, waits, cost = a.weight[BY_END], 0.0, a.weight[BY_END] * r.row[j, START]
    while True:
        r.row[j, RATE], r.row[j, WAITS] = rate, waits
        i = r.link[j, PREV]
        arrival = after_leg(a, r.row[i, DEPARTURE], r.row[i, TIME], j)
        wait = r.row[j, START] - arrival
        if wait > 0.0:
            waits += wait
            rate = 0.0
        if i < a.uavs:
            break
        if i < a.ends:
            rate += a.fixed[i, WEIGHT]
            cost += a.fixed[i, WEIGHT] * r.row[i, START]
            late = r.row[i, START] - a.fixed[i, DUE]
            if late >= 0.0:
                rate += a.weight[BY_LATENESS]
                cost += a.weight[BY_LATENESS] * late
        j = i
    r.row[i, RATE], r.row[i, WAITS] = rate, waits
    return cost


@inline_kernel
def set_sums(a: TimedArrays, r: TimedRoutes, u: int, c: int, value: float) -> None:
    """Set column c of UAV u's row of r.route, and the sum of the column. O(1)."""
    r.sums[c] += value - r.route[u, c]
    r.route[u, c] = value


@inline_kernel
def _is_infeasible(a: TimedArrays, r: TimedRoutes, u: int) -> bool:
    """Whether UAV u's route has excess that is not allowed. O(1)."""
    return r.route[u, WARP] > TOLERANCE or r.route[u, LOAD_EXCESS] > TOLERANCE or (
        a.weight[BY_EXCESS] == math.inf and (
            r.route[u, RANGE_EXCESS] > TOLERANCE or r.route[u, ENDURANCE_EXCESS] > TOLERANCE))


@inline_kernel
def _update_route(a: TimedArrays, r: TimedRoutes, u: int, before: float) -> None:
    """Update what r.route, r.sums and r.count say after a change of UAV u's route. O(m).

    before: tasks of the route before the change.
    """
    end, tasks = a.ends + u, r.route[u, TASKS]
    infeasible = _is_infeasible(a, r, u)
    set_sums(a, r, u, WARP, r.row[end, WARP_BEFORE])
    excess = loads = ranges = 0.0
    slot, i = u, u
    while True:
        loads += max(0.0, r.trip[slot, CARRIED] - a.limit[slot, CARRIED])
        ranges += max(0.0, r.trip[slot, FLOWN] - a.limit[slot, FLOWN])
        if not a.whole:
            break
        excess += max(0.0, r.trip[slot, AIRBORNE] - a.limit[slot, AIRBORNE])
        while True:
            i = r.link[i, NEXT]
            if i >= a.ends:
                break
        if i == end:
            break
        slot = slot_of(a, i)
    set_sums(a, r, u, LOAD_EXCESS, loads)
    set_sums(a, r, u, RANGE_EXCESS, ranges)
    set_sums(a, r, u, ENDURANCE_EXCESS, excess * a.begin[u, CRUISE])
    r.count[INFEASIBLE] += int(_is_infeasible(a, r, u)) - int(infeasible)
    if a.timed_cost:
        set_sums(a, r, u, TIME_COST, _cost_of_time(a, r, u))
        r.route[u, END] = (
            r.row[end, START] if tasks > 0.0 or a.begin[u, HELD] > 0.0 else 0.0)
        if a.weight[BY_FINISH] > 0.0:
            last = 0.0
            for v in range(a.uavs):
                last = max(last, r.route[v, END])
            r.sums[FINISH] = last
    if (before > 0.0) != (tasks > 0.0):
        r.empty[a.class_of[u]] += 1 if before > 0.0 else -1


@inline_kernel
def update_part(a: TimedArrays, r: TimedRoutes, u: int, first: int, last: int,
                before: float) -> None:
    """Update UAV u's route of one trip after the nodes between `first` and `last` changed.

    Goes on from them in both directions until nothing changes. O(tasks) at worst, O(1) mostly.
    """
    i, passed, end = first, first == last, a.ends + u
    while i != end:
        j = r.link[i, NEXT]
        changed = _step_forward(a, r, i, j)
        if passed and not changed:
            break
        passed = passed or j == last
        i = j
    j, passed = last, first == last
    while j != u:
        i = r.link[j, PREV]
        changed = _step_backward(a, r, i, j, -math.inf)
        if passed and not changed:
            break
        passed = passed or i == first
        j = i
    _update_route(a, r, u, before)


@inline_kernel
def _trip_hold(a: TimedArrays, r: TimedRoutes, head: int) -> float:
    """The time before which the trip with that head does not depart: its releases. O(tasks)."""
    hold, i = -math.inf, r.link[head, NEXT]
    while i < a.ends:
        hold = max(hold, a.fixed[i, TRIP_RELEASE])
        i = r.link[i, NEXT]
    return hold


@inline_kernel
def _trip_forward(a: TimedArrays, r: TimedRoutes, head: int) -> int:
    """Set what is known from before for all nodes of a trip; returns the node after. O(tasks).

    The departure of the head is set already.
    """
    i, load, metres, slot = head, 0.0, 0.0, slot_of(a, head)
    while True:
        j = r.link[i, NEXT]
        _step_forward(a, r, i, j)
        seconds = r.row[i, TIME]
        metres += r.row[i, LEG]
        lasted = r.row[i, LASTED] + seconds
        if j >= a.ends:
            break
        opened = max(a.fixed[j, OPENS], a.fixed[j, RELEASE] + seconds)
        wait = max(0.0, opened - lasted - r.row[i, LEFT])
        load += a.fixed[j, LOAD]
        r.row[j, LEFT] = min(r.row[i, LEFT], a.fixed[j, CLOSES] - lasted)
        r.row[j, LASTED] = lasted + wait + a.fixed[j, SERVICE]
        r.row[j, LOAD_BEFORE], r.row[j, LENGTH_BEFORE] = load, metres
        r.link[j, HEAD] = head
        i = j
    r.trip[slot, CARRIED], r.trip[slot, FLOWN], r.trip[slot, AIRBORNE] = load, metres, lasted
    return int(j)


@inline_kernel
def _depart(a: TimedArrays, r: TimedRoutes, head: int) -> None:
    """Set the earliest departure of a trip and what its head knows. O(tasks)."""
    r.row[head, LOAD_BEFORE] = r.row[head, LENGTH_BEFORE] = 0.0
    r.link[head, HEAD] = head
    if head < a.uavs:
        r.row[head, DEPARTURE] = a.begin[head, READY]
        r.row[head, LASTED] = a.begin[head, IN_AIR]
        r.row[head, LEFT] = a.begin[head, LAST_DEPARTURE]
        if a.begin[head, GROUNDED] == 0.0:
            return
    else:
        r.row[head, DEPARTURE] = r.row[head, START] + a.fixed[head, SERVICE]
        r.row[head, LASTED], r.row[head, LEFT] = 0.0, math.inf
    hold = _trip_hold(a, r, head) + r.row[head, LASTED]
    r.row[head, DEPARTURE] = max(r.row[head, DEPARTURE], hold)


@inline_kernel
def _trip_backward(a: TimedArrays, r: TimedRoutes, last: int) -> int:
    """Set what is known from after for all nodes of the trip that ends at `last`; its head."""
    j = last
    r.row[j, LASTS], r.row[j, EARLY] = 0.0, -math.inf
    while True:
        i = r.link[j, PREV]
        if i < a.uavs or i >= a.ends:
            break
        _step_backward(a, r, i, j, -math.inf)
        seconds = r.row[i, TIME]
        passed = a.fixed[i, SERVICE] + seconds
        early = max(r.row[j, EARLY], a.fixed[j, RELEASE] + seconds)
        wait = max(0.0, early - passed - a.fixed[i, CLOSES])
        r.row[i, LASTS] = passed + r.row[j, LASTS] + wait
        r.row[i, EARLY] = max(early - passed, a.fixed[i, OPENS]) - wait
        j = i
    hold = -math.inf
    if i >= a.uavs or a.begin[i, GROUNDED] > 0.0:
        hold = _trip_hold(a, r, i) + r.row[i, LASTED]
    _step_backward(a, r, i, j, hold)
    return int(i)


@kernel
def update_whole(a: TimedArrays, r: TimedRoutes, u: int, before: float) -> None:
    """Update UAV u's route from end to end. O(tasks)."""
    head, end = u, a.ends + u
    while True:
        _depart(a, r, head)
        j = _trip_forward(a, r, head)
        if a.timed_cost and (head >= a.uavs or a.begin[head, GROUNDED] > 0.0):
            most, slot = a.limit[slot_of(a, head), AIRBORNE], slot_of(a, head)
            late = r.row[j, START] - most + r.row[head, LASTED]
            if r.row[head, DEPARTURE] < late and r.trip[slot, AIRBORNE] <= most + TOLERANCE:
                r.row[head, DEPARTURE] = late  # as long on the ground as endurance needs
                _trip_forward(a, r, head)
        if j == end:
            break
        head = j
    last = end
    while True:
        head = _trip_backward(a, r, last)
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
    r.link[i, NEXT], r.link[j, PREV] = j, i
    r.row[i, LEG], r.row[i, TIME] = leg_of(a, u, i, j)


@inline_kernel
def cost_of(a: TimedArrays, sums: Floats) -> float:
    """Cost of the search: the objective, unserved tasks, and excess at its present prices."""
    cost = (a.weight[BY_DISTANCE] * sums[METRES] + sums[TIME_COST]
            + a.weight[BY_FINISH] * sums[FINISH] + sums[UNSERVED])
    for c in range(4):
        if sums[c] > TOLERANCE:
            cost += a.price[c] * sums[c]
    return float(cost)
