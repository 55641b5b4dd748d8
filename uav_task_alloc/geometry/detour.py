# SPDX-License-Identifier: Apache-2.0
"""The shortest safe path between two points, with the waypoints that fly it."""
from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from uav_task_alloc.checks import check_instances, check_number, check_point
from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.geometry.obstacles import Floats, Obstacles, containing_zones, pack
from uav_task_alloc.geometry.scene import path_found
from uav_task_alloc.geometry.search_budget import SearchBudget
from uav_task_alloc.model import Point, ThreatZone


@dataclass(frozen=True, slots=True)
class Detour:
    """A path between two points and what is special about it.

    `length` is inf and `points` is empty where there is no path.
    """

    length: float  # [m] of the polyline, from end to end
    points: tuple[Point, ...] = ()  # [m] ENU, without both ends
    start_inside: tuple[str, ...] = ()  # zones to leave first; points[0] is then outside
    goal_inside: tuple[str, ...] = ()  # zones that make the goal unreachable
    closed_off: bool = False  # zones and altitude limits leave no path
    given_up: bool = False  # the budget was spent before one was found; there may be one

    @property
    def reason(self) -> str:
        """Why there is no path, or that it starts inside a zone; empty: nothing special."""
        if self.goal_inside:
            return f'the goal is inside zone {", ".join(self.goal_inside)}'
        if self.given_up:
            return 'no safe path found in the time'
        if self.closed_off:
            return 'closed off by zones'
        if self.start_inside:
            return f'the start is inside zone {", ".join(self.start_inside)}, left first'
        return ''


def detour(a: Iterable[float], b: Iterable[float], zones: Iterable[ThreatZone] = (), *,
           clearance: float = 0.0, altitude_min: float = -math.inf,
           altitude_max: float = math.inf) -> tuple[float, tuple[Point, ...]]:
    """Find the shortest path between two points that stays outside every zone.

    Args:
        a: start [m] ENU. Inside zones the path first leads to the nearest point outside.
        b: goal [m] ENU.
        zones: each is enlarged by its own margin and `clearance`.
        clearance: [m], at least 0.
        altitude_min: lowest waypoint [m] ENU; does not bind a and b.
        altitude_max: highest waypoint [m] ENU; does not bind a and b.

    Returns:
        Length [m] of the polyline a, waypoints, b, and its waypoints [m] ENU without a and b.
        (inf, ()) where there is no path.

    Raises:
        InvalidValue: a point is not finite, something else is among the zones, the clearance is
            negative, or the limits are reversed.
    """
    found = find_detour(a, b, check_instances('zones', zones, ThreatZone), clearance=clearance,
                        altitude_min=altitude_min, altitude_max=altitude_max)
    return found.length, found.points


def find_detour(a: Iterable[float], b: Iterable[float], zones: Iterable[ThreatZone] = (), *,
                clearance: float = 0.0, altitude_min: float = -math.inf,
                altitude_max: float = math.inf, budget: SearchBudget | None = None,
                obstacles: Obstacles | None = None) -> Detour:
    """As `detour`, and report what is special about the path.

    Args:
        a: start [m] ENU.
        b: goal [m] ENU.
        zones: each is enlarged by its own margin and `clearance`.
        clearance: [m], at least 0.
        altitude_min: lowest waypoint [m] ENU; does not bind a and b.
        altitude_max: highest waypoint [m] ENU; does not bind a and b.
        budget: what the search may spend; None: no limit.
        obstacles: the zones with the clearance, packed before; None: they are packed now.

    Returns:
        The path, or why there is none.

    Raises:
        InvalidValue: as `detour`.
    """
    start, goal, zones = check_point('a', a), check_point('b', b), tuple(zones)
    limits = check_limits(altitude_min, altitude_max)
    obstacles = obstacles or pack(zones, clearance)
    start_inside = _around(obstacles, zones, start)
    goal_inside = _around(obstacles, zones, goal)
    if goal_inside:
        return Detour(math.inf, (), start_inside, goal_inside)
    length, points = path_between(obstacles, start, goal, limits, budget)
    if math.isnan(length):
        return Detour(math.inf, (), start_inside, given_up=True)
    return Detour(length, points, start_inside, (), math.isinf(length))


def check_limits(altitude_min: float, altitude_max: float) -> Floats:
    """Check altitude limits.

    Returns:
        (altitude_min, altitude_max) [m], float64, as kernels take them.

    Raises:
        InvalidValue: they are reversed, or not numbers.
    """
    limits = (check_number('altitude_min', altitude_min, -math.inf),
              check_number('altitude_max', altitude_max, -math.inf))
    if limits[0] > limits[1]:
        raise InvalidValue('altitude_min, altitude_max', limits, 'altitude_min <= altitude_max')
    return np.array(limits, dtype=np.float64)


def path_between(obstacles: Obstacles, start: Point, goal: Point, limits: Floats,
                 budget: SearchBudget | None = None) -> tuple[float, tuple[Point, ...]]:
    """Find the shortest path from a start to a goal outside all zones.

    Args:
        obstacles: the enlarged zones.
        start: [m] ENU; inside a zone the path first leads out of it.
        goal: [m] ENU.
        limits: altitude_min and altitude_max [m].
        budget: what the search may spend; None: no limit.

    Returns:
        Length [m] and waypoints [m] without both ends. inf: there is no path; NaN: none was found
        within the budget.
    """
    length, path, exits = path_found(np.array([start, goal]), obstacles.rows, limits, budget)
    first = as_points(exits)
    before = math.dist(start, first[0]) if first else 0.0
    return before + length, (*first, *as_points(path[1:-1]))


def as_points(rows: Floats) -> tuple[Point, ...]:
    """Rows of a float64 array of shape (n, 3) as points [m]."""
    return tuple((float(x), float(y), float(z)) for x, y, z in rows)


def _around(obstacles: Obstacles, zones: Sequence[ThreatZone], point: Point) -> tuple[str, ...]:
    return tuple(zones[k].id for k in containing_zones(obstacles.rows, *point))
