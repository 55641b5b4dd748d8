# SPDX-License-Identifier: Apache-2.0
"""Work whose heights are above the ground: its points and ways in the ENU frame."""
from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from uav_task_alloc.geometry.polyline import point_at, segment_fraction
from uav_task_alloc.model import Point, Shape, Task, ThreatZone
from uav_task_alloc.terrain import Terrain
from uav_task_alloc.work.values import Geometry
from uav_task_alloc.work.zone_sections import free_parts

_ON = 1e-6  # [m], and of a way: so near to a straight way a point is on it
_ALL = 0.999  # share of the ways over a zone that is inside of it where it bars all of them
_TOLERANCE = 0.1, 2.0  # share of the height above ground, and at least [m], that ways may be off


def above_ground_task(given: Geometry, terrain: Terrain) -> Task:
    """The task of work with its position in the ENU frame.

    Args:
        given: with heights above ground.
        terrain: the ground.

    Returns:
        The same task at that height.

    Raises:
        TerrainError: no data.
    """
    position, = terrain.raised([given.task.position], given.task.position[2])
    return replace(given.task, position=position)


def following_ways(given: Geometry, ways: list[tuple[Point, ...]], terrain: Terrain,
                   known: Sequence[tuple[Point, ...]] = ()) -> list[tuple[Point, ...]]:
    """Ways that follow the ground.

    Args:
        given: the work.
        ways: x, y [m] ENU and z [m] above the ground.
        terrain: the ground.
        known: straight ways that follow the ground already [m] ENU: what leads along them has
            their heights, so that the same part of a strip is the same way in each cut.

    Returns:
        [m] ENU, each with points added where the ground bends.

    Raises:
        TerrainError: no data.
    """
    lowest = min(z for way in ways for _, _, z in way)
    share, least = _TOLERANCE
    tolerance = max(least, share * lowest)
    if not known:
        return [terrain.followed(way, tolerance) for way in ways]
    found = []
    for way in ways:
        points: list[Point] = []
        for a, b in pairwise(way):
            part = next((part for each in known if (part := _part_between(each, a, b))), ())
            points += (part or terrain.followed((a, b), tolerance))[bool(points):]
        found.append(tuple(points))
    return found


def _part_between(way: tuple[Point, ...], a: Point, b: Point) -> tuple[Point, ...]:
    """The part of a straight way from a to b in plan view; () where these are not on it."""
    first, last = way[0][:2], way[-1][:2]
    ends = [segment_fraction(point[:2], first, last) for point in (a, b)]
    if not all(-_ON <= share <= 1.0 + _ON and math.dist(
            point[:2], point_at(first, last, share)) <= _ON
            for point, share in zip((a, b), ends, strict=True)):
        return ()
    shares = [segment_fraction(point[:2], first, last) for point in way]
    start, end = ((x, y, float(np.interp(share, shares, [z for _, _, z in way])))
                  for (x, y, _), share in zip((a, b), ends, strict=True))
    inner = [point for point, share in zip(way, shares, strict=True)
             if min(ends) + _ON < share < max(ends) - _ON]
    return start, *(inner if ends[0] < ends[1] else inner[::-1]), end


def barring_zones(ways: Iterable[Sequence[Point]], zones: Iterable[ThreatZone],
                  clearance: float) -> dict[str, ThreatZone]:
    """Zones that no way leads over or below: strips can be cut around them in plan view.

    Args:
        ways: [m] ENU, that follow the ground and may enter zones.
        zones: each is enlarged by its margin and `clearance`.
        clearance: [m].

    Returns:
        Such zones without limits of height, by id; no hemispheres, which are as wide as they are
        at the height of a way.
    """
    legs = [pair for way in ways for pair in pairwise(way)]
    found = {}
    for zone in zones:
        if zone.shape is Shape.HEMISPHERE:
            continue
        endless = replace(zone, z_min=-math.inf, z_max=math.inf)
        most = _length_inside(legs, endless, clearance)
        if most > 0.0 and _length_inside(legs, zone, clearance) >= _ALL * most:
            found[zone.id] = endless
    return found


def _length_inside(legs: Iterable[tuple[Point, Point]], zone: ThreatZone,
                   clearance: float) -> float:
    """Length [m] of the parts of legs that are inside a zone."""
    return math.fsum(math.dist(a, b) * (1.0 - math.fsum(
        end - start for start, end in free_parts(a, b, (zone,), clearance))) for a, b in legs)
