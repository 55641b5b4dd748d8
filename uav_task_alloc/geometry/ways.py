# SPDX-License-Identifier: Apache-2.0
"""The shortest safe way between two points, as a kernel: straight, or searched and pulled taut.

Only zones that turn out to be in the way take part: the shortest way past some of the zones is
never longer than that past all, so when it happens to be clear of all, it is the answer.
"""
from __future__ import annotations

import numba
import numpy as np

from uav_task_alloc.geometry.obstacles import Floats, Ints, Zones, blocked
from uav_task_alloc.geometry.search import add_corners, add_level, astar, corner_bound
from uav_task_alloc.geometry.single import keep_best, past_one
from uav_task_alloc.geometry.taut import (
    MAX_CORNERS,
    copy_point,
    length_of,
    span,
    tauten,
    zones_near,
)

RINGS = (12, 24, 64)  # corners around a zone; finer ones where no way was found
COARSE = 2  # zones at most in the way for which the first ring is fine enough


@numba.njit(cache=True, nogil=True)
def next_hit(o: Zones, k: int, p: Floats, i: int, j: int, floor: float, snug: bool) -> int:
    """The first zone from k on that the segment p[i] p[j] enters; o.size: none. O(zones)."""
    x0, x1 = min(p[i, 0], p[j, 0]), max(p[i, 0], p[j, 0])
    y0, y1 = min(p[i, 1], p[j, 1]), max(p[i, 1], p[j, 1])
    while k < o.size:
        zone = o[k]
        if (x0 <= zone.x1 and x1 >= zone.x0 and y0 <= zone.y1 and y1 >= zone.y0 and blocked(
                zone, p[i, 0], p[i, 1], p[i, 2], p[j, 0], p[j, 1], p[j, 2], floor, snug)):
            break
        k += 1
    return k


@numba.njit(cache=True, nogil=True)
def hit_by(o: Zones, p: Floats, i: int, j: int, floor: float, snug: bool, hit: Ints) -> int:
    """Mark the zones that the segment p[i] p[j] enters in hit; returns how many are new."""
    new, k = 0, next_hit(o, 0, p, i, j, floor, snug)
    while k < o.size:
        new += 1 - hit[k]
        hit[k] = 1
        k = next_hit(o, k + 1, p, i, j, floor, snug)
    return new


@numba.njit(cache=True, nogil=True)
def _corners(o: Zones, active: Ints, count: int, way: Floats, limits: Floats, floor: float,
             ring: int, x: Floats) -> int:
    """Both ends and the corners of the active zones into x; returns their number."""
    copy_point(way, 0, x, 0)
    copy_point(way, 1, x, 1)
    n = 2
    for m in range(count):
        zone = o[active[m]]
        n = add_corners(zone, way, limits, floor, ring, x, n)
        if ring > RINGS[0]:
            for k in range(count):
                other = o[active[k]]
                n = add_level(zone, way, limits, other.low - 1.5 * other.skin, RINGS[0], x, n)
                n = add_level(zone, way, limits, other.high + 1.5 * other.skin, RINGS[0], x, n)
    return n


@numba.njit(cache=True, nogil=True)
def _within(x: Floats, n: int, length: float) -> int:
    """Keep the corners that a way of at most `length` can touch; returns their number."""
    kept = 2
    for m in range(2, n):
        if span(x, 0, m) + span(x, m, 1) <= length:
            copy_point(x, m, x, kept)
            kept += 1
    return kept


@numba.njit(cache=True, nogil=True)
def _search(o: Zones, way: Floats, limits: Floats, floor: float, snug: bool, ring: int,
            known: float, hit: Ints, out: Floats) -> int:
    """A clear, coarse way into out, at most as long as one `known`; marks the zones heeded in hit.

    0: none found.
    """
    while True:
        active, bound = np.flatnonzero(hit), 2
        count = active.size
        for m in range(count):
            bound += corner_bound(o[active[m]], ring, 2 * count)
        x, path = np.empty((bound, 3)), np.empty(bound, np.int64)
        n = _within(x, _corners(o, active, count, way, limits, floor, ring, x), known)
        size = astar(o, active, count, x, n, floor, snug, path)
        if size == 0 or size > MAX_CORNERS // 2:
            return 0
        new = 0
        for i in range(size):
            copy_point(x, path[i], out, i)
            if i:
                new += hit_by(o, out, i - 1, i, floor, snug, hit)
        if new == 0:
            return size


@numba.njit(cache=True, nogil=True)
def _is_clear(o: Zones, p: Floats, n: int, floor: float) -> bool:
    """Whether the way p[:n] is clear of all zones."""
    x, y, z = p[0, 0], p[0, 1], p[0, 2]
    u, v, w = x, y, z
    for i in range(1, n):
        x, y, z = min(x, p[i, 0]), min(y, p[i, 1]), min(z, p[i, 2])
        u, v, w = max(u, p[i, 0]), max(v, p[i, 1]), max(w, p[i, 2])
    for k in range(o.size):
        zone = o[k]
        if (x > zone.x1 or u < zone.x0 or y > zone.y1 or v < zone.y0 or z > zone.z1
                or w < zone.z0):
            continue
        for i in range(1, n):
            if blocked(zone, p[i - 1, 0], p[i - 1, 1], p[i - 1, 2], p[i, 0], p[i, 1], p[i, 2],
                       floor, False):
                return False
    return True


@numba.njit(cache=True, nogil=True)
def shortest(o: Zones, way: Floats, limits: Floats, snug: bool,
             out: Floats) -> tuple[int, float]:
    """Points of the shortest safe way between the ends way[0] and way[1], both outside all zones.

    Writes them to out (MAX_CORNERS rows), returns their number and the length [m]; 0, inf: none.
    `snug`: an end is so near to a zone that the way cannot keep the skin's distance.
    """
    copy_point(way, 0, out, 0)
    copy_point(way, 1, out, 1)
    floor = min(way[0, 2], way[1, 2])
    first = next_hit(o, 0, way, 0, 1, floor, snug)
    if first == o.size:
        return 2, span(way, 0, 1)
    if not snug and next_hit(o, first + 1, way, 0, 1, floor, snug) == o.size:
        n = past_one(o[first], way, limits, floor, out)
        if n > 0 and _is_clear(o, out, n, floor):
            return n, length_of(out, n)
    hit, n, trial = np.zeros(o.size, np.int64), 0, np.empty((MAX_CORNERS, 3))
    hit_by(o, way, 0, 1, floor, snug, hit)
    for ring in RINGS:
        known = length_of(out, n) if n else np.inf
        n = keep_best(trial, _search(o, way, limits, floor, snug, ring, known, hit, trial), out, n)
        if n and (ring > RINGS[0] or hit.sum() <= COARSE):
            break
    if n == 0:
        return 0, np.inf
    near = zones_near(o, np.arange(o.size), way, 0, 1, length_of(out, n))
    n = tauten(o, near, out, n, limits, floor, snug)
    return n, length_of(out, n)
