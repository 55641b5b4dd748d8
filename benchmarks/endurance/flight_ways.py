# SPDX-License-Identifier: Apache-2.0
"""Ways of random flights, and whether those reported as completed were flown from end to end."""
from __future__ import annotations

import math
import random
from collections import Counter
from itertools import pairwise

from flight_world import World

from uav_task_alloc.model import Point
from uav_task_alloc.sim.config import FlightMode

EVERY = 8.0  # [m] between the places along a way that are looked at
NEAR = 10.0  # [m] from a place: it was passed
WIND = 1.0  # [m] of a reached item from a point of a way
APART = 5.0  # [m] at least, of a point of a way from the place of another task


def random_ways(rng: random.Random, places: dict[str, Point], share: float,
                ) -> dict[str, tuple[Point, ...]]:
    """Make some of the tasks ways, which begin at their places.

    Args:
        rng: of the ways only.
        places: of the tasks, ENU [m].
        share: of the tasks, 0..1.
    """
    ways = {}
    for name, (x, y, z) in places.items():
        if rng.random() >= share:
            continue
        path, course = [(x, y, z)], rng.uniform(0.0, 2.0 * math.pi)
        others = [place for other, place in places.items() if other != name]
        for _ in range(rng.randint(1, 3)):
            course, point = _next_point(rng, path[-1], course)
            while any(math.dist(point, place) < APART for place in others):
                course, point = _next_point(rng, path[-1], course)
            path.append(point)
        ways[name] = tuple(path)
    return ways


def _next_point(rng: random.Random, before: Point, course: float) -> tuple[float, Point]:
    """A course near the one before, and a point on it."""
    x, y, z = before
    course += rng.uniform(-1.2, 1.2)
    length = rng.uniform(40.0, 120.0)
    return course, (x + length * math.cos(course), y + length * math.sin(course), z)


class WayJudge:
    """Follows one flight tick by tick.

    Args:
        world: of the flight.
        ways: by task id, ENU [m].
    """

    def __init__(self, world: World, ways: dict[str, tuple[Point, ...]]) -> None:
        self._world = world
        self._open = {name: set(_places(path)) for name, path in ways.items()}  # never passed
        self._points = [(name, point) for name, path in ways.items() for point in path[1:-1]]
        self._reached: Counter[tuple[str, Point]] = Counter()
        self._completed: set[str] = set()
        self.faults: list[str] = []
        self.counts: Counter[str] = Counter()

    def step(self, completed: set[str]) -> None:
        """Judge one tick.

        Args:
            completed: ids of the tasks reported until now.
        """
        flight = self._world.vehicle.flight
        if flight.mode is FlightMode.MISSION:
            at = flight.body.position
            for places in self._open.values():
                places.difference_update([p for p in places if math.dist(p, at) <= NEAR])
        for event in self._world.truth:
            for key in self._points if event.name == 'item_reached' else ():
                if math.dist(key[1], event.point) < WIND:
                    self._reached[key] += 1
                    self.counts['way_points_again'] += self._reached[key] == 2
        for name in (completed - self._completed) & self._open.keys():
            self._completed.add(name)
            self.counts['ways_completed'] += 1
            if self._open[name]:
                self.counts['false_completed'] += 1
                self.faults.append(f'{self._world.now:.1f} false_completed: {name}: '
                                   f'{len(self._open[name])} places of its way never passed')


def _places(path: tuple[Point, ...]) -> list[Point]:
    """Places along a way, its ends left out."""
    found = []
    for a, b in pairwise(path):
        count = max(1, int(math.dist(a, b) // EVERY))
        for k in range(1, count):
            found.append((a[0] + (b[0] - a[0]) * k / count, a[1] + (b[1] - a[1]) * k / count,
                          a[2] + (b[2] - a[2]) * k / count))
    return found
