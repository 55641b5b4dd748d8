# SPDX-License-Identifier: Apache-2.0
"""Queries about single zones: is a point inside, how far is it, is a segment clear?"""
from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from itertools import pairwise

from uav_task_alloc.checks import check_point
from uav_task_alloc.geometry.obstacles import blocked, containing_zones, contains, pack
from uav_task_alloc.geometry.polygon import contains_point, edges
from uav_task_alloc.geometry.polyline import segment_distance
from uav_task_alloc.model import Point, Shape, ThreatZone


def inside(point: Iterable[float], zone: ThreatZone, clearance: float = 0.0) -> bool:
    """Whether a point is inside a zone enlarged by its margin and `clearance`.

    Args:
        point: [m] ENU.
        zone: the zone.
        clearance: [m].

    Returns:
        False on the surface. The space beneath a dome is outside.

    Raises:
        InvalidValue: the point is not finite or the clearance is negative.
    """
    packed = pack((zone,), clearance)  # kept alive: its rows point into it
    return bool(contains(packed.rows[0], *check_point('point', point), True))


def zones_around(point: Iterable[float], zones: Sequence[ThreatZone],
                 clearance: float = 0.0) -> tuple[ThreatZone, ...]:
    """The enlarged zones that a point is inside of; O(zones).

    Args:
        point: [m] ENU.
        zones: each is enlarged by its margin and `clearance`.
        clearance: [m].

    Returns:
        In the order of `zones`.

    Raises:
        InvalidValue: as `inside`.
    """
    packed, place = pack(zones, clearance), check_point('point', point)
    if not zones:  # the kernel is not loaded
        return ()
    return tuple(zones[k] for k in containing_zones(packed.rows, *place))


def outline(zone: ThreatZone, clearance: float = 0.0) -> list[tuple[float, float]]:
    """The outline of a zone enlarged by its margin and `clearance`, in plan view.

    Args:
        zone: the zone.
        clearance: [m].

    Returns:
        Corners (x, y) [m] counter-clockwise, a polygon that circumscribes the enlarged cylinder or
        prism; none for a dome.
    """
    _, rim, _ = pack((zone,), clearance).outlines
    return [(float(x), float(y)) for x, y in rim]


def distance(point: Iterable[float], zone: ThreatZone) -> float:
    """Distance from a point to a zone as it is, without margin.

    Args:
        point: [m] ENU.
        zone: the zone.

    Returns:
        [m]; 0.0 inside.
    """
    x, y, z = check_point('point', point)
    if zone.shape is Shape.HEMISPHERE:
        return _to_dome(x, y, z, zone)
    above = max(zone.z_min - z, z - zone.z_max, 0.0)
    if zone.shape is Shape.CYLINDER:
        aside = max(0.0, math.hypot(x - zone.center[0], y - zone.center[1]) - zone.radius)
    elif contains_point(zone.vertices, (x, y)):
        aside = 0.0
    else:
        aside = min(segment_distance((x, y), a, b) for a, b in edges(zone.vertices))
    return math.hypot(aside, above)


def is_clear(a: Iterable[float], b: Iterable[float], zones: Sequence[ThreatZone],
             clearance: float = 0.0) -> bool:
    """Whether the segment ab [m] enters no zone enlarged by its margin and `clearance` [m]."""
    return cut_by(a, b, zones, clearance) is None


def cut_by(a: Iterable[float], b: Iterable[float], zones: Sequence[ThreatZone],
           clearance: float = 0.0) -> ThreatZone | None:
    """The first zone that a segment enters; O(zones).

    Args:
        a, b: ends of the segment [m] ENU.
        zones: each is enlarged by its margin and `clearance`.
        clearance: [m].

    Returns:
        None where the segment is clear of all.

    Raises:
        InvalidValue: as `inside`.
    """
    start, end = check_point('a', a), check_point('b', b)
    obstacles = pack(zones, clearance)
    for k, zone in enumerate(zones):
        if blocked(obstacles.rows[k], *start, *end, -math.inf, True):
            return zone
    return None


def path_is_clear(points: Sequence[Point], zones: Sequence[ThreatZone],
                  clearance: float = 0.0) -> bool:
    """Whether a polyline enters no zone; O(points zones).

    Args:
        points: [m] ENU.
        zones: each is enlarged by its margin and `clearance`.
        clearance: [m].

    Returns:
        True where it touches zones only.
    """
    return all(is_clear(a, b, zones, clearance) for a, b in pairwise(points))


def _to_dome(x: float, y: float, z: float, zone: ThreatZone) -> float:
    """Distance [m] from (x, y, z) to the upper half of a ball."""
    aside, up = math.hypot(x - zone.center[0], y - zone.center[1]), z - zone.center[2]
    if up >= 0.0:
        return max(0.0, math.hypot(aside, up) - zone.radius)
    return math.hypot(max(0.0, aside - zone.radius), up)
