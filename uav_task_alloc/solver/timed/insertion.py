# SPDX-License-Identifier: Apache-2.0
"""Places for a task: what each costs, in O(1), by the segments before and after it."""
from __future__ import annotations

import math

from uav_task_alloc.geometry.outline import Ints
from uav_task_alloc.kernel import inline_kernel, kernel
from uav_task_alloc.solver.rng import RngState, uniform
from uav_task_alloc.solver.routes import SIGNED
from uav_task_alloc.solver.timed import columns as at
from uav_task_alloc.solver.timed.arrays import LINK, TOLERANCE, TimedArrays, TimedRoutes
from uav_task_alloc.solver.timed.segments import after_leg, is_task, join, leg_of, slot_of, update

NO_VISIT, BASE_BEFORE, BASE_AFTER = range(3)  # kinds of places: with a base visit or without


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
def _cost_of_delay(a: TimedArrays, r: TimedRoutes, u: int, t: int, start: float, then: int,
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
        cost += a.weight[at.BY_FINISH] * max(0.0, end - r.sums[at.FINISH])
    if r.route[u, at.TASKS] == 0.0:
        cost += a.weight[at.BY_END] * r.row[then, at.START]
    return float(cost)


@inline_kernel
def _fits_trip(a: TimedArrays, u: int, t: int, head: int) -> bool:
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
        lasts = _lasts(a, r, c, t, r.link[c, at.NEXT], seconds, further)
        most, scale = a.limit[slot, at.AIRBORNE], a.begin[u, at.CRUISE]
        known = r.trip[slot, at.AIRBORNE] - most
        cost += cost_of_excess(a.price[at.ENDURANCE_EXCESS], scale * known, scale * (lasts - most))
    return float(cost)


@inline_kernel
def place_cost(a: TimedArrays, r: TimedRoutes, u: int, t: int, c: int, least: float) -> float:
    """Cost of inserting t after node c of UAV u's route; >= least if not less. O(1)."""
    then = r.link[c, at.NEXT]
    metres, seconds = leg_of(a, u, c, t)
    more, further = leg_of(a, u, t, then)
    added = metres + more - r.row[c, at.LEG]
    cost = a.weight[at.BY_DISTANCE] * added
    if cost >= least or not added < math.inf:
        return math.inf
    head = r.link[c, at.HEAD] if a.whole else LINK(u)
    if not _fits_trip(a, u, t, head):
        return math.inf
    slot = slot_of(a, head)
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
    arrival = after_leg(a, start + a.fixed[t, at.SERVICE], further, then)
    late = arrival - r.row[then, at.LATEST]
    if late > 0.0:
        warp += late
    known = r.route[u, at.WARP]
    warp += r.row[c, at.WARP_BEFORE] + r.row[then, at.WARP_AFTER]
    cost += cost_of_excess(a.price[at.WARP], known, warp)
    if cost >= least:
        return math.inf
    cost += _trip_excess(a, r, u, t, c, slot, added, seconds, further)
    if a.timed_cost and cost < least:
        cost += _cost_of_delay(a, r, u, t, start, then, arrival)
    return float(cost)


@inline_kernel
def _lasts(a: TimedArrays, r: TimedRoutes, c: int, t: int, then: int, seconds: float,
           further: float) -> float:
    """Shortest duration [s] of the trip with t between nodes c and `then`. O(1)."""
    lasted = r.row[c, at.LASTED] + seconds
    opened = max(a.fixed[t, at.OPENS], a.fixed[t, at.RELEASE] + seconds)
    wait = max(0.0, opened - lasted - r.row[c, at.LEFT])
    left = min(r.row[c, at.LEFT], a.fixed[t, at.CLOSES] - lasted)
    lasted += wait + a.fixed[t, at.SERVICE] + further
    if then >= a.ends:
        return float(lasted)
    opened = max(r.row[then, at.EARLY], a.fixed[then, at.RELEASE] + further)
    wait = max(0.0, opened - lasted - left)
    return float(lasted + wait + r.row[then, at.LASTS])


@inline_kernel
def split_cost(a: TimedArrays, r: TimedRoutes, u: int, t: int, c: int, kind: int,
               base: int, least: float) -> float:
    """Cost of inserting t after node c, with a visit of the base before or after it. O(1)."""
    then, head = r.link[c, at.NEXT], r.link[c, at.HEAD]
    before = kind == BASE_AFTER  # t is in the trip before the visit
    if not _fits_trip(a, u, t, head if before else base):
        return math.inf
    i, j = (t, base) if before else (base, t)
    first, first_time = leg_of(a, u, c, i)
    second, second_time = leg_of(a, u, i, j)
    third, third_time = leg_of(a, u, j, then)
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
def _split_times(a: TimedArrays, r: TimedRoutes, u: int, t: int, c: int, before: bool, base: int,
                 first: float, second: float, third: float) -> float:
    """The part of split_cost that is due to times; first to third are the legs' [s]. O(1)."""
    then, head = r.link[c, at.NEXT], r.link[c, at.HEAD]
    slot, other = slot_of(a, head), slot_of(a, base)
    departure, hold = r.row[c, at.DEPARTURE], r.row[head, at.DEPARTURE]
    warp = r.row[c, at.WARP_BEFORE]
    left, lasted = r.row[c, at.LEFT], r.row[c, at.LASTED]
    if before and a.fixed[t, at.TRIP_RELEASE] > -math.inf:
        departure = max(departure, a.fixed[t, at.TRIP_RELEASE] + lasted)
        warp += max(0.0, a.fixed[t, at.TRIP_RELEASE] - left)
    turn = a.fixed[base, at.SERVICE]
    if before:
        start = after_leg(a, departure, first, t)
        start = max(start, a.fixed[t, at.OPENS])
        late = max(0.0, start - a.fixed[t, at.CLOSES])
        start, warp = start - late, warp + late
        lasted += first
        opened = max(a.fixed[t, at.OPENS], a.fixed[t, at.RELEASE] + first)
        lasts = lasted + (
            max(0.0, opened - lasted - left) + a.fixed[t, at.SERVICE] + second)
        # the releases of the trip may be those of tasks after the visit
        departure = max(start + a.fixed[t, at.SERVICE] + second + turn, hold)
        arrival = after_leg(a, departure, third, then)
        rest = third + r.row[then, at.LASTS] if then < a.ends else third
    else:
        lasts = lasted + first
        departure = max(departure + first + turn, hold)
        departure = max(departure, a.fixed[t, at.TRIP_RELEASE])
        start = max(after_leg(a, departure, second, t), a.fixed[t, at.OPENS])
        late = max(0.0, start - a.fixed[t, at.CLOSES])
        start, warp = start - late, warp + late
        arrival = after_leg(a, start + a.fixed[t, at.SERVICE], third, then)
        rest = second + a.fixed[t, at.SERVICE] + third
        if then < a.ends:
            opened = max(r.row[then, at.EARLY], a.fixed[then, at.RELEASE] + third)
            wait = max(0.0, opened - rest - (a.fixed[t, at.CLOSES] - second))
            rest += wait + r.row[then, at.LASTS]
    late = arrival - r.row[then, at.LATEST]
    warp += r.row[then, at.WARP_AFTER] + max(0.0, late)
    cost = cost_of_excess(a.price[at.WARP], r.route[u, at.WARP], warp)
    most = a.limit[slot, at.AIRBORNE]
    was = max(0.0, r.trip[slot, at.AIRBORNE] - most)
    now = max(0.0, lasts - most) + max(0.0, rest - a.limit[other, at.AIRBORNE])
    scale = a.begin[u, at.CRUISE]
    cost += cost_of_excess(a.price[at.ENDURANCE_EXCESS], scale * was, scale * now)
    if a.timed_cost:
        cost += _cost_of_delay(a, r, u, t, start, then, arrival)
    return float(cost)


@inline_kernel
def free_visit(a: TimedArrays, r: TimedRoutes, u: int) -> int:
    """A base visit of UAV u that is in no route; -1: none. O(visits)."""
    for base in range(a.bases + u * a.visits, a.bases + (u + 1) * a.visits):
        if r.link[base, at.OF_UAV] != u and a.fixed[base, at.SERVICE] < math.inf:
            return base
    return -1


@kernel
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


@inline_kernel
def try_place(a: TimedArrays, r: TimedRoutes, t: int, c: int, place: int, kind: int,
              least: float) -> tuple[int, int, float]:
    """The better of the place found so far and the one after node c. O(1)."""
    u = r.link[c, at.OF_UAV]
    cost = place_cost(a, r, u, t, c, least)
    if cost < least:
        place, kind, least = SIGNED(c), NO_VISIT, cost
    if a.visits > 0:
        which, cost = cheapest_split(a, r, t, c, least)
        if cost < least:
            place, kind, least = SIGNED(c), which, cost
    return place, kind, least


@inline_kernel
def idle_uav(a: TimedArrays, r: TimedRoutes, k: int) -> int:
    """A UAV of fleet class k without tasks; -1: none. O(members), O(1) if there is none."""
    if r.empty[k] == 0:
        return -1
    for m in range(a.first_member[k], a.first_member[k + 1]):
        if r.route[a.members[m], at.TASKS] == 0.0:
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
            if r.link[c, at.OF_UAV] == a.uavs:
                continue
            bound = 2.0 * a.near_length[i, m >> 1]
            if m & 1 == 0:
                open_end = r.link[c, at.NEXT] >= a.ends
            else:
                c = r.link[c, at.PREV]
                open_end = not is_task(a, c)
            if not open_end and a.weight[at.BY_DISTANCE] * (bound - r.row[c, at.LEG]) >= least:
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
            c = r.link[c, at.NEXT]
    return place, kind, least


@kernel
def insert_task(a: TimedArrays, r: TimedRoutes, t: int, c: int, kind: int) -> None:
    """Insert t after node c, with a visit of the base if the kind says so. O(tasks)."""
    u, then = r.link[c, at.OF_UAV], r.link[c, at.NEXT]
    before = r.row[c, at.LEG]
    first, last = c, then
    if kind != NO_VISIT:
        base = LINK(free_visit(a, r, u))
        r.link[base, at.OF_UAV] = u
        if kind == BASE_BEFORE:
            join(a, r, u, c, base)
            before -= r.row[c, at.LEG]
            c = base
        else:
            join(a, r, u, base, then)
            before -= r.row[base, at.LEG]
            then = base
    join(a, r, u, c, t)
    join(a, r, u, t, then)
    r.link[t, at.OF_UAV] = u
    r.link[t, at.HEAD] = r.link[c, at.HEAD]
    added = r.row[c, at.LEG] + r.row[t, at.LEG] - before
    r.route[u, at.METRES] += added
    r.sums[at.METRES] += added
    if not a.whole:
        r.trip[u, at.CARRIED] += a.fixed[t, at.LOAD]
        r.trip[u, at.FLOWN] = r.route[u, at.METRES]
    r.sums[at.UNSERVED_COST] -= a.unserved[t - a.uavs]
    r.sums[at.SERVED_WORTH] += a.fixed[t, at.WORTH]
    r.counts[at.SERVED] += 1
    tasks = r.route[u, at.TASKS]
    r.route[u, at.TASKS] = tasks + 1.0
    update(a, r, u, first, last, tasks)


@inline_kernel
def unlink(a: TimedArrays, r: TimedRoutes, t: int) -> None:
    """Take t out of its route; `update` has to follow. O(1)."""
    u, before, then = r.link[t, at.OF_UAV], r.link[t, at.PREV], r.link[t, at.NEXT]
    metres, seconds = leg_of(a, u, before, then)
    if metres == math.inf:  # no path is known: keep the one over t
        metres = r.row[before, at.LEG] + r.row[t, at.LEG]
        seconds = r.row[before, at.TIME] + r.row[t, at.TIME]
    added = metres - r.row[before, at.LEG] - r.row[t, at.LEG]
    r.link[before, at.NEXT], r.link[then, at.PREV] = then, before
    r.row[before, at.LEG], r.row[before, at.TIME] = metres, seconds
    r.route[u, at.METRES] += added
    r.sums[at.METRES] += added
    r.link[t, at.OF_UAV] = LINK(a.uavs)
    if not is_task(a, t):
        return
    if not a.whole:
        r.trip[u, at.CARRIED] -= a.fixed[t, at.LOAD]
        r.trip[u, at.FLOWN] = r.route[u, at.METRES]
    r.sums[at.UNSERVED_COST] += a.unserved[t - a.uavs]
    r.sums[at.SERVED_WORTH] -= a.fixed[t, at.WORTH]
    r.counts[at.SERVED] -= 1
    r.route[u, at.TASKS] -= 1.0


@kernel
def insert_in_order(a: TimedArrays, r: TimedRoutes, tasks: Ints, prizes: bool,
                    rng: RngState) -> int:
    """Insert task nodes in the given order, each where it costs least; returns how many failed.

    prizes: a task is left out if it costs more than its price. O(len(tasks) n) at worst.
    """
    missing = 0
    for i in range(tasks.size):
        t = LINK(tasks[i])
        if r.link[t, at.OF_UAV] != a.uavs:
            continue
        place, kind, cost = near_place(a, r, t, True, 0.0, rng)
        if place < 0:
            place, kind, cost = place_anywhere(a, r, t)
        if place >= 0 and (not prizes or cost < a.unserved[t - a.uavs]):
            insert_task(a, r, t, LINK(place), kind)
        else:
            missing += 1
    return missing
