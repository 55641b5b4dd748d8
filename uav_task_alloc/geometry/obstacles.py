# SPDX-License-Identifier: Apache-2.0
"""Zones as arrays, enlarged, and what kernels ask of them: does a point, a segment get inside?

A dome enlarged by g is the ball of radius R + g above z0 - g; a cylinder or prism grows by g
sideways and at both ends. Each holds the exact enlargement (all points nearer than g) and exceeds
it only at its rims. A dome stands on the ground: while both ends of a way are above its base (the
lower one is `floor`), the space beneath it is closed too, so that nobody digs under it.
"""
from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from uav_task_alloc.model import Shape, ThreatZone, check_number

DOME, CYLINDER, PRISM = Shape.HEMISPHERE.value, Shape.CYLINDER.value, Shape.POLYGON.value
TOUCH = 1e-7  # [m] so near a surface counts as on it, not inside
SKIN = 0.02  # [m] ways keep this much more distance, so that rounding never puts them inside

RIM = 24  # corners of the outline of a cylinder

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


class Obstacles(NamedTuple):
    """Enlarged zones, one row each; all lengths [m]."""

    kind: Ints
    centre: Floats  # (k, 3)
    radius: Floats  # enlarged
    low: Floats  # enlarged; a dome's base
    high: Floats  # enlarged
    grow: Floats  # margin + clearance
    skin: Floats
    box: Floats  # (k, 6): x, y, z low, x, y, z high, with the skin
    first: Ints  # PRISM: its corners are corners[first:first + count], counter-clockwise
    count: Ints
    corners: Floats  # (m, 2)
    first_rim: Ints  # CYLINDER and convex PRISM: the enlarged outline is rim[first:first + rims]
    rims: Ints
    rim: Floats  # (m, 2) [m], circumscribed, counter-clockwise, with 1.5 skins


def pack(zones: Sequence[ThreatZone], clearance: float = 0.0) -> Obstacles:
    """The zones enlarged by margin + clearance [m]. Raises InvalidValue."""
    clearance = check_number('clearance', clearance, 0.0, 1e6)
    k = len(zones)
    floats = np.zeros((5, k))
    centre, box = np.zeros((k, 3)), np.zeros((k, 6))
    first, count = np.zeros(k, np.int64), np.zeros(k, np.int64)
    corners: list[tuple[float, float]] = []
    rims: list[list[tuple[float, float]]] = []
    for i, zone in enumerate(zones):
        grow = zone.margin + clearance
        (centre[i], size, low, high), mine = _extent(zone), _counter_clockwise(zone.vertices)
        skin = min(SKIN, 1e-4 * (size + grow))
        floats[:, i] = zone.radius + grow, low - grow, high + grow, grow, skin
        first[i], count[i] = len(corners), len(mine)
        corners += mine
        rims.append(_rim(zone, mine, grow + 1.5 * skin))
        reach = np.array([_half_width(mine, 0, size), _half_width(mine, 1, size)]) + grow + skin
        bottom = -math.inf if zone.shape is Shape.HEMISPHERE else low - grow - skin
        box[i] = *(centre[i, :2] - reach), bottom, *(centre[i, :2] + reach), high + grow + skin
    kind = np.array([zone.shape.value for zone in zones], np.int64)
    sizes = np.array([len(rim) for rim in rims], np.int64)
    return Obstacles(kind, centre, *floats, box, first, count,
                     np.array(corners, dtype=np.float64).reshape(-1, 2),
                     np.cumsum(sizes) - sizes, sizes,
                     np.array([c for rim in rims for c in rim], np.float64).reshape(-1, 2))


def _extent(zone: ThreatZone) -> tuple[tuple[float, float, float], float, float, float]:
    """Centre, size, lowest and highest z of a zone as it is [m]."""
    if zone.shape is Shape.HEMISPHERE:
        return zone.center, zone.radius, zone.center[2], zone.center[2] + zone.radius
    if zone.shape is Shape.CYLINDER:
        return zone.center, zone.radius, zone.z_min, zone.z_max
    xs, ys = zip(*zone.vertices, strict=True)
    middle = (min(xs) + max(xs)) / 2, (min(ys) + max(ys)) / 2, 0.0
    return middle, math.hypot(max(xs) - min(xs), max(ys) - min(ys)) / 2, zone.z_min, zone.z_max


def _rim(zone: ThreatZone, corners: Sequence[tuple[float, float]],
         grow: float) -> list[tuple[float, float]]:
    """A convex outline just outside the enlarged zone; none for a dome or a dented polygon."""
    if zone.shape is Shape.HEMISPHERE:
        return []
    if zone.shape is Shape.CYLINDER:
        return _fan(zone.center, zone.radius + grow, 0.0, 2 * math.pi, RIM)
    rim: list[tuple[float, float]] = []
    for i, corner in enumerate(corners):
        before, after = corners[i - 1], corners[(i + 1) % len(corners)]
        start = math.atan2(corner[1] - before[1], corner[0] - before[0])
        turn = math.remainder(math.atan2(after[1] - corner[1], after[0] - corner[0]) - start,
                              2 * math.pi)
        if turn < 0.0:
            return []
        rim += _fan(corner, grow, start - math.pi / 2, turn, math.ceil(4 * turn / math.pi - 1e-9))
    return rim


def _fan(centre: Sequence[float], radius: float, start: float, turn: float,
         parts: int) -> list[tuple[float, float]]:
    """Corners of the polyline that circumscribes an arc."""
    step = turn / max(1, parts)
    far = radius / math.cos(step / 2)
    return [(centre[0] + far * math.cos(start + (i + 0.5) * step),
             centre[1] + far * math.sin(start + (i + 0.5) * step)) for i in range(parts)]


def _half_width(corners: Sequence[tuple[float, float]], axis: int, otherwise: float) -> float:
    values = [corner[axis] for corner in corners]
    return (max(values) - min(values)) / 2 if values else otherwise


def _counter_clockwise(vertices: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    area = sum(a[0] * b[1] - b[0] * a[1] for a, b in zip(
        vertices, [*vertices[1:], *vertices[:1]], strict=True))
    return list(vertices if area > 0 else reversed(vertices))


@numba.njit(cache=True, nogil=True)
def off_segment(px: float, py: float, ax: float, ay: float, bx: float, by: float) -> float:
    """Squared distance in plan from p to the segment ab."""
    dx, dy = bx - ax, by - ay
    span = dx * dx + dy * dy
    t = 0.0
    if span > 0.0:
        t = min(1.0, max(0.0, ((px - ax) * dx + (py - ay) * dy) / span))
    ex, ey = ax + t * dx - px, ay + t * dy - py
    return ex * ex + ey * ey


@numba.njit(cache=True, nogil=True)
def in_polygon(o: Obstacles, k: int, x: float, y: float) -> bool:
    """Whether (x, y) lies in the polygon as it is (even-odd rule)."""
    odd = False
    n, f = o.count[k], o.first[k]
    j = n - 1
    for i in range(n):
        xi, yi = o.corners[f + i, 0], o.corners[f + i, 1]
        xj, yj = o.corners[f + j, 0], o.corners[f + j, 1]
        if (yi > y) != (yj > y) and x < (xj - xi) * (y - yi) / (yj - yi) + xi:
            odd = not odd
        j = i
    return odd


@numba.njit(cache=True, nogil=True)
def _meets_polygon(o: Obstacles, k: int, ax: float, ay: float, bx: float, by: float,
                   reach: float) -> bool:
    """Whether the plan segment ab comes nearer to the polygon than `reach`. O(corners)."""
    limit = reach * reach
    n, f = o.count[k], o.first[k]
    cx, cy = o.corners[f + n - 1, 0], o.corners[f + n - 1, 1]
    for i in range(n):
        dx, dy = o.corners[f + i, 0], o.corners[f + i, 1]
        sa = (dx - cx) * (ay - cy) - (dy - cy) * (ax - cx)
        sb = (dx - cx) * (by - cy) - (dy - cy) * (bx - cx)
        sc = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        sd = (bx - ax) * (dy - ay) - (by - ay) * (dx - ax)
        if sa * sb < 0.0 and sc * sd < 0.0:
            return True
        if limit > 0.0 and (off_segment(ax, ay, cx, cy, dx, dy) < limit
                            or off_segment(bx, by, cx, cy, dx, dy) < limit
                            or off_segment(cx, cy, ax, ay, bx, by) < limit
                            or off_segment(dx, dy, ax, ay, bx, by) < limit):
            return True
        cx, cy = dx, dy
    return in_polygon(o, k, ax, ay) or in_polygon(o, k, (ax + bx) / 2, (ay + by) / 2)


@numba.njit(cache=True, nogil=True)
def _clip(pz: float, qz: float, low: float, high: float) -> tuple[float, float]:
    """The part [s, t] of a segment that is strictly between two heights; s >= t: none."""
    if pz == qz:
        return (0.0, 1.0) if low < pz < high else (1.0, 0.0)
    s, t = (low - pz) / (qz - pz), (high - pz) / (qz - pz)
    if s > t:
        s, t = t, s
    return max(0.0, s), min(1.0, t)


@numba.njit(cache=True, nogil=True)
def _near_centre(o: Obstacles, k: int, px: float, py: float, pz: float, dx: float, dy: float,
                 dz: float, s: float, t: float) -> float:
    """Squared distance from the centre to the part [s, t] of p + d."""
    fx, fy, fz = px - o.centre[k, 0], py - o.centre[k, 1], pz - o.centre[k, 2]
    span = dx * dx + dy * dy + dz * dz
    u = s
    if span > 0.0:
        u = min(t, max(s, -(fx * dx + fy * dy + fz * dz) / span))
    fx, fy, fz = fx + u * dx, fy + u * dy, fz + u * dz
    return fx * fx + fy * fy + fz * fz


@numba.njit(cache=True, nogil=True)
def _meets_dome(o: Obstacles, k: int, px: float, py: float, pz: float, qx: float, qy: float,
                qz: float, floor: float, skin: float) -> bool:
    reach = o.radius[k] + skin
    grounded = floor >= o.low[k]
    base = o.centre[k, 2] if grounded else o.low[k] - skin
    s, t = _clip(pz, qz, base, np.inf)
    if s < t and _near_centre(o, k, px, py, pz, qx - px, qy - py, qz - pz, s, t) < reach * reach:
        return True
    if not grounded:
        return False
    s, t = _clip(pz, qz, -np.inf, base)
    if pz == base and qz == base:
        s, t = 0.0, 1.0
    return s < t and _near_centre(o, k, px, py, o.centre[k, 2], qx - px, qy - py, 0.0, s,
                                  t) < reach * reach


@numba.njit(cache=True, nogil=True)
def blocked(o: Obstacles, k: int, px: float, py: float, pz: float, qx: float, qy: float,
            qz: float, floor: float, snug: bool) -> bool:
    """Whether the segment pq enters zone k. `snug`: up to the surface, without the skin."""
    if (min(px, qx) > o.box[k, 3] or max(px, qx) < o.box[k, 0]
            or min(py, qy) > o.box[k, 4] or max(py, qy) < o.box[k, 1]
            or min(pz, qz) > o.box[k, 5] or max(pz, qz) < o.box[k, 2]):
        return False
    skin = -TOUCH if snug else o.skin[k]
    if o.kind[k] == DOME:
        return _meets_dome(o, k, px, py, pz, qx, qy, qz, floor, skin)
    s, t = _clip(pz, qz, o.low[k] - skin, o.high[k] + skin)
    if s >= t:
        return False
    if o.kind[k] == CYLINDER:
        reach = o.radius[k] + skin
        return _near_centre(o, k, px, py, o.centre[k, 2], qx - px, qy - py, 0.0, s,
                            t) < reach * reach
    dx, dy = qx - px, qy - py
    return _meets_polygon(o, k, px + s * dx, py + s * dy, px + t * dx, py + t * dy,
                          o.grow[k] + skin)


@numba.njit(cache=True, nogil=True)
def contains(o: Obstacles, k: int, x: float, y: float, z: float, snug: bool) -> bool:
    """Whether a point is inside zone k; the space beneath a dome is not."""
    return blocked(o, k, x, y, z, x, y, z, -np.inf, snug)


@numba.njit(cache=True, nogil=True)
def first_around(o: Obstacles, x: float, y: float, z: float, snug: bool) -> int:
    """The first zone that contains a point; -1: none. O(zones)."""
    for k in range(o.kind.size):
        if contains(o, k, x, y, z, snug):
            return k
    return -1
