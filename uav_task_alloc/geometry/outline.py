# SPDX-License-Identifier: Apache-2.0
"""Outlines of zones in plan view: rims at a distance from them, and convex hulls."""
from __future__ import annotations

import math

import numpy as np
from numba.extending import register_jitable
from numpy.typing import NDArray

from uav_task_alloc.geometry.polygon import crosses_ray, orientation, segments_cross
from uav_task_alloc.kernel import allocating_kernel, inner_allocating_kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

for _predicate in (orientation, segments_cross, crosses_ray):  # so kernels may call them
    register_jitable(_predicate)


@inner_allocating_kernel
def corner_turn(ax: float, ay: float, x: float, y: float, bx: float,
                by: float) -> tuple[float, float]:
    """Heading [rad] from a to the corner (x, y), and the turn [rad] there towards b.

    Returns:
        The turn is in [-pi, pi), positive to the left.
    """
    heading = math.atan2(y - ay, x - ax)
    turn = math.atan2(by - y, bx - x) - heading
    return heading, turn - 2 * math.pi * math.floor((turn + math.pi) / (2 * math.pi))


@inner_allocating_kernel
def _fan(x: float, y: float, radius: float, start: float, turn: float, parts: int, rim: Floats,
         n: int) -> int:
    """Write the polyline that circumscribes an arc into rim[n:]; returns the new n. O(parts)"""
    step = turn / parts
    far = radius / math.cos(step / 2)
    for i in range(parts):
        angle = start + (i + 0.5) * step
        rim[n, 0], rim[n, 1] = x + far * math.cos(angle), y + far * math.sin(angle)
        n += 1
    return n


@allocating_kernel
def circle_rim(x: float, y: float, radius: float, parts: int) -> Floats:
    """Corners, float64 (parts, 2) [m], counter-clockwise, of a polygon around a circle."""
    rim = np.empty((parts, 2))
    _fan(x, y, radius, 0.0, 2 * math.pi, parts, rim, 0)
    return rim


@allocating_kernel
def polygon_rim(corners: Floats, grow: float) -> Floats:
    """The outline of a polygon enlarged by `grow` [m]; its round corners are circumscribed. O(n)

    Args:
        corners: float64 (n, 2) [m], counter-clockwise.
        grow: [m].

    Returns:
        float64 (m, 2) [m], counter-clockwise, m <= 5 n. It crosses itself where a notch is narrow.
    """
    count = corners.shape[0]
    rim, n = np.empty((5 * count, 2)), 0
    for i in range(count):
        x, y = corners[i, 0], corners[i, 1]
        h, j = i - 1 if i > 0 else count - 1, i + 1 if i + 1 < count else 0
        start, turn = corner_turn(corners[h, 0], corners[h, 1], x, y, corners[j, 0], corners[j, 1])
        parts = max(1, math.ceil(4 * turn / math.pi - 1e-9))
        n = _fan(x, y, grow, start - math.pi / 2, turn, parts, rim, n)
    return rim[:n].copy()


@allocating_kernel
def _monotone_chain(corners: Floats, order: Ints) -> Floats:
    """The convex hull of corners (n, 2) in the lexical `order` (n,); O(n)."""
    size = order.size
    hull, n, first = np.empty((2 * size + 1, 2)), 0, 0
    for m in range(2 * size - 1):
        i = order[m] if m < size else order[2 * size - 2 - m]
        if m == size:
            first = n - 1
        corner = corners[i, 0], corners[i, 1]
        while n - first > 1 and orientation(
                (hull[n - 2, 0], hull[n - 2, 1]), (hull[n - 1, 0], hull[n - 1, 1]), corner) <= 0.0:
            n -= 1
        hull[n, 0], hull[n, 1] = corners[i, 0], corners[i, 1]
        n += 1
    return hull[:n - 1].copy()


def convex_hull(corners: Floats) -> Floats:
    """The convex hull of corners, by Andrew's monotone chains; O(n log n).

    Args:
        corners: float64 (n, 2) [m].

    Returns:
        float64 (m, 2) [m], counter-clockwise, without corners on its edges.
    """
    return _monotone_chain(corners, np.lexsort((corners[:, 1], corners[:, 0])))
