# SPDX-License-Identifier: Apache-2.0
"""A coarse path: A* over a visibility graph with corners just outside the active zones."""
from __future__ import annotations

import math
from typing import Any

import numpy as np

from uav_task_alloc.geometry.numba_pointers import floats_at
from uav_task_alloc.geometry.obstacles import (
    CYLINDER,
    DOME,
    PRISM,
    Floats,
    Ints,
    Zone,
    Zones,
    blocked,
)
from uav_task_alloc.geometry.outline import corner_turn
from uav_task_alloc.geometry.points import point_distance
from uav_task_alloc.geometry.polygon import orientation
from uav_task_alloc.geometry.search_budget import spend
from uav_task_alloc.kernel import inline_kernel, inner_allocating_kernel

FEW_CORNERS = 160  # up to here edges are tested as late as possible


@inner_allocating_kernel
def corner_bound(zone: Zone, ring: int, levels: int) -> int:
    """An upper bound of the corners from a zone, with those at `levels` further heights."""
    if zone.kind == PRISM:
        return int((10 + 2 * levels) * zone.corner_count)
    return (4 + levels) * ring + 1


@inner_allocating_kernel
def _height(ends: Floats, x: float, y: float) -> float:
    """z [m] of the straight path between `ends` where (x, y) is nearest to it in plan view."""
    dx, dy = ends[1, 0] - ends[0, 0], ends[1, 1] - ends[0, 1]
    span = dx * dx + dy * dy
    t = 0.5
    if span > 0.0:
        t = min(1.0, max(0.0, ((x - ends[0, 0]) * dx + (y - ends[0, 1]) * dy) / span))
    return float(ends[0, 2] + t * (ends[1, 2] - ends[0, 2]))


@inner_allocating_kernel
def _heading(zone: Zone, ends: Floats) -> tuple[float, float]:
    """Direction of the path in plan view, so that corners built on it turn with the scene."""
    dx, dy = ends[1, 0] - ends[0, 0], ends[1, 1] - ends[0, 1]
    size = math.hypot(dx, dy)
    if size <= 1e-9 * abs(ends[1, 2] - ends[0, 2]):
        dx, dy = ends[0, 0] - zone.x, ends[0, 1] - zone.y
        size = math.hypot(dx, dy)
    return (dx / size, dy / size) if size > 0.0 else (1.0, 0.0)


@inner_allocating_kernel
def _ring(zone: Zone, ends: Floats, limits: Floats, radius: float, z: float, ring: int,
          out: Floats, n: int) -> int:
    """Write `ring` corners around the axis of a zone at height z (NaN: that of the path)."""
    ux, uy = _heading(zone, ends)
    low, high = limits[0], limits[1]
    for j in range(ring):
        c, s = math.cos(2 * math.pi * j / ring), math.sin(2 * math.pi * j / ring)
        ex, ey = ux * c - uy * s, ux * s + uy * c
        x, y, h = zone.x + radius * ex, zone.y + radius * ey, z
        if math.isnan(z):
            h = min(high, max(low, _height(ends, x, y)))
            if zone.kind == DOME:
                up = max(0.0, h - zone.z)
                if up >= radius:
                    continue
                wide = math.sqrt(radius * radius - up * up)
                x, y = zone.x + wide * ex, zone.y + wide * ey
        out[n, 0], out[n, 1], out[n, 2] = x, y, h
        n += 1
    return n


@inner_allocating_kernel
def _dome_corners(zone: Zone, ends: Floats, limits: Floats, floor: float, ring: int,
                  out: Floats, n: int) -> int:
    """Write the corners around a dome into out[n:]; returns the new n."""
    radius = (zone.radius + 1.5 * zone.skin) / math.cos(math.pi / ring)
    n = _ring(zone, ends, limits, radius, np.nan, ring, out, n)
    for step in range(1, 3):
        up = min(radius * math.sin(math.pi / 6 * step), limits[1] - zone.z)
        if up > 0.0 and zone.z + up >= limits[0]:
            n = _ring(zone, ends, limits, math.sqrt(radius * radius - up * up),
                      zone.z + up, ring, out, n)
    if limits[0] <= zone.z + radius <= limits[1]:
        out[n, 0], out[n, 1], out[n, 2] = zone.x, zone.y, zone.z + radius
        n += 1
    under = zone.low - 1.5 * zone.skin
    if floor < zone.low and limits[0] <= under <= limits[1]:
        n = _ring(zone, ends, limits, radius, under, ring, out, n)
    return n


@inner_allocating_kernel
def _crossing(ends: Floats, px: float, py: float, qx: float, qy: float) -> float:
    """Where along pq, in 0..1, the straight path crosses it in plan view; NaN: nowhere."""
    a, b = (ends[0, 0], ends[0, 1]), (ends[1, 0], ends[1, 1])
    sp, sq = orientation(a, b, (px, py)), orientation(a, b, (qx, qy))
    return sp / (sp - sq) if sp * sq < 0.0 else np.nan


@inner_allocating_kernel
def _edge_corners(zone: Zone, ends: Floats, z: float, reach: float, out: Floats,
                  n: int) -> int:
    """Write each edge's middle and crossing with the path, on a rim of the prism."""
    c, count = floats_at(zone.corners), zone.corner_count
    for i in range(count):
        j = (i + 1) % count
        px, py = c[2 * i], c[2 * i + 1]
        dx, dy = c[2 * j] - px, c[2 * j + 1] - py
        size = math.hypot(dx, dy)
        px, py = px + dy * reach / size, py - dx * reach / size
        cross = _crossing(ends, px, py, px + dx, py + dy)
        for t in (0.5, cross):
            if not math.isnan(t):
                out[n, 0], out[n, 1], out[n, 2] = px + t * dx, py + t * dy, z
                n += 1
    return n


@inner_allocating_kernel
def _prism_corners(zone: Zone, ends: Floats, limits: Floats, z: float, out: Floats,
                   n: int) -> int:
    """Write mitred corners at a prism's convex corners, at height z (NaN: the path's)."""
    reach = zone.grow + 1.5 * zone.skin
    corners, count = floats_at(zone.corners), zone.corner_count
    for i in range(count):
        h, j = (i - 1) % count, (i + 1) % count
        cx, cy = corners[2 * i], corners[2 * i + 1]
        before, turn = corner_turn(corners[2 * h], corners[2 * h + 1], cx, cy,
                                   corners[2 * j], corners[2 * j + 1])
        if turn <= 0.0:
            continue
        parts = max(1, math.ceil(turn / (0.5 * math.pi) - 1e-9))
        far = reach / math.cos(0.5 * turn / parts)
        for j in range(parts):
            angle = before - 0.5 * math.pi + (j + 0.5) * turn / parts
            x, y = cx + far * math.cos(angle), cy + far * math.sin(angle)
            out[n, 0], out[n, 1] = x, y
            out[n, 2] = min(limits[1], max(limits[0], _height(ends, x, y))) if math.isnan(
                z) else z
            n += 1
    return n


@inner_allocating_kernel
def add_corners(zone: Zone, ends: Floats, limits: Floats, floor: float, ring: int,
                out: Floats, n: int) -> int:
    """Write the corners of a zone for a path between `ends` into out[n:]; O(corner_bound).

    Args:
        ring: corners around a dome or cylinder.
        out: float64 (at least n + corner_bound, 3) [m].
        n: rows in use.

    Returns:
        The new n.
    """
    if zone.kind == DOME:
        return _dome_corners(zone, ends, limits, floor, ring, out, n)
    radius = (zone.radius + 1.5 * zone.skin) / math.cos(math.pi / ring)
    for level in range(3):
        z = np.nan
        if level == 1:
            z = zone.high + 1.5 * zone.skin
        elif level == 2:
            z = zone.low - 1.5 * zone.skin
        if z < limits[0] or z > limits[1] or math.isinf(z):
            continue
        if zone.kind == CYLINDER:
            n = _ring(zone, ends, limits, radius, z, ring, out, n)
        else:
            n = _prism_corners(zone, ends, limits, z, out, n)
            if not math.isnan(z):
                n = _edge_corners(zone, ends, z, zone.grow + 1.5 * zone.skin, out, n)
    return n


@inner_allocating_kernel
def add_level(zone: Zone, ends: Floats, limits: Floats, z: float, ring: int, out: Floats,
              n: int) -> int:
    """Write corners at the height z [m] where another zone ends; returns the new n."""
    low = zone.z if zone.kind == DOME else zone.low
    if not (max(low, limits[0]) < z < min(zone.high, limits[1])):
        return n
    if zone.kind == PRISM:
        return _prism_corners(zone, ends, limits, z, out, n)
    radius = (zone.radius + 1.5 * zone.skin) / math.cos(math.pi / ring)
    if zone.kind == DOME:
        radius = math.sqrt(radius * radius - (z - zone.z) ** 2)
    return _ring(zone, ends, limits, radius, z, ring, out, n)


@inner_allocating_kernel
def _boxes(zones: Zones, active: Ints) -> Floats:
    """x0, x1, y0, y1 of the active zones, float64 (active, 4), side by side in memory."""
    boxes = np.empty((active.size, 4))
    for m in range(active.size):
        zone = zones[active[m]]
        boxes[m, 0], boxes[m, 1], boxes[m, 2], boxes[m, 3] = zone.x0, zone.x1, zone.y0, zone.y1
    return boxes


@inner_allocating_kernel
def _is_visible(zones: Zones, active: Ints, boxes: Floats, x: Floats, i: int, j: int, floor: float,
                no_skin: bool) -> bool:
    """Whether the segment x[i] x[j] enters no active zone. O(active)"""
    x0, x1 = min(x[i, 0], x[j, 0]), max(x[i, 0], x[j, 0])
    y0, y1 = min(x[i, 1], x[j, 1]), max(x[i, 1], x[j, 1])
    for m in range(active.size):
        if (x0 <= boxes[m, 1] and x1 >= boxes[m, 0] and y0 <= boxes[m, 3] and y1 >= boxes[m, 2]
                and blocked(zones[active[m]], x[i, 0], x[i, 1], x[i, 2], x[j, 0], x[j, 1], x[j, 2],
                            floor, no_skin)):
            return False
    return True


@inner_allocating_kernel
def _next_parent(x: Floats, cost: Floats, closed: Ints, done: int, v: int,
                 failed: int) -> tuple[float, int]:
    """The next best path to v over a closed corner, after the one that failed."""
    best, parent, above, passed = np.inf, -1, cost[v], False
    for m in range(done):
        u = closed[m]
        c = cost[u] + point_distance(x, u, x, v)
        if c < best and (c > above or (c == above and passed)):
            best, parent = c, u
        passed = passed or u == failed
    return best, parent


@inner_allocating_kernel
def _nearest_open(cost: Floats, ahead: Floats, state: Any) -> int:
    """The open corner with the least bound on the whole path; -1: none. O(n)"""
    v, best = -1, np.inf
    for w in range(cost.size):
        if state[w] == 0 and cost[w] + ahead[w] < best:
            v, best = w, cost[w] + ahead[w]
    return v


@inline_kernel
def _follow(parent: Ints, path: Ints) -> int:
    """Write the corners from 0 over their parents into `path`; returns how many. O(corners)"""
    size, v = 0, 0
    while v >= 0:
        path[size] = v
        size, v = size + 1, parent[v]
    return size


@inner_allocating_kernel
def astar(zones: Zones, active: Ints, x: Floats, floor: float, no_skin: bool, path: Ints,
          work: Ints) -> int:
    """Find the shortest path from x[0] to x[1] over corners x past the active zones.

    Searched from x[1], so that parents lead forwards. Among few corners an edge is tested when it
    is about to be used, and a failed one falls back on the next best closed corner; among many
    that would repeat too often, and all edges of a corner are tested when it is closed.
    O(n) a step, or O(n zones).

    Args:
        active: indices of the zones, int64.
        x: corners, float64 (n, 3) [m].
        path: int64 (n,), the result: indices of corners from 0 to 1.

    Returns:
        Number of corners in `path`; 0: there is none, or the search was cut short.
    """
    n, boxes = x.shape[0], _boxes(zones, active)
    lazy = n <= FEW_CORNERS
    cost, state = np.empty(n), np.zeros(n, np.int64)
    parent, closed, ahead = np.empty(n, np.int64), np.empty(n, np.int64), np.empty(n)
    for v in range(n):
        cost[v], parent[v], ahead[v] = np.inf, -1, point_distance(x, v, x, 0)
    cost[1], state[1], closed[0], done, u = 0.0, 1, 1, 1, 1
    while True:
        for v in range(n):
            if state[v] == 0:
                c = cost[u] + point_distance(x, u, x, v)
                if c < cost[v] and (lazy or _is_visible(zones, active, boxes, x, u, v, floor,
                                                        no_skin)):
                    cost[v], parent[v] = c, u
            if v % 64 == 0 and spend(work, 64 if lazy else 64 * active.size):
                return 0
        while True:
            v = _nearest_open(cost, ahead, state)
            if v < 0 or spend(work, n + active.size):
                return 0
            if not lazy or _is_visible(zones, active, boxes, x, parent[v], v, floor, no_skin):
                break
            cost[v], parent[v] = _next_parent(x, cost, closed, done, v, parent[v])
        state[v], closed[done], u = 1, v, v
        done += 1
        if v == 0:
            return _follow(parent, path)
