# SPDX-License-Identifier: Apache-2.0
"""What a place for a task costs with a visit of the base before or after it, in O(1)."""
from __future__ import annotations

import math

from uav_task_alloc.kernel import inline_kernel, inner_kernel
from uav_task_alloc.solver.timed import columns as at
from uav_task_alloc.solver.timed.arrays import LINK, TimedArrays, TimedRoutes
from uav_task_alloc.solver.timed.legs import after_leg, leg_of, slot_of
from uav_task_alloc.solver.timed.places import cost_of_delay, cost_of_excess, fits_trip
from uav_task_alloc.solver.timed.ways import service_of

NO_VISIT, BASE_BEFORE, BASE_AFTER = range(3)  # kinds of places: with a base visit or without


@inline_kernel
def _may_wait(a: TimedArrays, r: TimedRoutes, u: int, i: int) -> bool:
    """Whether UAV u may serve node i and the others of its trip on a later one. O(tasks)."""
    while i < a.ends:
        if a.restricted[i - a.uavs] and not a.compatible[1, u, i - a.uavs]:
            return False
        i = r.link[i, at.NEXT]
    return True


@inline_kernel
def split_cost(a: TimedArrays, r: TimedRoutes, u: int, t: int, c: int, kind: int,
               base: int, least: float) -> float:
    """Cost of inserting t after node c, with a visit of the base before or after it. O(1)."""
    then, head = r.link[c, at.NEXT], r.link[c, at.HEAD]
    before = kind == BASE_AFTER  # t is in the trip before the visit
    if not fits_trip(a, u, t, head if before else base):
        return math.inf
    if head < a.uavs and a.begin[head, at.GROUNDED] == 0.0 and not _may_wait(a, r, u, then):
        return math.inf
    i, j = (t, base) if before else (base, t)
    first, first_time = leg_of(a, r, u, c, i)
    second, second_time = leg_of(a, r, u, i, j)
    third, third_time = leg_of(a, r, u, j, then)
    added = first + second + third - r.row[c, at.LEG]
    cost = a.weight[at.BY_DISTANCE] * added
    if cost >= least or not added < math.inf:
        return math.inf
    slot, other = slot_of(a, head), slot_of(a, base)
    load = r.row[c, at.LOAD_BEFORE] + (a.fixed[t, at.LOAD] if before else 0.0)
    rest = r.trip[slot, at.CARRIED] + a.fixed[t, at.LOAD] - load
    was, most = r.trip[slot, at.CARRIED] - a.limit[slot, at.CARRIED], a.limit[other, at.CARRIED]
    cost += cost_of_excess(a.price[at.LOAD_EXCESS], was,
                        max(0.0, load - a.limit[slot, at.CARRIED]) + max(0.0, rest - most))
    flown = r.row[c, at.LENGTH_BEFORE] + first + (second if before else 0.0)
    rest = r.trip[slot, at.FLOWN] + added - flown
    was, most = r.trip[slot, at.FLOWN] - a.limit[slot, at.FLOWN], a.limit[other, at.FLOWN]
    cost += cost_of_excess(a.price[at.RANGE_EXCESS], was,
                        max(0.0, flown - a.limit[slot, at.FLOWN]) + max(0.0, rest - most))
    if cost >= least:
        return math.inf
    return float(cost + _split_times(a, r, u, t, c, before, base, first_time, second_time,
                                     third_time))


@inline_kernel
def _then_visit(a: TimedArrays, r: TimedRoutes, u: int, t: int, c: int, base: int, first: float,
                second: float, third: float) -> tuple[float, float, float, float, float]:
    """Times of c, t, base, the node after c; first to third are the legs' [s]. O(1).

    Returns:
        Start of t, arrival at the last node, durations of both trips, time warp until then [s].
    """
    then, head = r.link[c, at.NEXT], r.link[c, at.HEAD]
    hold, warp = a.fixed[t, at.TRIP_RELEASE], r.row[c, at.WARP_BEFORE]
    left, lasted = r.row[c, at.LEFT], r.row[c, at.LASTED]
    departure = max(r.row[c, at.DEPARTURE], hold + lasted)
    warp += max(0.0, hold - left)
    start = max(after_leg(a, departure, first, t), a.fixed[t, at.OPENS])
    late = max(0.0, start - a.fixed[t, at.CLOSES])
    start -= late
    lasted += first
    opened = max(a.fixed[t, at.OPENS], a.fixed[t, at.RELEASE] + first)
    lasts = lasted + max(0.0, opened - lasted - left) + service_of(a, r, u, t) + second
    # the releases of the trip may be those of tasks after the visit
    departure = max(start + service_of(a, r, u, t) + second + a.fixed[base, at.SERVICE],
                    r.row[head, at.DEPARTURE])
    rest = third + (r.row[then, at.LASTS] if then < a.ends else 0.0)
    return start, after_leg(a, departure, third, then), lasts, rest, warp + late


@inline_kernel
def _visit_then(a: TimedArrays, r: TimedRoutes, u: int, t: int, c: int, base: int, first: float,
                second: float, third: float) -> tuple[float, float, float, float, float]:
    """Times of c, base, t, the node after c; as _then_visit. O(1)."""
    then, head = r.link[c, at.NEXT], r.link[c, at.HEAD]
    departure = max(r.row[c, at.DEPARTURE] + first + a.fixed[base, at.SERVICE],
                    r.row[head, at.DEPARTURE], a.fixed[t, at.TRIP_RELEASE])
    start = max(after_leg(a, departure, second, t), a.fixed[t, at.OPENS])
    late = max(0.0, start - a.fixed[t, at.CLOSES])
    start -= late
    rest = second + service_of(a, r, u, t) + third
    if then < a.ends:
        opened = max(r.row[then, at.EARLY], a.fixed[then, at.RELEASE] + third)
        wait = max(0.0, opened - rest - (a.fixed[t, at.CLOSES] - second))
        rest += wait + r.row[then, at.LASTS]
    arrival = after_leg(a, start + service_of(a, r, u, t), third, then)
    return (start, arrival, r.row[c, at.LASTED] + first, rest,
            r.row[c, at.WARP_BEFORE] + late)


@inline_kernel
def _split_times(a: TimedArrays, r: TimedRoutes, u: int, t: int, c: int, before: bool, base: int,
                 first: float, second: float, third: float) -> float:
    """The part of split_cost that is due to times; first to third are the legs' [s]. O(1)."""
    if before:
        start, arrival, lasts, rest, warp = _then_visit(a, r, u, t, c, base, first, second,
                                                       third)
    else:
        start, arrival, lasts, rest, warp = _visit_then(a, r, u, t, c, base, first, second,
                                                       third)
    then, slot, other = r.link[c, at.NEXT], slot_of(a, r.link[c, at.HEAD]), slot_of(a, base)
    warp += r.row[then, at.WARP_AFTER] + max(0.0, arrival - r.row[then, at.LATEST])
    cost = cost_of_excess(a.price[at.WARP], r.route[u, at.WARP], warp)
    most = a.limit[slot, at.AIRBORNE]
    was = max(0.0, r.trip[slot, at.AIRBORNE] - most)
    now = max(0.0, lasts - most) + max(0.0, rest - a.limit[other, at.AIRBORNE])
    scale = a.begin[u, at.CRUISE]
    cost += cost_of_excess(a.price[at.ENDURANCE_EXCESS], scale * was, scale * now)
    if a.timed_cost:
        cost += cost_of_delay(a, r, u, t, start, then, arrival)
    return float(cost)


@inline_kernel
def free_visit(a: TimedArrays, r: TimedRoutes, u: int) -> int:
    """A base visit of UAV u that is in no route; -1: none. O(visits)."""
    for base in range(a.bases + u * a.visits, a.bases + (u + 1) * a.visits):
        if r.link[base, at.OF_UAV] != u and a.fixed[base, at.SERVICE] < math.inf:
            return base
    return -1


@inner_kernel
def cheapest_split(a: TimedArrays, r: TimedRoutes, t: int, c: int,
                   least: float) -> tuple[int, float]:
    """The kind of place with a base visit after node c that costs least, below `least`. O(1)."""
    u, kind = r.link[c, at.OF_UAV], BASE_BEFORE
    free = free_visit(a, r, u)
    if free < 0:
        return kind, math.inf
    base = LINK(free)
    for each in (BASE_BEFORE, BASE_AFTER):
        if (each == BASE_AFTER and r.link[c, at.NEXT] >= a.ends) or (
                each == BASE_BEFORE and c >= a.bases):
            continue
        cost = split_cost(a, r, u, t, c, each, base, least)
        if cost < least:
            kind, least = each, cost
    return kind, least
