# SPDX-License-Identifier: Apache-2.0
"""Random zones and points between them, and a count of samples that are too near to a zone."""
import math
from itertools import pairwise

import numpy as np

from uav_task_alloc.geometry.zones import inside
from uav_task_alloc.model import Shape, ThreatZone

CLEARANCE = 5.0  # [m] in all comparisons


def random_zone(rng: np.random.Generator, name: str, side: float, size: float,
                shapes: str = 'hcp') -> ThreatZone:
    """A zone of about `size` [m] within a square of `side` [m]; shape e: a dome above ground."""
    x, y = rng.uniform(0, side, 2)
    radius = size * rng.uniform(0.4, 1.0)
    margin = float(rng.choice([0.0, 5.0]))
    shape = rng.choice(list(shapes))
    low = float(rng.choice([-math.inf, 0.0, 40.0]))
    high = float(rng.choice([80.0, 150.0, math.inf]))
    if shape in 'he':
        return ThreatZone.hemisphere(name, (x, y, 40.0 * (shape == 'e')), radius, margin)
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
    line, count = [], 0
    for a, b in pairwise(np.asarray(points, float)):
        steps = max(1, math.ceil(np.linalg.norm(b - a)))
        line.append(a + np.linspace(0.0, 1.0, steps + 1)[:, None] * (b - a))
    samples = np.vstack(line)
    for zone in zones:
        aside, above = apart(samples, zone)
        near = np.hypot(np.maximum(0.0, aside), np.maximum(0.0, above))
        inside_it = (aside < -1e-6) & (above < -1e-6)
        count += int(np.sum(inside_it | (near < zone.margin + clearance - 1e-6)))
    return count


def apart(samples: np.ndarray, zone: ThreatZone) -> tuple[np.ndarray, np.ndarray]:
    """How far samples are from a zone, sideways and upwards [m]; both negative: inside."""
    x, y, z = samples.T
    if zone.shape is Shape.POLYGON:
        return -_in_polygon(x, y, zone), np.maximum(zone.z_min - z, z - zone.z_max)
    aside = np.hypot(x - zone.center[0], y - zone.center[1])
    if zone.shape is Shape.CYLINDER:
        return aside - zone.radius, np.maximum(zone.z_min - z, z - zone.z_max)
    up = z - zone.center[2]
    return (np.where(up >= 0, np.hypot(aside, up), aside) - zone.radius,
            np.where(up > 0, np.minimum(-up, 0.0), -up))


def _in_polygon(x: np.ndarray, y: np.ndarray, zone: ThreatZone) -> np.ndarray:
    """Distance in plan to the polygon's edges [m], negative outside; by winding number."""
    corners = np.array(zone.vertices)
    edges = np.roll(corners, -1, axis=0) - corners
    to = np.column_stack([x, y])[:, None] - corners
    along = np.clip((to * edges).sum(2) / (edges * edges).sum(1), 0.0, 1.0)
    edge = np.linalg.norm(to - along[..., None] * edges, axis=2).min(1)
    next_to = np.roll(to, -1, axis=1)
    turns = np.arctan2(to[..., 0] * next_to[..., 1] - to[..., 1] * next_to[..., 0],
                       (to * next_to).sum(2)).sum(1)
    return np.where(np.abs(turns) > np.pi, edge, -edge)
