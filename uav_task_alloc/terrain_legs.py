# SPDX-License-Identifier: Apache-2.0
"""Legs that keep clear of the ground and enter no zone: raised, or level around zones."""
from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Protocol

from uav_task_alloc.model import Point
from uav_task_alloc.terrain import Terrain, TerrainError

_SLACK = 0.1  # [m] that a leg may be lower than the clearance: rounding
_UPRIGHT = 0.5  # [m] of horizontal way in a climb or descent
_ROUNDS = 4  # of level ways, each higher than the one before


class ZoneWays(Protocol):
    """What legs over terrain ask of zones; all points are [m] ENU.

    Arguments of methods:
        a: start.
        b: end.
        low: [m] lowest point of the way.
        points: a polyline.
    """

    def way_around(self, a: Point, b: Point, low: float) -> tuple[Point, ...] | None:
        """Return the points between a and b of the shortest way around zones; None: no way."""

    def grade(self, points: Sequence[Point]) -> int:
        """Return how clear of zones a polyline is; more is better."""


class TerrainLegs:
    """Legs over one terrain.

    Args:
        terrain: the ground.
        clearance: [m] kept from it; ends that are lower are left and reached upright.
        top: [m] ENU, the highest point that may be added.
        zones: the ways around the zones.
    """

    def __init__(self, terrain: Terrain, clearance: float, top: float, zones: ZoneWays) -> None:
        self._terrain, self._clearance, self._top = terrain, clearance, top
        self._zones = zones

    def over(self, line: Sequence[Point]) -> tuple[Point, ...] | None:
        """Return the points of a leg that keeps clear of the ground.

        The way around the zones is raised where it is too low. Where that enters a zone, the leg
        climbs at its start, flies around the zones at one height, and descends at its end.

        Args:
            line: [m] ENU, from its start to its end, with the points of a way around zones.

        Returns:
            [m] ENU, without both ends; None where no such leg is below `top`.

        Raises:
            TerrainError: no data, or too many points would be needed.
        """
        higher = self._raised(line)
        if self._accepted(higher, line):
            return higher[1:-1]
        a, b, low = line[0], line[-1], max(z for _, _, z in higher)
        for _ in range(_ROUNDS):
            if low > self._top + _SLACK:
                return None
            level = [(p[0], p[1], max(p[2], low)) for p in (a, b)]
            between = self._zones.way_around(level[0], level[1], low)
            if between is None:
                return None
            try:
                higher = self._raised(_distinct((a, level[0], *between, level[1], b)))
            except TerrainError:
                return None  # it leads over ground that is not known
            if self._accepted(higher, line):
                return higher[1:-1]
            low = max(low + _SLACK, *(z for _, _, z in higher))
        return None

    def keeps(self, points: Sequence[Point], share: float = 1.0,
              upright: float = _UPRIGHT) -> bool:
        """Return whether a leg keeps clear of the ground, apart from upright parts.

        Args:
            points: [m] ENU, with both ends.
            share: of the clearance that has to be kept.
            upright: [m] horizontal length up to which a part counts as upright.

        Returns:
            False also where the ground is not known.
        """
        try:
            return all(self._terrain.least_clearance(a, b)[0] >= share * self._clearance - _SLACK
                       for a, b in pairwise(points) if math.dist(a[:2], b[:2]) > upright)
        except TerrainError:
            return False

    def _raised(self, line: Sequence[Point]) -> tuple[Point, ...]:
        """The line with points added; those between its ends are raised themselves."""
        inner = line[1:-1]
        floor = self._terrain.raised(inner, self._clearance + _SLACK) if inner else []
        points = [line[0], *((p[0], p[1], max(p[2], q[2]))
                             for p, q in zip(inner, floor, strict=True)), line[-1]]
        higher = [points[0]]
        for a, b in pairwise(points):
            if math.dist(a[:2], b[:2]) > _UPRIGHT:
                higher += self._terrain.lifted(a, b, self._clearance)
            higher.append(b)
        return _distinct(higher)

    def _accepted(self, higher: Sequence[Point], line: Sequence[Point]) -> bool:
        """Whether a raised line is low enough, and as clear of zones as it was before."""
        given = set(line)
        return (all(z <= self._top + _SLACK for x, y, z in higher if (x, y, z) not in given)
                and (tuple(higher) == tuple(line)
                     or self._zones.grade(higher) >= self._zones.grade(line)))


def _distinct(points: Sequence[Point]) -> tuple[Point, ...]:
    """Points without those that repeat the one before."""
    return points[0], *(b for a, b in pairwise(points) if math.dist(a, b) > 1e-6)
