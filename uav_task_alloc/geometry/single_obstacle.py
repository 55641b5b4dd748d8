# SPDX-License-Identifier: Apache-2.0
"""The shortest path past a single zone in closed form, for domes, cylinders and prisms.

Past a dome: tangent, arc, tangent in the plane through both ends and the centre. Past the others
the shortest of: around on either side, with z rising evenly; over the top; beneath. Arcs become
circumscribed polylines of as few corners as the tolerance allows.
"""
from __future__ import annotations

import math

import numpy as np
from numba import carray  # type: ignore[attr-defined]

from uav_task_alloc.geometry.numba_pointers import floats_at
from uav_task_alloc.geometry.obstacles import CYLINDER, DOME, Floats, Zone
from uav_task_alloc.geometry.points import copy_point, path_length
from uav_task_alloc.geometry.polygon import orientation
from uav_task_alloc.kernel import inner_allocating_kernel

ARC_GAIN = 1.5e-3  # share of the path by which an arc's polyline may be longer
MAX_PARTS = 12  # corners of one arc
SLIDE_ROUNDS = 10  # rounds in which both rim points of a path over the top converge


@inner_allocating_kernel
def _arc_corners(radius: float, arc: float, straight: float) -> int:
    """Corners for an arc [rad]: k of them make it about radius arc^3 / (12 k^2) longer."""
    excess = radius * arc ** 3 / (12.0 * ARC_GAIN * (straight + radius * arc))
    return min(MAX_PARTS, max(1, math.ceil(math.sqrt(excess)), math.ceil(arc)))


@inner_allocating_kernel
def _dot(u: Floats, v: Floats) -> float:
    return float(u[0] * v[0] + u[1] * v[1] + u[2] * v[2])


@inner_allocating_kernel
def _tangent_path(centre: Floats, radius: float, ends: Floats, flat: bool, out: Floats) -> int:
    """Tangent, arc, tangent around a ball, or a circle in plan view; 0: no such path."""
    u, v = np.empty(3), np.empty(3)
    for m in range(3):
        u[m], v[m] = ends[0, m] - centre[m], ends[1, m] - centre[m]
    if flat:
        u[2], v[2] = 0.0, 0.0
    du, dv = math.sqrt(_dot(u, u)), math.sqrt(_dot(v, v))
    if du <= radius or dv <= radius:
        return 0
    along = _dot(u, v) / du
    for m in range(3):
        u[m] /= du
        v[m] -= along * u[m]
    off = math.sqrt(_dot(v, v))
    first = math.acos(radius / du)
    arc = math.atan2(off, along) - first - math.acos(radius / dv)
    if off < 1e-9 * dv:
        if not flat:
            return 0
        v[0], v[1], off = -u[1], u[0], 1.0
    if arc <= 0.0:
        return 0
    straight = math.sqrt(du * du - radius * radius) + math.sqrt(dv * dv - radius * radius)
    k = _arc_corners(radius, arc, straight)
    far = radius / math.cos(0.5 * arc / k)
    for j in range(k):
        angle = first + (j + 0.5) * arc / k
        c, s = far * math.cos(angle), far * math.sin(angle) / off
        for m in range(3):
            out[j + 1, m] = centre[m] + c * u[m] + s * v[m]
    copy_point(ends, 0, out, 0)
    copy_point(ends, 1, out, k + 1)
    return k + 2


@inner_allocating_kernel
def _interpolate_heights(p: Floats, n: int) -> None:
    """Let z rise evenly with the length in plan view from p[0] to p[n - 1]. O(n)"""
    total = 0.0
    for i in range(1, n):
        total += math.hypot(p[i, 0] - p[i - 1, 0], p[i, 1] - p[i - 1, 1])
    done = 0.0
    for i in range(1, n - 1):
        done += math.hypot(p[i, 0] - p[i - 1, 0], p[i, 1] - p[i - 1, 1])
        p[i, 2] = p[0, 2] + (p[n - 1, 2] - p[0, 2]) * done / total


@inner_allocating_kernel
def _path_around_hull(rim: Floats, ends: Floats, side: float, out: Floats) -> int:
    """Path around one side (1: left) of a convex rim, by gift wrapping. O(n rim)"""
    copy_point(ends, 0, out, 0)
    n = 1
    while n <= rim.shape[0] + 1:
        x, y = out[n - 1, 0], out[n - 1, 1]
        bx, by, last = ends[1, 0], ends[1, 1], True
        for i in range(rim.shape[0]):
            turn = orientation((x, y), (bx, by), (rim[i, 0], rim[i, 1]))
            if side * turn > 0.0 and (rim[i, 0] != x or rim[i, 1] != y):
                bx, by, last = rim[i, 0], rim[i, 1], False
        if last:
            copy_point(ends, 1, out, n)
            return n + 1
        out[n, 0], out[n, 1] = bx, by
        n += 1
    return 0


@inner_allocating_kernel
def _in_hull(hull: Floats, p: Floats) -> bool:
    """Whether p lies in a convex hull (n, 2), counter-clockwise, or on it. O(n)"""
    for i in range(hull.shape[0]):
        j = i + 1 if i + 1 < hull.shape[0] else 0
        if orientation((hull[i, 0], hull[i, 1]), (hull[j, 0], hull[j, 1]), (p[0], p[1])) < 0.0:
            return False
    return True


@inner_allocating_kernel
def _crossed_edges(rim: Floats, ends: Floats) -> tuple[int, int, float, float]:
    """The first and last edge of a rim (n, 2) that a line crosses in plan view. O(n)

    Returns:
        Both edges (-1: none), and where along the line (0: ends[0], 1: ends[1]).
    """
    enter, leave, s, t = -1, -1, np.inf, -np.inf
    dx, dy = ends[1, 0] - ends[0, 0], ends[1, 1] - ends[0, 1]
    n = rim.shape[0]
    a, b = (ends[0, 0], ends[0, 1]), (ends[1, 0], ends[1, 1])
    i = n - 1
    si = orientation(a, b, (rim[i, 0], rim[i, 1]))
    for j in range(n):
        sj = orientation(a, b, (rim[j, 0], rim[j, 1]))
        if (si > 0.0) != (sj > 0.0):
            f = si / (si - sj)
            x = rim[i, 0] + f * (rim[j, 0] - rim[i, 0]) - ends[0, 0]
            y = rim[i, 1] + f * (rim[j, 1] - rim[i, 1]) - ends[0, 1]
            u = (x * dx + y * dy) / (dx * dx + dy * dy)
            if u < s:
                enter, s = i, u
            if u > t:
                leave, t = i, u
        i, si = j, sj
    return enter, leave, s, t


@inner_allocating_kernel
def _rim_point(rim: Floats, edge: int, z: float, p: Floats, q: Floats, x: Floats) -> int:
    """Set x to the point on an edge of the rim at height z over which the path p x q is shortest.

    Unfolded about the edge the path is straight, so x divides the feet of p and q in the ratio of
    their distances from it.

    Returns:
        The edge to try next.
    """
    n = rim.shape[0]
    j = edge + 1 if edge + 1 < n else 0
    ex, ey = rim[j, 0] - rim[edge, 0], rim[j, 1] - rim[edge, 1]
    size = math.hypot(ex, ey)
    ex, ey = ex / size, ey / size
    fp = (p[0] - rim[edge, 0]) * ex + (p[1] - rim[edge, 1]) * ey
    fq = (q[0] - rim[edge, 0]) * ex + (q[1] - rim[edge, 1]) * ey
    hp = math.hypot((p[0] - rim[edge, 0]) * ey - (p[1] - rim[edge, 1]) * ex, p[2] - z)
    hq = math.hypot((q[0] - rim[edge, 0]) * ey - (q[1] - rim[edge, 1]) * ex, q[2] - z)
    s = fp + (fq - fp) * hp / (hp + hq) if hp + hq > 0.0 else fp
    t = min(size, max(0.0, s))
    x[0], x[1], x[2] = rim[edge, 0] + t * ex, rim[edge, 1] + t * ey, z
    if s < 0.0:
        return edge - 1 if edge > 0 else n - 1
    return j if s > size else edge


@inner_allocating_kernel
def _outside_cylinder(zone: Zone, p: Floats) -> bool:
    """Whether p is outside a cylinder in plan view, though perhaps within its rim."""
    return bool(zone.kind == CYLINDER
                and math.hypot(p[0] - zone.x, p[1] - zone.y) > zone.radius + zone.skin)


@inner_allocating_kernel
def _path_over_rim(zone: Zone, rim: Floats, z: float, side: float, ends: Floats,
                   out: Floats) -> int:
    """Path over the rim at height z (side 1), or beneath it (-1); 0: no such path."""
    enter, leave, s, t = _crossed_edges(rim, ends)
    climbs, sinks = side * (z - ends[0, 2]) > 0.0, side * (z - ends[1, 2]) > 0.0
    if (enter < 0 or leave < 0 or (climbs and s <= 0.0 and not _outside_cylinder(zone, ends[0]))
            or (sinks and t >= 1.0 and not _outside_cylinder(zone, ends[1]))):
        return 0
    p, q = np.empty(3), np.empty(3)
    for m in range(2):
        p[m] = ends[0, m] + (max(0.0, s) if climbs else 0.0) * (ends[1, m] - ends[0, m])
        q[m] = ends[0, m] + (min(1.0, t) if sinks else 1.0) * (ends[1, m] - ends[0, m])
    p[2], q[2] = z if climbs else ends[0, 2], z if sinks else ends[1, 2]
    for _ in range(SLIDE_ROUNDS if climbs and sinks else 4):
        if climbs:
            enter = _rim_point(rim, enter, z, ends[0], q, p)
        if sinks:
            leave = _rim_point(rim, leave, z, p, ends[1], q)
    copy_point(ends, 0, out, 0)
    n = 1
    if climbs:
        out[n, 0], out[n, 1], out[n, 2] = p[0], p[1], p[2]
        n += 1
    if sinks:
        out[n, 0], out[n, 1], out[n, 2] = q[0], q[1], q[2]
        n += 1
    copy_point(ends, 1, out, n)
    return n + 1


@inner_allocating_kernel
def _least_length_over(z: float, side: float, ends: Floats) -> float:
    """A lower bound [m] of the length of a path over (or beneath) height z."""
    up = max(0.0, side * (z - ends[0, 2])) + max(0.0, side * (z - ends[1, 2]))
    return math.hypot(math.hypot(ends[1, 0] - ends[0, 0], ends[1, 1] - ends[0, 1]),
                      max(up, abs(ends[1, 2] - ends[0, 2])))


@inner_allocating_kernel
def keep_best(trial: Floats, n: int, out: Floats, best: int) -> int:
    """Copy the path trial[:n] to `out` where it is shorter than out[:best]; returns its size."""
    if n == 0 or (best > 0 and path_length(trial, n) >= path_length(out, best)):
        return best
    for i in range(n):
        copy_point(trial, i, out, i)
    return n


@inner_allocating_kernel
def path_past_zone(zone: Zone, ends: Floats, limits: Floats, floor: float,
                   out: Floats) -> int:
    """Write the shortest path that passes one zone into `out`; O(rim^2).

    Args:
        out: float64 (MAX_CORNERS, 3) [m].

    Returns:
        Its number of points; 0: there is no closed form.
    """
    skin, centre = 1.5 * zone.skin, np.empty(3)
    centre[0], centre[1], centre[2] = zone.x, zone.y, zone.z
    if zone.kind == DOME:
        n = _tangent_path(centre, zone.radius + skin, ends, False, out) if floor >= zone.low else 0
        for i in range(1, n - 1):
            if not limits[0] <= out[i, 2] <= limits[1]:
                return 0
        return n
    if floor < limits[0] or max(ends[0, 2], ends[1, 2]) > limits[1]:
        return 0
    rim = carray(floats_at(zone.rim), (zone.rim_count, 2))
    hull = carray(floats_at(zone.hull), (zone.hull_count, 2))
    if zone.concave and (_in_hull(hull, ends[0]) or _in_hull(hull, ends[1])):
        return 0
    trial, best = np.empty((zone.hull_count + 3, 3)), 0
    for side in (-1.0, 1.0):
        if zone.kind == CYLINDER:
            n = _tangent_path(centre, zone.radius + skin, ends, True, trial) if side > 0.0 else 0
        else:
            n = _path_around_hull(hull, ends, side, trial)
        _interpolate_heights(trial, n)
        best = keep_best(trial, n, out, best)
    for side in (-1.0, 1.0):
        z = zone.high + skin if side > 0.0 else zone.low - skin
        if limits[0] <= z <= limits[1] and not math.isinf(z) and (
                best == 0 or _least_length_over(z, side, ends) < path_length(out, best)):
            best = keep_best(trial, _path_over_rim(zone, rim, z, side, ends, trial), out, best)
    return best
