# SPDX-License-Identifier: Apache-2.0
"""Random instances for experiments: 10 x 10 km, ranges that barely suffice, domes where asked."""
from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uav_task_alloc.model import Task, ThreatZone, Uav

SIDE = 10_000.0  # [m]
SLACK = 1.5  # range over a fair share of a good tour; at 1.25 OR-Tools finds no plan at 50 tasks
TOUR = 0.7124  # a shortest tour of n random points in a square is TOUR sqrt(n) sides long
HEIGHTS = 50.0, 150.0  # [m] of tasks and starts among domes
RADII = 600.0, 1100.0  # [m] of domes
CLEAR = 100.0  # [m] between a dome and any task or start


@dataclass(frozen=True, slots=True)
class Instance:
    """A problem with a name."""

    name: str
    uavs: tuple[Uav, ...]
    tasks: tuple[Task, ...]
    zones: tuple[ThreatZone, ...] = ()
    route_end: str = 'hold'
    collects: bool = False  # ranges do not suffice for all: the value served counts, not the way
    known: float = math.nan  # best published value (collects) or length [m]


def make_instance(uavs: int, tasks: int, seed: int, one_base: bool = False,
                  slack: float = SLACK) -> Instance:
    """Tasks and starts uniform in the square; one_base: all UAVs start at its middle.

    Ranges: `slack` times the mean way to a first task, where all start at one base, and a fair
    share of a tour; no task is out of reach.
    """
    rng = np.random.default_rng((seed, uavs, tasks, one_base))
    places = rng.uniform(0.0, SIDE, (tasks, 2))
    starts = np.full((uavs, 2), 0.5 * SIDE) if one_base else rng.uniform(0.0, SIDE, (uavs, 2))
    ways = np.hypot(*(places[:, None] - starts[None]).T)  # (uavs, tasks)
    share = TOUR * math.sqrt(tasks) * SIDE / uavs
    reach = slack * (share + (float(ways.mean()) if one_base else 0.0))
    reach = max(reach, 1.05 * float(ways.min(axis=0).max()))
    kind = ('base' if one_base else 'spread') + (f'*{slack:g}' if slack != SLACK else '')
    return Instance(
        f'{kind}-{uavs}-{tasks}-{seed}',
        tuple(Uav(f'u{i}', (x, y, 0.0), reach) for i, (x, y) in enumerate(starts)),
        tuple(Task(f't{i}', (x, y, 0.0)) for i, (x, y) in enumerate(places)))


def make_dome_scene(uavs: int, tasks: int, domes: int, seed: int) -> Instance:
    """As above, spread, but in three dimensions and among domes, which hold no task or start."""
    rng = np.random.default_rng((seed, uavs, tasks, domes))
    zones = [ThreatZone.hemisphere(f'z{i}', (*rng.uniform(0.1 * SIDE, 0.9 * SIDE, 2), 0.0),
                                   rng.uniform(*RADII)) for i in range(domes)]
    places = [_outside(zones, rng) for _ in range(uavs + tasks)]
    reach = SLACK * TOUR * math.sqrt(tasks) * SIDE / uavs
    return Instance(
        f'domes{domes}-{uavs}-{tasks}-{seed}',
        tuple(Uav(f'u{i}', tuple(place), reach) for i, place in enumerate(places[:uavs])),
        tuple(Task(f't{i}', tuple(place)) for i, place in enumerate(places[uavs:])),
        tuple(zones))


def _outside(zones: list[ThreatZone], rng: np.random.Generator) -> NDArray[np.float64]:
    while True:
        place = np.array([*rng.uniform(0.0, SIDE, 2), rng.uniform(*HEIGHTS)])
        if all(math.dist(place, zone.center) > zone.radius + CLEAR for zone in zones):
            return place
