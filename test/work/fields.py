# SPDX-License-Identifier: Apache-2.0
"""Random fields with holes and zones, and a raster that says what of them ways have covered."""
import math
from itertools import pairwise

import numpy as np

from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.model import Shape, Task, ThreatZone
from uav_task_alloc.work.pieces import Work
from uav_task_alloc.work.values import Kind

HEIGHT = 50.0  # [m] of flight


def star(rng, x, y, radius, corners, rough):
    """A polygon around a place: corners [m] by angle, at `1 - rough` to 1 of the radius."""
    angles = sorted(rng.uniform(0.0, 2 * math.pi) for _ in range(corners))
    reach = [radius * rng.uniform(1.0 - rough, 1.0) for _ in angles]
    return [(x + r * math.cos(angle), y + r * math.sin(angle))
            for angle, r in zip(angles, reach, strict=True)]


def random_zones(rng, size, most):
    """Zones of all shapes around a field."""
    zones = []
    for k in range(rng.randint(0, most)):
        x, y, margin = rng.uniform(-size, size), rng.uniform(-size, size), rng.uniform(0.0, 5.0)
        radius = size * rng.uniform(0.05, 0.25)
        shape = rng.choice(list(Shape))
        if shape is Shape.CYLINDER:
            zones.append(ThreatZone.cylinder(f'z{k}', (x, y), radius, 0.0, 100.0, margin))
        elif shape is Shape.HEMISPHERE:
            zones.append(ThreatZone.hemisphere(f'z{k}', (x, y, 0.0), radius + 30.0, margin))
        else:
            corners = star(rng, x, y, radius, rng.randint(4, 8), 0.5)
            zones.append(ThreatZone.polygon(f'z{k}', corners, 0.0, 100.0, margin))
    return zones


def random_field(rng, holes=3, zones=4):
    """An AREA and zones, drawn again until it is valid."""
    while True:
        size = rng.uniform(100.0, 500.0)
        outer = star(rng, 0.0, 0.0, size, rng.randint(3, 14), rng.uniform(0.1, 0.7))
        inner = [star(rng, rng.uniform(-size, size) / 2, rng.uniform(-size, size) / 2,
                      size * rng.uniform(0.05, 0.2), rng.randint(3, 8), 0.5)
                 for _ in range(rng.randint(0, holes))]
        try:
            return field(outer, rng.uniform(size / 25, size / 6), inner), random_zones(
                rng, size, zones)
        except InvalidValue:
            continue


def field(outer, width, holes=(), **more):
    """An AREA at HEIGHT."""
    return Work(Task('f', (0.0, 0.0, 0.0)), Kind.AREA, [(*corner, HEIGHT) for corner in outer],
                [[(*corner, 0.0) for corner in hole] for hole in holes], width, **more)


class Raster:
    """Points of a field outside its holes and zones, and which of them have been covered."""

    def __init__(self, work, zones, clearance, points=300):
        xs, ys, _ = np.transpose(work.path)
        self.x, self.y = np.meshgrid(np.linspace(xs.min(), xs.max(), points),
                                     np.linspace(ys.min(), ys.max(), points))
        wanted = self._in(work.path)
        for hole in work.holes:
            wanted &= ~self._in(hole)
        for zone in zones:
            wanted &= ~self._near(zone, zone.margin + clearance)
        self.x, self.y = self.x[wanted], self.y[wanted]
        self.covered = np.zeros(self.x.shape, bool)

    def share(self):
        """Of what can be reached; 1.0 where nothing can."""
        return float(self.covered.mean()) if self.covered.size else 1.0

    def fly(self, path, width):
        """Cover the rectangles around the segments of a way."""
        for a, b in pairwise(path):
            dx, dy = b[0] - a[0], b[1] - a[1]
            length = math.hypot(dx, dy)
            if length > 0.0:
                px, py = self.x - a[0], self.y - a[1]
                along, aside = (px * dx + py * dy) / length, (py * dx - px * dy) / length
                self.covered |= ((along >= -1e-6) & (along <= length + 1e-6)
                                 & (abs(aside) <= width / 2 + 1e-6))

    def _in(self, ring):
        inside = np.zeros(self.x.shape, bool)
        for a, b in zip(ring, [*ring[1:], ring[0]], strict=True):
            if a[1] != b[1]:
                x = a[0] + (self.y - a[1]) * (b[0] - a[0]) / (b[1] - a[1])
                inside ^= ((a[1] > self.y) != (b[1] > self.y)) & (self.x < x)
        return inside

    def _near(self, zone, grow):
        away = np.hypot(self.x - zone.center[0], self.y - zone.center[1])
        if zone.shape is Shape.CYLINDER:
            return away < zone.radius + grow
        if zone.shape is Shape.HEMISPHERE:
            return np.hypot(away, HEIGHT) < zone.radius + grow
        inside = self._in(zone.vertices)
        for a, b in zip(zone.vertices, [*zone.vertices[1:], zone.vertices[0]], strict=True):
            dx, dy = b[0] - a[0], b[1] - a[1]
            t = np.clip(((self.x - a[0]) * dx + (self.y - a[1]) * dy) / (dx * dx + dy * dy), 0, 1)
            inside |= np.hypot(self.x - a[0] - t * dx, self.y - a[1] - t * dy) < grow
        return inside
