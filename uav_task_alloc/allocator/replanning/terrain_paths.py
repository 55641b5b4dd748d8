# SPDX-License-Identifier: Apache-2.0
"""Safe paths around zones that keep clear of the ground.

Importing this module loads the compiled kernels.
"""
from __future__ import annotations

import math
from collections.abc import Sequence

from uav_task_alloc.allocator.replanning.zone_paths import ZonePaths
from uav_task_alloc.geometry.polyline import points_passed, polyline_length
from uav_task_alloc.model import Leg, Point, ThreatZone
from uav_task_alloc.params import AllocatorParams
from uav_task_alloc.terrain import Terrain, TerrainError
from uav_task_alloc.terrain_legs import TerrainLegs

_IN_FLIGHT = 0.5  # share of the clearance that a leg under way has to keep, as for zones
_UPRIGHT = 10.0  # [m] that a UAV may be beside the place where it climbs or descends
_MOST_KEPT = 20_000  # answers that are kept


class TerrainPaths(ZonePaths):
    """The `SafePaths` around zones and over the ground.

    Legs are planned with `terrain_clearance`; one under way keeps half of it, so that wind and
    errors of heights do not change it. The paths of tasks are judged when tasks are accepted.

    Args:
        zones: in force.
        params: as of `ZonePaths`, and `terrain_clearance`.
        terrain: the ground.

    Arguments of methods:
        a: start [m] ENU.
        b: end [m] ENU.
        points: polyline [m] ENU.
        position: of the UAV [m] ENU.
        leg: to a task or home.
        goal: its end [m] ENU.
        low: [m] ENU, lowest point of a way.
    """

    def __init__(self, zones: Sequence[ThreatZone], params: AllocatorParams,
                 terrain: Terrain) -> None:
        super().__init__(zones, params)
        self._legs = TerrainLegs(terrain, params.terrain_clearance, params.altitude_max, self)
        self._kept: dict[tuple[Point, ...], bool] = {}
        self._found: dict[tuple[Point, Point], Leg | None] = {}

    def leg(self, a: Point, b: Point) -> Leg | None:
        """Return a safe leg from a to b; None if none was found in the budget."""
        if len(self._found) > _MOST_KEPT:
            self._found.clear()
        if (a, b) not in self._found:
            try:
                self._found[a, b] = self._over(a, b)
            except TerrainError:
                self._found[a, b] = None
        return self._found[a, b]

    def _over(self, a: Point, b: Point) -> Leg | None:
        """A leg from a to b. Raises TerrainError."""
        flat = super().leg(a, b)
        via = None if flat is None else self._legs.over((a, *flat.via, b))
        return None if via is None else Leg(via, polyline_length((a, *via, b)))

    def why_none(self, a: Point, b: Point) -> str:
        """Return why there is no safe path from a to the home b."""
        return self.why_no_leg(a, b) or super().why_none(a, b)

    def why_no_leg(self, a: Point, b: Point) -> str:
        """Return why the ground leaves no leg from a to b; '' if it does."""
        try:
            if super().leg(a, b) is None or self._over(a, b) is not None:
                return ''
        except TerrainError as error:
            return str(error)
        return (f'{self.params.terrain_clearance:g} m above the ground a zone or altitude_max = '
                f'{self.params.altitude_max:g} m is in the way')

    def leg_clear(self, *points: Point) -> bool:
        """Return whether a leg enters no zone and keeps clear of the ground."""
        if len(self._kept) > _MOST_KEPT:
            self._kept.clear()
        if points not in self._kept:
            self._kept[points] = self._legs.keeps(points)
        return self._kept[points] and self.clear(*points)

    def rest_of_leg(self, position: Point, leg: Leg, goal: Point,
                    velocity: Point | None = None) -> float | None:
        """Return the length [m] still to fly of a leg; None if a zone or the ground cuts it."""
        ahead = leg.via[points_passed(position, (*leg.via, goal), velocity=velocity):]
        if not self._legs.keeps((position, *ahead, goal), _IN_FLIGHT, _UPRIGHT):
            return None
        return self.rest(position, leg, goal, velocity)

    # what legs over terrain ask of zones

    def way_around(self, a: Point, b: Point, low: float) -> tuple[Point, ...] | None:
        """Return the points between a and b of a way that is nowhere below `low` [m]."""
        if low >= self.params.altitude_max:
            return () if self.clear(a, b) else None
        found = self._find(a, b, low)
        return None if math.isinf(found.length) else found.points

    def grade(self, points: Sequence[Point]) -> int:
        """Return 2 for the whole clearance from zones, 1 for half of it, 0 for less."""
        return self.clear(*points) + (self.clear(*points) and self.planned_clear(*points))
