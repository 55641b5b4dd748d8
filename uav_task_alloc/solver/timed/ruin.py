# SPDX-License-Identifier: Apache-2.0
"""Ruin and recreate with time: strings of tasks are removed and inserted again.

Christiaens and Vanden Berghe, Slack Induction by String Removals for Vehicle Routing Problems,
Transportation Science 54 (2020).
"""
from __future__ import annotations

import math
from typing import Any

from uav_task_alloc.kernel import inline_kernel, inner_kernel
from uav_task_alloc.solver.rng import RngState, below, uniform
from uav_task_alloc.solver.ruin import MAX_STRING, PRESERVE_RATE, SPLIT_RATE
from uav_task_alloc.solver.timed import columns as at
from uav_task_alloc.solver.timed.arrays import LINK, TimedArrays, TimedRoutes
from uav_task_alloc.solver.timed.insertion import (
    idle_uav,
    insert_task,
    near_place,
    place_anywhere,
    unlink,
)
from uav_task_alloc.solver.timed.places import cheapest_direction
from uav_task_alloc.solver.timed.round import (
    ABSENT,
    ORDERS,
    REMOVED,
    SERIAL,
    Round,
    note_removed,
    save_route,
)
from uav_task_alloc.solver.timed.route_sums import cost_of
from uav_task_alloc.solver.timed.segments import update
from uav_task_alloc.solver.timed.ways import is_task

ABSENT_SEED_RATE = 0.5  # share of rounds that start at an absent task, if there is one
# share of tasks without a place among neighbours, or without one at their price, that try all
ANYWHERE_RATE = 0.02


@inline_kernel
def _may_begin_at_base(a: TimedArrays, u: int) -> bool:
    """Whether UAV u may need a visit of its base before its first task. O(1)."""
    later = a.uavs + u * a.visits
    return bool(a.begin[u, at.GROUNDED] == 0.0 or a.limit[u, at.FLOWN] < a.limit[later, at.FLOWN]
            or a.limit[u, at.AIRBORNE] < a.limit[later, at.AIRBORNE]
            or a.limit[u, at.CARRIED] < a.limit[later, at.CARRIED])


@inline_kernel
def drop_idle_visits(a: TimedArrays, r: TimedRoutes, u: int) -> None:
    """Take visits of the base out of UAV u's route that begin or end no trip. O(tasks)."""
    i, end = r.link[u, at.NEXT], a.ends + u
    while i != end:
        then, last = r.link[i, at.NEXT], r.link[i, at.PREV]
        if not is_task(a, i):
            idle = not is_task(a, last) and not (last == u and _may_begin_at_base(a, u))
            if idle or not is_task(a, then):
                unlink(a, r, i)
        i = then


@inline_kernel
def _remove_string(a: TimedArrays, r: TimedRoutes, w: Round, c: int, size: int,
                   rng: RngState) -> None:
    """Remove `size` tasks around c; sometimes preserve a substring. O(tasks of the route)."""
    u = r.link[c, at.OF_UAV]
    tasks = r.route[u, at.TASKS]
    count, preserved = int(tasks), 0
    if size > 1 and size < count and uniform(rng) < SPLIT_RATE:
        preserved = 1
        while size + preserved < count and uniform(rng) < PRESERVE_RATE:
            preserved += 1
    t, back = c, below(rng, size + preserved)
    while back > 0 and r.link[t, at.PREV] >= a.uavs:
        t, back = r.link[t, at.PREV], back - 1
    keep_from = 1 + below(rng, size - 1) if preserved > 0 else size
    first, i = r.link[t, at.PREV], 0
    while i < size + preserved and (t < a.ends or t >= a.bases):
        then = r.link[t, at.NEXT]
        if is_task(a, t):
            if i < keep_from or i >= keep_from + preserved:
                unlink(a, r, t)
                note_removed(r, w, t)
            i += 1
        t = then
    if a.visits > 0:
        drop_idle_visits(a, r, u)
    update(a, r, u, first, t, tasks)


@inline_kernel
def list_absent(a: TimedArrays, r: TimedRoutes, w: Round) -> None:
    """List the tasks in no route that could be in one. O(n)."""
    w.counts[ABSENT] = 0
    for t in range(a.uavs, a.ends):
        if r.link[t, at.OF_UAV] == a.uavs and a.unserved[t - a.uavs] > 0.0:
            w.absent[w.counts[ABSENT]] = t
            w.counts[ABSENT] += 1


@inline_kernel
def _seed(a: TimedArrays, r: TimedRoutes, w: Round, rng: RngState) -> Any:
    """The task that a round starts at: often one in no route. O(1)."""
    if w.counts[ABSENT] > 0 and uniform(rng) < ABSENT_SEED_RATE:
        t = w.absent[below(rng, w.counts[ABSENT])]
        if r.link[t, at.OF_UAV] == a.uavs:
            return t
    return LINK(a.uavs + below(rng, a.ends - a.uavs))


@inner_kernel
def ruin_strings(a: TimedArrays, r: TimedRoutes, w: Round, mean: float, most_absent: int,
                 skipped: float, rng: RngState) -> Any:
    """Remove about `mean` tasks in strings of routes around a random task; returns that. O(k).

    most_absent: absent tasks around it that are to be inserted, too; each of them but that task is
    passed over with probability `skipped`.
    """
    none = a.uavs
    seed = _seed(a, r, w, rng)
    used = 0
    for k in range(a.first_member.size - 1):
        used += a.first_member[k + 1] - a.first_member[k] - r.empty[k]
    served = max(1.0, r.counts[at.SERVED] / max(1, used))
    longest = min(float(MAX_STRING), served)
    strings = int(1.0 + uniform(rng) * (4.0 * mean / (1.0 + longest) - 1.0))
    left_out = 0
    for m in range(-1, a.near_count[seed - a.uavs]):
        c = seed if m < 0 else a.near[seed - a.uavs, m]
        u = r.link[c, at.OF_UAV]
        if u == none:
            passed_over = skipped > 0.0 and m >= 0 and uniform(rng) < skipped
            if (not passed_over and left_out < most_absent and a.unserved[c - a.uavs] > 0.0
                    and not _is_taken(w, c)):
                note_removed(r, w, c)
                left_out += 1
        elif strings > 0 and w.saved_in[u] != w.counts[SERIAL]:
            save_route(a, r, w, u)
            size = 1 + int(uniform(rng) * min(longest, r.route[u, at.TASKS]))
            _remove_string(a, r, w, c, size, rng)
            strings -= 1
        if strings == 0 and (w.counts[ABSENT] == 0 or left_out >= most_absent):
            break
    return seed


@inline_kernel
def _is_taken(w: Round, c: int) -> bool:
    """Whether c is on the list of tasks to be inserted. O(removed)."""
    found = False
    for k in range(w.counts[REMOVED]):
        found = found or w.removed[k] == c
    return found


@inline_kernel
def _sort_removed(a: TimedArrays, w: Round, by_value: float, rng: RngState) -> None:
    """Sort removed tasks: at random, or by load, distance, value or window. O(removed^2).

    by_value: share of rounds that sort by value and chance in any case.
    """
    kind = below(rng, ORDERS)
    if by_value > 0.0 and uniform(rng) < by_value:
        kind = ORDERS
    for i in range(w.counts[REMOVED]):
        t = w.removed[i]
        if kind < 4:
            key = uniform(rng)
        elif kind < 6:
            key = -a.fixed[t, at.LOAD]
        elif kind < 8:
            key = -a.fixed[t, at.REMOTE]
        elif kind == 8:
            key = a.fixed[t, at.REMOTE]
        elif kind < 11:
            key = a.fixed[t, at.WIDTH]
        elif kind == 11:
            key = a.fixed[t, at.OPENS]
        elif kind == 12:
            key = -a.fixed[t, at.CLOSES]
        elif kind == ORDERS:
            key = -a.unserved[t - a.uavs] * (0.5 + uniform(rng))
        else:
            key = -a.unserved[t - a.uavs]
        place = i
        while place > 0 and w.order[place - 1] > key:
            w.order[place], w.removed[place] = w.order[place - 1], w.removed[place - 1]
            place -= 1
        w.order[place], w.removed[place] = key, t


@inline_kernel
def insert_saved(a: TimedArrays, r: TimedRoutes, w: Round, t: int, place: int,
                 kind: int) -> None:
    """Insert t after node `place`, whose route is saved before. O(tasks)."""
    save_route(a, r, w, r.link[place, at.OF_UAV])
    insert_task(a, r, t, place, kind)


@inner_kernel
def open_route(a: TimedArrays, r: TimedRoutes, w: Round, t: int) -> None:
    """Insert t into an empty route, whatever that costs, if one may serve it. O(classes)."""
    for m in range(a.near_class.shape[1]):
        k = a.near_class[t - a.uavs, m]
        u = idle_uav(a, r, k) if k >= 0 else -1
        if u < 0:
            continue
        kind = cheapest_direction(a, r, LINK(u), t, LINK(u))
        if kind >= 0:
            insert_saved(a, r, w, t, LINK(u), kind)
            break


@inner_kernel
def insert_removed(a: TimedArrays, r: TimedRoutes, w: Round, generous: float, by_value: float,
                   blinks: float, limit: float, rng: RngState) -> None:
    """Insert removed tasks where each costs least. O(removed k).

    generous: a task is inserted where it costs less than so many times its price; by_value: share
    of rounds that insert about the most valuable tasks first; limit: ends where all would cost
    that much even if the rest cost nothing.
    """
    _sort_removed(a, w, by_value, rng)
    waiting = 0.0
    for i in range(w.counts[REMOVED]):
        if r.link[w.removed[i], at.OF_UAV] == a.uavs:
            waiting += a.unserved[w.removed[i] - a.uavs]
    for i in range(w.counts[REMOVED]):
        t = w.removed[i]
        if r.link[t, at.OF_UAV] != a.uavs:
            continue
        most = generous * a.unserved[t - a.uavs]
        place, kind, cost = near_place(a, r, t, True, blinks, most if a.gaps else math.inf, rng)
        if place < 0 and uniform(rng) < ANYWHERE_RATE:
            place, kind, cost = place_anywhere(a, r, t)
        if place >= 0 and cost < most:
            insert_saved(a, r, w, t, LINK(place), kind)
        waiting -= a.unserved[t - a.uavs]
        if cost_of(a, r.sums) - waiting >= limit:
            break
