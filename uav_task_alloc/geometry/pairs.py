# SPDX-License-Identifier: Apache-2.0
"""Kernels for the lengths of safe paths between numbered points: known, or searched for now.

`length(pairs, i, j)` may be called in any kernel, also without the GIL. The lengths fill
a square table (NaN: not known yet), or for many points a cache of the last ones.
"""
from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from uav_task_alloc.geometry.numba_pointers import call_float, floats_at, ints_at
from uav_task_alloc.geometry.obstacles import Floats, Ints
from uav_task_alloc.geometry.path_store import store_path
from uav_task_alloc.geometry.points import path_length, reverse_points
from uav_task_alloc.geometry.scene import (
    BUDGET_INDEX,
    INSIDE,
    LOCATION_INDEX,
    WITHIN_SKIN,
    scene_at,
    stored_ends,
)
from uav_task_alloc.geometry.search_budget import CUT_SHORT, EXHAUSTED, MAX_UNITS
from uav_task_alloc.geometry.shortest_path import path_clears
from uav_task_alloc.kernel import allocating_kernel, inner_allocating_kernel, inner_kernel

CACHE_SIZE = 1 << 20  # lengths kept where there is no table; a power of two


class _Addresses(NamedTuple):
    """Sizes and addresses; numba_pointers.py says why."""

    points: int
    zones: int
    xyz: int  # float64 (points, 3) [m]
    row: int  # length of a row of the table; 0: no table
    slot: int  # int64: row and column of each point in the table
    table: int  # float64 [m], NaN: unknown
    keys: int  # int64: i * points + j of each length in the cache
    lengths: int  # float64 [m]
    scene: int  # what `find` reads
    find: int  # C function (scene, i, j) -> length [m]; 0 where there are no zones
    join: int  # C function (scene, i, k << 32 | j) -> length [m]; 0 where there are no zones


class Pairs(_Addresses):
    """What `length` needs inside a kernel; made by Distances, opaque to all others."""

    owner: object  # keeps alive what the addresses point to

    def __reduce__(self) -> str:
        raise TypeError('Pairs hold addresses of this process: make new Distances there')


@allocating_kernel
def length(pairs: Pairs, i: int, j: int) -> float:
    """Return the length of the shortest safe path between two points; O(1) once known.

    Args:
        pairs: arrays of `Distances`, of n points; found lengths are stored in them.
        i: of the point to start from, in 0..n-1.
        j: of the point to reach, in 0..n-1.

    Returns:
        [m]; inf: no path was found.
    """
    if pairs.row > 0:
        slot = ints_at(pairs.slot)
        known = floats_at(pairs.table)[slot[i] * pairs.row + slot[j]]
        return known if known >= 0.0 else _find_for_table(pairs, i, j)
    if pairs.zones > 0:
        return _find_for_cache(pairs, i, j)
    xyz = floats_at(pairs.xyz)
    dx, dy, dz = xyz[3 * i] - xyz[3 * j], xyz[3 * i + 1] - xyz[3 * j + 1], xyz[
        3 * i + 2] - xyz[3 * j + 2]
    return math.sqrt(dx * dx + dy * dy + dz * dz)


@inner_kernel
def is_enclosed(pairs: Pairs, i: int) -> bool:
    """Return whether a point is inside a zone. O(1)

    Args:
        pairs: arrays of `Distances`, of n points.
        i: of the point, in 0..n-1.

    Returns:
        True: no path leads to it.
    """
    return bool(pairs.zones > 0
                and ints_at(ints_at(pairs.scene)[LOCATION_INDEX])[i] == INSIDE)


@inner_allocating_kernel
def _search_length(pairs: Pairs, i: int, j: int, known: float) -> float:
    """Search for a length now; `known` is what an earlier search left that was cut short.

    Where the time is up and there is no table, easy paths are still found: among so many points
    few pairs are known by then, and a plan of known pairs alone would serve no task.

    Returns:
        [m]; -w - 1: not found with w units of work; NaN: there was no time to search.
    """
    state, table = ints_at(ints_at(pairs.scene)[BUDGET_INDEX]), pairs.row > 0
    if state[EXHAUSTED] != 0:
        if table or known < 0.0:
            return float(known)
    elif -known > state[MAX_UNITS]:
        state[CUT_SHORT] += 1
        return float(known)
    found = call_float(pairs.find, pairs.scene, i, j)
    if found == found:
        return float(found)
    state[CUT_SHORT] += 1
    if state[EXHAUSTED] == 0:
        return -1.0 - float(state[MAX_UNITS])
    return float(known) if table or known < 0.0 else -1.0


@inner_allocating_kernel
def _find_for_table(pairs: Pairs, i: int, j: int) -> float:
    """As `length`, where the table does not have it yet."""
    slot, table = ints_at(pairs.slot), floats_at(pairs.table)
    place = slot[i] * pairs.row + slot[j]
    found = _search_length(pairs, i, j, table[place])
    table[place] = found
    location = ints_at(ints_at(pairs.scene)[LOCATION_INDEX])
    if location[i] != INSIDE and location[j] != INSIDE:
        table[slot[j] * pairs.row + slot[i]] = found
    return found if found >= 0.0 else np.inf


@inner_allocating_kernel
def _find_for_cache(pairs: Pairs, i: int, j: int) -> float:
    """As `length`, with the cache instead of the table."""
    keys, lengths = ints_at(pairs.keys), floats_at(pairs.lengths)
    location = ints_at(ints_at(pairs.scene)[LOCATION_INDEX])
    if j < i and location[i] != INSIDE and location[j] != INSIDE:
        i, j = j, i
    key = i * pairs.points + j
    place = (key * 0x9E3779B1 >> 8) & (CACHE_SIZE - 1)
    if keys[place] == key and lengths[place] >= 0.0:
        return float(lengths[place])
    found = _search_length(pairs, i, j, lengths[place] if keys[place] == key else np.nan)
    if found == found:
        keys[place], lengths[place] = key, found
    return found if found >= 0.0 else np.inf


@allocating_kernel
def known_length(pairs: Pairs, i: int, j: int) -> float:
    """Return the length of a path without a search. O(1)

    Args:
        pairs: arrays of `Distances`, of n points.
        i: of the point to start from, in 0..n-1.
        j: of the point to reach, in 0..n-1.

    Returns:
        [m]; NaN or negative: not known.
    """
    if pairs.row > 0:
        slot = ints_at(pairs.slot)
        return float(floats_at(pairs.table)[slot[i] * pairs.row + slot[j]])
    if pairs.zones == 0:
        return length(pairs, i, j)
    keys, lengths = ints_at(pairs.keys), floats_at(pairs.lengths)
    for a, b in ((i, j), (j, i)):
        key = a * pairs.points + b
        place = (key * 0x9E3779B1 >> 8) & (CACHE_SIZE - 1)
        if keys[place] == key:
            return float(lengths[place])
    return np.nan


@allocating_kernel
def read_known_lengths(pairs: Pairs, origins: Ints, goals: Ints, known: Floats) -> None:
    """Write `known_length` of many pairs, without a search.

    Args:
        pairs: arrays of `Distances`.
        origins: int64 (m,), points to start from.
        goals: int64 (m,), points to reach.
        known: float64 (m,) [m], the result; NaN or negative: not known.
    """
    for m in range(origins.size):
        known[m] = known_length(pairs, origins[m], goals[m])


@inner_allocating_kernel
def _store_length(pairs: Pairs, i: int, j: int, found: float) -> None:
    """Store the length of a path from i to j, which is outside all zones. O(1)"""
    location = ints_at(ints_at(pairs.scene)[LOCATION_INDEX])
    if pairs.row > 0:
        slot, table = ints_at(pairs.slot), floats_at(pairs.table)
        table[slot[i] * pairs.row + slot[j]] = found
        if location[i] != INSIDE:
            table[slot[j] * pairs.row + slot[i]] = found
    elif pairs.zones > 0:
        key = (i * pairs.points + j if location[i] == INSIDE
               else min(i, j) * pairs.points + max(i, j))
        place = (key * 0x9E3779B1 >> 8) & (CACHE_SIZE - 1)
        ints_at(pairs.keys)[place], floats_at(pairs.lengths)[place] = key, found


@inner_allocating_kernel
def length_via(pairs: Pairs, i: int, k: int, j: int) -> float:
    """Return the length of the path from i to j, or over point k where none is known.

    Args:
        pairs: arrays of `Distances`, of n points; found lengths are stored in them.
        i: of the point to start from, in 0..n-1.
        k: of a point between, in 0..n-1.
        j: of the point to reach, in 0..n-1.

    Returns:
        [m]; inf: nor are the paths from i to k and from k to j known.
    """
    found = length(pairs, i, j)
    if found < np.inf or pairs.zones == 0:
        return found
    found = call_float(pairs.join, pairs.scene, i, (k << 32) | j)
    if found < np.inf:
        _store_length(pairs, i, j, found)
    return float(found)


@allocating_kernel
def ensure_lengths(pairs: Pairs, origins: Ints, goals: Ints) -> None:
    """Search now for the lengths of all pairs that are not known.

    Args:
        pairs: arrays of `Distances`; found lengths are stored in them.
        origins: int64 (m,), points to start from.
        goals: int64 (m,), points to reach.
    """
    for m in range(origins.size):
        length(pairs, origins[m], goals[m])


@allocating_kernel
def take_path(pairs: Pairs, i: int, j: int, path: Floats, n: int) -> bool:
    """Store a path if it is clear of zones; O(zones n).

    Args:
        pairs: arrays of `Distances`; the path and its length are stored in them.
        i: of the point it starts from, outside all zones.
        j: of the point it reaches, outside all zones.
        path: float64 (>= n, 3) [m] with both ends; left reversed where paths are stored so.
        n: number of points.

    Returns:
        Whether it was stored.
    """
    scene, ends = scene_at(pairs.scene), np.empty((2, 3))
    if stored_ends(scene, i, j, ends):
        reverse_points(path, 0, n)
    no_skin = scene.location[i] == WITHIN_SKIN or scene.location[j] == WITHIN_SKIN
    if not path_clears(scene.zones, path, n, min(ends[0, 2], ends[1, 2]), no_skin):
        return False
    store_path(scene.store, path, n, ends)
    _store_length(pairs, i, j, path_length(path, n))
    return True
