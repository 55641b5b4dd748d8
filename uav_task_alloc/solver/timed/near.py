# SPDX-License-Identifier: Apache-2.0
"""Neighbours of tasks where windows count: the nearest of those that may follow or precede."""
from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from uav_task_alloc.geometry.outline import Floats, Ints
from uav_task_alloc.kernel import inline_kernel, kernel
from uav_task_alloc.solver.timed import columns as at
from uav_task_alloc.solver.timed.arrays import Links, TimedArrays
from uav_task_alloc.solver.timed.ways import nearest_ends


class KnownNear(NamedTuple):
    """Neighbours of the tasks of an earlier problem, and which of them are in the present one."""

    uavs: int  # of the earlier problem: its first task node
    near: Links  # as in TimedArrays
    lengths: Floats  # [m]
    counts: Ints
    then: Ints  # (n) index of each present task in the earlier problem; -1: new
    now: Ints  # index of each earlier task in the present problem; -1: gone
    fresh: Ints  # indices of the new tasks


def known_near(a: TimedArrays, earlier: TimedArrays | None, then: Ints) -> KnownNear:
    """The neighbours of an earlier problem as far as they are still right.

    Args:
        a: the present problem.
        earlier: None: nothing is known.
        then: (n) index of each task in the earlier problem; -1: it had none of this id.
    """
    if earlier is None or earlier.near.shape[1] != a.near.shape[1]:
        return KnownNear(0, a.near, a.near_length, a.near_count, np.full(len(then), -1), then[:0],
                         then[:0])
    stays = np.flatnonzero(then >= 0)
    moved = np.zeros(len(stays), np.bool_)
    for here, there in ((a.uavs + stays, earlier.uavs + then[stays]),
                        (a.far[stays], earlier.far[then[stays]])):
        moved |= (a.fixed[here, :at.Z + 1] != earlier.fixed[there, :at.Z + 1]).any(axis=1)
    then = then.copy()
    then[stays[moved]] = -1
    now = np.full(earlier.ends - earlier.uavs, -1)
    stays = np.flatnonzero(then >= 0)
    now[then[stays]] = stays
    return KnownNear(earlier.uavs, earlier.near, earlier.near_length, earlier.near_count, then,
                     now, np.flatnonzero(then < 0))


@inline_kernel
def _may_be_adjacent(a: TimedArrays, t: int, s: int, least: float) -> bool:
    """Whether the windows allow task s directly after t, or t after s, `least` [s] apart. O(1)."""
    return bool(a.fixed[t, at.OPENS] + a.fixed[t, at.SERVICE] + least <= a.fixed[s, at.CLOSES]
            or a.fixed[s, at.OPENS] + a.fixed[s, at.SERVICE] + least <= a.fixed[t, at.CLOSES])


@inline_kernel
def _add_neighbour(a: TimedArrays, i: int, kept: int, j: int, pace: float) -> int:
    """Add task j to the first `kept` neighbours of task i, nearest first; how many now. O(k)."""
    t, s, k = a.uavs + i, a.uavs + j, a.near.shape[1]
    square, flat = nearest_ends(a, t, s)
    metres = math.sqrt(square)
    if i == j or k == 0 or (kept == k and metres >= a.near_length[i, k - 1]):
        return kept
    if not _may_be_adjacent(a, t, s, math.sqrt(flat) * pace):
        return kept
    place = min(kept, k - 1)
    while place > 0 and a.near_length[i, place - 1] > metres:
        a.near_length[i, place] = a.near_length[i, place - 1]
        a.near[i, place] = a.near[i, place - 1]
        place -= 1
    a.near_length[i, place], a.near[i, place] = metres, s
    return int(min(kept + 1, k))


@kernel
def fill_near(a: TimedArrays, known: KnownNear, pace: float, squares: Floats) -> None:
    """Fill all neighbours of `a`. O(n (k + classes)) where known, else O(n (n + classes)).

    known: neighbours of an earlier problem; pace: [s/m] of the fastest UAV, horizontally;
    squares: (c) scratch.
    """
    _fill_near_tasks(a, known, pace)
    _fill_near_classes(a, squares)


@inline_kernel
def _fill_near_tasks(a: TimedArrays, known: KnownNear, pace: float) -> None:
    """Fill a.near, a.near_length and a.near_count. O(n k) where known, else O(n^2)."""
    n = len(a.near)
    for i in range(n):
        kept, before = 0, known.then[i]
        if before >= 0:
            for m in range(known.counts[before]):
                j = known.now[known.near[before, m] - known.uavs]
                if j >= 0:
                    a.near[i, kept], a.near_length[i, kept] = a.uavs + j, known.lengths[before, m]
                    kept += 1
            for m in range(known.fresh.size):
                kept = _add_neighbour(a, i, kept, known.fresh[m], pace)
        if before < 0 or kept < known.counts[before] // 2:
            kept = 0
            for j in range(n):
                kept = _add_neighbour(a, i, kept, j, pace)
        a.near_count[i] = kept


@inline_kernel
def _least_base_way(a: TimedArrays, t: int) -> float:
    """Least length [m] of a leg between task t and a start or home, or less. O(1).

    0 where there are many classes of UAVs: to read all their homes would delay a warm plan.
    """
    classes, least = a.first_member.size - 1, math.inf
    if not a.returns or classes > a.near_class.shape[1]:
        return 0.0
    for k in range(classes):
        u = a.members[a.first_member[k]]
        start, _ = nearest_ends(a, t, u)
        home, _ = nearest_ends(a, t, a.ends + u)
        least = min(least, start, home)
    cut = 2.0 / a.grain if a.grain > 0.0 else 0.0
    return float(math.sqrt(least) - cut if classes > 0 else 0.0)


@inline_kernel
def _fill_near_classes(a: TimedArrays, squares: Floats) -> None:
    """Fill a.near_class and REMOTE with the nearest starts of classes. O(n classes).

    squares: (c) scratch.
    """
    classes, c = a.first_member.size - 1, a.near_class.shape[1]
    for i in range(a.ends - a.uavs):
        t, kept = a.uavs + i, 0
        for k in range(classes):
            square, _ = nearest_ends(a, t, a.members[a.first_member[k]])
            if kept == c and square >= squares[c - 1]:
                continue
            place = min(kept, c - 1)
            while place > 0 and squares[place - 1] > square:
                squares[place] = squares[place - 1]
                a.near_class[i, place] = a.near_class[i, place - 1]
                place -= 1
            squares[place], a.near_class[i, place] = square, k
            kept = min(kept + 1, c)
        a.fixed[t, at.REMOTE] = math.sqrt(squares[0]) if kept > 0 else 0.0
        a.fixed[t, at.BASE_WAY] = _least_base_way(a, t)
