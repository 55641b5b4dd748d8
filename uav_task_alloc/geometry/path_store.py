# SPDX-License-Identifier: Apache-2.0
"""Paths that were found, by their ends: a ring buffer that overwrites the oldest.

Several threads may write at once, and zones may have changed since. A caller that loads a path
has to check that it is clear, and as long as expected.
"""
from __future__ import annotations

from typing import Any

import numpy as np
from numba import carray  # type: ignore[attr-defined]

from uav_task_alloc.geometry.numba_pointers import floats_at, ints_at
from uav_task_alloc.geometry.obstacles import Floats
from uav_task_alloc.geometry.points import copy_point
from uav_task_alloc.geometry.taut import MAX_CORNERS
from uav_task_alloc.kernel import inner_allocating_kernel

SLOTS = 1 << 16  # for paths; a power of two
PROBES = 4  # slots that a path may take
_CAPACITY = 1 << 19  # rows: points and a count for each path


class PathStore:
    """Memory for the points of paths; kernels take its `address`."""

    def __init__(self) -> None:
        self._place = np.full(SLOTS, -1, np.int64)  # row in which a path begins
        self._points = np.empty((_CAPACITY, 3))  # number of points, then the points
        self._state = np.zeros(3, np.int64)
        self._state[1:] = self._place.ctypes.data, self._points.ctypes.data

    @property
    def address(self) -> int:
        """Address of the state: next free row, addresses of slots and points."""
        return int(self._state.ctypes.data)


@inner_allocating_kernel
def _first_place(ends: Floats) -> int:
    """The first slot for a path with these ends (2, 3): a hash of them in 1/1024 m."""
    mixed: Any = np.int64(17)
    for i in range(2):
        for m in range(3):
            mixed = (mixed ^ np.int64(ends[i, m] * 1024.0)) * 0x9E3779B1
            mixed ^= mixed >> 29
    return int(mixed & (SLOTS - 1))


@inner_allocating_kernel
def _same(points: Floats, first: int, ends: Floats) -> bool:
    """Whether the path that begins in row `first` has these ends (2, 3)."""
    n = int(points[first, 0])
    if not 2 <= n <= MAX_CORNERS or first + n >= _CAPACITY:
        return False
    for m in range(3):
        if points[first + 1, m] != ends[0, m] or points[first + n, m] != ends[1, m]:
            return False
    return True


@inner_allocating_kernel
def store_path(address: int, path: Floats, n: int, ends: Floats) -> None:
    """Store the polyline path[:n] under its ends; O(n).

    Args:
        address: PathStore.address.
        path: (at least n, 3) [m].
        n: number of points, both ends included.
        ends: (2, 3) [m], the key; they need not be the first and last point in this order.
    """
    state = ints_at(address)
    slots = carray(ints_at(state[1]), SLOTS)
    points = carray(floats_at(state[2]), (_CAPACITY, 3))
    first = state[0]
    if first + n >= _CAPACITY:
        first = 0
    state[0] = first + n + 1
    points[first, 0] = n
    for i in range(n):
        copy_point(path, i, points, first + 1 + i)
    first_slot = _first_place(ends)
    slot = first_slot
    for k in range(PROBES):
        old = slots[(first_slot + k) & (SLOTS - 1)]
        if old < 0 or _same(points, old, ends):
            slot = (first_slot + k) & (SLOTS - 1)
            break
    slots[slot] = first


@inner_allocating_kernel
def load_path(address: int, ends: Floats, path: Floats) -> int:
    """Copy the path between `ends` into `path`; O(n).

    Args:
        address: PathStore.address.
        ends: (2, 3) [m], as stored.
        path: (MAX_CORNERS, 3) [m], the result.

    Returns:
        Its number of points; 0: not stored, or overwritten.
    """
    state = ints_at(address)
    slots = carray(ints_at(state[1]), SLOTS)
    points = carray(floats_at(state[2]), (_CAPACITY, 3))
    first_slot = _first_place(ends)
    for k in range(PROBES):
        first = slots[(first_slot + k) & (SLOTS - 1)]
        if first >= 0 and _same(points, first, ends):
            n = int(points[first, 0])
            for i in range(n):
                copy_point(points, first + 1 + i, path, i)
            return n
    return 0
