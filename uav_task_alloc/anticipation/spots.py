# SPDX-License-Identifier: Apache-2.0
"""Hot spots: mixtures of round Gaussians and a uniform background, fitted to the latest tasks."""
from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from uav_task_alloc.kernel import inner_kernel

_Floats = NDArray[np.float64]
_Ints = NDArray[np.int64]
_STEPS = 2  # of expectation and maximisation at each task
_SIZE_PRIOR = 6.0  # tasks that the size of a spot at its begin is worth
_LEAST_TASKS = 0.1  # that a spot loses to others, so that spots without tasks vanish
_BACKGROUND_PRIOR = 2.0  # tasks of the background


class Spots(NamedTuple):
    """Mixtures of at most s spots each; g mixtures that differ in what they forget."""

    forgetting: _Floats  # (g) [s] after which a task counts 1 / e; inf: never
    size: float  # [m] standard deviation of a spot at its begin
    used: _Ints  # (g) spots of each mixture
    x: _Floats  # (g, s) [m]
    y: _Floats  # (g, s)
    variance: _Floats  # (g, s) [m^2] east and north
    weight: _Floats  # (g, s) probability of the next task
    background: _Floats  # (g) the rest, uniform
    seen: _Floats  # (n, 3) [m, m, s] the latest tasks, in a ring
    tasks: _Ints  # (1) seen
    sums: _Floats  # (s, 5) scratch


def make_spots(forgetting: tuple[float, ...], spots: int, size: float, latest: int) -> Spots:
    """Mixtures that have seen no task.

    Args:
        forgetting: [s] of each mixture.
        spots: of a mixture at most.
        size: [m] standard deviation of a spot at its begin.
        latest: tasks to which a mixture is fitted at most.

    Returns:
        The mixtures, uniform.
    """
    g = len(forgetting)
    x, y, variance, weight = np.zeros((4, g, spots))
    return Spots(np.array(forgetting, float), size, np.zeros(g, np.int64), x, y, variance, weight,
                 np.ones(g), np.zeros((latest, 3)), np.zeros(1, np.int64), np.zeros((spots, 5)))


@inner_kernel
def remember(s: Spots, x: float, y: float, now: float) -> None:
    """Keep a task in place of the oldest one. O(1)"""
    at = s.tasks[0] % s.seen.shape[0]
    s.seen[at, 0], s.seen[at, 1], s.seen[at, 2] = x, y, now
    s.tasks[0] += 1


@inner_kernel
def fit_spots(s: Spots, g: int, area: float, now: float) -> None:
    """Fit mixture g to the tasks remembered, from where it was; the last one may begin a spot.

    A few steps of expectation and maximisation (Dempster, Laird and Rubin 1977). O(n s)

    Args:
        s: is changed.
        g: the mixture.
        area: [m^2] of the background.
        now: [s].
    """
    last = (s.tasks[0] - 1) % s.seen.shape[0]
    x, y = s.seen[last, 0], s.seen[last, 1]
    if s.background[g] / area > 0.5 * spots_density(s, g, area, x, y):
        _begin_spot(s, g, x, y)
    for _ in range(_STEPS):
        _step(s, g, area, now)


@inner_kernel
def _begin_spot(s: Spots, g: int, x: float, y: float) -> None:
    """Begin a spot at a task; with no room, in place of the one with the fewest tasks. O(s)"""
    k = s.used[g]
    if k < s.x.shape[1]:
        s.used[g] += 1
    else:
        k = 0
        for i in range(s.used[g]):
            k = i if s.weight[g, i] < s.weight[g, k] else k
    s.x[g, k], s.y[g, k], s.variance[g, k] = x, y, s.size * s.size
    s.weight[g, k] = 1.0 / (s.tasks[0] + 1.0)


@inner_kernel
def _step(s: Spots, g: int, area: float, now: float) -> None:
    """One step of expectation and maximisation. O(n s)"""
    s.sums[:] = 0.0
    background = _BACKGROUND_PRIOR
    for i in range(min(s.tasks[0], s.seen.shape[0])):
        x, y, past = s.seen[i, 0], s.seen[i, 1], max(0.0, now - s.seen[i, 2])
        kept = math.exp(-past / s.forgetting[g])
        total = s.background[g] / area
        for k in range(s.used[g]):
            s.sums[k, 4] = _spot_density(s, g, k, x, y)
            total += s.sums[k, 4]
        background += kept * s.background[g] / area / total
        for k in range(s.used[g]):
            part = kept * s.sums[k, 4] / total
            s.sums[k, 0] += part
            s.sums[k, 1] += part * x
            s.sums[k, 2] += part * y
            s.sums[k, 3] += part * ((x - s.x[g, k]) ** 2 + (y - s.y[g, k]) ** 2)
    total = background
    for k in range(s.used[g]):
        tasks = s.sums[k, 0]
        if tasks > 0.0:
            s.x[g, k], s.y[g, k] = s.sums[k, 1] / tasks, s.sums[k, 2] / tasks
        s.variance[g, k] = ((0.5 * s.sums[k, 3] + _SIZE_PRIOR * s.size * s.size)
                            / (tasks + _SIZE_PRIOR))
        s.weight[g, k] = max(tasks - _LEAST_TASKS, 1e-3)
        total += s.weight[g, k]
    s.background[g] = background / total
    for k in range(s.used[g]):
        s.weight[g, k] /= total


@inner_kernel
def _spot_density(s: Spots, g: int, k: int, x: float, y: float) -> float:
    """The density [1/m^2] of tasks of spot k at a point. O(1)"""
    away = (x - s.x[g, k]) ** 2 + (y - s.y[g, k]) ** 2
    variance = s.variance[g, k]
    return float(s.weight[g, k] * math.exp(-0.5 * away / variance) / (2.0 * math.pi * variance))


@inner_kernel
def spots_density(s: Spots, g: int, area: float, x: float, y: float) -> float:
    """The density [1/m^2] of tasks of mixture g at a point. O(s)

    Args:
        s: the mixtures.
        g: one of them.
        area: [m^2] of the background.
        x, y: [m].
    """
    total = s.background[g] / area
    for k in range(s.used[g]):
        total += _spot_density(s, g, k, x, y)
    return float(total)
