# SPDX-License-Identifier: Apache-2.0
"""Kernels for points in rows of arrays of shape (n, 3), float64 [m]: copy, distance, length."""
from __future__ import annotations

import math

from uav_task_alloc.geometry.outline import Floats
from uav_task_alloc.kernel import inner_kernel


@inner_kernel
def copy_point(source: Floats, i: int, to: Floats, j: int) -> None:
    """Set to[j] = source[i]; slices would do, but take a second each to compile."""
    to[j, 0], to[j, 1], to[j, 2] = source[i, 0], source[i, 1], source[i, 2]


@inner_kernel
def point_distance(p: Floats, i: int, q: Floats, j: int) -> float:
    """Distance [m] between p[i] and q[j]."""
    dx, dy, dz = p[i, 0] - q[j, 0], p[i, 1] - q[j, 1], p[i, 2] - q[j, 2]
    return math.sqrt(dx * dx + dy * dy + dz * dz)


@inner_kernel
def reverse_points(p: Floats, first: int, n: int) -> None:
    """Reverse the order of p[first:first + n]; O(n)."""
    for i in range(n // 2):
        j, k = first + i, first + n - 1 - i
        for c in range(3):
            p[j, c], p[k, c] = p[k, c], p[j, c]


@inner_kernel
def path_length(p: Floats, n: int) -> float:
    """Length [m] of the polyline p[:n]; O(n)."""
    total = 0.0
    for i in range(1, n):
        total += point_distance(p, i - 1, p, i)
    return total
