# SPDX-License-Identifier: Apache-2.0
"""Zones as arrays, enlarged, and the predicates of kernels: does a point or a segment enter one?

A dome enlarged by g is the ball of radius R + g above z0 - g; a cylinder or prism grows by g
sideways and at both ends. Each holds the exact enlargement (all points nearer than g) and exceeds
it only at its rims. A dome rests on the ground: while both ends of a path are above its base (the
lower one is `floor`), the space beneath it is closed too, so that no path leads under it.

Arguments that kernels of this package share:
    zones: rows of dtype _ZONE, shape (zones,); `zone` is one row.
    p, path, out: points, float64 (n, 3) [m]. ends: start and goal, float64 (2, 3) [m].
    px ... qz: coordinates [m] of the ends p and q of a segment.
    limits: lowest and highest waypoint, float64 (2,) [m].
    floor: z of the lower end of the whole path [m]; -inf: the space beneath domes is open.
    no_skin: up to the surface; otherwise a skin of 0.02 m around each zone counts as inside.
    work: int64 (3,), see search_budget.py.
"""
from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numba
import numpy as np
from numba import types
from numba.extending import intrinsic
from numpy.typing import NDArray

from uav_task_alloc.checks import check_number
from uav_task_alloc.geometry.numba_pointers import cast, floats_at
from uav_task_alloc.geometry.outline import (
    Floats as Floats,
    Ints as Ints,
    circle_rim,
    convex_hull,
    polygon_rim,
)
from uav_task_alloc.geometry.polygon import crosses_ray, segments_cross, signed_area
from uav_task_alloc.kernel import allocating_kernel, inner_allocating_kernel
from uav_task_alloc.model import Shape, ThreatZone

DOME, CYLINDER, PRISM = Shape.HEMISPHERE.value, Shape.CYLINDER.value, Shape.POLYGON.value
TOUCH = 1e-7  # [m] so near a surface counts as on it, not inside
SKIN = 0.02  # [m] paths keep this much more distance, so that rounding never puts them inside

RIM_CORNERS = 24  # corners of the outline of a cylinder
NO_CORNERS: Floats = np.zeros((0, 2))

Zones = NDArray[np.void]  # of dtype _ZONE
Zone = Any  # one row of it, in a kernel


#: One enlarged zone, all lengths [m]. Corners are x, y, x, y, ..., counter-clockwise.
_ZONE = np.dtype([
    ('kind', np.int64),
    ('x', np.float64), ('y', np.float64), ('z', np.float64),  # centre; z is a dome's base
    ('radius', np.float64), ('low', np.float64), ('high', np.float64),  # enlarged
    ('grow', np.float64), ('skin', np.float64),  # margin + clearance
    ('x0', np.float64), ('y0', np.float64), ('z0', np.float64),  # box around it, with the skin
    ('x1', np.float64), ('y1', np.float64), ('z1', np.float64),
    ('corners', np.int64), ('corner_count', np.int64),  # PRISM: address and number, not enlarged
    ('rim', np.int64), ('rim_count', np.int64),  # its outline, 1.5 skins off; none for a dome
    ('hull', np.int64), ('hull_count', np.int64),  # the rim's convex hull
    ('concave', np.int64),  # 1: they are not the same
])


@intrinsic
def _zones_at(typing_context: Any, address: int) -> Any:
    """The rows of dtype _ZONE at an address."""
    row = types.CPointer(numba.from_dtype(_ZONE))  # type: ignore[no-untyped-call]
    return row(types.int64), cast


zones_at: Callable[[int], Any] = _zones_at  # type: ignore[assignment]


@dataclass(frozen=True, eq=False)
class Obstacles:
    """Enlarged zones as kernels take them.

    Attributes:
        rows: dtype _ZONE, one for each zone.
        outlines: the arrays whose addresses `rows` hold.
    """

    rows: Zones
    outlines: tuple[Floats, ...]


def pack(zones: Sequence[ThreatZone], clearance: float = 0.0) -> Obstacles:
    """Pack zones for kernels; O(corners log corners).

    Args:
        zones: the zones.
        clearance: [m] by which they are enlarged beyond their margins.

    Returns:
        One row for each zone, in the same order.

    Raises:
        InvalidValue: the clearance is negative or not a number.
    """
    clearance = check_number('clearance', clearance, 0.0, 1e6)
    rows, outlines = [], []
    for zone in zones:
        grow = zone.margin + clearance
        (x, y, z), size, low, high = _extent(zone)
        skin = min(SKIN, 1e-4 * (size + grow))
        outline, rim, hull, concave = _outlines(zone, grow + 1.5 * skin)
        wide, deep = np.ptp(outline, axis=0) / 2 if len(outline) else (size, size)
        wide, deep = wide + grow + skin, deep + grow + skin
        bottom = -math.inf if zone.shape is Shape.HEMISPHERE else low - grow - skin
        rows.append((
            zone.shape.value, x, y, z, zone.radius + grow, low - grow, high + grow, grow, skin,
            x - wide, y - deep, bottom, x + wide, y + deep, high + grow + skin,
            outline.ctypes.data, len(outline), rim.ctypes.data, len(rim),
            hull.ctypes.data, len(hull), concave))
        outlines += [outline, rim, hull]
    return Obstacles(np.array(rows, _ZONE), tuple(outlines))


def _outlines(zone: ThreatZone, reach: float) -> tuple[Floats, Floats, Floats, bool]:
    """Corners, rim and hull of the rim, `reach` [m] off it, and whether rim and hull differ."""
    if zone.shape is Shape.HEMISPHERE:
        return NO_CORNERS, NO_CORNERS, NO_CORNERS, False
    if zone.shape is Shape.CYLINDER:
        rim = circle_rim(zone.center[0], zone.center[1], zone.radius + reach, RIM_CORNERS)
        return NO_CORNERS, rim, rim, False
    clockwise = signed_area(zone.vertices) < 0.0
    corners = np.array(zone.vertices[::-1] if clockwise else zone.vertices, np.float64)
    hull = convex_hull(corners)
    return corners, polygon_rim(corners, reach), polygon_rim(hull, reach), len(hull) < len(corners)


def _extent(zone: ThreatZone) -> tuple[tuple[float, float, float], float, float, float]:
    """Centre, radius of the circle around it, lowest and highest z of a zone as it is [m]."""
    if zone.shape is Shape.HEMISPHERE:
        return zone.center, zone.radius, zone.center[2], zone.center[2] + zone.radius
    if zone.shape is Shape.CYLINDER:
        return zone.center, zone.radius, zone.z_min, zone.z_max
    xs, ys = zip(*zone.vertices, strict=True)
    middle = (min(xs) + max(xs)) / 2, (min(ys) + max(ys)) / 2, 0.0
    return middle, math.hypot(max(xs) - min(xs), max(ys) - min(ys)) / 2, zone.z_min, zone.z_max


@inner_allocating_kernel
def box_distance(zone: Zone, x: float, y: float, z: float) -> float:
    """Distance [m] from a point to the box around a zone; 0.0 inside."""
    dx = max(zone.x0 - x, x - zone.x1, 0.0)
    dy = max(zone.y0 - y, y - zone.y1, 0.0)
    dz = max(zone.z0 - z, z - zone.z1, 0.0)
    return math.sqrt(dx * dx + dy * dy + dz * dz)


@inner_allocating_kernel
def squared_segment_distance(px: float, py: float, ax: float, ay: float, bx: float,
                             by: float) -> float:
    """Squared distance [m2] in plan view from p to the segment ab."""
    dx, dy = bx - ax, by - ay
    span = dx * dx + dy * dy
    t = 0.0
    if span > 0.0:
        t = min(1.0, max(0.0, ((px - ax) * dx + (py - ay) * dy) / span))
    ex, ey = ax + t * dx - px, ay + t * dy - py
    return ex * ex + ey * ey


@inner_allocating_kernel
def in_polygon(zone: Zone, x: float, y: float) -> bool:
    """Whether (x, y) [m] lies in the polygon without its margin; O(corners)."""
    odd = False
    c, n = floats_at(zone.corners), zone.corner_count
    j = n - 1
    for i in range(n):
        if crosses_ray((x, y), (c[2 * i], c[2 * i + 1]), (c[2 * j], c[2 * j + 1])):
            odd = not odd
        j = i
    return odd


@inner_allocating_kernel
def _meets_polygon(zone: Zone, ax: float, ay: float, bx: float, by: float,
                   reach: float) -> bool:
    """Whether ab comes nearer than `reach` [m] to the polygon in plan view; O(corners)."""
    limit = reach * reach
    c, n = floats_at(zone.corners), zone.corner_count
    cx, cy = c[2 * n - 2], c[2 * n - 1]
    for i in range(n):
        dx, dy = c[2 * i], c[2 * i + 1]
        if segments_cross((ax, ay), (bx, by), (cx, cy), (dx, dy)):
            return True
        if limit > 0.0 and (squared_segment_distance(ax, ay, cx, cy, dx, dy) < limit
                            or squared_segment_distance(bx, by, cx, cy, dx, dy) < limit
                            or squared_segment_distance(cx, cy, ax, ay, bx, by) < limit
                            or squared_segment_distance(dx, dy, ax, ay, bx, by) < limit):
            return True
        cx, cy = dx, dy
    return in_polygon(zone, ax, ay) or in_polygon(zone, (ax + bx) / 2, (ay + by) / 2)


@inner_allocating_kernel
def _clip(pz: float, qz: float, low: float, high: float) -> tuple[float, float]:
    """The part [s, t] of a segment strictly between two heights [m]; s >= t: none."""
    if pz == qz:
        return (0.0, 1.0) if low < pz < high else (1.0, 0.0)
    s, t = (low - pz) / (qz - pz), (high - pz) / (qz - pz)
    if s > t:
        s, t = t, s
    return max(0.0, s), min(1.0, t)


@inner_allocating_kernel
def _squared_centre_distance(zone: Zone, px: float, py: float, pz: float, dx: float, dy: float,
                             dz: float, s: float, t: float) -> float:
    """Squared distance [m2] from the centre to the part [s, t] of p + d."""
    fx, fy, fz = px - zone.x, py - zone.y, pz - zone.z
    span = dx * dx + dy * dy + dz * dz
    u = s
    if span > 0.0:
        u = min(t, max(s, -(fx * dx + fy * dy + fz * dz) / span))
    fx, fy, fz = fx + u * dx, fy + u * dy, fz + u * dz
    return float(fx * fx + fy * fy + fz * fz)


@inner_allocating_kernel
def _meets_dome(zone: Zone, px: float, py: float, pz: float, qx: float, qy: float,
                qz: float, floor: float, skin: float) -> bool:
    """Whether the segment pq enters a dome, or the closed space beneath it."""
    reach = zone.radius + skin
    grounded = floor >= zone.low
    base = zone.z if grounded else zone.low - skin
    s, t = _clip(pz, qz, base, np.inf)
    if s < t and _squared_centre_distance(zone, px, py, pz, qx - px, qy - py, qz - pz, s,
                                          t) < reach * reach:
        return True
    if not grounded:
        return False
    s, t = _clip(pz, qz, -np.inf, base)
    if pz == base and qz == base:
        s, t = 0.0, 1.0
    return s < t and _squared_centre_distance(zone, px, py, zone.z, qx - px, qy - py, 0.0, s,
                                              t) < reach * reach


@allocating_kernel
def blocked(zone: Zone, px: float, py: float, pz: float, qx: float, qy: float,
            qz: float, floor: float, no_skin: bool) -> bool:
    """Return whether the segment pq enters a zone; O(corners), O(1) where the boxes are apart.

    Args:
        zone: row of an `Obstacles` table.
        px, py, pz: [m] ENU, one end.
        qx, qy, qz: [m] ENU, the other end.
        floor: [m] z of the lower end of the whole path; -inf: the space beneath domes is open.
        no_skin: up to the surface; otherwise 0.02 m around the zone count as inside.

    Returns:
        False where the segment is outside or only touches.
    """
    if (min(px, qx) > zone.x1 or max(px, qx) < zone.x0
            or min(py, qy) > zone.y1 or max(py, qy) < zone.y0
            or min(pz, qz) > zone.z1 or max(pz, qz) < zone.z0):
        return False
    skin = -TOUCH if no_skin else zone.skin
    if zone.kind == DOME:
        return _meets_dome(zone, px, py, pz, qx, qy, qz, floor, skin)
    s, t = _clip(pz, qz, zone.low - skin, zone.high + skin)
    if s >= t:
        return False
    if zone.kind == CYLINDER:
        reach = zone.radius + skin
        return bool(_squared_centre_distance(zone, px, py, zone.z, qx - px, qy - py, 0.0, s,
                                             t) < reach * reach)
    dx, dy = qx - px, qy - py
    return _meets_polygon(zone, px + s * dx, py + s * dy, px + t * dx, py + t * dy,
                          zone.grow + skin)


@allocating_kernel
def contains(zone: Zone, x: float, y: float, z: float, no_skin: bool) -> bool:
    """Whether a point is inside a zone; the space beneath a dome is not. O(corners)"""
    return blocked(zone, x, y, z, x, y, z, -np.inf, no_skin)


@inner_allocating_kernel
def first_containing(zones: Zones, x: float, y: float, z: float, no_skin: bool) -> int:
    """Index of the first zone that contains a point; -1: none. O(zones)"""
    for k in range(zones.size):
        if contains(zones[k], x, y, z, no_skin):
            return k
    return -1


@allocating_kernel
def containing_zones(zones: Zones, x: float, y: float, z: float) -> Ints:
    """Indices, int64 (n,), of all zones that contain a point without skin. O(zones)"""
    found, n = np.empty(zones.size, np.int64), 0
    for k in range(zones.size):
        if contains(zones[k], x, y, z, True):
            found[n] = k
            n += 1
    return found[:n]
