# SPDX-License-Identifier: Apache-2.0
"""Conflicts of timed straight pieces, found exactly: a sweep over time, then a closed form.

Two pieces are in conflict where positions p1(t1) and p2(t2) exist whose times differ by no more
than the lag of the pair, whose vertical distance is less than `vertical` and whose horizontal one
is less than `horizontal`. All but the last are linear in (t1, t2): they bound a convex polygon. On
it the squared horizontal distance is a convex quadratic function, whose least value lies where the
horizontal lines cross, or on an edge.
"""
from __future__ import annotations

import functools
import math
from dataclasses import dataclass

import numpy as np

from uav_task_alloc.geometry.outline import Floats, Ints
from uav_task_alloc.kernel import inline_kernel, inner_kernel, kernel
from uav_task_alloc.kernel_cache import NOTICE, KernelWork
from uav_task_alloc.separation.rule import Separation
from uav_task_alloc.separation.volumes import COLUMNS, PieceRows, Volumes

_CORNERS = 12  # of a polygon at most: a rectangle cut four times has 8
_ROUNDING = 1e-6  # [m] by which a distance that is kept exactly may be missed
_SHORTEST = 1e-6  # [s] added to each lag: without it the polygon may be a line, lost by rounding
_WORK = KernelWork(6.0, 6)


@inner_kernel
def _cut(polygon: Floats, n: int, cut: Floats, a: float, b: float, c: float) -> int:
    """Cut a convex polygon[:n] to where a * s + b * t <= c; `cut` is space. O(n)"""
    m = 0
    for i in range(n):
        j = i + 1 if i + 1 < n else 0
        here = a * polygon[i, 0] + b * polygon[i, 1] - c
        there = a * polygon[j, 0] + b * polygon[j, 1] - c
        if here <= 0.0:
            cut[m, 0], cut[m, 1] = polygon[i, 0], polygon[i, 1]
            m += 1
        if (here < 0.0 < there) or (there < 0.0 < here):
            share = here / (here - there)
            cut[m, 0] = polygon[i, 0] + share * (polygon[j, 0] - polygon[i, 0])
            cut[m, 1] = polygon[i, 1] + share * (polygon[j, 1] - polygon[i, 1])
            m += 1
    for i in range(m):
        polygon[i, 0], polygon[i, 1] = cut[i, 0], cut[i, 1]
    return m


@inner_kernel
def _nearest(p: Floats, q: Floats, lag: float, vertical: float, space: Floats,
             found: Floats) -> float:
    """Least squared horizontal distance [m2] of rows p and q where they are not apart vertically.

    `space` is (2, _CORNERS, 2); times of both [s] are put into `found`. Infinite where there are
    no such positions. O(1)
    """
    polygon, cut = space[0], space[1]
    wide, high = p[1] - p[0], q[1] - q[0]
    polygon[0, 0], polygon[0, 1] = 0.0, 0.0
    polygon[1, 0], polygon[1, 1] = wide, 0.0
    polygon[2, 0], polygon[2, 1] = wide, high
    polygon[3, 0], polygon[3, 1] = 0.0, high
    apart = q[0] - p[0]
    n = _cut(polygon, 4, cut, 1.0, -1.0, lag + apart)
    n = _cut(polygon, n, cut, -1.0, 1.0, lag - apart)
    above = p[4] - q[4]
    n = _cut(polygon, n, cut, p[7], -q[7], vertical - above)
    n = _cut(polygon, n, cut, -p[7], q[7], vertical + above)
    best = math.inf
    dx, dy = p[2] - q[2], p[3] - q[3]
    for i in range(n):
        j = i + 1 if i + 1 < n else 0
        s, t = polygon[i, 0], polygon[i, 1]
        ds, dt = polygon[j, 0] - s, polygon[j, 1] - t
        fx, fy = dx + p[5] * s - q[5] * t, dy + p[6] * s - q[6] * t
        gx, gy = p[5] * ds - q[5] * dt, p[6] * ds - q[6] * dt
        square = gx * gx + gy * gy
        share = 0.0 if square == 0.0 else min(1.0, max(0.0, -(fx * gx + fy * gy) / square))
        fx, fy = fx + share * gx, fy + share * gy
        if fx * fx + fy * fy < best:
            best = fx * fx + fy * fy
            found[0], found[1] = p[0] + s + share * ds, q[0] + t + share * dt
    return 0.0 if n > 2 and best > 0.0 and _cross_within(
        p, q, dx, dy, polygon, n, found) else best


@inner_kernel
def _cross_within(p: Floats, q: Floats, dx: float, dy: float, polygon: Floats, n: int,
                  found: Floats) -> bool:
    """Whether the horizontal lines of p and q cross at times within the polygon. O(n)"""
    turn = p[6] * q[5] - p[5] * q[6]
    if abs(turn) < 1e-12:
        return False
    s = (dx * q[6] - dy * q[5]) / turn
    t = (dx * p[6] - dy * p[5]) / turn
    for i in range(n):
        j = i + 1 if i + 1 < n else 0
        ds, dt = polygon[j, 0] - polygon[i, 0], polygon[j, 1] - polygon[i, 1]
        if ds * (t - polygon[i, 1]) - dt * (s - polygon[i, 0]) < 0.0:
            return False
    found[0], found[1] = p[0] + s, q[0] + t
    return True


@inline_kernel
def _boxes_apart(a: Floats, b: Floats, horizontal: float, vertical: float) -> bool:
    """Whether two boxes are apart: rows of lower and upper x, y and z [m]. O(1)"""
    return bool(a[0] - b[1] >= horizontal or b[0] - a[1] >= horizontal
                or a[2] - b[3] >= horizontal or b[2] - a[3] >= horizontal
                or a[4] - b[5] >= vertical or b[4] - a[5] >= vertical)


@kernel
def _sweep(rows: Floats, boxes: Floats, owner: Ints, horizontal: float, vertical: float,
           time: float, active: Ints, space: Floats, pairs: Ints, figures: Floats) -> int:
    """Find all conflicts of rows in the order of begin - uncertainty. Returns their number.

    boxes (n, 6) see `_boxes`, pairs (m, 2) rows, figures (m, 4): least horizontal and the vertical
    distance [m], both times [s]; those beyond m are counted only. O(n * pieces at a time)
    """
    alive, count = 0, 0
    found = space[1, _CORNERS - 1]
    for i in range(len(rows)):
        p = rows[i]
        begin, a = p[0] - p[8], 0
        while a < alive:
            j = active[a]
            q = rows[j]
            if q[1] + time + q[8] < begin:
                alive -= 1
                active[a] = active[alive]
                continue
            a += 1
            if _boxes_apart(boxes[i], boxes[j], horizontal, vertical) or owner[i] == owner[j]:
                continue
            lag = time + p[8] + q[8] + _SHORTEST
            if p[0] > q[1] + lag or q[0] > p[1] + lag:
                continue
            square = _nearest(p, q, lag, vertical, space, found)
            if square < horizontal * horizontal:
                if count < len(pairs):
                    pairs[count, 0], pairs[count, 1] = i, j
                    figures[count, 0] = math.sqrt(square)
                    figures[count, 1] = abs(p[4] + p[7] * (found[0] - p[0])
                                            - q[4] - q[7] * (found[1] - q[0]))
                    figures[count, 2], figures[count, 3] = found[0], found[1]
                count += 1
        active[alive] = i
        alive += 1
    return count


@kernel
def _first_conflict(some: Floats, some_boxes: Floats, rows: Floats, boxes: Floats, owner: Ints,
                    n: int, mine: int, horizontal: float, vertical: float, time: float,
                    space: Floats) -> int:
    """The first of rows[:n] of others that is in conflict with one of `some`; -1: none.

    O(len(some) * n)
    """
    found = space[1, _CORNERS - 1]
    for j in range(n):
        if owner[j] == mine:
            continue
        q = rows[j]
        for i in range(len(some)):
            if _boxes_apart(some_boxes[i], boxes[j], horizontal, vertical):
                continue
            p = some[i]
            lag = time + p[8] + q[8] + _SHORTEST
            if p[0] > q[1] + lag or q[0] > p[1] + lag:
                continue
            if _nearest(p, q, lag, vertical, space, found) < horizontal * horizontal:
                return j
    return -1


@dataclass(frozen=True, slots=True)
class FoundConflict:
    """Two legs that are not apart."""

    flights: tuple[int, int]  # indices, the smaller first
    legs: tuple[int, int]  # indices of their legs
    time: float  # [s] when the first of both is where they come nearest
    horizontal: float  # [m] least distance within the uncertainty of their times
    vertical: float  # [m] distance there


def find_conflicts(volumes: Volumes, rule: Separation) -> list[FoundConflict]:
    """Find all pairs of legs of different flights that are not apart.

    Args:
        volumes: of the flights, see `flight_volumes`.
        rule: that is on.

    Returns:
        One for each pair of legs, where they come nearest; in the order of their times.
    """
    load_separation_kernels()
    order = np.argsort(volumes.rows[:, 0] - volumes.rows[:, 8])
    rows = np.ascontiguousarray(volumes.rows[order])
    owner, legs, boxes = volumes.owner[order], volumes.leg[order], _boxes(rows)
    room, count = max(1024, len(rows)), 0
    while True:
        pairs, figures = np.empty((room, 2), np.int64), np.empty((room, 4))
        count = _sweep(rows, boxes, owner, rule.horizontal - _ROUNDING,
                       rule.vertical - _ROUNDING, rule.time, np.empty(len(rows), np.int64),
                       _space(), pairs, figures)
        if count <= room:
            return _of_legs(owner, legs, pairs[:count], figures[:count])
        room = count


def _boxes(rows: PieceRows) -> Floats:
    """Lower and upper x, y and z [m] of each row, (n, 6)."""
    boxes = np.empty((len(rows), 6))
    ends = rows[:, 2:5] + rows[:, 5:8] * (rows[:, 1] - rows[:, 0])[:, None]
    boxes[:, 0::2] = np.minimum(rows[:, 2:5], ends)
    boxes[:, 1::2] = np.maximum(rows[:, 2:5], ends)
    return boxes


def _of_legs(owner: Ints, legs: Ints, pairs: Ints, figures: Floats) -> list[FoundConflict]:
    """One conflict for each pair of legs."""
    best: dict[tuple[tuple[int, int], tuple[int, int]], FoundConflict] = {}
    ends = zip(owner[pairs].tolist(), legs[pairs].tolist(), figures.tolist(),
               strict=True)
    for (a, b), (leg, other), (horizontal, vertical, time, later) in ends:
        if a > b:
            a, b, leg, other = b, a, other, leg
        key, known = ((a, b), (leg, other)), best.get(((a, b), (leg, other)))
        if known is None or horizontal < known.horizontal:
            best[key] = FoundConflict(*key, min(time, later), horizontal, vertical)
    return sorted(best.values(), key=lambda each: (each.time, each.flights, each.legs))


class AcceptedRows:
    """The pieces that new ones must be apart from: a table that grows.

    Args:
        rule: that is on.

    Arguments of methods:
        rows: of COLUMNS numbers each.
        owner: indices of the flight and of its leg.
        mine: index of the flight that they are of, which is not in its own way.
    """

    def __init__(self, rule: Separation) -> None:
        load_separation_kernels()
        self._rule, self._space = rule, _space()
        self._rows, self._boxes = np.empty((256, COLUMNS)), np.empty((256, 6))
        self._flights = np.empty(256, np.int64)
        self._owner: list[tuple[int, int]] = []

    def add(self, rows: list[tuple[float, ...]], owner: tuple[int, int]) -> None:
        """Accept pieces."""
        if not rows:
            return
        n, more = len(self._owner), np.array(rows, np.float64)
        while n + len(rows) > len(self._rows):
            self._rows = np.concatenate((self._rows, np.empty_like(self._rows)))
            self._boxes = np.concatenate((self._boxes, np.empty_like(self._boxes)))
            self._flights = np.concatenate((self._flights, np.empty_like(self._flights)))
        self._flights[n:n + len(rows)] = owner[0]
        self._rows[n:n + len(rows)], self._boxes[n:n + len(rows)] = more, _boxes(more)
        self._owner += [owner] * len(rows)

    def conflict(self, rows: list[tuple[float, ...]], mine: int) -> tuple[int, int] | None:
        """Whose accepted pieces are in conflict with these; None: nobody's."""
        if not rows or not self._owner:
            return None
        rule, some = self._rule, np.array(rows, np.float64)
        found = _first_conflict(some, _boxes(some), self._rows, self._boxes, self._flights,
                                len(self._owner), mine, rule.horizontal - _ROUNDING,
                                rule.vertical - _ROUNDING, rule.time, self._space)
        return None if found < 0 else self._owner[found]


def _space() -> Floats:
    """What kernels write into."""
    return np.empty((2, _CORNERS, 2))


@functools.cache
def load_separation_kernels() -> None:
    """Load the kernels, compile those not on disk yet; further calls do nothing."""
    rows: PieceRows = np.zeros((2, COLUMNS))
    rows[:, 1] = 1.0
    with NOTICE.until_loaded('separation', _WORK):
        boxes = _boxes(rows)
        _sweep(rows, boxes, np.arange(2), 1.0, 1.0, 1.0, np.empty(2, np.int64), _space(),
               np.empty((1, 2), np.int64), np.empty((1, 4)))
        _first_conflict(rows, boxes, rows, boxes, np.arange(2), 2, -1, 1.0, 1.0, 1.0, _space())
