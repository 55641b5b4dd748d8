# SPDX-License-Identifier: Apache-2.0
"""Random instances for experiments: 10 x 10 km, spread or one base, ranges that barely suffice."""
from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from uav_task_alloc.model import Task, Uav

SIDE = 10_000.0  # [m]
SLACK = 1.5  # range over a fair share of a good tour; at 1.25 OR-Tools finds no plan at 50 tasks
TOUR = 0.7124  # a shortest tour of n random points in a square is TOUR sqrt(n) sides long


@dataclass(frozen=True, slots=True)
class Instance:
    """A problem with a name."""

    name: str
    uavs: tuple[Uav, ...]
    tasks: tuple[Task, ...]


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
