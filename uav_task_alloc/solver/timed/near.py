# SPDX-License-Identifier: Apache-2.0
"""Neighbours of tasks where windows count: the nearest of those that may follow or precede."""
from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from uav_task_alloc.geometry.outline import Floats, Ints
from uav_task_alloc.kernel import allocating_kernel, inline_kernel, inner_allocating_kernel
from uav_task_alloc.solver.neighbours import sort_into_cells
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


class TaskCells(NamedTuple):
    """Ends of tasks sorted into square cells, as `sort_into_cells` returns them."""

    cell: Ints  # of each end
    first: Ints  # index in `order` of the first end of each cell, and the end
    order: Ints  # ends by cell
    side: float  # [m] of a cell


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
def _comes_after(a: TimedArrays, i: int, m: int, metres: float, rank: int) -> bool:
    """Whether the m-th neighbour of task i comes after one at a distance, of two as near the one
    of greater rank. O(1).
    """
    return bool(a.near_length[i, m] > metres
                or (a.near_length[i, m] == metres and a.near[i, m] > rank))


@inline_kernel
def _add_neighbour(a: TimedArrays, i: int, kept: int, j: int, rank: int, pace: float) -> int:
    """Add task j to the first `kept` neighbours of task i, nearest first; how many now. O(k).

    rank: of two that are as near the one with the smaller node is first, of j with this one.
    """
    t, s, k = a.uavs + i, a.uavs + j, a.near.shape[1]
    square, flat = nearest_ends(a, t, s)
    metres = math.sqrt(square)
    if i == j or k == 0 or (kept == k and not _comes_after(a, i, k - 1, metres, rank)):
        return kept
    if not _may_be_adjacent(a, t, s, math.sqrt(flat) * pace):
        return kept
    place = min(kept, k - 1)
    while place > 0 and _comes_after(a, i, place - 1, metres, rank):
        a.near_length[i, place] = a.near_length[i, place - 1]
        a.near[i, place] = a.near[i, place - 1]
        place -= 1
    a.near_length[i, place], a.near[i, place] = metres, s
    return int(min(kept + 1, k))


@allocating_kernel
def fill_near(a: TimedArrays, known: KnownNear, pace: float, xyz: Floats,
              squares: Floats) -> None:
    """Fill all neighbours of `a`. About O(n (k + classes)).

    known: neighbours of an earlier problem; pace: [s/m] of the fastest UAV, horizontally;
    xyz: [m] where tasks begin, (n, 3), and where they end, (2 n, 3) if any has a path;
    squares: (c) scratch.
    """
    _fill_near_tasks(a, known, pace, xyz)
    _fill_near_classes(a, squares)


@inner_allocating_kernel
def _fill_near_tasks(a: TimedArrays, known: KnownNear, pace: float, xyz: Floats) -> None:
    """Fill a.near, a.near_length and a.near_count. O(n k), more where windows exclude many."""
    n, last, seen = len(a.near), 1 << 62, np.empty(len(a.near), np.int64)
    cells = TaskCells(*sort_into_cells(xyz, 3.0))
    for i in range(n):
        seen[i] = -1
    for i in range(n):
        kept, before = 0, known.then[i]
        if before >= 0:
            for m in range(known.counts[before]):
                j = known.now[known.near[before, m] - known.uavs]
                if j >= 0:
                    a.near[i, kept], a.near_length[i, kept] = a.uavs + j, known.lengths[before, m]
                    kept += 1
            for m in range(known.fresh.size):
                kept = _add_neighbour(a, i, kept, known.fresh[m], last, pace)
        if before < 0 or kept < known.counts[before] // 2:
            kept = _nearest_by_cells(a, i, pace, cells, seen)
        a.near_count[i] = kept


@inline_kernel
def _nearest_by_cells(a: TimedArrays, i: int, pace: float, cells: TaskCells, seen: Ints) -> int:
    """Write the neighbours of task i, from cells around its ends outwards; returns their number.

    seen: (n) tasks before i at most; is changed.
    """
    n, k, kept, ring = len(a.near), a.near.shape[1], 0, 0
    across = int(math.sqrt(cells.first.size - 1) + 0.5)
    while ring < across and k > 0:
        if kept == k and a.near_length[i, k - 1] < (ring - 1) * cells.side:
            break
        for end in range(i, cells.cell.size, n):
            row, column = cells.cell[end] // across, cells.cell[end] % across
            for y in range(max(0, row - ring), min(across, row + ring + 1)):
                step = 1 if abs(y - row) == ring or ring == 0 else 2 * ring
                for x in range(column - ring, column + ring + 1, step):
                    if x < 0 or x >= across:
                        continue
                    at_cell = y * across + x
                    for m in range(cells.first[at_cell], cells.first[at_cell + 1]):
                        j = cells.order[m] % n
                        if seen[j] != i:
                            seen[j] = i
                            kept = _add_neighbour(a, i, kept, j, a.uavs + j, pace)
        ring += 1
    return kept


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
