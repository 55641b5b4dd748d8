# SPDX-License-Identifier: Apache-2.0
"""Places for a task: what each costs, in O(1), by the segments before and after it."""
from __future__ import annotations

import math

import numpy as np

from uav_task_alloc.geometry.outline import Ints
from uav_task_alloc.kernel import inline_kernel, kernel
from uav_task_alloc.solver.rng import RngState, uniform
from uav_task_alloc.solver.timed.arrays import (
    AIRBORNE,
    BY_DISTANCE,
    BY_END,
    BY_FINISH,
    BY_LATENESS,
    CARRIED,
    CLOSES,
    CRUISE,
    DEPARTURE,
    DUE,
    EARLY,
    ENDURANCE_EXCESS,
    FINISH,
    FLOWN,
    HEAD,
    LASTED,
    LASTS,
    LATEST,
    LEFT,
    LEG,
    LENGTH_BEFORE,
    LINK,
    LOAD,
    LOAD_BEFORE,
    LOAD_EXCESS,
    METRES,
    NEXT,
    OPENS,
    PREV,
    RANGE_EXCESS,
    RATE,
    RELEASE,
    SERVED,
    SERVED_WORTH,
    SERVICE,
    START,
    TASKS,
    TIME,
    TOLERANCE,
    TRIP_RELEASE,
    UAV,
    UNSERVED,
    WAITS,
    WARP,
    WARP_AFTER,
    WARP_BEFORE,
    WEIGHT,
    WORTH,
    TimedArrays,
    TimedRoutes,
)
from uav_task_alloc.solver.timed.segments import after_leg, is_task, join, leg_of, slot_of, update

NO_VISIT, BASE_BEFORE, BASE_AFTER = range(3)  # kinds of places: with a base visit or without


@inline_kernel
def excess_cost(price: float, before: float, after: float) -> float:
    """Cost of changing an amount of excess; inf if it is more and not allowed. O(1)."""
    before, after = max(0.0, before), max(0.0, after)
    if after <= TOLERANCE and before <= TOLERANCE:
        return 0.0
    if price == math.inf:
        return math.inf if after > before + TOLERANCE else 0.0
    return price * (after - before)


@inline_kernel
def _cost_of_delay(a: TimedArrays, r: TimedRoutes, u: int, t: int, start: float, then: int,
                   arrival: float) -> float:
    """Cost of the times if t is served from `start` and node `then` reached at `arrival`. O(1).

    Exact for mean times and the finish as long as no wait ends and no task becomes late by it;
    else more than this.
    """
    delay = arrival - r.row[then, START]
    delay = delay if delay > 0.0 else 0.0
    cost = a.fixed[t, WEIGHT] * start + r.row[then, RATE] * delay
    late = start - a.fixed[t, DUE]
    if late > 0.0:
        cost += a.weight[BY_LATENESS] * late
    if a.weight[BY_FINISH] > 0.0:
        end = r.row[a.ends + u, START] + max(0.0, delay - r.row[then, WAITS])
        cost += a.weight[BY_FINISH] * max(0.0, end - r.sums[FINISH])
    if r.route[u, TASKS] == 0.0:
        cost += a.weight[BY_END] * r.row[then, START]
    return float(cost)


@inline_kernel
def _fits_trip(a: TimedArrays, u: int, t: int, head: int) -> bool:
    """Whether UAV u may serve t in the trip with that head."""
    i = t - a.uavs
    return not a.restricted[i] or bool(a.compatible[0 if head < a.uavs else 1, u, i])


@inline_kernel
def place_cost(a: TimedArrays, r: TimedRoutes, u: int, t: int, c: int, least: float) -> float:
    """Cost of inserting t after node c of UAV u's route; >= least if not less. O(1)."""
    then = r.link[c, NEXT]
    metres, seconds = leg_of(a, u, c, t)
    more, further = leg_of(a, u, t, then)
    added = metres + more - r.row[c, LEG]
    cost = a.weight[BY_DISTANCE] * added
    if cost >= least or not added < math.inf:
        return math.inf
    head = r.link[c, HEAD] if a.whole else LINK(u)
    if not _fits_trip(a, u, t, head):
        return math.inf
    slot = slot_of(a, head)
    departure, warp = r.row[c, DEPARTURE], 0.0
    if a.whole and a.fixed[t, TRIP_RELEASE] > -math.inf:
        hold = a.fixed[t, TRIP_RELEASE]
        departure = max(departure, hold + r.row[c, LASTED])
        warp += max(0.0, hold - r.row[c, LEFT])
    start = after_leg(a, departure, seconds, t)
    if start < a.fixed[t, OPENS]:
        start = a.fixed[t, OPENS]
    elif start > a.fixed[t, CLOSES]:
        warp += start - a.fixed[t, CLOSES]
        start = a.fixed[t, CLOSES]
    arrival = after_leg(a, start + a.fixed[t, SERVICE], further, then)
    late = arrival - r.row[then, LATEST]
    if late > 0.0:
        warp += late
    known = r.route[u, WARP]
    warp += r.row[c, WARP_BEFORE] + r.row[then, WARP_AFTER]
    cost += excess_cost(a.price[WARP], known, warp)
    if cost >= least:
        return math.inf
    load, most = r.trip[slot, CARRIED], a.limit[slot, CARRIED]
    cost += excess_cost(a.price[LOAD_EXCESS], load - most, load + a.fixed[t, LOAD] - most)
    flown, most = r.trip[slot, FLOWN], a.limit[slot, FLOWN]
    cost += excess_cost(a.price[RANGE_EXCESS], flown - most, flown + added - most)
    if a.whole and a.limit[slot, AIRBORNE] < math.inf:
        lasts = _lasts(a, r, c, t, then, seconds, further)
        most, scale = a.limit[slot, AIRBORNE], a.begin[u, CRUISE]
        cost += excess_cost(a.price[ENDURANCE_EXCESS], scale * (r.trip[slot, AIRBORNE] - most),
                            scale * (lasts - most))
    if a.timed_cost and cost < least:
        cost += _cost_of_delay(a, r, u, t, start, then, arrival)
    return float(cost)


@inline_kernel
def _lasts(a: TimedArrays, r: TimedRoutes, c: int, t: int, then: int, seconds: float,
           further: float) -> float:
    """Shortest duration [s] of the trip with t between nodes c and `then`. O(1)."""
    lasted = r.row[c, LASTED] + seconds
    opened = max(a.fixed[t, OPENS], a.fixed[t, RELEASE] + seconds)
    wait = max(0.0, opened - lasted - r.row[c, LEFT])
    left = min(r.row[c, LEFT], a.fixed[t, CLOSES] - lasted)
    lasted += wait + a.fixed[t, SERVICE] + further
    if then >= a.ends:
        return float(lasted)
    opened = max(r.row[then, EARLY], a.fixed[then, RELEASE] + further)
    wait = max(0.0, opened - lasted - left)
    return float(lasted + wait + r.row[then, LASTS])


@inline_kernel
def split_cost(a: TimedArrays, r: TimedRoutes, u: int, t: int, c: int, kind: int,
               base: int, least: float) -> float:
    """Cost of inserting t after node c, with a visit of the base before or after it. O(1)."""
    then, head = r.link[c, NEXT], r.link[c, HEAD]
    before = kind == BASE_AFTER  # t is in the trip before the visit
    if not _fits_trip(a, u, t, head if before else base):
        return math.inf
    i, j = (t, base) if before else (base, t)
    first, first_time = leg_of(a, u, c, i)
    second, second_time = leg_of(a, u, i, j)
    third, third_time = leg_of(a, u, j, then)
    added = first + second + third - r.row[c, LEG]
    cost = a.weight[BY_DISTANCE] * added
    if cost >= least or not added < math.inf:
        return math.inf
    slot, other = slot_of(a, head), slot_of(a, base)
    load = r.row[c, LOAD_BEFORE] + (a.fixed[t, LOAD] if before else 0.0)
    rest = r.trip[slot, CARRIED] + a.fixed[t, LOAD] - load
    was, most = r.trip[slot, CARRIED] - a.limit[slot, CARRIED], a.limit[other, CARRIED]
    cost += excess_cost(a.price[LOAD_EXCESS], was,
                        max(0.0, load - a.limit[slot, CARRIED]) + max(0.0, rest - most))
    flown = r.row[c, LENGTH_BEFORE] + first + (second if before else 0.0)
    rest = r.trip[slot, FLOWN] + added - flown
    was, most = r.trip[slot, FLOWN] - a.limit[slot, FLOWN], a.limit[other, FLOWN]
    cost += excess_cost(a.price[RANGE_EXCESS], was,
                        max(0.0, flown - a.limit[slot, FLOWN]) + max(0.0, rest - most))
    if cost >= least:
        return math.inf
    return cost + _split_times(a, r, u, t, c, before, base, first_time, second_time, third_time)


@inline_kernel
def _split_times(a: TimedArrays, r: TimedRoutes, u: int, t: int, c: int, before: bool, base: int,
                 first: float, second: float, third: float) -> float:
    """The part of split_cost that is due to times; first to third are the legs' [s]. O(1)."""
    then, head = r.link[c, NEXT], r.link[c, HEAD]
    slot, other = slot_of(a, head), slot_of(a, base)
    departure, warp, hold = r.row[c, DEPARTURE], r.row[c, WARP_BEFORE], r.row[head, DEPARTURE]
    left, lasted = r.row[c, LEFT], r.row[c, LASTED]
    if before and a.fixed[t, TRIP_RELEASE] > -math.inf:
        departure = max(departure, a.fixed[t, TRIP_RELEASE] + lasted)
        warp += max(0.0, a.fixed[t, TRIP_RELEASE] - left)
    turn = a.fixed[base, SERVICE]
    if before:
        start = after_leg(a, departure, first, t)
        start = max(start, a.fixed[t, OPENS])
        late = max(0.0, start - a.fixed[t, CLOSES])
        start, warp = start - late, warp + late
        lasted += first
        opened = max(a.fixed[t, OPENS], a.fixed[t, RELEASE] + first)
        lasts = lasted + (
            max(0.0, opened - lasted - left) + a.fixed[t, SERVICE] + second)
        # the releases of the trip may be those of tasks after the visit
        departure = max(start + a.fixed[t, SERVICE] + second + turn, hold)
        arrival = after_leg(a, departure, third, then)
        rest = third + r.row[then, LASTS] if then < a.ends else third
    else:
        lasts = lasted + first
        departure = max(departure + first + turn, hold)
        departure = max(departure, a.fixed[t, TRIP_RELEASE])
        start = max(after_leg(a, departure, second, t), a.fixed[t, OPENS])
        late = max(0.0, start - a.fixed[t, CLOSES])
        start, warp = start - late, warp + late
        arrival = after_leg(a, start + a.fixed[t, SERVICE], third, then)
        rest = second + a.fixed[t, SERVICE] + third
        if then < a.ends:
            opened = max(r.row[then, EARLY], a.fixed[then, RELEASE] + third)
            rest += max(0.0, opened - rest - (a.fixed[t, CLOSES] - second)) + r.row[then, LASTS]
    late = arrival - r.row[then, LATEST]
    warp += r.row[then, WARP_AFTER] + max(0.0, late)
    cost = excess_cost(a.price[WARP], r.route[u, WARP], warp)
    was = max(0.0, r.trip[slot, AIRBORNE] - a.limit[slot, AIRBORNE])
    now = max(0.0, lasts - a.limit[slot, AIRBORNE]) + max(0.0, rest - a.limit[other, AIRBORNE])
    scale = a.begin[u, CRUISE]
    cost += excess_cost(a.price[ENDURANCE_EXCESS], scale * was, scale * now)
    if a.timed_cost:
        cost += _cost_of_delay(a, r, u, t, start, then, arrival)
    return float(cost)


@inline_kernel
def free_visit(a: TimedArrays, r: TimedRoutes, u: int) -> int:
    """A base visit of UAV u that is in no route; -1: none. O(visits)."""
    for base in range(a.bases + u * a.visits, a.bases + (u + 1) * a.visits):
        if r.link[base, UAV] != u and a.fixed[base, SERVICE] < math.inf:
            return base
    return -1


@kernel
def cheapest_split(a: TimedArrays, r: TimedRoutes, t: int, c: int,
                   least: float) -> tuple[int, float]:
    """The kind of place with a base visit after node c that costs least, below `least`. O(1)."""
    u, kind = r.link[c, UAV], BASE_BEFORE
    free = free_visit(a, r, u)
    if free < 0:
        return kind, math.inf
    base = LINK(free)
    for each in (BASE_BEFORE, BASE_AFTER):
        if (each == BASE_AFTER and r.link[c, NEXT] >= a.ends) or (
                each == BASE_BEFORE and c >= a.bases):
            continue
        cost = split_cost(a, r, u, t, c, each, base, least)
        if cost < least:
            kind, least = each, cost
    return kind, least


@inline_kernel
def try_place(a: TimedArrays, r: TimedRoutes, t: int, c: int, place: int, kind: int,
              least: float) -> tuple[int, int, float]:
    """The better of the place found so far and the one after node c. O(1)."""
    u = r.link[c, UAV]
    cost = place_cost(a, r, u, t, c, least)
    if cost < least:
        place, kind, least = np.int64(c), NO_VISIT, cost
    if a.visits > 0:
        which, cost = cheapest_split(a, r, t, c, least)
        if cost < least:
            place, kind, least = np.int64(c), which, cost
    return place, kind, least


@inline_kernel
def idle_uav(a: TimedArrays, r: TimedRoutes, k: int) -> int:
    """A UAV of fleet class k without tasks; -1: none. O(members), O(1) if there is none."""
    if r.empty[k] == 0:
        return -1
    for m in range(a.first_member[k], a.first_member[k + 1]):
        if r.route[a.members[m], TASKS] == 0.0:
            return int(a.members[m])
    return -1


@inline_kernel
def near_place(a: TimedArrays, r: TimedRoutes, t: int, opens: bool, blinks: float,
                    rng: RngState) -> tuple[int, int, float]:
    """The cheapest place beside neighbours and in empty routes: (node before, kind, cost). O(k).

    opens: empty routes are tried, too. Each place is skipped with probability `blinks`.
    """
    i, place, kind, least = t - a.uavs, -1, NO_VISIT, math.inf
    sides = 2 * a.near_count[i]
    for m in range(sides + (a.near_class.shape[1] if opens else 0)):
        if m < sides:
            c = a.near[i, m >> 1]
            if r.link[c, UAV] == a.uavs:
                continue
            bound = 2.0 * a.near_length[i, m >> 1]
            if m & 1 == 0:
                open_end = r.link[c, NEXT] >= a.ends
            else:
                c = r.link[c, PREV]
                open_end = not is_task(a, c)
            if not open_end and a.weight[BY_DISTANCE] * (bound - r.row[c, LEG]) >= least:
                continue
        else:
            k = a.near_class[i, m - sides]
            u = idle_uav(a, r, k) if k >= 0 else -1
            if u < 0:
                continue
            c = LINK(u)
        if blinks > 0.0 and uniform(rng) < blinks:
            continue
        place, kind, least = try_place(a, r, t, c, place, kind, least)
    return place, kind, least


@kernel
def cost_at(a: TimedArrays, r: TimedRoutes, u: int, t: int, c: int) -> float:
    """As place_cost without a bound, for kernels that need few."""
    return float(place_cost(a, r, u, t, c, math.inf))


@kernel
def place_anywhere(a: TimedArrays, r: TimedRoutes, t: int) -> tuple[int, int, float]:
    """The cheapest place in all routes: (node before or -1, kind, cost). O(n)."""
    place, kind, least = -1, NO_VISIT, math.inf
    for u in range(a.uavs):
        c = LINK(u)
        while c < a.ends or c >= a.bases:
            place, kind, least = try_place(a, r, t, c, place, kind, least)
            c = r.link[c, NEXT]
    return place, kind, least


@kernel
def insert_task(a: TimedArrays, r: TimedRoutes, t: int, c: int, kind: int) -> None:
    """Insert t after node c, with a visit of the base if the kind says so. O(tasks)."""
    u, then = r.link[c, UAV], r.link[c, NEXT]
    before = r.row[c, LEG]
    first, last = c, then
    if kind != NO_VISIT:
        base = LINK(free_visit(a, r, u))
        r.link[base, UAV] = u
        if kind == BASE_BEFORE:
            join(a, r, u, c, base)
            before -= r.row[c, LEG]
            c = base
        else:
            join(a, r, u, base, then)
            before -= r.row[base, LEG]
            then = base
    join(a, r, u, c, t)
    join(a, r, u, t, then)
    r.link[t, UAV] = u
    r.link[t, HEAD] = r.link[c, HEAD]
    added = r.row[c, LEG] + r.row[t, LEG] - before
    r.route[u, METRES] += added
    r.sums[METRES] += added
    if not a.whole:
        r.trip[u, CARRIED] += a.fixed[t, LOAD]
        r.trip[u, FLOWN] = r.route[u, METRES]
    r.sums[UNSERVED] -= a.unserved[t - a.uavs]
    r.sums[SERVED_WORTH] += a.fixed[t, WORTH]
    r.count[SERVED] += 1
    tasks = r.route[u, TASKS]
    r.route[u, TASKS] = tasks + 1.0
    update(a, r, u, first, last, tasks)


@inline_kernel
def unlink(a: TimedArrays, r: TimedRoutes, t: int) -> None:
    """Take t out of its route; `update` has to follow. O(1)."""
    u, before, then = r.link[t, UAV], r.link[t, PREV], r.link[t, NEXT]
    metres, seconds = leg_of(a, u, before, then)
    if metres == math.inf:  # no path is known: keep the one over t
        metres = r.row[before, LEG] + r.row[t, LEG]
        seconds = r.row[before, TIME] + r.row[t, TIME]
    added = metres - r.row[before, LEG] - r.row[t, LEG]
    r.link[before, NEXT], r.link[then, PREV] = then, before
    r.row[before, LEG], r.row[before, TIME] = metres, seconds
    r.route[u, METRES] += added
    r.sums[METRES] += added
    r.link[t, UAV] = LINK(a.uavs)
    if not is_task(a, t):
        return
    if not a.whole:
        r.trip[u, CARRIED] -= a.fixed[t, LOAD]
        r.trip[u, FLOWN] = r.route[u, METRES]
    r.sums[UNSERVED] += a.unserved[t - a.uavs]
    r.sums[SERVED_WORTH] -= a.fixed[t, WORTH]
    r.count[SERVED] -= 1
    r.route[u, TASKS] -= 1.0


@kernel
def insert_in_order(a: TimedArrays, r: TimedRoutes, tasks: Ints, prizes: bool,
                    rng: RngState) -> int:
    """Insert task nodes in the given order, each where it costs least; returns how many failed.

    prizes: a task is left out if it costs more than its price. O(len(tasks) n) at worst.
    """
    missing = 0
    for i in range(tasks.size):
        t = LINK(tasks[i])
        if r.link[t, UAV] != a.uavs:
            continue
        place, kind, cost = near_place(a, r, t, True, 0.0, rng)
        if place < 0:
            place, kind, cost = place_anywhere(a, r, t)
        if place >= 0 and (not prizes or cost < a.unserved[t - a.uavs]):
            insert_task(a, r, t, LINK(place), kind)
        else:
            missing += 1
    return missing
