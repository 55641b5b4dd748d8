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

from uav_task_alloc.kernel import inline_kernel, inner_kernel
from uav_task_alloc.solver.timed import columns as at
from uav_task_alloc.solver.timed.arrays import TOLERANCE, TimedArrays, TimedRoutes
from uav_task_alloc.solver.timed.legs import after_leg, slot_of
from uav_task_alloc.solver.timed.route_sums import update_route
from uav_task_alloc.solver.timed.ways import has_paths, is_task, service_of


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
def _gap(a: TimedArrays, r: TimedRoutes, i: int, j: int) -> float:
    """Time [s] from the departure of node i to the latest start of j after it. O(1).

    inf where j is late already.
    """
    departure, latest = r.row[i, at.DEPARTURE], r.row[j, at.LATEST]
    late = after_leg(a, departure, r.row[i, at.TIME], j) > latest
    return math.inf if late else float(latest - departure)


@inline_kernel
def set_gaps(a: TimedArrays, r: TimedRoutes, first: int, last: int) -> None:
    """Set TimedRoutes.gap of all tasks from node `first` to `last` of a route. O(tasks).

    What else is known of the route is up to date.
    """
    i, before = first, r.link[first, at.PREV]
    if not is_task(a, i):
        i, before = r.link[i, at.NEXT], i
    gap_before = _gap(a, r, before, i)
    while is_task(a, i):
        then = r.link[i, at.NEXT]
        gap_after = _gap(a, r, i, then)
        inner = outer = -math.inf
        if is_task(a, then):
            inner = gap_after
        else:
            outer = gap_after
        if is_task(a, before):
            inner = max(inner, gap_before)
        else:
            outer = max(outer, gap_before)
        r.gap[i, at.INNER], r.gap[i, at.OUTER] = inner, outer
        if i == last:
            break
        before, i, gap_before = i, then, gap_after


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
def update_part(a: TimedArrays, r: TimedRoutes, u: int, first: int, last: int,
                before: float) -> None:
    """Update UAV u's route of one trip after the nodes between `first` and `last` changed.

    Goes on from them in both directions until nothing changes. O(tasks) at worst, O(1) mostly.
    """
    to, passed, end = first, first == last, a.ends + u
    set_reach(a, r, first)
    while to != end:
        i, to = to, r.link[to, at.NEXT]
        changed = _step_forward(a, r, u, i, to)
        if not passed:
            set_reach(a, r, to)
        if passed and not changed:
            break
        passed = passed or to == last
    back, passed = last, first == last
    while back != u:
        j, back = back, r.link[back, at.PREV]
        changed = _step_backward(a, r, u, back, j, -math.inf)
        if passed and not changed:
            break
        passed = passed or back == first
    if a.gaps:
        set_gaps(a, r, back, to)
    update_route(a, r, u, before)


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
            lasts = r.trip[slot, at.AIRBORNE]
            late = r.row[j, at.START] - max(most, lasts) + r.row[head, at.LASTED]
            if r.row[head, at.DEPARTURE] < late and (
                    lasts <= most + TOLERANCE or a.weight[at.BY_EXCESS] < math.inf):
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
    if a.gaps:
        set_gaps(a, r, u, end)
    update_route(a, r, u, before)


@inline_kernel
def update(a: TimedArrays, r: TimedRoutes, u: int, first: int, last: int, before: float) -> None:
    """Update UAV u's route after the nodes between `first` and `last` changed. O(tasks)."""
    if a.whole:
        update_whole(a, r, u, before)
    else:
        update_part(a, r, u, first, last, before)
