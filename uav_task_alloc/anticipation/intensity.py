# SPDX-License-Identifier: Apache-2.0
"""Intensity of tasks over place: estimates that compete by how well they foretell tasks."""
from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from uav_task_alloc.anticipation.spots import Spots, fit_spots, remember, spots_density
from uav_task_alloc.kernel import inner_kernel, kernel

_Floats = NDArray[np.float64]
_Ints = NDArray[np.int64]
DAY = 86_400.0  # [s]
_LEAST_PROBABILITY = 1e-12  # of a task where no task was expected


class Cells(NamedTuple):
    """The area of work as a grid of equal cells, row by row from its south-west corner."""

    x: _Floats  # (c) [m] east, of centres
    y: _Floats  # (c) [m] north
    side: _Floats  # (2) [m] of a cell, east and north
    across: int  # cells of a row
    inside: _Floats  # (c) 1.0 in the area of work, 0.0 outside it


class Estimates(NamedTuple):
    """Kernel estimates for each bandwidth, forgetting time and division of the day, and spots.

    A row is the estimate of one part of the day; an estimate that ignores the time has one row.
    """

    bandwidth: _Floats  # (e) [m] standard deviation of the kernel
    forgetting: _Floats  # (e) [s] after which a task counts 1 / e; inf: never
    first_row: _Ints  # (e)
    parts: _Ints  # (e) of the day
    mass: _Floats  # (rows) tasks in a row, less what is forgotten
    field: _Floats  # (rows, c) their kernels; the sum of a row is its mass
    log_weight: _Floats  # (e) logarithm of the share of each estimate, up to a constant
    begin: _Floats  # (e) share of each estimate at the begin; the sum is 1
    at: _Floats  # (1) [s] up to which tasks are forgotten; -inf: no task was seen
    mixture: _Ints  # (e) of `spots` that an estimate is; -1: a kernel estimate
    spots: Spots


@kernel
def observe(cells: Cells, e: Estimates, prior: float, share: float, x: float, y: float,
            now: float, scratch: _Floats) -> None:
    """Weigh the estimates by the probability each gave to a task's place, then add the task.

    Switching between estimates follows fixed share (Herbster and Warmuth 1998). O(e c).

    Args:
        cells: the area.
        e: is changed.
        prior: tasks that the uniform prior is worth.
        share: of its weight that an estimate hands out to all at each task.
        x, y: [m] of the task.
        now: [s] of its announcement; its time of day is that of UTC if it counts from 1970.
        scratch: (c).
    """
    _forget(e, now)
    remember(e.spots, x, y, e.at[0])
    at, free = cell_at(cells, x, y), cells.inside.sum()
    largest = -math.inf
    for i in range(e.bandwidth.size):
        row = _row(e, i, now)
        p = (prior * cells.inside[at] / free + e.field[row, at]) / (prior + e.mass[row])
        e.log_weight[i] += math.log(p + _LEAST_PROBABILITY)
        largest = max(largest, e.log_weight[i])
    total = 0.0
    for i in range(e.bandwidth.size):
        total += math.exp(e.log_weight[i] - largest)
    for i in range(e.bandwidth.size):
        weight = math.exp(e.log_weight[i] - largest) / total
        e.log_weight[i] = math.log((1.0 - share) * weight + share * e.begin[i])
        if e.mixture[i] >= 0:
            _fit(cells, e, i)
        else:
            _add(cells, e, i, _row(e, i, now), x, y, scratch)


@inner_kernel
def _row(e: Estimates, i: int, now: float) -> int:
    """The row of estimate i for a time of day. O(1)"""
    return int(e.first_row[i] + int(now % DAY / DAY * e.parts[i]))


@inner_kernel
def _kept(e: Estimates, i: int, now: float) -> float:
    """The share of its tasks that estimate i has not forgotten since it last did. O(1)"""
    past = now - e.at[0]
    return math.exp(-past / e.forgetting[i]) if 0.0 < past < math.inf else 1.0


@inner_kernel
def _forget(e: Estimates, now: float) -> None:
    """Forget tasks up to a time. O(rows c)"""
    for i in range(e.bandwidth.size):
        kept = _kept(e, i, now)
        if kept < 1.0:
            for row in range(e.first_row[i], e.first_row[i] + e.parts[i]):
                e.mass[row] *= kept
                for c in range(e.field.shape[1]):
                    e.field[row, c] *= kept
    e.at[0] = max(e.at[0], now)


@inner_kernel
def _add(cells: Cells, e: Estimates, i: int, row: int, x: float, y: float,
         scratch: _Floats) -> None:
    """Add a kernel of mass 1 within the area to a row of estimate i. O(c)"""
    total = 0.0
    for c in range(cells.x.size):
        dx, dy = (cells.x[c] - x) / e.bandwidth[i], (cells.y[c] - y) / e.bandwidth[i]
        scratch[c] = cells.inside[c] * math.exp(-0.5 * (dx * dx + dy * dy))
        total += scratch[c]
    if total > 0.0:
        e.mass[row] += 1.0
        for c in range(cells.x.size):
            e.field[row, c] += scratch[c] / total


@inner_kernel
def _fit(cells: Cells, e: Estimates, i: int) -> None:
    """Fit the mixture of estimate i, and write it in its row. O(n s + c s)"""
    area = cells.inside.sum() * cells.side[0] * cells.side[1]
    row, total = e.first_row[i], 0.0
    fit_spots(e.spots, e.mixture[i], area, e.at[0])
    for c in range(cells.x.size):
        e.field[row, c] = 0.0
        if cells.inside[c] > 0.0:
            e.field[row, c] = spots_density(e.spots, e.mixture[i], area, cells.x[c], cells.y[c])
            total += e.field[row, c]
    e.mass[row] += 1.0
    for c in range(cells.x.size):
        e.field[row, c] *= e.mass[row] / total


@inner_kernel
def cell_at(cells: Cells, x: float, y: float) -> int:
    """The cell of a point, or the nearest one of the grid. O(1)"""
    rows = cells.x.size // cells.across
    i = math.floor((x - cells.x[0]) / cells.side[0] + 0.5)
    j = math.floor((y - cells.y[0]) / cells.side[1] + 0.5)
    return int(min(max(j, 0), rows - 1) * cells.across + min(max(i, 0), cells.across - 1))


@kernel
def density(cells: Cells, e: Estimates, prior: float, now: float, out: _Floats) -> None:
    """The probability that the next task is in each cell. O(e c)

    Args:
        cells: the area.
        e: the estimates.
        prior: tasks that the uniform prior is worth.
        now: [s].
        out: (c) is overwritten; its sum is 1.
    """
    free, total = cells.inside.sum(), 0.0
    out[:] = 0.0
    for i in range(e.bandwidth.size):
        total += math.exp(e.log_weight[i])
    for i in range(e.bandwidth.size):
        row, kept = _row(e, i, now), _kept(e, i, now)
        weight = math.exp(e.log_weight[i]) / total / (prior + kept * e.mass[row])
        for c in range(cells.x.size):
            out[c] += weight * (prior * cells.inside[c] / free + kept * e.field[row, c])
