# SPDX-License-Identifier: Apache-2.0
"""Cover: how soon the next task would be answered, given what all UAVs have to do now."""
from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from uav_task_alloc.kernel import inner_kernel

_Floats = NDArray[np.float64]
_Ints = NDArray[np.int64]
_Bools = NDArray[np.bool_]
_LONGEST = 3600.0  # [s] until the next task is answered where there is no other UAV


class CoverPrices(NamedTuple):
    """What cover is worth when tasks are assigned."""

    tasks: float  # to come for each idle UAV whose expected response time counts; 0.0: no cover
    least: float  # of these tasks
    backup: float  # share of tasks that find their nearest UAV busy: the second one answers
    look_ahead: float  # [s] until the next task: busy UAVs are free by so much sooner


COVER_PRICES = CoverPrices(1.0, 1.5, 0.2, 50.0)


class Cover(NamedTuple):
    """The times until each of m UAVs is at each of k places."""

    prices: CoverPrices
    x: _Floats  # (k) [m] places where the next task may be
    y: _Floats  # (k)
    weight: _Floats  # (k) probability of the next task
    waiting: _Floats  # (m, 2) [m] where idle UAVs wait
    time: _Floats  # (m, k) [s]
    tasks: _Floats  # (1) to come whose expected response time counts
    least: _Floats  # (3, k) [s] the least times, ascending
    nearest: _Ints  # (2, k) the UAVs of the first two
    current: _Bools  # (1) whether these two are those of `time`
    scratch: _Floats  # (3, k)


def make_cover(prices: CoverPrices, x: _Floats, y: _Floats, waiting: _Floats) -> Cover:
    """Cover of uniform tasks.

    Args:
        prices: of cover.
        x, y: (k) [m] places where the next task may be.
        waiting: (m, 2) [m] where idle UAVs wait; shared with what moves them.

    Returns:
        The cover; its times are not set.
    """
    return Cover(prices, x, y, np.full(len(x), 1.0 / len(x)), waiting,
                 np.zeros((len(waiting), len(x))), np.zeros(1), np.zeros((3, len(x))),
                 np.zeros((2, len(x)), np.int64), np.zeros(1, np.bool_), np.zeros((3, len(x))))


@inner_kernel
def set_times(cover: Cover, u: int, free_in: float, x: float, y: float, speed: float) -> None:
    """Set the times of UAV u, which is free at a point [m] after a time [s]. O(k)"""
    _times(cover, free_in, x, y, speed, cover.time[u])
    cover.current[0] = False


@inner_kernel
def leave_out(cover: Cover, u: int) -> None:
    """Prepare `expected` and `expected_after` for UAV u: the two least times of others. O(k)"""
    if not cover.current[0]:
        _rank(cover)
    first, second = cover.scratch[0], cover.scratch[1]
    for c in range(first.size):
        place = 0 if cover.nearest[0, c] == u else 1 if cover.nearest[1, c] == u else 2
        first[c] = cover.least[1 if place == 0 else 0, c]
        second[c] = cover.least[1 if place == 2 else 2, c]


@inner_kernel
def _rank(cover: Cover) -> None:
    """Set the three least times of each place. O(m k)"""
    least, nearest = cover.least, cover.nearest
    least[:] = _LONGEST
    nearest[:] = -1
    for v in range(cover.time.shape[0]):
        row = cover.time[v]
        for c in range(row.size):
            t = row[c]
            if t < least[0, c]:
                least[2, c], least[1, c], least[0, c] = least[1, c], least[0, c], t
                nearest[1, c], nearest[0, c] = nearest[0, c], v
            elif t < least[1, c]:
                least[2, c], least[1, c] = least[1, c], t
                nearest[1, c] = v
            elif t < least[2, c]:
                least[2, c] = t
    cover.current[0] = True


@inner_kernel
def expected(cover: Cover, u: int) -> float:
    """The price [s] of the next tasks with the times of UAV u as set. O(k)"""
    return _expected(cover, cover.time[u])


@inner_kernel
def expected_after(cover: Cover, free_in: float, x: float, y: float, speed: float) -> float:
    """As `expected`, if the UAV left out is free at another time and point. O(k)"""
    _times(cover, free_in, x, y, speed, cover.scratch[2])
    return _expected(cover, cover.scratch[2])


@inner_kernel
def _times(cover: Cover, free_in: float, x: float, y: float, speed: float, out: _Floats) -> None:
    ready, slowness = max(0.0, free_in - cover.prices.look_ahead), 1.0 / speed
    for c in range(out.size):
        dx, dy = cover.x[c] - x, cover.y[c] - y
        out[c] = ready + math.sqrt(dx * dx + dy * dy) * slowness


@inner_kernel
def _expected(cover: Cover, row: _Floats) -> float:
    first, second, total, backup = cover.scratch[0], cover.scratch[1], 0.0, cover.prices.backup
    for c in range(row.size):
        t, a, b = row[c], first[c], second[c]
        low = t if t < a else a
        high = a if t < a else t
        total += cover.weight[c] * ((1.0 - backup) * low + backup * (high if high < b else b))
    return float(cover.tasks[0] * total)
