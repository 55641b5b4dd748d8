# SPDX-License-Identifier: Apache-2.0
"""Parallel ways that cover a plane region, turned off where no UAV may fly."""
from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.geometry.polygon import XY, edges, signed_area
from uav_task_alloc.geometry.polyline import polyline_length
from uav_task_alloc.work.cells import (
    PlaneCell,
    Region,
    between,
    cells_area,
    clip,
    crossings,
    merged_spans,
    slab_cells,
    turn,
)
from uav_task_alloc.work.values import MOST_PIECES
from uav_task_alloc.work.zone_sections import Span, remaining, ring_spans

PlaneWay = list[XY]  # [m] from one end to the other
_SHIFTS = 0.0, 0.5, -0.5, 0.25, -0.25, 0.375, -0.375, 0.125, -0.125  # of a strip, tried in order
_SCRAP = 0.02  # of the square of the width: what is smaller is left out
_TRIM = 0.001  # of the area: so much may be left out at all pointed ends on one side
_MOST_DIRECTIONS = 8  # that are compared, by the number of strips
_ALIKE = math.radians(0.5)  # directions that differ by less are one


def cover(region: Region, width: float, direction: float | None, place: str) -> list[PlaneWay]:
    """Ways in parallel strips over a region; each strip is within half a width of its way.

    Args:
        region: [m].
        width: [m] > 0.
        direction: [rad] of the strips; None: of all directions of edges the one with the shortest
            total way, where each strip more counts as a way of one width.
        place: of the width, for errors.

    Returns:
        In the order of strips, those of a strip from one end to the other; none where the region
        has no area outside the barred rings.

    Raises:
        InvalidValue: there would be more than MOST_PIECES.
    """
    points = crossings(region.rings)
    ranked = sorted((_height(region, angle), angle) for angle in (
        _directions(region) if direction is None else [direction]))
    if ranked[0][0] > MOST_PIECES * width:
        raise InvalidValue(place, width, f'at least {ranked[0][0] / MOST_PIECES:.3g} m: more than '
                                         f'{MOST_PIECES} strips otherwise')
    best: tuple[float, float, int] | None = None  # cost, direction, pieces
    for height, angle in ranked[:_MOST_DIRECTIONS]:
        if height > MOST_PIECES * width:
            break
        ways = _strips(region, angle, points, width, 0.0)
        cost = snake_length(ways) + width * len(ways)
        if best is None or cost < best[0] - 1e-6:
            best = cost, angle, len(ways)
    assert best is not None
    if best[2] > MOST_PIECES:
        raise InvalidValue(place, width, f'wider strips: {best[2]} pieces, and at most '
                                         f'{MOST_PIECES} are allowed')
    return [turn(way, best[1]) for way in _strips(region, best[1], points, width, _TRIM)]


def _directions(region: Region) -> list[float]:
    """Directions [rad] of the edges of the region and its holes, in [0, pi)."""
    found: list[float] = []
    for ring in (region.outer, *region.holes):
        for (ax, ay), (bx, by) in edges(ring):
            angle = math.atan2(by - ay, bx - ax) % math.pi
            if not any(abs(math.remainder(angle - other, math.pi)) < _ALIKE for other in found):
                found.append(angle)
    return found


def _height(region: Region, angle: float) -> float:
    ys = [y for _, y in turn(region.outer, -angle)]
    return max(ys) - min(ys)


def snake_length(ways: Sequence[PlaneWay]) -> float:
    """Length [m] of ways flown in their order, each from its nearer end."""
    total, at = 0.0, None
    for way in ways:
        ends = way if at is None or math.dist(at, way[0]) <= math.dist(at, way[-1]) else way[::-1]
        total += polyline_length(ends if at is None else [at, *ends])
        at = ends[-1]
    return total


def _strips(given: Region, angle: float, crossed: Iterable[XY], width: float,
            trim: float) -> list[PlaneWay]:
    """Ways in a direction, turned to be along x; edges cross at `crossed`."""
    region, levels = given.turned(-angle), [y for _, y in turn(crossed, -angle)]
    ys = [y for _, y in region.outer]
    low, high = min(ys), max(ys)
    count = max(1, math.ceil((high - low) / width - 1e-9))
    step = (high - low) / count
    strips: list[list[PlaneCell]] = [[] for _ in range(count)]
    for middle, cell in slab_cells(region, [*levels, *(low + k * step for k in range(count + 1))]):
        strips[min(count - 1, max(0, int((middle - low) / step)))].append(cell)
    # without the barred rings, so that a zone changes no strip elsewhere
    holes = sum(abs(signed_area(hole)) for hole in given.holes)
    area = max(0.0, abs(signed_area(given.outer)) - holes)
    scrap = min(_SCRAP * width * width, 2e-3 * area / count)
    ways: list[PlaneWay] = []
    for k, cells in enumerate(strips):
        found = _in_strip(region, cells, low + (k + 0.5) * step, step, width, scrap,
                          trim * area / count)
        ways += sorted(found, reverse=k % 2 == 1)
    return ways


def _in_strip(region: Region, cells: list[PlaneCell], middle: float, step: float, width: float,
              scrap: float, trim: float) -> list[PlaneWay]:
    """Ways over the cells of one strip: along its middle, and shifted where that is barred."""
    ways: list[PlaneWay] = []
    for shift in _SHIFTS:
        if cells_area(cells) <= scrap:
            break
        y = middle + shift * step
        low, high = y - width / 2 - 1e-9, y + width / 2 + 1e-9
        seen = between(cells, 1, low, high)
        barred = ring_spans((0.0, y), (1.0, y), region.barred)
        for span in merged_spans(seen, width / 2):
            for part in remaining(span, barred):
                over = between(seen, 0, *part)
                if cells_area(over) <= scrap:
                    continue
                start, end = _extent(over, step, trim)
                _add([(start, y), (end, y)], ways, region, width)
                cells = [left for cell in cells
                         for left in _without(cell, part[0], part[1], low, high)]
    return ways


def _extent(cells: list[PlaneCell], step: float, trim: float) -> Span:
    """Where cells begin and end along x, without pointed ends of an area of at most `trim`."""
    xs = [x for cell in cells for x, _ in cell]
    first, last = min(xs), max(xs)
    cuts = []
    for end, sign in ((first, 1.0), (last, -1.0)) if trim else ():
        low, high = 0.0, (last - first) / 3
        for _ in range(12):
            middle = (low + high) / 2
            cut = between(cells, 0, *sorted((end, end + sign * middle)))
            low, high = (middle, high) if cells_area(cut) <= trim else (low, middle)
        cuts.append(low if low * step > 3.0 * trim else 0.0)  # 1: it is no pointed end
    return (first + cuts[0], last - cuts[1]) if cuts else (first, last)


def _without(cell: PlaneCell, x0: float, x1: float, y0: float, y1: float) -> list[PlaneCell]:
    """The parts of a cell outside a box."""
    parts = []
    for axis, low, high in ((0, x0, x1), (1, y0, y1)):
        parts += [clip(cell, axis, low, True), clip(cell, axis, high, False)]
        cell = clip(clip(cell, axis, low, False), axis, high, True)
    return [part for part in parts if part]


def _add(new: PlaneWay, ways: list[PlaneWay], region: Region, width: float) -> None:
    """Add a way, as the tail of the nearest other one where nothing is between."""
    near = sorted((math.dist(other[-1], tail[0]), k, other, tail)
                  for k, way in enumerate(ways) for other in (way, way[::-1])
                  for tail in (new, new[::-1]))
    for gap, k, other, tail in near:
        along = abs(other[-1][0] - tail[0][0])
        if gap <= width and along <= width / 2 and _is_open(other[-1], tail[0], region):
            ways[k] = min([*other, *tail], [*tail[::-1], *other[::-1]])
            return
    ways.append(new)


def _is_open(a: XY, b: XY, region: Region) -> bool:
    """Whether nothing barred is between two points that are themselves outside."""
    return a == b or not any(
        min(1.0, end) - max(0.0, start) > 1e-9
        for start, end in ring_spans(a, b, region.barred))
