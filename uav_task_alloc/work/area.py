# SPDX-License-Identifier: Apache-2.0
"""AREA: a polygon with holes, covered by strips of equal width at one height."""
from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

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
_SAME = 0.5  # [m] that a flown way may be above or below an area, and count for it
_LEVEL = 10.0  # [m] by which the heights of corners may differ: the earth curves


@dataclass(frozen=True, slots=True)
class FlownStrips:
    """Ways that are flown over an area, and how wide each of them has covered it."""

    ways: tuple[tuple[tuple[Point, ...], float], ...] = ()  # [m] ENU, [m]

    def rings(self, height: float) -> list[list[XY]]:
        """What those at a height have covered: a rectangle [m] around each leg.

        Args:
            height: [m] of the area.
        """
        found: list[list[XY]] = []
        for width, (ax, ay, az), (bx, by, bz) in (
                (width, *leg) for way, width in self.ways for leg in pairwise(way)):
            length = math.hypot(bx - ax, by - ay)
            if length > 0.0 and abs(az - height) <= _SAME and abs(bz - height) <= _SAME:
                x, y = 0.5 * width * (ay - by) / length, 0.5 * width * (bx - ax) / length
                found.append([(ax - x, ay - y), (bx - x, by - y), (bx + x, by + y),
                              (ax + x, ay + y)])
        return found


NOTHING_FLOWN = FlownStrips()


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


def area_ways(given: Geometry, zones: Sequence[ThreatZone], clearance: float,
              flown: FlownStrips = NOTHING_FLOWN) -> list[tuple[Point, ...]]:
    """Cut an AREA into strips.

    Args:
        given: checked.
        zones: are holes as well; each is enlarged by its margin and `clearance`.
        clearance: [m].
        flown: what it has covered is left out.

    Returns:
        [m], z as that of the path; none where zones and what is flown cover all of it.

    Raises:
        InvalidValue: there would be too many strips.
    """
    height = math.fsum(z for _, _, z in given.path) / len(given.path)
    x0, y0, _ = given.path[0]  # near the corners, where rounding is small

    def near(points: Sequence[Sequence[float]]) -> list[XY]:
        return [(point[0] - x0, point[1] - y0) for point in points]

    region = Region(near(given.path), tuple(near(hole) for hole in given.holes), tuple(
        near(ring) for ring in sections(zones, height, height, clearance)),
        tuple(near(ring) for ring in flown.rings(height)))
    ways = cover(region, given.strip_width, given.direction, given.place('strip_width'))
    return [tuple((x + x0, y + y0, height) for x, y in way) for way in ways]
