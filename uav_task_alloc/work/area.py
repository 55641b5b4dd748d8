# SPDX-License-Identifier: Apache-2.0
"""AREA: a polygon with holes, covered by strips of equal width at one height."""
from __future__ import annotations

import math
from collections.abc import Sequence

from uav_task_alloc.checks import check_number, check_polygon
from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.geometry.polygon import XY, contains_point, edges, segments_cross
from uav_task_alloc.geometry.polyline import segment_distance
from uav_task_alloc.model import Point, ThreatZone
from uav_task_alloc.work.cells import Region
from uav_task_alloc.work.strips import cover
from uav_task_alloc.work.values import Geometry, refuse_unused
from uav_task_alloc.work.zone_sections import sections

_USED = 'path', 'holes', 'strip_width', 'direction'
_LEVEL = 10.0  # [m] by which the heights of corners may differ: the earth curves


def check_area(given: Geometry) -> None:
    """Check an AREA; a last corner equal to the first is dropped.

    Raises:
        InvalidValue: a ring crosses itself, a hole is not inside, or a value is missing.
    """
    refuse_unused(given, _USED)
    outer = check_polygon(given.place('path'), given.path)
    object.__setattr__(given, 'path', given.path[:len(outer)])
    heights = [z for _, _, z in given.path]
    if max(heights) - min(heights) > _LEVEL:
        raise InvalidValue(given.place('path'), (min(heights), max(heights)),
                           f'corners at one height; these differ by more than {_LEVEL:g} m')
    check_number(given.place('strip_width'), given.strip_width, 0.0, open_low=True)
    for k, hole in enumerate(given.holes):
        corners = check_polygon(given.place(f'holes[{k}]'), hole)
        object.__setattr__(given, 'holes', (
            *given.holes[:k], hole[:len(corners)], *given.holes[k + 1:]))
        if not _within(corners, outer):
            raise InvalidValue(given.place(f'holes[{k}]'), corners, 'corners inside of path')


def _within(hole: Sequence[XY], outer: Sequence[XY]) -> bool:
    """Whether a polygon is inside another one; it may touch it."""
    return all(contains_point(outer, corner) or any(
        segment_distance(corner, a, b) < 1e-6 for a, b in edges(outer)) for corner in hole
    ) and not any(segments_cross(a, b, c, d) for a, b in edges(hole) for c, d in edges(outer))


def area_ways(given: Geometry, zones: Sequence[ThreatZone],
              clearance: float) -> list[tuple[Point, ...]]:
    """Cut an AREA into strips.

    Args:
        given: checked.
        zones: are holes as well; each is enlarged by its margin and `clearance`.
        clearance: [m].

    Returns:
        [m], z as that of the path; none where zones cover all of it.

    Raises:
        InvalidValue: there would be too many strips.
    """
    height = math.fsum(z for _, _, z in given.path) / len(given.path)
    x0, y0, _ = given.path[0]  # near the corners, where rounding is small

    def near(points: Sequence[Sequence[float]]) -> list[XY]:
        return [(point[0] - x0, point[1] - y0) for point in points]

    region = Region(near(given.path), tuple(near(hole) for hole in given.holes), tuple(
        near(ring) for ring in sections(zones, height, height, clearance)))
    ways = cover(region, given.strip_width, given.direction, given.place('strip_width'))
    return [tuple((x + x0, y + y0, height) for x, y in way) for way in ways]
