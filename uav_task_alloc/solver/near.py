# SPDX-License-Identifier: Apache-2.0
"""Who is near whom: nearest tasks by a grid, nearest starts by looking at all."""
from __future__ import annotations

import math

import numpy as np

from uav_task_alloc.solver.chance import Chance, uniform
from uav_task_alloc.solver.kernel import kernel, maker
from uav_task_alloc.solver.routes import TINY, Arrays, Floats, Ints, step


@maker
def _cells(xyz: Floats, per_cell: float) -> tuple[Ints, Ints, Ints, Floats]:
    """Points sorted into square cells: cell of each, first of each cell, order, (x0, y0, side)."""
    n = len(xyz)
    x0, y0 = xyz[:, 0].min(), xyz[:, 1].min()
    wide = max(xyz[:, 0].max() - x0, xyz[:, 1].max() - y0, 1e-6)
    across = max(1, int(math.sqrt(n / per_cell)))
    side = wide / across * (1.0 + 1e-9)
    cell = np.empty(n, np.int64)
    first = np.zeros(across * across + 1, np.int64)
    for i in range(n):
        cell[i] = int((xyz[i, 1] - y0) / side) * across + int((xyz[i, 0] - x0) / side)
        first[cell[i] + 1] += 1
    first[:] = np.cumsum(first)
    order, fill = np.empty(n, np.int64), first.copy()
    for i in range(n):
        order[fill[cell[i]]] = i
        fill[cell[i]] += 1
    return cell, first, order, np.array((x0, y0, side))


@kernel
def _keep(ids: Ints, squares: Floats, kept: int, j: int, square: float) -> int:
    """Insert j into the sorted front of `ids`, nearest first; returns how many are kept."""
    k = ids.size
    if kept == k and square >= squares[k - 1]:
        return kept
    place = min(kept, k - 1)
    while place > 0 and squares[place - 1] > square:
        ids[place], squares[place] = ids[place - 1], squares[place - 1]
        place -= 1
    ids[place], squares[place] = j, square
    return min(kept + 1, k)


@maker
def nearest(xyz: Floats, k: int) -> Ints:
    """The k nearest others of each point as the crow flies, nearest first. O(n k) about."""
    n = len(xyz)
    near = np.empty((n, k), np.int64)
    if k == 0:
        return near
    cell, first, order, frame = _cells(xyz, 3.0)
    side, across = frame[2], int(math.sqrt(first.size - 1) + 0.5)
    squares = np.empty(k)
    for i in range(n):
        row, column, kept, ring = cell[i] // across, cell[i] % across, 0, 0
        while ring < across:
            if kept == k and squares[k - 1] <= ((ring - 1) * side) ** 2:
                break
            for y in range(max(0, row - ring), min(across, row + ring + 1)):
                edge = abs(y - row) == ring
                for x in range(column - ring, column + ring + 1, 1 if edge or ring == 0
                               else 2 * ring):
                    if x < 0 or x >= across:
                        continue
                    for m in range(first[y * across + x], first[y * across + x + 1]):
                        j = order[m]
                        if j != i:
                            square = ((xyz[i, 0] - xyz[j, 0]) ** 2 + (xyz[i, 1] - xyz[j, 1]) ** 2
                                      + (xyz[i, 2] - xyz[j, 2]) ** 2)
                            kept = _keep(near[i], squares, kept, j, square)
            ring += 1
    return near


@kernel
def near_tasks(a: Arrays, found: Ints) -> None:
    """Fill a.near with the found neighbours in order of the way to fly. O(n k^2)."""
    n, k = a.near.shape
    for i in range(n):
        for m in range(k):
            j, t, place = a.uavs + found[i, m], a.uavs + i, m
            d = step(a, j, t)  # inf: t lies inside a zone
            if d < np.inf:
                d = max(d, step(a, t, j))  # inf: j does
            while place > 0 and a.near_length[i, place - 1] > d:
                a.near[i, place] = a.near[i, place - 1]
                a.near_length[i, place] = a.near_length[i, place - 1]
                place -= 1
            a.near[i, place], a.near_length[i, place] = j, d


@maker
def near_starts(a: Arrays, xyz: Floats, rng: Chance) -> None:
    """Fill a.starts with the starts nearest to each task, equally near ones shuffled. O(n m).

    The price of tasks that nobody has the range for becomes 0.
    """
    n, s = a.starts.shape
    squares = np.empty(s)
    for i in range(n):
        kept, t, spare = 0, a.uavs + i, -np.inf
        for u in range(a.uavs):
            if not a.may[u, i]:
                continue
            square = ((xyz[u, 0] - xyz[t, 0]) ** 2 + (xyz[u, 1] - xyz[t, 1]) ** 2
                      + (xyz[u, 2] - xyz[t, 2]) ** 2)
            spare = max(spare, a.reach[u] - math.sqrt(square))
            if kept < s or square <= squares[s - 1]:
                square += 1e-6 * (square + 1.0) * uniform(rng)
                kept = _keep(a.starts[i], squares, kept, u, square)
        if a.hard and spare < -TINY:
            a.price[i] = 0.0
        for m in range(s):
            if m < kept:
                a.start_length[i, m] = step(a, a.starts[i, m], t)
            else:
                a.starts[i, m], a.start_length[i, m] = 0, np.inf
