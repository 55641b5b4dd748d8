# SPDX-License-Identifier: Apache-2.0
"""The shortest safe path between two points, as a kernel: straight, or searched and pulled taut.

Only zones that prove to be in the way take part: the shortest path past some of the zones is
never longer than that past all, so if it happens to be clear of all, it is the result.
"""
from __future__ import annotations

import numpy as np

from uav_task_alloc.geometry.obstacles import Floats, Ints, Zone, Zones, blocked, contains
from uav_task_alloc.geometry.points import copy_point, path_length, point_distance
from uav_task_alloc.geometry.search_budget import spend
from uav_task_alloc.geometry.single_obstacle import keep_best, path_past_zone
from uav_task_alloc.geometry.taut import MAX_CORNERS, tauten, zones_near
from uav_task_alloc.geometry.visibility_graph import add_corners, add_level, astar, corner_bound
from uav_task_alloc.kernel import inner_allocating_kernel

_RINGS = (12, 24, 64)  # corners around a zone; finer ones where no path was found
FEW_ZONES = 2  # blocking zones up to which the first ring is fine enough
MANY_ZONES = 8  # blocking zones; among more, levels only of those beside a zone
FIRST_SEARCHES = 5  # with the blocking zones only; then with those that overlap them


@inner_allocating_kernel
def next_blocking(zones: Zones, k: int, p: Floats, i: int, j: int, floor: float,
                  no_skin: bool) -> int:
    """Index of the first zone from k on that p[i] p[j] enters; zones.size: none. O(zones)"""
    x0, x1 = min(p[i, 0], p[j, 0]), max(p[i, 0], p[j, 0])
    y0, y1 = min(p[i, 1], p[j, 1]), max(p[i, 1], p[j, 1])
    while k < zones.size:
        zone = zones[k]
        if (x0 <= zone.x1 and x1 >= zone.x0 and y0 <= zone.y1 and y1 >= zone.y0 and blocked(
                zone, p[i, 0], p[i, 1], p[i, 2], p[j, 0], p[j, 1], p[j, 2], floor, no_skin)):
            break
        k += 1
    return k


@inner_allocating_kernel
def mark_blocking(zones: Zones, p: Floats, i: int, j: int, floor: float, no_skin: bool,
                  blocking: Ints) -> int:
    """Mark the zones that p[i] p[j] enters in blocking (zones,); returns how many are new."""
    new, k = 0, next_blocking(zones, 0, p, i, j, floor, no_skin)
    while k < zones.size:
        new += 1 - blocking[k]
        blocking[k] = 1
        k = next_blocking(zones, k + 1, p, i, j, floor, no_skin)
    return new


@inner_allocating_kernel
def _zones_beside(zones: Zones, active: Ints, k: int) -> Ints:
    """The other active zones in which corners of zone k may lie: within twice its box."""
    zone, found, n = zones[k], np.empty(active.size, np.int64), 0
    wide, deep = 0.5 * (zone.x1 - zone.x0), 0.5 * (zone.y1 - zone.y0)
    for m in active:
        other = zones[m]
        if m != k and (zone.x0 - wide <= other.x1 and zone.x1 + wide >= other.x0
                       and zone.y0 - deep <= other.y1 and zone.y1 + deep >= other.y0):
            found[n] = m
            n += 1
    return found[:n]


@inner_allocating_kernel
def _levels(zones: Zones, among: Ints, zone: Zone) -> Floats:
    """Heights [m] between the ends of a zone at which others end, each once. O(among^2)"""
    found, n = np.empty(2 * among.size), 0
    for m in range(among.size):
        other = zones[among[m]]
        for side in range(2):
            z = other.low - 1.5 * other.skin if side == 0 else other.high + 1.5 * other.skin
            new = zone.low < z < zone.high
            for i in range(n):
                new = new and found[i] != z
            if new:
                found[n] = z
                n += 1
    return found[:n]


@inner_allocating_kernel
def _zone_corners(zones: Zones, k: int, levels: Floats, ends: Floats, limits: Floats, floor: float,
                  ring: int) -> Floats:
    """The corners of zone k, float64 (n, 3) [m], also at these levels."""
    x = np.empty((corner_bound(zones[k], ring, levels.size), 3))
    n = add_corners(zones[k], ends, limits, floor, ring, x, 0)
    for z in levels:
        n = add_level(zones[k], ends, limits, z, _RINGS[0], x, n)
    return x[:n]


@inner_allocating_kernel
def _is_inside_any(zones: Zones, among: Ints, p: Floats, i: int, no_skin: bool) -> bool:
    """Whether p[i] is inside a zone with an index `among`. O(among)"""
    for m in range(among.size):
        if contains(zones[among[m]], p[i, 0], p[i, 1], p[i, 2], no_skin):
            return True
    return False


@inner_allocating_kernel
def _graph_corners(zones: Zones, active: Ints, ends: Floats, limits: Floats, floor: float,
                   no_skin: bool, ring: int, known: float, work: Ints) -> Floats:
    """Both ends, and the corners of active zones that a path of at most `known` [m] can touch.

    Corners inside another active zone are left out.

    Returns:
        float64 (n, 3) [m].
    """
    x, n = np.empty((64, 3)), 2
    copy_point(ends, 0, x, 0)
    copy_point(ends, 1, x, 1)
    for m in range(active.size):
        beside = _zones_beside(zones, active, active[m])
        levels = np.empty(0)
        if ring > _RINGS[0]:
            among = active if active.size <= MANY_ZONES else beside
            levels = _levels(zones, among, zones[active[m]])
        found = _zone_corners(zones, active[m], levels, ends, limits, floor, ring)
        if n + found.shape[0] > x.shape[0]:
            more = np.empty((2 * (n + found.shape[0]), 3))
            for i in range(n):
                copy_point(x, i, more, i)
            x = more
        for i in range(found.shape[0]):
            bound = point_distance(ends, 0, found, i) + point_distance(ends, 1, found, i)
            if bound <= known and not _is_inside_any(zones, beside, found, i, no_skin):
                copy_point(found, i, x, n)
                n += 1
        if spend(work, active.size + found.shape[0] * (1 + beside.size)):
            break
    return x[:n]


@inner_allocating_kernel
def _add_overlapping(zones: Zones, blocking: Ints, before: Ints) -> None:
    """Mark as blocking also the zones that overlap those marked since `before`."""
    for k in range(zones.size):
        if blocking[k] and not before[k]:
            zone = zones[k]
            for m in range(zones.size):
                other = zones[m]
                if (zone.x0 <= other.x1 and zone.x1 >= other.x0 and zone.y0 <= other.y1
                        and zone.y1 >= other.y0):
                    blocking[m] = 1


@inner_allocating_kernel
def _marked(blocking: Ints, least: int) -> Ints:
    """Indices of zones whose mark is at least `least`; O(zones)."""
    marked, n = np.empty(blocking.size, np.int64), 0
    for k in range(blocking.size):
        if blocking[k] >= least:
            marked[n] = k
            n += 1
    return marked[:n]


@inner_allocating_kernel
def _search(zones: Zones, ends: Floats, limits: Floats, floor: float, no_skin: bool, ring: int,
            known: float, blocking: Ints, out: Floats, work: Ints) -> int:
    """Write a clear, coarse path of at most `known` [m] into `out`; marks the zones it considers.

    Returns:
        Its number of points; 0: none found, or the search was cut short (work[2]).
    """
    tries = 0
    while True:
        active = _marked(blocking, 1)
        x = _graph_corners(zones, active, ends, limits, floor, no_skin, ring, known, work)
        if work[2]:
            return 0
        path = np.empty(x.shape[0], np.int64)
        size = astar(zones, active, x, floor, no_skin, path, work)
        if size == 0 or size > MAX_CORNERS // 2:
            return 0
        new, before = 0, np.empty(blocking.size, np.int64)
        for k in range(blocking.size):
            before[k] = blocking[k]
        for i in range(size):
            copy_point(x, path[i], out, i)
            if i:
                new += mark_blocking(zones, out, i - 1, i, floor, no_skin, blocking)
        if new == 0:
            return size
        tries += 1
        if tries > FIRST_SEARCHES:
            _add_overlapping(zones, blocking, before)
        if spend(work, size * zones.size):
            return 0


@inner_allocating_kernel
def path_clears(zones: Zones, p: Floats, n: int, floor: float, no_skin: bool) -> bool:
    """Whether the polyline p[:n] enters no zone; O(zones n), most of them by their boxes."""
    x, y, z = p[0, 0], p[0, 1], p[0, 2]
    u, v, w = x, y, z
    for i in range(1, n):
        x, y, z = min(x, p[i, 0]), min(y, p[i, 1]), min(z, p[i, 2])
        u, v, w = max(u, p[i, 0]), max(v, p[i, 1]), max(w, p[i, 2])
    for k in range(zones.size):
        zone = zones[k]
        if (x > zone.x1 or u < zone.x0 or y > zone.y1 or v < zone.y0 or z > zone.z1
                or w < zone.z0):
            continue
        for i in range(1, n):
            if blocked(zone, p[i - 1, 0], p[i - 1, 1], p[i - 1, 2], p[i, 0], p[i, 1], p[i, 2],
                       floor, no_skin):
                return False
    return True


@inner_allocating_kernel
def easy_path(zones: Zones, ends: Floats, limits: Floats, no_skin: bool, out: Floats) -> int:
    """Write the path between two ends into `out` if it is straight, or leads past one zone.

    Args:
        zones, ends, limits, no_skin, out: as of `shortest_path`.

    Returns:
        Number of points; 0: it is neither. O(zones)
    """
    copy_point(ends, 0, out, 0)
    copy_point(ends, 1, out, 1)
    floor = min(ends[0, 2], ends[1, 2])
    first = next_blocking(zones, 0, ends, 0, 1, floor, no_skin)
    if first == zones.size:
        return 2
    if no_skin or next_blocking(zones, first + 1, ends, 0, 1, floor, no_skin) < zones.size:
        return 0
    n = path_past_zone(zones[first], ends, limits, floor, out)
    return n if n > 0 and path_clears(zones, out, n, floor, False) else 0


@inner_allocating_kernel
def shortest_path(zones: Zones, ends: Floats, limits: Floats, no_skin: bool, out: Floats,
                  work: Ints) -> tuple[int, float]:
    """Write the shortest safe path between two ends, both outside all zones, into `out`.

    Args:
        no_skin: an end is so near to a zone that the path cannot keep the skin's distance.
        out: float64 (MAX_CORNERS, 3) [m].

    Returns:
        Number of points and length [m]. (0, inf): there is none; (0, NaN): not known, as the
        search was cut short. A path found before that is returned.
    """
    n, floor = easy_path(zones, ends, limits, no_skin, out), min(ends[0, 2], ends[1, 2])
    cut_short = spend(work, zones.size if n == 2 else 3 * zones.size)
    if n > 0:
        return n, path_length(out, n)
    if cut_short:
        return 0, np.nan
    blocking, trial = np.zeros(zones.size, np.int64), np.empty((MAX_CORNERS, 3))
    mark_blocking(zones, ends, 0, 1, floor, no_skin, blocking)
    for ring in _RINGS:
        known = path_length(out, n) if n else np.inf
        size = _search(zones, ends, limits, floor, no_skin, ring, known, blocking, trial, work)
        n = keep_best(trial, size, out, n)
        if work[2] or (n and (ring > _RINGS[0] or _marked(blocking, 1).size <= FEW_ZONES)):
            break
    if n == 0:
        return 0, np.nan if work[2] else np.inf
    near = zones_near(zones, _marked(blocking, 0), ends, 0, 1, path_length(out, n))
    n = tauten(zones, near, out, n, limits, floor, no_skin, work)
    return n, path_length(out, n)
