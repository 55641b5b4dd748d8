# SPDX-License-Identifier: Apache-2.0
"""Parallel ways that cover a plane region, turned off where no UAV may fly."""
from __future__ import annotations

import math
from bisect import bisect
from collections.abc import Iterable, Sequence
from itertools import accumulate, pairwise

import numpy as np

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
_Profile = tuple[list[float], list[float]]  # [m] heights and lengths of an end
_SHIFTS = 0.0, 0.5, -0.5, 0.25, -0.25, 0.375, -0.375, 0.125, -0.125  # of a strip, tried in order
_SCRAP = 0.02  # of the square of the width: what is smaller is left out
_TRIM = 0.0035  # of the area: so much may be left out at all pointed ends
_MOST_DIRECTIONS = 8  # that are compared, by the number of strips
_LEFT = 0.0005  # of the area: so much of all strips is left out as scraps
_THICK = 0.5  # of the width: no higher ends of strips are left out
_PARTS = 12  # lengths of an end of a strip for which its height is known
_MOSTLY = 0.8  # of an area: where less is free of zones, _TRIM is that of what is free
_SLACK = 0.02  # of a width: with less to spare strips are even
_SAVED = 0.005  # of the way: with less saved strips are even
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
        has no area outside the barred and covered rings.

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
    # without barred and covered rings, so that these change no strip elsewhere
    whole = Region(region.outer, region.holes)
    cuts = _cuts(whole, levels, width)
    count = len(cuts) - 1
    strips = _cells_between(slab_cells(region, [*levels, *cuts]), cuts)
    holes = sum(abs(signed_area(hole)) for hole in given.holes)
    area = max(0.0, abs(signed_area(given.outer)) - holes)
    scrap = min(_SCRAP * width * width, _LEFT * area / count)
    trims = [[(span, span) for span in merged_spans(cells, width / 2)] for cells in strips]
    if trim:
        reached = math.fsum(cells_area(cells) for cells in strips)
        most = trim * (area if reached > _MOSTLY * area else reached)
        trims = _trims(_cells_between(slab_cells(whole, [*levels, *cuts]), cuts), width, most)
    ways: list[PlaneWay] = []
    for k, (cells, (low, high)) in enumerate(zip(strips, pairwise(cuts), strict=True)):
        found = _in_strip(region, cells, (low + high) / 2, high - low, width, scrap, trims[k])
        ways += sorted(found, reverse=k % 2 == 1)
    return ways


def _cuts(region: Region, levels: Sequence[float], width: float) -> list[float]:
    """Where strips along x begin and end along y: all are equal, or all but one of full width.

    Args:
        region: turned, without barred rings.
        levels: [m] y where edges cross.
        width: [m] of a strip at most.

    Returns:
        [m] in order, one more than strips. Strips of full width save way in a region that becomes
        narrower: the one that is narrower is where the ways are the shortest in all.
    """
    ys = [y for _, y in region.outer]
    low, high = min(ys), max(ys)
    count = max(1, math.ceil((high - low) / width - 1e-9))
    even = [low + (high - low) * k / count for k in range(count + 1)]
    upper = [low + k * width for k in range(count)]  # from below
    lower = [high - (count - k) * width for k in range(1, count + 1)]  # from above
    if lower[0] - low > (1.0 - _SLACK) * width:
        return even
    from_below, from_above, narrow = (
        [_spans_length(cells, width) for cells in _pairs(region, levels, a, b)]
        for a, b in ((upper, [y + width for y in upper]), ([y - width for y in lower], lower),
                     (upper, lower)))
    best = min(range(count), key=lambda k: (
        math.fsum([*from_below[:k], narrow[k], *from_above[k + 1:]])))
    uneven = math.fsum([*from_below[:best], narrow[best], *from_above[best + 1:]])
    whole = math.fsum(_spans_length(cells, width) for cells in _pairs(
        region, levels, even[:-1], even[1:]))
    if uneven > (1.0 - _SAVED) * whole:
        return even
    return [*upper[:best + 1], *lower[best:]]


def _pairs(region: Region, levels: Sequence[float], lows: Sequence[float],
           highs: Sequence[float]) -> list[list[PlaneCell]]:
    """The cells of slabs, each between two y."""
    cells = list(slab_cells(region, [*levels, *lows, *highs]))
    middles = [middle for middle, _ in cells]  # in order
    return [[cell for _, cell in cells[bisect(middles, low):bisect(middles, high)]]
            for low, high in zip(lows, highs, strict=True)]


def _cells_between(cells: Iterable[tuple[float, PlaneCell]],
                   cuts: Sequence[float]) -> list[list[PlaneCell]]:
    """Cells by the slab that they are in."""
    slabs: list[list[PlaneCell]] = [[] for _ in cuts[1:]]
    for middle, cell in cells:
        slabs[min(len(slabs), max(1, bisect(cuts, middle))) - 1].append(cell)
    return slabs


def _spans_length(cells: Iterable[PlaneCell], width: float) -> float:
    return math.fsum(end - start for start, end in merged_spans(cells, width / 2))


def _in_strip(region: Region, cells: list[PlaneCell], middle: float, step: float, width: float,
              scrap: float, trims: Sequence[tuple[Span, Span]]) -> list[PlaneWay]:
    """Ways over the cells of one strip: along its middle, and shifted where that is barred.

    trims: where the strip begins and ends along x without barred rings, and where its ways may.
    """
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
                start, end = _within(_ends(over), trims)
                if start < end:
                    _add([(start, y), (end, y)], ways, region, width)
                cells = [left for cell in cells
                         for left in _without(cell, part[0], part[1], low, high)]
    return ways


def _within(span: Span, trims: Iterable[tuple[Span, Span]]) -> Span:
    """A part of a strip without what of the ends of the strip is left out."""
    for whole, left in trims:
        if whole[0] - 1e-6 <= span[0] and span[1] <= whole[1] + 1e-6:
            return max(span[0], left[0]), min(span[1], left[1])
    return span


def _ends(cells: Iterable[PlaneCell]) -> Span:
    xs = [x for cell in cells for x, _ in cell]
    return min(xs), max(xs)


def _end_area(cells: Iterable[PlaneCell], end: float, length: float) -> float:
    """Area [m2] of cells from an end of them on; a negative length: to the left."""
    return cells_area(part for cell in cells
                      if (part := clip(cell, 0, end + length, length > 0.0)))


def _trims(strips: Iterable[list[PlaneCell]], width: float,
           most: float) -> list[list[tuple[Span, Span]]]:
    """The spans of strips, and what is left of them without pointed ends of one height.

    That height is the one for which an area of `most` [m2] is left out in all.
    """
    spans = [[(span, _profile(between(cells, 0, *span), span[0], span[1]),
               _profile(between(cells, 0, *span), span[1], span[0]))
              for span in merged_spans(cells, width / 2)] for cells in strips]
    profiles = [profile for row in spans for _, *both in row for profile in both]
    low, high = 0.0, _THICK * width
    for _ in range(16):
        thin = (low + high) / 2
        area = math.fsum(thin * _cut(profile, thin) / 2 for profile in profiles)
        low, high = (thin, high) if area <= most else (low, thin)
    return [[(span, (span[0] + _cut(first, low), span[1] - _cut(last, low)))
             for span, first, last in row] for row in spans]


def _cut(profile: _Profile, thin: float) -> float:
    """Length [m] of an end that is as large as a triangle of this height [m]."""
    return float(np.interp(thin, *profile))


def _profile(cells: list[PlaneCell], end: float, other: float) -> _Profile:
    """Heights [m] of triangles as large as the parts up to some lengths [m] from an end."""
    lengths = [abs(other - end) / 3 * (k / _PARTS)**2 for k in range(1, _PARTS + 1)]
    sign = math.copysign(1.0, other - end)
    heights = [2.0 * _end_area(cells, end, sign * length) / length for length in lengths]
    blunt = heights[0] - (heights[1] - heights[0]) * lengths[0] / (lengths[1] - lengths[0])
    return list(accumulate([max(0.0, blunt), *heights], max)), [0.0, *lengths]


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
