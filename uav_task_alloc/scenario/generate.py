# SPDX-License-Identifier: Apache-2.0
"""Random scenarios from a seed, for tests and benchmarks, and random points outside zones."""
from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from uav_task_alloc.model import Point, Task, ThreatZone
from uav_task_alloc.scenario.values import (
    DEFAULT_ORIGIN,
    Scenario,
    ScenarioUav,
    TimedTask,
    TimedZone,
)

_TRIES = 1000  # per point
_DISTANCE = 10.0  # [m] between a point and a zone with its margin


def draw_points(rng: np.random.Generator, count: int, low: Point, high: Point,
                zones: Sequence[ThreatZone]) -> list[Point]:
    """Draw points outside all zones.

    Args:
        rng: advanced by the draws.
        count: number of points.
        low, high: corners of the box [m].
        zones: kept clear of by 10 m beyond their margins.

    Returns:
        Points [m] rounded to 0.1 m; fewer than `count` where there is no room.
    """
    from uav_task_alloc.geometry.zones import zones_around  # imports numba
    points: list[Point] = []
    for _ in range(count * _TRIES):
        if len(points) == count:
            break
        x, y, z = (round(float(v), 1) for v in rng.uniform(low, high))
        if not zones_around((x, y, z), zones, _DISTANCE):
            points.append((x, y, z))
    return points


def generate(seed: int, *, uavs: int = 4, tasks: int = 20, arrivals: int = 0, zones: int = 3,
             size: float = 2000.0, base: bool = False, uav_range: float = math.inf,
             between: tuple[float, float] = (20.0, 120.0)) -> Scenario:
    """Generate a scenario in a square, with the fleet along its south edge or at one base.

    Args:
        seed: of all random values.
        uavs, tasks, zones: how many are there from the start.
        arrivals: number of later tasks.
        size: side of the square [m].
        base: all UAVs start at one point.
        uav_range: of each UAV [m].
        between: first and last time of arrivals [s].

    Returns:
        Named `random_SEED`, at the default origin; zones are domes, cylinders and prisms in turn.
    """
    rng = np.random.default_rng(seed)
    volumes = [_draw_zone(rng, f'z{i + 1}', i % 3, size) for i in range(zones)]
    points = draw_points(rng, tasks + arrivals, (0.0, 0.1 * size, 40.0), (size, size, 80.0),
                         volumes)
    times = [0.0] * tasks + sorted(round(float(t), 1) for t in rng.uniform(*between, arrivals))
    values = rng.integers(1, 6, tasks + arrivals)
    timed = [TimedTask(at, Task(f't{i + 1:02d}', point, float(value), 2.0))
             for i, (at, point, value) in enumerate(zip(times, points, values, strict=False))]
    starts = [(round(size * (0.5 if base else (i + 0.5) / uavs), 1), 0.0, 0.0)
              for i in range(uavs)]
    fleet = [ScenarioUav(f'uav_{i + 1}', i + 1, 'ardupilot' if i % 2 == 0 else 'px4', start,
                         start, range=uav_range) for i, start in enumerate(starts)]
    return Scenario(f'random_{seed}', seed, DEFAULT_ORIGIN, tuple(fleet), tuple(timed),
                    tuple(TimedZone(zone) for zone in volumes))


def _draw_zone(rng: np.random.Generator, name: str, shape: int, size: float) -> ThreatZone:
    """A zone inside the square, away from the south edge where the fleet starts."""
    radius = round(float(rng.uniform(0.03, 0.07)) * size, 1)
    x, y = (round(float(v), 1) for v in rng.uniform((0.2 * size, 0.25 * size), 0.8 * size))
    if shape == 0:
        return ThreatZone.hemisphere(name, (x, y, 0.0), max(radius, 120.0), 5.0)
    if shape == 1:
        return ThreatZone.cylinder(name, (x, y), radius, 0.0, 300.0, 5.0)
    corners = [(round(x + radius * math.cos(a), 1), round(y + radius * math.sin(a), 1))
               for a in np.linspace(0.0, 2.0 * math.pi, 5, endpoint=False)]
    return ThreatZone.polygon(name, corners, 0.0, 300.0, 5.0)
