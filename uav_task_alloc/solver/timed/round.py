# SPDX-License-Identifier: Apache-2.0
"""A round of ruin and recreate with time: what it removed and saved, and how all of it is undone.

Before a route changes, its rows are copied; undoing copies them back.
"""
from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from uav_task_alloc.geometry.outline import Floats, Ints
from uav_task_alloc.kernel import inline_kernel
from uav_task_alloc.solver.timed import columns as at
from uav_task_alloc.solver.timed.arrays import LINK, Links, TimedArrays, TimedRoutes, node_count
from uav_task_alloc.solver.timed.legs import slot_of
from uav_task_alloc.solver.timed.segments import set_gaps, set_reach
from uav_task_alloc.solver.timed.ways import has_paths, is_task

ORDERS = 15  # weights of the orders of insertion
# entries of Round.counts
SAVED, SAVED_ROUTES, REMOVED, ABSENT, SERIAL, PATIENCE = range(6)


class Round(NamedTuple):
    """What a round of ruin and recreate changes, and what rounds start at."""

    node: Links  # (nodes) saved rows: their nodes
    link: Links  # (nodes, 4)
    way: Links  # (nodes, 2)
    row: Floats  # (nodes, columns from START)
    uav: Ints  # (m) saved routes: their UAVs
    route: Floats  # (m, columns from WARP)
    trip: Floats  # (slots, 4)
    sums: Floats  # (10)
    routes_count: Ints  # (2) TimedRoutes.counts before the round
    removed: Links  # task nodes to be inserted
    order: Floats  # sort key of each: smallest first
    saved_in: Ints  # (m) serial of the round that saved this route last
    absent: Links  # task nodes in no route at the last listing
    counts: Ints  # (6)


def empty_round(a: TimedArrays) -> Round:
    """An empty round with room for any."""
    nodes, m, n = node_count(a), a.uavs, a.ends - a.uavs
    return Round(np.empty(nodes, LINK), np.empty((nodes, 4), LINK), np.empty((nodes, 2), LINK),
                 np.empty((nodes, at.ROW_COLUMNS)), np.empty(m, np.int64),
                 np.empty((m, at.ROUTE_COLUMNS)), np.empty((len(a.limit), at.TRIP_COLUMNS)),
                 np.empty(at.SUM_COLUMNS), np.empty(2, np.int64), np.empty(n + 1, LINK),
                 np.empty(n + 1), np.full(m, -1, np.int64), np.empty(n + 1, LINK),
                 np.zeros(6, np.int64))


@inline_kernel
def begin_round(r: TimedRoutes, w: Round) -> None:
    """Begin a round. O(1)."""
    w.counts[SAVED] = w.counts[SAVED_ROUTES] = w.counts[REMOVED] = 0
    w.counts[SERIAL] += 1
    for c in range(at.SUM_COLUMNS):
        w.sums[c] = r.sums[c]
    w.routes_count[0], w.routes_count[1] = r.counts[0], r.counts[1]


@inline_kernel
def _copy_node(a: TimedArrays, of: TimedRoutes | Round, k: int, to: TimedRoutes | Round,
               i: int) -> None:
    """Copy the node at k of one to i of the other, without its trip. O(1)."""
    for c in range(4):
        to.link[i, c] = of.link[k, c]
    if has_paths(a):
        to.way[i, 0], to.way[i, 1] = of.way[k, 0], of.way[k, 1]
    for c in range(at.RATE):
        to.row[i, c] = of.row[k, c]
    if a.whole or a.timed_cost:
        for c in range(at.RATE, at.ROW_COLUMNS):
            to.row[i, c] = of.row[k, c]


@inline_kernel
def save_route(a: TimedArrays, r: TimedRoutes, w: Round, u: int) -> None:
    """Save UAV u's route, once in a round. O(tasks)."""
    if w.saved_in[u] == w.counts[SERIAL]:
        return
    w.saved_in[u] = w.counts[SERIAL]
    k = w.counts[SAVED_ROUTES]
    w.uav[k] = u
    w.counts[SAVED_ROUTES] += 1
    for c in range(at.ROUTE_COLUMNS):
        w.route[k, c] = r.route[u, c]
    i, k, end = LINK(u), w.counts[SAVED], a.ends + u
    while True:
        w.node[k] = i
        _copy_node(a, r, i, w, k)
        if not is_task(a, i) and i != end:
            slot = slot_of(a, i)
            for c in range(at.TRIP_COLUMNS):
                w.trip[slot, c] = r.trip[slot, c]
        k += 1
        if i == end:
            break
        i = r.link[i, at.NEXT]
    w.counts[SAVED] = k


@inline_kernel
def take_back(a: TimedArrays, r: TimedRoutes, w: Round) -> None:
    """Restore all routes that the round changed. O(their tasks)."""
    for k in range(w.counts[REMOVED]):
        r.link[w.removed[k], at.OF_UAV] = LINK(a.uavs)
        r.reach[w.removed[k], at.INNER] = r.reach[w.removed[k], at.OUTER] = -math.inf
    for k in range(w.counts[SAVED_ROUTES]):
        u = w.uav[k]
        if (r.route[u, at.TASKS] == 0.0) != (w.route[k, at.TASKS] == 0.0):
            r.empty[a.class_of[u]] += 1 if w.route[k, at.TASKS] == 0.0 else -1
        for c in range(at.ROUTE_COLUMNS):
            r.route[u, c] = w.route[k, c]
        for base in range(a.bases + u * a.visits, a.bases + (u + 1) * a.visits):
            r.link[base, at.OF_UAV] = LINK(a.uavs)
    for k in range(w.counts[SAVED]):
        i = w.node[k]
        _copy_node(a, w, k, r, i)
        if is_task(a, i):
            set_reach(a, r, i)
        elif i < a.uavs or i >= a.bases:
            slot = slot_of(a, i)
            for c in range(at.TRIP_COLUMNS):
                r.trip[slot, c] = w.trip[slot, c]
    if a.gaps:
        for k in range(w.counts[SAVED_ROUTES]):
            set_gaps(a, r, w.uav[k], a.ends + w.uav[k])
    for c in range(at.SUM_COLUMNS):
        r.sums[c] = w.sums[c]
    r.counts[0], r.counts[1] = w.routes_count[0], w.routes_count[1]


@inline_kernel
def note_removed(r: TimedRoutes, w: Round, t: int) -> None:
    """Put t on the list of tasks to be inserted. O(1)."""
    w.removed[w.counts[REMOVED]] = t
    w.counts[REMOVED] += 1
