# SPDX-License-Identifier: Apache-2.0
"""LINE: a way through points, flown from either end; cut where it enters zones."""
from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.model import Point, ThreatZone
from uav_task_alloc.work.values import Geometry, check_steps, refuse_unused
from uav_task_alloc.work.zone_sections import free_parts, joined_parts

_USED = ('path',)
_SHORTEST = 0.1  # [m] of what is left of a way beside a zone


def check_line(given: Geometry) -> None:
    """Check a LINE.

    Raises:
        InvalidValue: it has less than two points, or two the same in a row.
    """
    refuse_unused(given, _USED)
    if len(given.path) < 2:
        raise InvalidValue(given.place('path'), given.path, 'at least 2 points')
    check_steps(given)


def line_ways(given: Geometry, zones: Sequence[ThreatZone],
              clearance: float) -> list[tuple[Point, ...]]:
    """Cut a LINE: at its points where it is divisible, and where it enters zones.

    Args:
        given: checked.
        zones: each is enlarged by its margin and `clearance`.
        clearance: [m].

    Returns:
        [m] the ways outside all zones, in order.
    """
    ways = free_ways(given.path, zones, clearance)
    return [pair for way in ways for pair in pairwise(way)] if given.divisible else ways


def free_ways(path: Sequence[Point], zones: Sequence[ThreatZone],
              clearance: float) -> list[tuple[Point, ...]]:
    """The parts of a polyline that enter no zone.

    Args:
        path: [m] ENU.
        zones: each is enlarged by its margin and `clearance`.
        clearance: [m].

    Returns:
        Polylines in the order of the path.
    """
    return joined_parts(path, lambda a, b: free_parts(a, b, zones, clearance), _SHORTEST)
