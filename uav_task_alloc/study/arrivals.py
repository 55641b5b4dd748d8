# SPDX-License-Identifier: Apache-2.0
"""Tasks that arrive at random over an area: uniform, at hot spots, that move or switch."""
from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

_Floats = NDArray[np.float64]
AREA = 10_000.0  # [m] side of the square, its south-west corner at the origin
DURATION = 7200.0  # [s] of arrivals
ARRIVAL_KINDS = ('uniform', 'hot', 'moving', 'switch')
SPOTS, SPREAD = 3, 800.0  # hot spots; [m] their standard deviation, east and north
BACKGROUND = 0.1  # share of tasks that are uniform with hot spots, too
DRIFT = 1.0  # [m/s] of moving hot spots, which turn back at the edge
SWITCH = 3600.0  # [s] after which hot spots are at other places
SERVICE_TIMES = 30.0, 90.0  # [s] shortest and longest, uniform between


class TaskStream(NamedTuple):
    """The tasks of a run, and what they were drawn from."""

    place: _Floats  # (n, 2) [m]
    announced: _Floats  # (n) [s], ascending
    service: _Floats  # (n) [s]
    spots: _Floats  # (minutes, spots, 2) [m] centres in each minute; no spots: uniform


def make_stream(kind: str, rate: float, seed: int) -> TaskStream:
    """Draw the tasks of a run.

    Args:
        kind: one of ARRIVAL_KINDS.
        rate: [1/s] of arrivals, which are a Poisson process.
        seed: of all that is drawn; the same seed has the same hot spots at any rate.

    Returns:
        The tasks in the order of their announcements.
    """
    rng = np.random.default_rng([seed, ARRIVAL_KINDS.index(kind)])
    spots = np.zeros((int(DURATION // 60), 0, 2)) if kind == 'uniform' else _spots(kind, rng)
    n = int(rng.poisson(rate * DURATION))
    announced = np.sort(rng.uniform(0.0, DURATION, n))
    place = rng.uniform(0.0, AREA, (n, 2))
    if kind != 'uniform':
        near = rng.random(n) >= BACKGROUND
        place[near] = _near_spots(spots, announced[near], rng)
    return TaskStream(place, announced, rng.uniform(*SERVICE_TIMES, n), spots)


def _spots(kind: str, rng: np.random.Generator) -> _Floats:
    """Centres of the hot spots in each minute."""
    minutes = 60.0 * np.arange(int(DURATION // 60))[:, None, None]
    start, later = rng.uniform(SPREAD, AREA - SPREAD, (2, SPOTS, 2))
    heading = rng.uniform(0.0, 2.0 * np.pi, SPOTS)
    drift = DRIFT * minutes * np.stack([np.cos(heading), np.sin(heading)], 1)
    spots: _Floats = {'hot': start + 0.0 * minutes,
                     'switch': np.where(minutes < SWITCH, start, later),
                     # reflected at the edges
                     'moving': AREA - np.abs(AREA - np.abs(start + drift) % (2.0 * AREA))}[kind]
    return spots


def _near_spots(spots: _Floats, announced: _Floats, rng: np.random.Generator) -> _Floats:
    """Places around hot spots, within the area."""
    minute = (announced // 60).astype(int)
    centre = spots[minute, rng.integers(SPOTS, size=len(announced))]
    place: _Floats = rng.normal(centre, SPREAD)
    while (outside := ((place < 0.0) | (place > AREA)).any(1)).any():
        place[outside] = rng.normal(centre[outside], SPREAD)
    return place


def true_density(spots: _Floats, x: _Floats, y: _Floats) -> _Floats:
    """The probability of the next task in each cell of a grid, for each minute.

    Args:
        spots: (minutes, spots, 2) of a stream.
        x, y: (c) [m] centres of the cells.

    Returns:
        (minutes, c); the sum of each row is 1.
    """
    flat = np.full((len(spots), len(x)), 1.0 / len(x))
    if not spots.shape[1]:
        return flat
    away = (x - spots[..., :1]) ** 2 + (y - spots[..., 1:]) ** 2  # (minutes, spots, c)
    near = np.exp(-0.5 * away / SPREAD ** 2)
    near /= near.sum(2, keepdims=True)
    density: _Floats = BACKGROUND * flat + (1.0 - BACKGROUND) * near.mean(1)
    return density
