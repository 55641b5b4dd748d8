# SPDX-License-Identifier: Apache-2.0
"""Neighbour lists: nearest tasks by a grid, nearest starts by comparing all."""
from __future__ import annotations

import math

import numpy as np

from uav_task_alloc.kernel import (
    allocating_kernel,
    inline_kernel,
    inner_allocating_kernel,
    inner_kernel,
    kernel,
)
from uav_task_alloc.solver.rng import RngState, below, uniform
from uav_task_alloc.solver.routes import NODE, TINY, Arrays, Floats, Ints, leg_length

_NOISE = 4096  # random numbers drawn once; each task reads them from a random offset


@inner_allocating_kernel
def sort_into_cells(xyz: Floats, per_cell: float) -> tuple[Ints, Ints, Ints, float]:
    """Sort points into square cells in plan view. O(n)

    Args:
        xyz: float64 (n, 3) [m], at least one.
        per_cell: points in a cell, about.

    Returns:
        The cell of each point (n), the first index of each cell in the order, with one more entry
        for the end, the order (n), and the side of a cell [m].
    """
    n = len(xyz)
    x0, y0 = xyz[0, 0], xyz[0, 1]
    x1, y1 = x0, y0
    for i in range(1, n):
        x0, y0 = min(x0, xyz[i, 0]), min(y0, xyz[i, 1])
        x1, y1 = max(x1, xyz[i, 0]), max(y1, xyz[i, 1])
    wide = max(max(x1 - x0, y1 - y0), 1e-6)
    across = max(1, int(math.sqrt(n / per_cell)))
    side = wide / across * (1.0 + 1e-9)
    cell = np.empty(n, np.int64)
    first = np.zeros(across * across + 1, np.int64)
    for i in range(n):
        cell[i] = int((xyz[i, 1] - y0) / side) * across + int((xyz[i, 0] - x0) / side)
        first[cell[i] + 1] += 1
    for i in range(1, first.size):
        first[i] += first[i - 1]
    order, fill = np.empty(n, np.int64), np.empty(first.size, np.int64)
    for i in range(first.size):
        fill[i] = first[i]
    for i in range(n):
        order[fill[cell[i]]] = i
        fill[cell[i]] += 1
    return cell, first, order, side


@inner_kernel
def _insert_sorted(ids: Ints, squares: Floats, kept: int, j: int, square: float) -> int:
    """Insert j into the first `kept` ids, nearest first; returns how many are kept now. O(k)."""
    k = ids.size
    if kept == k and square >= squares[k - 1]:
        return kept
    place = min(kept, k - 1)
    while place > 0 and squares[place - 1] > square:
        ids[place], squares[place] = ids[place - 1], squares[place - 1]
        place -= 1
    ids[place], squares[place] = j, square
    return min(kept + 1, k)


@inline_kernel
def _square(xyz: Floats, i: int, j: int) -> float:
    """Squared distance [m^2] of two points. O(1)."""
    x, y, z = xyz[i, 0] - xyz[j, 0], xyz[i, 1] - xyz[j, 1], xyz[i, 2] - xyz[j, 2]
    return float(x * x + y * y + z * z)


@allocating_kernel
def find_nearest(xyz: Floats, near: Ints, fresh: Ints) -> Floats:
    """Fill near (n, k) with the k nearest others of each point, nearest first. About O(n k).

    Returns their squared Euclidean distances (n, k) [m^2]. A row that begins with -1 is searched
    for; any other row holds the nearest points before the points `fresh` were added.
    """
    n, k = near.shape
    squares = np.empty((n, k))
    if k == 0:
        return squares
    cell, first, order, side = sort_into_cells(xyz, 3.0)
    across = int(math.sqrt(first.size - 1) + 0.5)
    held = np.empty(k, np.int64)
    for i in range(n):
        if near[i, 0] >= 0:
            kept = 0
            for m in range(k):
                held[m] = near[i, m]
            for ids in (held, fresh):
                for m in range(ids.size):
                    kept = _insert_sorted(near[i], squares[i], kept, ids[m],
                                          _square(xyz, i, ids[m]))
            continue
        row, column, kept, ring = cell[i] // across, cell[i] % across, 0, 0
        while ring < across:
            if kept == k and squares[i, k - 1] <= ((ring - 1) * side) ** 2:
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
                            kept = _insert_sorted(near[i], squares[i], kept, j, _square(xyz, i, j))
            ring += 1
    return squares


@kernel
def fill_near_tasks(a: Arrays, found: Ints, squares: Floats) -> None:
    """Fill a.near (n, k) with neighbours, sorted by leg length. O(n k^2).

    found: (n, k) tasks from 0; squares: (n, k) their squared Euclidean distances [m^2].
    """
    n, k = a.near.shape
    for i in range(n):
        for m in range(k):
            j, t, place = NODE(a.uavs + found[i, m]), NODE(a.uavs + i), m
            if a.straight:
                a.near[i, m], a.near_length[i, m] = j, math.sqrt(squares[i, m])
                continue
            d = leg_length(a, j, t)  # inf: t lies inside a zone
            if d < np.inf:
                d = max(d, leg_length(a, t, j))  # inf: j does
            while place > 0 and a.near_length[i, place - 1] > d:
                a.near[i, place] = a.near[i, place - 1]
                a.near_length[i, place] = a.near_length[i, place - 1]
                place -= 1
            a.near[i, place], a.near_length[i, place] = j, d


@allocating_kernel
def fill_near_starts(a: Arrays, xyz: Floats, rng: RngState) -> None:
    """Fill a.starts (n, s) with the starts nearest to each task, equal ones shuffled. O(n m).

    Where ranges are hard, UAVs that cannot reach the task are left out, and the unassigned cost
    of tasks that no UAV can reach becomes 0.
    """
    n, s = a.starts.shape
    squares, squared, shuffled = np.empty(s), np.empty(a.uavs), np.empty(a.uavs)
    xs, ys, zs = np.empty(a.uavs), np.empty(a.uavs), np.empty(a.uavs)
    most = np.empty(a.uavs)  # [m^2] squared range
    for u in range(a.uavs):
        xs[u], ys[u], zs[u], most[u] = xyz[u, 0], xyz[u, 1], xyz[u, 2], np.inf
        if a.hard:
            most[u] = (a.range_left[u] + TINY) ** 2 if a.range_left[u] >= 0.0 else -1.0
    noise = np.empty(_NOISE + a.uavs)
    for m in range(noise.size):
        noise[m] = 1e-6 * uniform(rng)
    for i in range(n):
        kept, t, spare, row = 0, a.uavs + i, -np.inf, a.starts[i]
        x, y, z = xyz[t, 0], xyz[t, 1], xyz[t, 2]
        noise_from = noise[below(rng, _NOISE):]
        for u in range(a.uavs):  # kept minimal so that LLVM vectorises it
            squared[u] = (xs[u] - x) ** 2 + (ys[u] - y) ** 2 + (zs[u] - z) ** 2
            shuffled[u] = squared[u] + noise_from[u] * (squared[u] + 1.0)
        for u in range(a.uavs):
            if a.restricted[i] and not a.compatible[u, i]:
                continue
            more = a.range_left[u] - spare
            if more > 0.0 and squared[u] < more * more:
                spare = a.range_left[u] - math.sqrt(squared[u])
            if squared[u] <= most[u] and (kept < s or shuffled[u] < squares[s - 1]):
                kept = _insert_sorted(row, squares, kept, u, shuffled[u])
        if a.hard and spare < -TINY:
            a.unassigned_cost[i] = 0.0
        for m in range(s):
            if m < kept:
                a.start_length[i, m] = leg_length(a, a.starts[i, m], NODE(t))
            else:
                a.starts[i, m], a.start_length[i, m] = 0, np.inf
