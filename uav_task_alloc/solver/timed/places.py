# SPDX-License-Identifier: Apache-2.0
"""What a place for a task costs, in O(1), by the segments before and after it."""
from __future__ import annotations

import math

from uav_task_alloc.kernel import inline_kernel, inner_kernel
from uav_task_alloc.solver.timed import columns as at
from uav_task_alloc.solver.timed.arrays import LINK, TOLERANCE, TimedArrays, TimedRoutes
from uav_task_alloc.solver.timed.legs import after_leg, least_leg, leg_of, slot_of
from uav_task_alloc.solver.timed.route_sums import finish_cost
from uav_task_alloc.solver.timed.ways import TURNED, directions, face, has_paths, service_of


@inline_kernel
def excess_price(price: float, amount: float) -> float:
    """Price of an amount of new excess, which may be negative: none. O(1)."""
    return price * amount if amount > TOLERANCE else 0.0


@inline_kernel
def cost_of_excess(price: float, before: float, after: float) -> float:
    """Cost of changing an amount of excess; inf if it is more and not allowed. O(1)."""
    before, after = max(0.0, before), max(0.0, after)
    if after <= TOLERANCE and before <= TOLERANCE:
        return 0.0
    if price == math.inf:
        return math.inf if after > before + TOLERANCE else 0.0
    return price * (after - before)


@inline_kernel
def cost_of_delay(a: TimedArrays, r: TimedRoutes, u: int, t: int, start: float, then: int,
                   arrival: float) -> float:
    """Cost of the times if t is served from `start` and node `then` reached at `arrival`. O(1).

    Exact for mean times and the finish as long as no wait ends and no task becomes late by it;
    else more than this.
    """
    delay = arrival - r.row[then, at.START]
    delay = delay if delay > 0.0 else 0.0
    cost = a.fixed[t, at.WEIGHT] * start + r.row[then, at.RATE] * delay
    late = start - a.fixed[t, at.DUE]
    if late > 0.0:
        cost += a.weight[at.BY_LATENESS] * late
    if a.weight[at.BY_FINISH] > 0.0:
        end = r.row[a.ends + u, at.START] + max(0.0, delay - r.row[then, at.WAITS])
        more = max(0.0, end - a.weight[at.FINISH_FROM]) - max(
            0.0, r.route[u, at.END] - a.weight[at.FINISH_FROM])
        last = r.sums[at.FINISH]
        cost += finish_cost(a, max(last, end), more) - finish_cost(a, last, 0.0)
    return float(cost)


@inline_kernel
def fits_trip(a: TimedArrays, u: int, t: int, head: int) -> bool:
    """Whether UAV u may serve t in the trip with that head."""
    i = t - a.uavs
    return not a.restricted[i] or bool(a.compatible[0 if head < a.uavs else 1, u, i])


@inline_kernel
def _trip_excess(a: TimedArrays, r: TimedRoutes, u: int, t: int, c: int, slot: int, added: float,
                 seconds: float, further: float) -> float:
    """Cost of the excess of load, range and endurance that t after node c adds. O(1)."""
    load, most = r.trip[slot, at.CARRIED], a.limit[slot, at.CARRIED]
    cost = cost_of_excess(a.price[at.LOAD_EXCESS], load - most, load + a.fixed[t, at.LOAD] - most)
    flown, most = r.trip[slot, at.FLOWN], a.limit[slot, at.FLOWN]
    cost += cost_of_excess(a.price[at.RANGE_EXCESS], flown - most, flown + added - most)
    if a.whole and a.limit[slot, at.AIRBORNE] < math.inf:
        lasts = _lasts(a, r, u, c, t, r.link[c, at.NEXT], seconds, further)
        most, scale = a.limit[slot, at.AIRBORNE], a.begin[u, at.CRUISE]
        known = r.trip[slot, at.AIRBORNE] - most
        cost += cost_of_excess(a.price[at.ENDURANCE_EXCESS], scale * known, scale * (lasts - most))
    return float(cost)


@inline_kernel
def place_cost(a: TimedArrays, r: TimedRoutes, u: int, t: int, c: int, least: float) -> float:
    """Cost of inserting t after node c of UAV u's route; >= least if not less. O(1)."""
    then, head = r.link[c, at.NEXT], r.link[c, at.HEAD] if a.whole else LINK(u)
    metres, seconds = leg_of(a, r, u, c, t)
    more, further = leg_of(a, r, u, t, then)
    added = metres + more - r.row[c, at.LEG]
    cost, start, arrival = _legs_cost(a, r, u, t, c, head, added, seconds, further, least)
    if cost >= least:
        return math.inf
    cost += _trip_excess(a, r, u, t, c, slot_of(a, head), added, seconds, further)
    if a.timed_cost and cost < least:
        cost += cost_of_delay(a, r, u, t, start, then, arrival)
        if a.whole and a.fixed[t, at.TRIP_RELEASE] > -math.inf:
            cost += _cost_of_hold(a, r, t, head, then)
    return float(cost)


@inline_kernel
def costs_less(a: TimedArrays, r: TimedRoutes, u: int, t: int, c: int, least: float) -> bool:
    """Whether place_cost may be less than `least`, by straight legs. O(1).

    Past zones it may take long to look a leg up.
    """
    then, head = r.link[c, at.NEXT], r.link[c, at.HEAD] if a.whole else LINK(u)
    metres, seconds = least_leg(a, r, u, c, t)
    more, further = least_leg(a, r, u, t, then)
    added = metres + more - r.row[c, at.LEG]
    cost, _, _ = _legs_cost(a, r, u, t, c, head, added, seconds, further, least)
    return bool(cost < least)


@inline_kernel
def _legs_cost(a: TimedArrays, r: TimedRoutes, u: int, t: int, c: int, head: int, added: float,
               seconds: float, further: float, least: float) -> tuple[float, float, float]:
    """Cost of t after node c by length and windows; its start and the next arrival [s]. O(1).

    added [m]: by the legs to t and on, which take `seconds` and `further`. Not less with longer
    ones; inf where it is not less than `least`.
    """
    cost = a.weight[at.BY_DISTANCE] * added
    if cost >= least or not added < math.inf or not fits_trip(a, u, t, head):
        return math.inf, 0.0, 0.0
    then = r.link[c, at.NEXT]
    departure, warp = r.row[c, at.DEPARTURE], 0.0
    if a.whole and a.fixed[t, at.TRIP_RELEASE] > -math.inf:
        hold = a.fixed[t, at.TRIP_RELEASE]
        departure = max(departure, hold + r.row[c, at.LASTED])
        warp += max(0.0, hold - r.row[c, at.LEFT])
    start = after_leg(a, departure, seconds, t)
    if start < a.fixed[t, at.OPENS]:
        start = a.fixed[t, at.OPENS]
    elif start > a.fixed[t, at.CLOSES]:
        warp += start - a.fixed[t, at.CLOSES]
        start = a.fixed[t, at.CLOSES]
    arrival = after_leg(a, start + service_of(a, r, u, t), further, then)
    late = arrival - r.row[then, at.LATEST]
    if late > 0.0:
        warp += late
    known = r.route[u, at.WARP]
    warp += r.row[c, at.WARP_BEFORE] + r.row[then, at.WARP_AFTER]
    cost += cost_of_excess(a.price[at.WARP], known, warp)
    return float(cost), start, arrival


@inline_kernel
def _cost_of_hold(a: TimedArrays, r: TimedRoutes, t: int, head: int, then: int) -> float:
    """Cost of the tasks before node `then` as the trip departs later for the load of t. O(1)."""
    if head < a.uavs and a.begin[head, at.GROUNDED] == 0.0:
        return 0.0
    delay = a.fixed[t, at.TRIP_RELEASE] + r.row[head, at.LASTED] - r.row[head, at.DEPARTURE]
    rate = r.row[head, at.RATE]
    if r.row[head, at.WAITS] <= r.row[then, at.WAITS]:  # nobody waits between them
        rate -= r.row[then, at.RATE]
    return float(rate * delay) if delay > 0.0 and rate > 0.0 else 0.0


@inline_kernel
def _lasts(a: TimedArrays, r: TimedRoutes, u: int, c: int, t: int, then: int, seconds: float,
           further: float) -> float:
    """Shortest duration [s] of the trip with t between nodes c and `then`. O(1)."""
    lasted = r.row[c, at.LASTED] + seconds
    opened = max(a.fixed[t, at.OPENS], a.fixed[t, at.RELEASE] + seconds)
    wait = max(0.0, opened - lasted - r.row[c, at.LEFT])
    left = min(r.row[c, at.LEFT], a.fixed[t, at.CLOSES] - lasted)
    lasted += wait + service_of(a, r, u, t) + further
    if then >= a.ends:
        return float(lasted)
    opened = max(r.row[then, at.EARLY], a.fixed[then, at.RELEASE] + further)
    wait = max(0.0, opened - lasted - left)
    return float(lasted + wait + r.row[then, at.LASTS])


@inner_kernel
def cost_at(a: TimedArrays, r: TimedRoutes, u: int, t: int, c: int) -> float:
    """As place_cost without a bound, for kernels that need few."""
    return float(place_cost(a, r, u, t, c, math.inf))


@inner_kernel
def cheapest_direction(a: TimedArrays, r: TimedRoutes, u: int, t: int, c: int) -> int:
    """The kind of the cheaper direction of t after node c of UAV u's route; -1: none may be. O(1).

    Without a visit of the base.
    """
    kind, least = -1, math.inf
    for turned in range(directions(a, t)):
        if has_paths(a):
            face(a, r, t, turned == 1)
        cost = cost_at(a, r, u, t, c)
        if cost < least:
            kind, least = TURNED * turned, cost
    return kind
