# SPDX-License-Identifier: Apache-2.0
"""The cheapest place of a task, beside neighbours or anywhere, and its insertion there."""
from __future__ import annotations

import math
from typing import Any

from uav_task_alloc.geometry.outline import Ints
from uav_task_alloc.geometry.pairs import is_enclosed
from uav_task_alloc.kernel import inline_kernel, inner_kernel
from uav_task_alloc.solver.rng import RngState, uniform
from uav_task_alloc.solver.routes import SIGNED
from uav_task_alloc.solver.timed import columns as at
from uav_task_alloc.solver.timed.arrays import LINK, TimedArrays, TimedRoutes
from uav_task_alloc.solver.timed.legs import join, leg_of
from uav_task_alloc.solver.timed.places import costs_less, excess_price, place_cost
from uav_task_alloc.solver.timed.segments import update
from uav_task_alloc.solver.timed.visits import (
    BASE_BEFORE,
    NO_VISIT,
    cheapest_split,
    free_visit,
)
from uav_task_alloc.solver.timed.ways import (
    TURNED,
    directions,
    face,
    has_paths,
    is_task,
    way_length,
)


@inline_kernel
def try_place(a: TimedArrays, r: TimedRoutes, t: int, c: int, place: int, kind: int,
              least: float, far: bool) -> tuple[int, int, float]:
    """The better of the place found so far and the one after node c. O(1).

    far: most places are too far, and their legs not known.
    """
    u = r.link[c, at.OF_UAV]
    for turned in range(directions(a, t)):
        if has_paths(a):
            face(a, r, t, turned == 1)
        if not far or costs_less(a, r, u, t, c, least):
            cost = place_cost(a, r, u, t, c, least)
            if cost < least:
                place, kind, least = SIGNED(c), NO_VISIT + TURNED * turned, cost
        if a.visits > 0:
            which, cost = cheapest_split(a, r, t, c, least)
            if cost < least:
                place, kind, least = SIGNED(c), which + TURNED * turned, cost
    return place, kind, least


@inline_kernel
def idle_uav(a: TimedArrays, r: TimedRoutes, k: int) -> int:
    """A UAV of fleet class k without tasks; -1: none. O(members), O(1) mostly."""
    if r.empty[k] == 0:
        return -1
    first, then = a.first_member[k], a.first_member[k + 1]
    m = r.idle[k]
    for _ in range(then - first):
        if r.route[a.members[m], at.TASKS] == 0.0:
            r.idle[k] = m
            return int(a.members[m])
        m = m + 1 if m + 1 < then else first
    return -1


@inline_kernel
def _price_of_load(a: TimedArrays, r: TimedRoutes, u: int, t: int) -> float:
    """What the load of t costs at least in UAV u's route. O(1)."""
    load, most = a.fixed[t, at.LOAD], a.limit[u, at.CARRIED]
    if a.visits > 0 or load == 0.0:
        return 0.0
    return excess_price(a.price[at.LOAD_EXCESS],
                        min(load, r.trip[u, at.CARRIED] + load - most))


@inline_kernel
def _place_beside(a: TimedArrays, r: TimedRoutes, t: int, side: int, least: float) -> Any:
    """The node before the place at that side of neighbours; -1: not cheaper than `least`. O(1).

    side: twice the index of the neighbour; one more: before it, not after it.
    """
    i = t - a.uavs
    c, apart = a.near[i, side >> 1], a.near_length[i, side >> 1]
    u, pace = r.link[c, at.OF_UAV], a.least_pace
    if u == a.uavs:
        return -1
    if side & 1 == 0:
        before, open_end = c, r.link[c, at.NEXT] >= a.ends
        leg = r.row[c, at.LEG] - way_length(a, c) - way_length(a, t)
        late = r.row[c, at.DEPARTURE] + apart * pace - a.fixed[t, at.CLOSES] - a.least_cut
    else:
        before = r.link[c, at.PREV]
        leg, open_end = r.row[c, at.LEG_TO], not is_task(a, before)
        leg -= way_length(a, before) + way_length(a, t)
        opened = max(a.fixed[t, at.OPENS], a.fixed[t, at.RELEASE]) + a.fixed[t, at.SERVICE]
        late = opened + apart * pace - r.row[c, at.LATEST] - a.least_cut
    if not open_end and a.weight[at.BY_DISTANCE] * (2.0 * apart - leg) >= least:
        return -1
    late -= r.route[u, at.WARP]  # a place can end what the route has
    if excess_price(a.price[at.WARP], late) >= least or _price_of_load(a, r, u, t) >= least:
        return -1
    return SIGNED(before)


@inline_kernel
def _with_empty_first_trip(a: TimedArrays, r: TimedRoutes, c: int) -> int:
    """The UAV of a route with node c that begins with a visit of the base; -1: not so. O(1).

    No task is beside the place before that visit.
    """
    if a.visits == 0:
        return -1
    u = r.link[c, at.OF_UAV]
    return SIGNED(u) if u < a.uavs and r.link[u, at.NEXT] >= a.bases else -1


@inline_kernel
def _within_reach(a: TimedArrays, r: TimedRoutes, t: int, side: int, least: float) -> int:
    """The first of these sides of neighbours of task t where a place may cost less. O(k).

    Most neighbours are passed over, by what a few lines of the cache hold: their legs and, where
    TimedArrays.gaps asks for it, the time from a departure to the latest start after it. So may be
    places that cost less because they end an excess.
    """
    if side & 1:
        return side
    i, k, base_way = t - a.uavs, side >> 1, a.fixed[t, at.BASE_WAY]
    weight, price = a.weight[at.BY_DISTANCE], a.price[at.WARP]
    service = a.fixed[t, at.SERVICE] - a.least_cut
    # of a leg's other end: as far, or tried at its turn, or one that needs warp to be adjacent
    pace_to_other = a.least_pace if price == math.inf else 0.0
    while k < a.near_count[i]:
        c, apart = a.near[i, k], a.near_length[i, k]
        inner, outer = apart - r.reach[c, at.INNER], base_way - r.reach[c, at.OUTER]
        if not weight * (apart + (inner if inner < outer else outer)) >= least:
            if not a.gaps:
                break
            passes = service + apart * a.least_pace
            late = passes + apart * pace_to_other - r.gap[c, at.INNER]
            inner = weight * (apart + inner) + excess_price(price, late)
            late = passes + base_way * a.least_pace - r.gap[c, at.OUTER]
            outer = weight * (apart + outer) + excess_price(price, late)
            if not (inner if inner < outer else outer) >= least:
                break
        k += 1
    return int(side if k == side >> 1 else 2 * k)


@inline_kernel
def near_place(a: TimedArrays, r: TimedRoutes, t: int, opens: bool, blinks: float, most: float,
               rng: RngState) -> tuple[int, int, float]:
    """The cheapest place beside neighbours and in empty routes: (node before, kind, cost). O(k).

    TURNED is part of the kind; the node is -1 where none costs less than `most`. A place that ends
    an excess may be passed over.

    opens: empty routes are tried, too. Each place is skipped with probability `blinks`, but for
    an empty first trip.
    """
    i, place, kind, least = t - a.uavs, -1, NO_VISIT, most
    sides, m = 2 * a.near_count[i], -1
    last = sides + (a.near_class.shape[1] if opens else 0)
    while True:
        m = _within_reach(a, r, t, m + 1, least)
        if m >= last:
            break
        if m < sides:
            before = _place_beside(a, r, t, m, least)
            u = _with_empty_first_trip(a, r, a.near[i, m >> 1]) if m & 1 == 0 else -1
            if u >= 0:
                place, kind, least = try_place(a, r, t, LINK(u), place, kind, least, False)
        else:
            k = a.near_class[i, m - sides]
            before = idle_uav(a, r, k) if k >= 0 else -1
        if before < 0 or (blinks > 0.0 and uniform(rng) < blinks):
            continue
        place, kind, least = try_place(a, r, t, LINK(before), place, kind, least, False)
    return place, kind, least


@inner_kernel
def place_anywhere(a: TimedArrays, r: TimedRoutes, t: int) -> tuple[int, int, float]:
    """The cheapest place in all routes: (node before or -1, kind, cost). O(n)."""
    place, kind, least = -1, NO_VISIT, math.inf
    for u in range(a.uavs):
        c = LINK(u)
        while c < a.ends or c >= a.bases:
            place, kind, least = try_place(a, r, t, c, place, kind, least, not a.straight)
            c = r.link[c, at.NEXT]
    return place, kind, least


@inner_kernel
def insert_task(a: TimedArrays, r: TimedRoutes, t: int, c: int, kind: int) -> None:
    """Insert t after node c, turned or with a visit of the base if kind says so. O(tasks)."""
    if has_paths(a):
        face(a, r, t, kind >= TURNED)
        kind &= TURNED - 1
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
    metres, seconds = leg_of(a, r, u, before, then)
    if metres == math.inf:  # no path is known: keep the one over t
        metres = r.row[before, at.LEG] + r.row[t, at.LEG]
        seconds = r.row[before, at.TIME] + r.row[t, at.TIME]
    added = metres - r.row[before, at.LEG] - r.row[t, at.LEG]
    r.link[before, at.NEXT], r.link[then, at.PREV] = then, before
    r.row[before, at.LEG], r.row[before, at.TIME] = metres, seconds
    r.row[then, at.LEG_TO] = metres
    r.route[u, at.METRES] += added
    r.sums[at.METRES] += added
    r.link[t, at.OF_UAV] = LINK(a.uavs)
    r.reach[t, at.INNER] = r.reach[t, at.OUTER] = -math.inf
    if not is_task(a, t):
        return
    if not a.whole:
        r.trip[u, at.CARRIED] -= a.fixed[t, at.LOAD]
        r.trip[u, at.FLOWN] = r.route[u, at.METRES]
    r.sums[at.UNSERVED_COST] += a.unserved[t - a.uavs]
    r.sums[at.SERVED_WORTH] -= a.fixed[t, at.WORTH]
    r.counts[at.SERVED] -= 1
    r.route[u, at.TASKS] -= 1.0


@inner_kernel
def insert_in_order(a: TimedArrays, r: TimedRoutes, tasks: Ints, prizes: bool, most: int,
                    rng: RngState) -> int:
    """Insert task nodes in the given order, each where it costs least. O(len(tasks) k + most)

    prizes: a task is left out if it costs more than its price; most: places that are tried for
    tasks that may not be beside any neighbour. Returns the index from which on such tasks were
    tried nowhere else, len(tasks): none was.
    """
    limited = tasks.size
    for i in range(tasks.size):
        t = LINK(tasks[i])
        if r.link[t, at.OF_UAV] != a.uavs:
            continue
        place, kind, cost = near_place(a, r, t, True, 0.0, math.inf, rng)
        if place < 0 and limited == tasks.size and not is_enclosed(a.pairs, a.point[t]):
            most -= a.uavs + r.counts[at.SERVED]
            if most >= 0:
                place, kind, cost = place_anywhere(a, r, t)
            else:
                limited = i
        if place >= 0 and (not prizes or cost < a.unserved[t - a.uavs]):
            insert_task(a, r, t, LINK(place), kind)
    return int(limited)
