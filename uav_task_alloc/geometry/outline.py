# SPDX-License-Identifier: Apache-2.0
"""Outlines of zones in plan: the rim that lies some way off them, and convex hulls."""
from __future__ import annotations

import math

import numpy as np
from numba.extending import register_jitable
from numpy.typing import NDArray

from uav_task_alloc.geometry.polygon import crosses_ray, orientation, segments_cross
from uav_task_alloc.kernel import allocating_kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

for _predicate in (orientation, segments_cross, crosses_ray):  # so kernels may call them
    register_jitable(_predicate)


@allocating_kernel
def corner_turn(ax: float, ay: float, x: float, y: float, bx: float,
                by: float) -> tuple[float, float]:
    """Heading [rad] from a to the corner (x, y), and the turn [rad] there towards b.

    Returns:
        The turn is in [-pi, pi), positive to the left.
    """
    heading = math.atan2(y - ay, x - ax)
    turn = math.atan2(by - y, bx - x) - heading
    return heading, turn - 2 * math.pi * math.floor((turn + math.pi) / (2 * math.pi))


@allocating_kernel
def _fan(x: float, y: float, radius: float, start: float, turn: float, parts: int, rim: Floats,
         n: int) -> int:
    """Corners of the polyline that circumscribes an arc into rim[n:]; returns the new n."""
    step = turn / parts
    far = radius / math.cos(step / 2)
    for i in range(parts):
        angle = start + (i + 0.5) * step
        rim[n, 0], rim[n, 1] = x + far * math.cos(angle), y + far * math.sin(angle)
        n += 1
    return n


@allocating_kernel
def circle_rim(x: float, y: float, radius: float, parts: int) -> Floats:
    """Corners (parts, 2) [m] of the polygon that circumscribes a circle, counter-clockwise."""
    rim = np.empty((parts, 2))
    _fan(x, y, radius, 0.0, 2 * math.pi, parts, rim, 0)
    return rim


@allocating_kernel
def polygon_rim(corners: Floats, grow: float) -> Floats:
    """The outline `grow` [m] off a counter-clockwise polygon, circumscribing its round corners."""
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
    """The convex hull of corners in lexical order, by monotone chains. O(n)"""
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
    """The convex hull, counter-clockwise, without corners on its edges."""
    return _monotone_chain(corners, np.lexsort((corners[:, 1], corners[:, 0])))
