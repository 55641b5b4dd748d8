# SPDX-License-Identifier: Apache-2.0
"""Flight times of legs around zones: along the path that was found, kept in a hash table."""
from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from uav_task_alloc.geometry.distances import Distances
from uav_task_alloc.geometry.numba_pointers import call_float, floats_at, ints_at
from uav_task_alloc.geometry.pairs import Pairs
from uav_task_alloc.geometry.scene import time_address
from uav_task_alloc.kernel import inner_allocating_kernel

TABLE_SIZE = 1 << 18  # times kept; a power of two
Speeds = tuple[float, float, float]  # [m/s] cruise, climb, descent


class _TimeAddresses(NamedTuple):
    """Addresses; geometry/numba_pointers.py says why."""

    keys: int  # int64: (class of speeds * points + i) * points + j of each time; -1: free
    seconds: int  # float64 [s]
    scenes: int  # int64 (classes, 2) what `time` reads
    time: int  # C function (row of scenes, i, j) -> [s]; 0 where there are no zones


class PathTimes(_TimeAddresses):
    """What `path_seconds` needs; made by `path_times`."""

    owner: object  # keeps alive what the addresses point to


def path_times(distances: Distances, classes: Sequence[Speeds]) -> PathTimes:
    """No times yet, of UAVs with these speeds."""
    size = TABLE_SIZE if distances.zones else 1
    keys, seconds = np.full(size, -1, np.int64), np.empty(size)
    speeds = np.array(classes, np.float64).reshape(-1, 3)
    scenes = np.array([(distances.pairs.scene, speeds.ctypes.data + 24 * c)
                       for c in range(len(speeds))], np.int64).reshape(-1, 2)
    times = PathTimes(keys.ctypes.data, seconds.ctypes.data, scenes.ctypes.data,
                      time_address(bool(distances.zones)))
    times.owner = (keys, seconds, speeds, scenes, distances)
    return times


@inner_allocating_kernel
def path_seconds(pairs: Pairs, times: PathTimes, speeds: int, i: int, j: int) -> float:
    """Time [s] along the path from point i to point j, whose length is known. O(1) once known.

    speeds: class of the UAV's speeds. inf where the path is lost and not found again.
    """
    keys, seconds = ints_at(times.keys), floats_at(times.seconds)
    key = (speeds * pairs.points + i) * pairs.points + j
    place = (key * 0x9E3779B1 >> 8) & (TABLE_SIZE - 1)
    if keys[place] == key:
        return float(seconds[place])
    scene = times.scenes + 16 * speeds
    found = call_float(times.time, scene, i, j)
    if not found >= 0.0:
        call_float(pairs.find, pairs.scene, i, j)
        found = call_float(times.time, scene, i, j)
    if not found >= 0.0:
        return math.inf
    keys[place], seconds[place] = -1, found
    keys[place] = key
    return float(found)
