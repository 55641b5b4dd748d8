# SPDX-License-Identifier: Apache-2.0
"""Plane regions between rings as convex cells in horizontal slabs, and what is done with them."""
from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from uav_task_alloc.geometry.polygon import XY, edges, signed_area
from uav_task_alloc.work.zone_sections import PlaneRing, Span

PlaneCell = list[XY]  # [m] corners of a convex polygon
_THIN = 1e-7  # [m] slabs that are thinner have no cells
_ROUNDING, _ROWS = 1e-6, 256  # [m] around boxes of edges; edges compared with all at once


@dataclass(frozen=True, slots=True)
class Region:
    """A polygon without holes, without what is covered, and without barred rings.

    No UAV may fly in a barred ring.
    """

    outer: PlaneRing
    holes: tuple[PlaneRing, ...] = ()
    barred: tuple[PlaneRing, ...] = ()
    covered: tuple[PlaneRing, ...] = ()

    @property
    def rings(self) -> tuple[PlaneRing, ...]:
        """All rings, the outer one first."""
        return (self.outer, *self.holes, *self.barred, *self.covered)

    def turned(self, angle: float) -> Region:
        """The region turned around (0, 0) by an angle [rad]."""
        return Region(turn(self.outer, angle), *(
            tuple(turn(ring, angle) for ring in rings)
            for rings in (self.holes, self.barred, self.covered)))


def turn(points: Iterable[XY], angle: float) -> list[XY]:
    """Points turned around (0, 0), counter-clockwise.

    Args:
        points: [m].
        angle: [rad].
    """
    c, s = math.cos(angle), math.sin(angle)
    return [(c * x - s * y, s * x + c * y) for x, y in points]


def crossings(rings: Sequence[PlaneRing]) -> list[XY]:
    """The points in which edges of rings cross; O(edges^2) tests of their boxes, vectorised.

    Args:
        rings: [m].

    Returns:
        Without common corners of neighbouring edges.
    """
    ends = np.array([(a, b) for ring in rings for a, b in edges(ring)]).reshape(-1, 2, 2)
    start, along = ends[:, 0], ends[:, 1] - ends[:, 0]
    (west, south), (east, north) = ends.min(axis=1).T - _ROUNDING, ends.max(axis=1).T + _ROUNDING
    found: list[XY] = []
    for first in range(0, len(ends), _ROWS):
        rows = slice(first, first + _ROWS)
        i, j = np.nonzero((west <= east[rows, None]) & (east >= west[rows, None])
                          & (south <= north[rows, None]) & (north >= south[rows, None]))
        i, j = i[j > i + first] + first, j[j > i + first]
        (px, py), (dx, dy), (qx, qy), (ex, ey) = start[i].T, along[i].T, start[j].T, along[j].T
        cross = dx * ey - dy * ex
        with np.errstate(divide='ignore', invalid='ignore'):
            t = ((qx - px) * ey - (qy - py) * ex) / cross
            u = ((qx - px) * dy - (qy - py) * dx) / cross
        inside = (np.abs(cross) > 1e-12) & (t > 0.0) & (t < 1.0) & (u > 0.0) & (u < 1.0)
        i, t = i[inside], t[inside, None]
        found += map(tuple, (start[i] + t * along[i]).tolist())
    return found


def slab_cells(region: Region, levels: Iterable[float]) -> Iterator[tuple[float, PlaneCell]]:
    """Cut a region into trapezoids.

    Args:
        region: its rings decide by their winding numbers.
        levels: [m] y of further cuts; the y of corners are among the cuts anyway. Edges that cross
            do so at one of `levels`.

    Yields:
        y in the middle of its slab, and the corners of a trapezoid, from below.
    """
    lines = sorted((min(a[1], b[1]), max(a[1], b[1]), a, b, 1 if b[1] > a[1] else -1, k)
                   for k, ring in enumerate(region.rings) for a, b in edges(ring) if a[1] != b[1])
    cuts = sorted({*levels, *(y for low, high, *_ in lines for y in (low, high))})
    active: list[tuple[float, float, XY, XY, int, int]] = []
    n = 0
    for low, high in pairwise(cuts):
        if high - low < _THIN:
            continue
        middle = (low + high) / 2
        while n < len(lines) and lines[n][0] < middle:
            active.append(lines[n])
            n += 1
        active = [line for line in active if line[1] > middle]
        ordered = sorted(active, key=lambda line: _x_at(line, middle))
        for left, right in _inner(ordered):
            yield middle, [(_x_at(left, low), low), (_x_at(right, low), low),
                           (_x_at(right, high), high), (_x_at(left, high), high)]


def _x_at(line: tuple[float, float, XY, XY, int, int], y: float) -> float:
    a, b = line[2], line[3]
    return a[0] + (y - a[1]) * (b[0] - a[0]) / (b[1] - a[1])


def _inner(ordered: Iterable[tuple[float, float, XY, XY, int, int]]) -> Iterator[tuple[
        tuple[float, float, XY, XY, int, int], tuple[float, float, XY, XY, int, int]]]:
    """Neighbouring edges between which the region is: in the first ring and in no other."""
    windings: dict[int, int] = {}
    start = None
    for line in ordered:
        windings[line[5]] = windings.get(line[5], 0) + line[4]
        within = windings.get(0, 0) != 0 and not any(
            count for ring, count in windings.items() if ring)
        if start is not None and not within:
            yield start, line
            start = None
        elif start is None and within:
            start = line


def clip(cell: PlaneCell, axis: int, bound: float, keep_below: bool) -> PlaneCell:
    """The part of a convex cell on one side of a line parallel to an axis.

    Args:
        cell: its corners.
        axis: of the coordinate that is compared.
        bound: [m].
        keep_below: the part with smaller coordinates.

    Returns:
        Its corners; none where nothing is left.
    """
    sign = 1.0 if keep_below else -1.0
    out: PlaneCell = []
    for a, b in edges(cell):
        da, db = sign * (bound - a[axis]), sign * (bound - b[axis])
        if da >= 0.0:
            out.append(a)
        if da * db < 0.0:
            t = da / (da - db)
            out.append((a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])))
    return out if len(out) > 2 else []


def between(cells: Iterable[PlaneCell], axis: int, low: float, high: float) -> list[PlaneCell]:
    """The parts of cells between two lines parallel to an axis."""
    parts = (clip(clip(cell, axis, low, False), axis, high, True) for cell in cells)
    return [part for part in parts if part]


def cells_area(cells: Iterable[PlaneCell]) -> float:
    """Area [m2] of cells that do not overlap."""
    return math.fsum(abs(signed_area(cell)) for cell in cells)


def merged_spans(cells: Iterable[PlaneCell], gap: float) -> list[Span]:
    """Where cells are along x: spans, those that are at most `gap` [m] apart joined."""
    joined: list[Span] = []
    for low, high in sorted((min(x for x, _ in cell), max(x for x, _ in cell)) for cell in cells):
        if joined and low <= joined[-1][1] + gap:
            joined[-1] = joined[-1][0], max(joined[-1][1], high)
        else:
            joined.append((low, high))
    return joined
