# SPDX-License-Identifier: Apache-2.0
"""Safe paths around zones: the obstacles are packed once for many questions.

Importing this module loads the compiled kernels.
"""
from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from uav_task_alloc.geometry.box_grid import BoxGrid
from uav_task_alloc.geometry.detour import Detour, find_detour
from uav_task_alloc.geometry.obstacles import Floats, Obstacles, blocked, pack
from uav_task_alloc.geometry.polyline import points_passed, polyline_length
from uav_task_alloc.geometry.search_budget import SearchBudget
from uav_task_alloc.model import Leg, Point, ThreatZone
from uav_task_alloc.params import AllocatorParams

_AT_POINT = 30.0  # [m] from a point that a vehicle is passing
_MAX_WORK = 20_000_000  # units in one search for a path, some 50 ms


class ZonePaths:
    """The `SafePaths` around `zones`.

    Paths are planned with the clearance; in flight half of it is left for wind and GPS error.

    Args:
        zones: in force.
        params: clearance [m], altitude limits [m] and `replan_margin` are used.

    Arguments of methods:
        a: start [m] ENU.
        b: end [m] ENU.
        points: polyline [m] ENU.
        position: of the UAV [m] ENU.
        leg: that is being flown.
        goal: its end [m] ENU.
    """

    def __init__(self, zones: Sequence[ThreatZone], params: AllocatorParams) -> None:
        self.zones, self.params = tuple(zones), params
        self.margin = params.replan_margin
        self._bare = pack(self.zones)
        self._wide = pack(self.zones, 0.5 * params.clearance)
        self._planned = pack(self.zones, params.clearance)
        self._low, self._high = _boxes(self._wide)
        self._wide_grid, self._planned_grid = (BoxGrid(*_boxes(each)) for each in (
            self._wide, self._planned))

    def leg(self, a: Point, b: Point) -> Leg | None:
        """Return the shortest safe leg from a to b; None if none was found in the budget."""
        found = self._find(a, b)
        return None if math.isinf(found.length) else Leg(found.points, found.length)

    def why_none(self, a: Point, b: Point) -> str:
        """Return why there is no safe path from a to the home b."""
        found = self._find(a, b)
        if found.goal_inside:
            return f'its home is inside zone {", ".join(found.goal_inside)}'
        return 'none was found in the time' if found.given_up else 'zones close it off'

    def why_no_leg(self, a: Point, b: Point) -> str:
        """Return '': what is in the way is a zone."""
        return ''

    def _find(self, a: Point, b: Point, low: float | None = None) -> Detour:
        """Search with a bounded budget, as this runs in the thread of the callbacks."""
        params, budget = self.params, SearchBudget()
        budget.start_stage(_MAX_WORK)
        return find_detour(a, b, self.zones, clearance=params.clearance,
                           altitude_min=params.altitude_min if low is None else low,
                           altitude_max=params.altitude_max,
                           budget=budget, obstacles=self._planned)

    def around(self, point: Point, up: float = 0.0, wide: bool = False) -> str:
        """Return the first zone that contains a point, or one less than `up` above it.

        Args:
            point: [m] ENU.
            up: [m].
            wide: with half the clearance, not the margin alone.

        Returns:
            Its id, '' where there is none. O(zones).
        """
        rows, top = (self._wide if wide else self._bare).rows, (*point[:2], point[2] + up)
        near = ((top >= self._low) & (point <= self._high)).all(axis=1)
        return next((self.zones[k].id for k in np.flatnonzero(near)
                     if blocked(rows[k], *point, *top, -np.inf, True)), '')

    def clear(self, *points: Point) -> bool:
        """Return whether a polyline enters no zone. O(zones near) a segment."""
        return not (self.zones and _cut(self._wide, self._wide_grid, points))

    def planned_clear(self, *points: Point) -> bool:
        """Return whether a polyline keeps the whole clearance from all zones."""
        return not (self.zones and _cut(self._planned, self._planned_grid, points))

    def leg_clear(self, *points: Point) -> bool:
        """Return whether a leg with these points is safe: it enters no zone."""
        return self.clear(*points)

    def rest(self, position: Point, leg: Leg, goal: Point,
             velocity: Point | None = None) -> float | None:
        """Return the length [m] still to fly of a leg under way; None if a zone cuts it.

        At a point of the leg it is not known whether the vehicle has passed it: either will do.
        Off the leg its `velocity` shows to which point it flies, see `points_passed`.
        """
        line = (*leg.via, goal)
        passed = points_passed(position, line, velocity=velocity)
        for n in (passed, passed + 1, passed - 1):
            if n != passed and not (0 <= n < len(line) and math.dist(
                    position, line[min(n, passed)]) <= _AT_POINT):
                continue
            if self.clear(position, *line[n:]):
                return polyline_length((position, *line[n:]))
        return None

    def rest_of_leg(self, position: Point, leg: Leg, goal: Point,
                    velocity: Point | None = None) -> float | None:
        """Return the length [m] still to fly of a leg to a task; None if a zone cuts it."""
        return self.rest(position, leg, goal, velocity)


def _boxes(obstacles: Obstacles) -> tuple[Floats, Floats]:
    """Lowest and highest corners (n, 3) [m] of the boxes around obstacles."""
    rows = obstacles.rows
    return (np.stack([rows['x0'], rows['y0'], rows['z0']], axis=1),
            np.stack([rows['x1'], rows['y1'], rows['z1']], axis=1))


def _cut(obstacles: Obstacles, grid: BoxGrid, points: Sequence[Point]) -> bool:
    """Whether a polyline enters an obstacle."""
    rows = obstacles.rows
    for a, b in pairwise(points):
        for k in grid.near(a, b):
            if blocked(rows[k], *a, *b, -np.inf, True):
                return True
    return False
