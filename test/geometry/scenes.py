# SPDX-License-Identifier: Apache-2.0
"""Random zones and points between them, and a count of samples that are too near to a zone."""
import math
from itertools import pairwise

import numpy as np

from uav_task_alloc.geometry.zones import distance, inside
from uav_task_alloc.model import ThreatZone

CLEARANCE = 5.0  # [m] in all comparisons


def random_zone(rng: np.random.Generator, name: str, side: float, size: float,
                shapes: str = 'hcp') -> ThreatZone:
    """A zone of about `size` [m] within a square of `side` [m]."""
    x, y = rng.uniform(0, side, 2)
    radius = size * rng.uniform(0.4, 1.0)
    margin = float(rng.choice([0.0, 5.0]))
    shape = rng.choice(list(shapes))
    low = float(rng.choice([-math.inf, 0.0, 40.0]))
    high = float(rng.choice([80.0, 150.0, math.inf]))
    if shape == 'h':
        return ThreatZone.hemisphere(name, (x, y, 0.0), radius, margin)
    if shape == 'c':
        return ThreatZone.cylinder(name, (x, y), radius, low, high, margin)
    count = int(rng.integers(3, 8))
    angles = np.sort(rng.uniform(0, 2 * math.pi / count, count)
                     + np.arange(count) * 2 * math.pi / count)
    reach = radius * rng.uniform(0.4, 1.0, count)
    return ThreatZone.polygon(name, np.column_stack([x + reach * np.cos(angles),
                                                     y + reach * np.sin(angles)]), low, high,
                              margin)


def random_zones(rng: np.random.Generator, count: int, apart: bool, side: float = 4000.0,
                 size: float = 300.0, shapes: str = 'hcp') -> list[ThreatZone]:
    """Zones that overlap freely, or are `apart`: their circles in plan do not meet."""
    zones: list[ThreatZone] = []
    circles: list[tuple[float, float, float]] = []
    while len(zones) < count:
        zone = random_zone(rng, f'z{len(zones)}', side, size, shapes)
        plan = np.array(zone.vertices or [zone.center[:2]])
        x, y = (plan.max(0) + plan.min(0)) / 2
        reach = (np.hypot(*(plan - (x, y)).T).max() + zone.radius + zone.margin + CLEARANCE + 2)
        if not apart or all(math.hypot(x - u, y - v) > reach + r for u, v, r in circles):
            zones.append(zone)
            circles.append((x, y, reach))
    return zones


def random_point(rng: np.random.Generator, zones: list[ThreatZone],
                 side: float = 4000.0) -> tuple[float, float, float]:
    """A point outside all zones."""
    while True:
        x, y = rng.uniform(0, side, 2)
        point = float(x), float(y), float(rng.uniform(5, 120))
        if not any(inside(point, zone, CLEARANCE) for zone in zones):
            return point


def violations(points: list[tuple[float, float, float]], zones: list[ThreatZone],
               clearance: float = CLEARANCE) -> int:
    """Samples, one a metre, that are nearer to a zone than margin + clearance."""
    count = 0
    for a, b in pairwise(points):
        steps = max(1, math.ceil(math.dist(a, b)))
        for t in np.linspace(0.0, 1.0, steps + 1):
            sample = tuple(p + t * (q - p) for p, q in zip(a, b, strict=True))
            for zone in zones:
                near = distance(sample, zone)
                count += near < zone.margin + clearance - 1e-6 or near == 0.0
    return count
