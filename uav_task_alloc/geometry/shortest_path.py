# SPDX-License-Identifier: Apache-2.0
"""The shortest safe way between two points, as a kernel: straight, or searched and pulled taut.

Only zones that turn out to be in the way take part: the shortest way past some of the zones is
never longer than that past all, so when it happens to be clear of all, it is the answer.
"""
from __future__ import annotations

import math

import numpy as np

from uav_task_alloc.geometry.obstacles import Floats, Ints, Zone, Zones, blocked, contains
from uav_task_alloc.geometry.search_budget import spend
from uav_task_alloc.geometry.single_obstacle import keep_best, past_one
from uav_task_alloc.geometry.taut import (
    MAX_CORNERS,
    copy_point,
    length_of,
    point_span,
    tauten,
    zones_near,
)
from uav_task_alloc.geometry.visibility_graph import add_corners, add_level, astar, corner_bound
from uav_task_alloc.kernel import allocating_kernel

_RINGS = (12, 24, 64)  # corners around a zone; finer ones where no way was found
COARSE = 2  # zones at most in the way for which the first ring is fine enough
MANY = 8  # zones in the way; among more, levels of those around a zone must do
PATIENT = 5  # searches past the zones hit so far, before those around them are heeded, too


@allocating_kernel
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


@allocating_kernel
def hit_by(o: Zones, p: Floats, i: int, j: int, floor: float, snug: bool, hit: Ints) -> int:
    """Mark the zones that the segment p[i] p[j] enters in hit; returns how many are new."""
    new, k = 0, next_hit(o, 0, p, i, j, floor, snug)
    while k < o.size:
        new += 1 - hit[k]
        hit[k] = 1
        k = next_hit(o, k + 1, p, i, j, floor, snug)
    return new


@allocating_kernel
def _beside(o: Zones, active: Ints, k: int) -> Ints:
    """The other active zones that corners of zone k may lie in, which lie within twice its box."""
    zone, found, n = o[k], np.empty(active.size, np.int64), 0
    wide, deep = 0.5 * (zone.x1 - zone.x0), 0.5 * (zone.y1 - zone.y0)
    for m in active:
        other = o[m]
        if m != k and (zone.x0 - wide <= other.x1 and zone.x1 + wide >= other.x0
                       and zone.y0 - deep <= other.y1 and zone.y1 + deep >= other.y0):
            found[n] = m
            n += 1
    return found[:n]


@allocating_kernel
def _levels(o: Zones, among: Ints, zone: Zone) -> Floats:
    """Heights [m] between the ends of a zone at which others end, each once."""
    found, n = np.empty(2 * among.size), 0
    for m in range(among.size):
        other = o[among[m]]
        for side in range(2):
            z = other.low - 1.5 * other.skin if side == 0 else other.high + 1.5 * other.skin
            new = zone.low < z < zone.high
            for i in range(n):
                new = new and found[i] != z
            if new:
                found[n] = z
                n += 1
    return found[:n]


@allocating_kernel
def _corners_of(o: Zones, k: int, levels: Floats, way: Floats, limits: Floats, floor: float,
                ring: int) -> Floats:
    """The corners of zone k, also at these levels."""
    x = np.empty((corner_bound(o[k], ring, levels.size), 3))
    n = add_corners(o[k], way, limits, floor, ring, x, 0)
    for z in levels:
        n = add_level(o[k], way, limits, z, _RINGS[0], x, n)
    return x[:n]


@allocating_kernel
def _in_any(o: Zones, among: Ints, p: Floats, i: int, snug: bool) -> bool:
    for m in range(among.size):  # noqa: SIM110 - numba knows no any()
        if contains(o[among[m]], p[i, 0], p[i, 1], p[i, 2], snug):
            return True
    return False


@allocating_kernel
def _off(p: Floats, i: int, q: Floats, j: int) -> float:
    dx, dy, dz = p[i, 0] - q[j, 0], p[i, 1] - q[j, 1], p[i, 2] - q[j, 2]
    return math.sqrt(dx * dx + dy * dy + dz * dz)


@allocating_kernel
def _corners(o: Zones, active: Ints, way: Floats, limits: Floats, floor: float, snug: bool,
             ring: int, known: float, work: Ints) -> Floats:
    """Both ends, and the corners of the active zones that a way of at most `known` can touch.

    Corners inside another active zone are none.
    """
    x, n = np.empty((64, 3)), 2
    copy_point(way, 0, x, 0)
    copy_point(way, 1, x, 1)
    for m in range(active.size):
        beside = _beside(o, active, active[m])
        levels = np.empty(0)
        if ring > _RINGS[0]:
            levels = _levels(o, active if active.size <= MANY else beside, o[active[m]])
        found = _corners_of(o, active[m], levels, way, limits, floor, ring)
        if n + found.shape[0] > x.shape[0]:
            more = np.empty((2 * (n + found.shape[0]), 3))
            more[:n] = x[:n]
            x = more
        for i in range(found.shape[0]):
            if _off(way, 0, found, i) + _off(way, 1, found, i) <= known and not _in_any(
                    o, beside, found, i, snug):
                copy_point(found, i, x, n)
                n += 1
        if spend(work, active.size + found.shape[0] * (1 + beside.size)):
            break
    return x[:n]


@allocating_kernel
def _activate(o: Zones, hit: Ints, before: Ints) -> None:
    """Heed the zones as well that overlap those hit since `before`."""
    for k in range(o.size):
        if hit[k] and not before[k]:
            zone = o[k]
            for m in range(o.size):
                other = o[m]
                if (zone.x0 <= other.x1 and zone.x1 >= other.x0 and zone.y0 <= other.y1
                        and zone.y1 >= other.y0):
                    hit[m] = 1


@allocating_kernel
def _search(o: Zones, way: Floats, limits: Floats, floor: float, snug: bool, ring: int,
            known: float, hit: Ints, out: Floats, work: Ints) -> int:
    """A clear, coarse way into out, at most as long as one `known`; marks the zones heeded in hit.

    0: none found, or work[2] says that the search was cut short.
    """
    tries = 0
    while True:
        active = np.flatnonzero(hit)
        x = _corners(o, active, way, limits, floor, snug, ring, known, work)
        if work[2]:
            return 0
        path = np.empty(x.shape[0], np.int64)
        size = astar(o, active, x, floor, snug, path, work)
        if size == 0 or size > MAX_CORNERS // 2:
            return 0
        new, before = 0, hit.copy()
        for i in range(size):
            copy_point(x, path[i], out, i)
            if i:
                new += hit_by(o, out, i - 1, i, floor, snug, hit)
        if new == 0:
            return size
        tries += 1
        if tries > PATIENT:
            _activate(o, hit, before)
        if spend(work, size * o.size):
            return 0


@allocating_kernel
def is_clear(o: Zones, p: Floats, n: int, floor: float, snug: bool) -> bool:
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
                       floor, snug):
                return False
    return True


@allocating_kernel
def shortest(o: Zones, way: Floats, limits: Floats, snug: bool, out: Floats,
             work: Ints) -> tuple[int, float]:
    """Points of the shortest safe way between the ends way[0] and way[1], both outside all zones.

    Writes them to out (MAX_CORNERS rows), returns their number and the length [m]; 0, inf: none;
    0, NaN: not known, as the work came to its limit. What was found before that is returned.
    `snug`: an end is so near to a zone that the way cannot keep the skin's distance.
    """
    copy_point(way, 0, out, 0)
    copy_point(way, 1, out, 1)
    floor = min(way[0, 2], way[1, 2])
    first = next_hit(o, 0, way, 0, 1, floor, snug)
    if first == o.size:
        spend(work, o.size)
        return 2, point_span(way, 0, 1)
    if not snug and next_hit(o, first + 1, way, 0, 1, floor, snug) == o.size:
        n = past_one(o[first], way, limits, floor, out)
        if n > 0 and is_clear(o, out, n, floor, False):
            spend(work, 3 * o.size)
            return n, length_of(out, n)
    if spend(work, 3 * o.size):
        return 0, np.nan
    hit, n, trial = np.zeros(o.size, np.int64), 0, np.empty((MAX_CORNERS, 3))
    hit_by(o, way, 0, 1, floor, snug, hit)
    for ring in _RINGS:
        known = length_of(out, n) if n else np.inf
        n = keep_best(trial, _search(o, way, limits, floor, snug, ring, known, hit, trial, work),
                      out, n)
        if work[2] or (n and (ring > _RINGS[0] or hit.sum() <= COARSE)):
            break
    if n == 0:
        return 0, np.nan if work[2] else np.inf
    near = zones_near(o, np.arange(o.size), way, 0, 1, length_of(out, n))
    n = tauten(o, near, out, n, limits, floor, snug, work)
    return n, length_of(out, n)
