# SPDX-License-Identifier: Apache-2.0
"""Neighbours of tasks where windows count: the nearest of those that may follow or precede."""
from __future__ import annotations

import math

from uav_task_alloc.geometry.outline import Floats
from uav_task_alloc.kernel import inline_kernel, kernel
from uav_task_alloc.solver.timed import columns as at
from uav_task_alloc.solver.timed.arrays import TimedArrays


@inline_kernel
def _square_between(a: TimedArrays, i: int, j: int) -> float:
    """Squared distance [m^2] of two nodes. O(1)."""
    x, y = a.fixed[i, at.X] - a.fixed[j, at.X], a.fixed[i, at.Y] - a.fixed[j, at.Y]
    z = a.fixed[i, at.Z] - a.fixed[j, at.Z]
    return float(x * x + y * y + z * z)


@inline_kernel
def _may_be_adjacent(a: TimedArrays, t: int, s: int, least: float) -> bool:
    """Whether the windows allow task s directly after t, or t after s, `least` [s] apart. O(1)."""
    return bool(a.fixed[t, at.OPENS] + a.fixed[t, at.SERVICE] + least <= a.fixed[s, at.CLOSES]
            or a.fixed[s, at.OPENS] + a.fixed[s, at.SERVICE] + least <= a.fixed[t, at.CLOSES])


@kernel
def fill_near(a: TimedArrays, squares: Floats, pace: float) -> None:
    """Fill a.near, a.near_length and a.near_count. O(n^2), some ns a pair.

    squares: (k) scratch; pace: [s/m] of the fastest UAV, horizontally.
    """
    n, k = a.near.shape
    for i in range(n):
        t, kept = a.uavs + i, 0
        for j in range(n):
            s = a.uavs + j
            square = _square_between(a, t, s)
            if (kept == k and square >= squares[k - 1]) or i == j or k == 0:
                continue
            x, y = a.fixed[s, at.X] - a.fixed[t, at.X], a.fixed[s, at.Y] - a.fixed[t, at.Y]
            if not _may_be_adjacent(a, t, s, math.sqrt(x * x + y * y) * pace):
                continue
            place = min(kept, k - 1)
            while place > 0 and squares[place - 1] > square:
                squares[place], a.near[i, place] = squares[place - 1], a.near[i, place - 1]
                place -= 1
            squares[place], a.near[i, place] = square, s
            kept = min(kept + 1, k)
        a.near_count[i] = kept
        for m in range(kept):
            a.near_length[i, m] = math.sqrt(squares[m])


@kernel
def fill_near_classes(a: TimedArrays, squares: Floats) -> None:
    """Fill a.near_class and REMOTE with the nearest starts of classes. O(n classes).

    squares: (c) scratch.
    """
    classes, c = a.first_member.size - 1, a.near_class.shape[1]
    for i in range(a.ends - a.uavs):
        t, kept = a.uavs + i, 0
        for k in range(classes):
            square = _square_between(a, t, a.members[a.first_member[k]])
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
