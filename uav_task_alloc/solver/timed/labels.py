# SPDX-License-Identifier: Apache-2.0
"""The best route of one UAV beside those of the others, by labels.

A label is a way to a task. It is dropped where another one there is no later, no longer and no
heavier, earned no less, and visited no task near by that it has not (labels: Feillet et al. 2004;
ng-routes: Baldacci, Mingozzi and Roberti 2011). A task keeps a limited number, so the best route
may be missed. For the objective of distance alone, one trip, no limit of its duration, and tasks
without paths; ranges are kept, soft ones too.
"""
from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from uav_task_alloc.geometry.outline import Floats
from uav_task_alloc.kernel import inline_kernel, inner_kernel, kernel
from uav_task_alloc.solver.timed import columns as at
from uav_task_alloc.solver.timed.arrays import TOLERANCE, TimedArrays, TimedRoutes
from uav_task_alloc.solver.timed.legs import after_leg, leg_of

LABELS = 8  # at the same time for each that may be kept, about
NEAR_TASKS = 8  # of a task, which ways to it remember: with 12 no more is found, with 4 less
BUCKETS = 400  # of labels by time
# columns of Labels.value, Labels.link and Labels.home; GONE: 1 where it was dropped
DEPARTED, EARNED, WAY_LENGTH, TAKEN = range(4)
AT_NODE, BEFORE, LATER, GONE = range(4)
HOME_METRES, HOME_SECONDS = range(2)


class Labels(NamedTuple):
    """Ways of one UAV to tasks: l labels, n tasks, w words of 64 bits."""

    value: Floats  # (l, 4) columns from DEPARTED: departure [s], price earned, way [m], load [kg]
    link: NDArray[np.int64]  # (l, 4) columns from AT_NODE
    visited: NDArray[np.uint64]  # (l, w) a bit a task
    near: NDArray[np.uint64]  # (n, w) a bit a task: the nearest to it
    front: NDArray[np.int64]  # (n, kept) labels at each task
    kept: NDArray[np.int64]  # (n) how many
    bucket: NDArray[np.int64]  # (buckets) first label, next ones by LATER; -1: none
    open: NDArray[np.bool_]  # (n) in no route, or in that of the UAV
    home: Floats  # (n, 2) columns HOME_METRES and HOME_SECONDS of the leg to the end of the route


def empty_labels(tasks: int, kept: int) -> Labels:
    """Room for labels.

    Args:
        tasks: of the problem.
        kept: labels at a task, at most.
    """
    count, words = (2 * LABELS * kept + 1) * tasks + 1, (tasks + 63) // 64
    return Labels(np.empty((count, 4)), np.empty((count, 4), np.int64),
                  np.zeros((count, words), np.uint64), np.zeros((tasks, words), np.uint64),
                  np.empty((tasks, kept), np.int64), np.empty(tasks, np.int64),
                  np.empty(BUCKETS, np.int64), np.empty(tasks, np.bool_), np.empty((tasks, 2)))


@inline_kernel
def _bit(i: int) -> np.uint64:
    """The bit of task i in its word."""
    return np.uint64(1) << np.uint64(i & 63)


@inline_kernel
def _begin(a: TimedArrays, r: TimedRoutes, u: int, w: Labels) -> None:
    """Set what labels of UAV u need to know of tasks, and its first label. O(n)."""
    w.bucket[:], w.near[:], w.kept[:] = -1, 0, 0
    for i in range(a.ends - a.uavs):
        t = a.uavs + i
        w.open[i] = ((r.link[t, at.OF_UAV] == a.uavs or r.link[t, at.OF_UAV] == u)
                     and (not a.restricted[i] or a.compatible[0, u, i]))
        w.home[i, HOME_METRES], w.home[i, HOME_SECONDS] = leg_of(a, r, u, t, a.ends + u)
        for k in range(min(NEAR_TASKS, a.near_count[i])):
            j = int(a.near[i, k]) - a.uavs
            w.near[i, j >> 6] |= _bit(j)
    w.value[0, DEPARTED], w.value[0, EARNED] = a.begin[u, at.READY], 0.0
    w.value[0, WAY_LENGTH], w.value[0, TAKEN] = 0.0, 0.0
    w.link[0, AT_NODE], w.link[0, BEFORE], w.link[0, LATER] = u, -1, -1
    w.link[0, GONE] = 0
    w.visited[0, :] = 0
    w.bucket[0] = 0


@inline_kernel
def _covers(w: Labels, i: int, one: int, other: int) -> bool:
    """Whether label `one` at task i has visited no task near by that `other` has not. O(w)."""
    for k in range(w.visited.shape[1]):
        if w.visited[one, k] & w.near[i, k] & ~w.visited[other, k]:
            return False
    return True


@inline_kernel
def _no_worse(w: Labels, i: int, one: int, other: int) -> bool:
    """Whether label `one` at task i makes `other` unnecessary. O(w)."""
    return bool(w.value[one, DEPARTED] <= w.value[other, DEPARTED]
                and w.value[one, EARNED] >= w.value[other, EARNED] - TOLERANCE
                and w.value[one, WAY_LENGTH] <= w.value[other, WAY_LENGTH] + TOLERANCE
                and w.value[one, TAKEN] <= w.value[other, TAKEN] + TOLERANCE
                and _covers(w, i, one, other))


@inline_kernel
def _keep(w: Labels, i: int, label: int, price: float) -> bool:
    """Keep a label at task i, if none there is as good; drops those it is better than. O(kept)."""
    for k in range(w.kept[i]):
        if _no_worse(w, i, w.front[i, k], label):
            return False
    count, worst, least = 0, -1, w.value[label, EARNED] - price * w.value[label, DEPARTED]
    for k in range(w.kept[i]):
        other = w.front[i, k]
        if _no_worse(w, i, label, other):
            w.link[other, GONE] = 1
            continue
        worth = w.value[other, EARNED] - price * w.value[other, DEPARTED]
        if worth < least:
            worst, least = count, worth
        w.front[i, count] = other
        count += 1
    w.kept[i] = count
    if count == w.front.shape[1]:
        if worst < 0:
            return False
        w.link[w.front[i, worst], GONE] = 1
        w.front[i, worst] = label
    else:
        w.front[i, count] = label
        w.kept[i] = count + 1
    return True


@inner_kernel
def _extend(a: TimedArrays, r: TimedRoutes, u: int, w: Labels, label: int, j: int, new: int,
            price: float) -> bool:
    """Make label `new` of UAV u at task node j after `label`; whether it may be used. O(kept)."""
    i = j - a.uavs
    if not w.open[i] or w.visited[label, i >> 6] & _bit(i):
        return False
    metres, seconds = leg_of(a, r, u, w.link[label, AT_NODE], j)
    start = max(after_leg(a, w.value[label, DEPARTED], seconds, j), a.fixed[j, at.OPENS])
    left = start + a.fixed[j, at.SERVICE]
    flown = w.value[label, WAY_LENGTH] + metres
    load = w.value[label, TAKEN] + a.fixed[j, at.LOAD]
    if (start > a.fixed[j, at.CLOSES]
            or left + w.home[i, HOME_SECONDS] > a.fixed[a.ends + u, at.CLOSES]
            or flown + w.home[i, HOME_METRES] > a.limit[u, at.FLOWN] + TOLERANCE
            or load > a.limit[u, at.CARRIED] + TOLERANCE):
        return False
    w.value[new, DEPARTED], w.value[new, WAY_LENGTH], w.value[new, TAKEN] = left, flown, load
    w.value[new, EARNED] = (w.value[label, EARNED] + a.unserved[i]
                            - a.weight[at.BY_DISTANCE] * metres)
    for k in range(w.visited.shape[1]):
        w.visited[new, k] = w.visited[label, k]
    w.link[new, AT_NODE], w.link[new, BEFORE], w.link[new, GONE] = j, label, 0
    if not _keep(w, i, new, price):
        return False
    w.visited[new, i >> 6] |= _bit(i)
    return True


@inline_kernel
def _end_price(a: TimedArrays, w: Labels, u: int, label: int) -> float:
    """What a route earns that ends after a label; the empty one is as it is now. O(1)."""
    node = w.link[label, AT_NODE]
    metres = a.begin[u, at.EMPTY_LENGTH] if node == u else w.home[node - a.uavs, HOME_METRES]
    return float(w.value[label, EARNED] - a.weight[at.BY_DISTANCE] * metres)


@kernel
def best_label(a: TimedArrays, r: TimedRoutes, u: int, w: Labels, end: float,
               price: float) -> int:
    """Make labels of UAV u, earlier ones first; returns that of the best route.

    end: [s] by which each label has departed, about. price: of a second, to choose labels by.
    """
    _begin(a, r, u, w)
    count, free, best, most = 1, -1, 0, _end_price(a, w, u, 0)
    first, tasks, size = a.begin[u, at.READY], a.ends - a.uavs, w.link.shape[0]
    width = max((end - first) / (BUCKETS - 1), 1e-9)
    for b in range(BUCKETS):
        room = tasks + (size - tasks) * (b + 1) // BUCKETS  # so that some is left for later ones
        while w.bucket[b] >= 0:
            label = w.bucket[b]
            w.bucket[b] = w.link[label, LATER]
            node = w.link[label, AT_NODE]
            if w.link[label, GONE]:
                if label != best:  # no other goes on from it
                    w.link[label, LATER], free = free, label
                continue
            begins = node == u
            for k in range(tasks if begins else a.near_count[node - a.uavs]):
                new = free if free >= 0 else count
                if new >= room:
                    break
                then = w.link[new, LATER]
                j = a.uavs + k if begins else int(a.near[node - a.uavs, k])
                if not _extend(a, r, u, w, label, j, new, price):
                    continue
                if new == free:
                    free = then
                else:
                    count += 1
                place = min(max(int((w.value[new, DEPARTED] - first) / width), b), BUCKETS - 1)
                w.link[new, LATER] = w.bucket[place]
                w.bucket[place] = new
                earned = _end_price(a, w, u, new)
                if earned > most:
                    best, most = new, earned
    return best
