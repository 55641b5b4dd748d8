# SPDX-License-Identifier: Apache-2.0
"""Random instances for experiments: 10 x 10 km, ranges that barely suffice, optional domes."""
from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uav_task_alloc.model import Task, ThreatZone, Uav
from uav_task_alloc.objective import Objective, check_objective, needs_time
from uav_task_alloc.solver.problem import Rules

SIDE = 10_000.0  # [m]
SLACK = 1.5  # range over a fair share of a good tour; at 1.25 OR-Tools finds no plan at 50 tasks
# a shortest tour of n random points in a square is about TOUR sqrt(n) sides long (Beardwood,
# Halton and Hammersley; the constant by Johnson and McGeoch)
TOUR = 0.7124
HEIGHTS = 50.0, 150.0  # [m] of tasks and starts among domes
RADII = 600.0, 1100.0  # [m] of domes
CLEAR = 100.0  # [m] between a dome and any task or start


@dataclass(frozen=True, slots=True)
class Instance:
    """A named problem of the benchmark or the study."""

    name: str
    uavs: tuple[Uav, ...]
    tasks: tuple[Task, ...]
    zones: tuple[ThreatZone, ...] = ()
    route_end: str = 'hold'
    collects: bool = False  # ranges may not suffice for all tasks: the value served counts
    known: float = math.nan  # best published value (collects), cost or length [m]
    group: str = ''  # of instances that a mean gap is over; '': as the name says
    objective: Objective | str = 'distance'
    trips: int = 1  # of a UAV at most
    grain: float = 0.0  # [1/m] lengths are cut to multiples of 1 / grain

    @property
    def rules(self) -> Rules:
        """How routes end and what they cost."""
        return Rules(self.route_end == 'home', objective=check_objective(self.objective),
                     trips=self.trips, grain=self.grain)

    @property
    def has_time(self) -> bool:
        """Whether times, loads or trips can change its best plan."""
        return needs_time(self.uavs, self.tasks, self.rules.objective, self.trips)


def make_instance(uavs: int, tasks: int, seed: int, one_base: bool = False,
                  slack: float = SLACK) -> Instance:
    """An instance with tasks and starts uniform in the square.

    Args:
        uavs: number of UAVs.
        tasks: number of tasks.
        seed: of all random values.
        one_base: all UAVs start at the middle of the square.
        slack: the range of a UAV over its fair share of a tour, to which the mean distance to a
            task is added with one base. Ranges are raised until every task is within one.
    """
    rng = np.random.default_rng((seed, uavs, tasks, one_base))
    positions = rng.uniform(0.0, SIDE, (tasks, 2))
    starts = np.full((uavs, 2), 0.5 * SIDE) if one_base else rng.uniform(0.0, SIDE, (uavs, 2))
    distances = np.hypot(*(positions[:, None] - starts[None]).T)  # (uavs, tasks)
    share = TOUR * math.sqrt(tasks) * SIDE / uavs
    uav_range = slack * (share + (float(distances.mean()) if one_base else 0.0))
    uav_range = max(uav_range, 1.05 * float(distances.min(axis=0).max()))
    kind = ('base' if one_base else 'spread') + (f'*{slack:g}' if slack != SLACK else '')
    return Instance(
        f'{kind}-{uavs}-{tasks}-{seed}',
        tuple(Uav(f'u{i}', (x, y, 0.0), uav_range) for i, (x, y) in enumerate(starts)),
        tuple(Task(f't{i}', (x, y, 0.0)) for i, (x, y) in enumerate(positions)))


def make_dome_scene(uavs: int, tasks: int, domes: int, seed: int) -> Instance:
    """An instance in three dimensions among hemispheres, which contain no task and no start.

    Args:
        uavs: number of UAVs.
        tasks: number of tasks.
        domes: number of hemispheres.
        seed: of all random values.
    """
    rng = np.random.default_rng((seed, uavs, tasks, domes))
    zones = [ThreatZone.hemisphere(f'z{i}', (*rng.uniform(0.1 * SIDE, 0.9 * SIDE, 2), 0.0),
                                   rng.uniform(*RADII)) for i in range(domes)]
    positions = [_position_outside(zones, rng) for _ in range(uavs + tasks)]
    uav_range = SLACK * TOUR * math.sqrt(tasks) * SIDE / uavs
    return Instance(
        f'domes{domes}-{uavs}-{tasks}-{seed}',
        tuple(Uav(f'u{i}', tuple(start), uav_range) for i, start in enumerate(positions[:uavs])),
        tuple(Task(f't{i}', tuple(point)) for i, point in enumerate(positions[uavs:])),
        tuple(zones))


def _position_outside(zones: list[ThreatZone], rng: np.random.Generator) -> NDArray[np.float64]:
    while True:
        position = np.array([*rng.uniform(0.0, SIDE, 2), rng.uniform(*HEIGHTS)])
        if all(math.dist(position, zone.center) > zone.radius + CLEAR for zone in zones):
            return position
