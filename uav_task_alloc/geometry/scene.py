# SPDX-License-Identifier: Apache-2.0
"""Points among zones, and the kernels that find the path from one to another."""
from __future__ import annotations

import functools
import math
from typing import Any, NamedTuple

import numba
import numpy as np
from numba import carray  # type: ignore[attr-defined]

from uav_task_alloc.geometry.escape import escape_point
from uav_task_alloc.geometry.flight_time import path_time
from uav_task_alloc.geometry.numba_pointers import floats_at, ints_at
from uav_task_alloc.geometry.obstacles import Floats, Ints, Zones, first_containing, zones_at
from uav_task_alloc.geometry.path_store import PathStore, load_path, store_path
from uav_task_alloc.geometry.points import copy_point, path_length, reverse_points
from uav_task_alloc.geometry.search_budget import SearchBudget, is_exhausted, new_work
from uav_task_alloc.geometry.shortest_path import easy_path, path_clears, shortest_path
from uav_task_alloc.geometry.taut import MAX_CORNERS
from uav_task_alloc.kernel import allocating_kernel, c_function, inner_allocating_kernel

OUTSIDE, WITHIN_SKIN, INSIDE = 0, 1, 2
LOCATION_INDEX, BUDGET_INDEX, _PATH_INDEX = 3, 7, 9  # in scene_addresses


class PathScene(NamedTuple):
    """Points among zones, as kernels take them."""

    xyz: Floats  # (n, 3) [m]
    location: Ints  # OUTSIDE, WITHIN_SKIN (nearer than the skin) or INSIDE
    exits: Floats  # (n, 3) [m] nearest point outside; NaN: none, inf: not searched for yet
    limits: Floats  # altitude_min, altitude_max [m]
    zones: Zones
    budget: Ints  # state of the SearchBudget
    store: int  # PathStore.address


def make_scene(xyz: Floats, zones: Zones, limits: Floats, budget: SearchBudget,
               store: PathStore | None) -> PathScene:
    """The scene of points (n, 3) [m]; escape points are searched for when first needed."""
    location, exits = np.zeros(len(xyz), np.int64), np.full((len(xyz), 3), np.inf)
    if zones.size:
        _locate_all(zones, xyz, location)
    return PathScene(xyz, location, exits, limits, zones, budget.state,
                     store.address if store else 0)


@inner_allocating_kernel
def locate(zones: Zones, p: Floats) -> int:
    """Whether p (3,) is INSIDE a zone, WITHIN_SKIN of one or OUTSIDE all; O(zones)."""
    if first_containing(zones, p[0], p[1], p[2], False) < 0:
        return OUTSIDE
    return INSIDE if first_containing(zones, p[0], p[1], p[2], True) >= 0 else WITHIN_SKIN


@allocating_kernel
def _locate_all(zones: Zones, xyz: Floats, location: Ints) -> None:
    """Set location (n,) for all points; O(n zones)."""
    for i in range(xyz.shape[0]):
        location[i] = locate(zones, xyz[i])


@inner_allocating_kernel
def _exit_point(scene: PathScene, i: int, work: Ints) -> Floats:
    """The escape point of point i, inside a zone; NaN: none, or the search was cut short."""
    if math.isinf(scene.exits[i, 0]):
        point: Floats = escape_point(scene.zones, scene.xyz[i], scene.limits, work)
        if work[2] == 0:  # x last: other threads read it
            scene.exits[i, 2], scene.exits[i, 1], scene.exits[i, 0] = point[2], point[1], point[0]
        return point
    first: Floats = scene.exits[i]
    return first


def scene_addresses(scene: PathScene) -> Ints:
    """Sizes and addresses of the scene's arrays, int64 (10,), as `scene_at` reads them.

    The last is of an array that `_find` writes the path to instead of storing it; 0: none.
    """
    return np.array([len(scene.xyz), len(scene.zones),
                     *(array.ctypes.data for array in scene[:6]), scene.store, 0], np.int64)


@inner_allocating_kernel
def scene_at(address: int) -> PathScene:
    """The scene whose `scene_addresses` are at an address."""
    at = ints_at(address)
    n, k = at[0], at[1]
    return PathScene(
        carray(floats_at(at[2]), (n, 3)), carray(ints_at(at[3]), n),
        carray(floats_at(at[4]), (n, 3)), carray(floats_at(at[5]), 2),
        carray(zones_at(at[6]), k), carray(ints_at(at[7]), 5), at[8])


@inner_allocating_kernel
def ordered_ends(p: Floats, q: Floats, ends: Floats) -> bool:
    """Write p and q into ends in lexical order, one for both directions; True: swapped."""
    swapped = bool(p[0] > q[0] or (
        p[0] == q[0] and (p[1] > q[1] or (p[1] == q[1] and p[2] > q[2]))))
    for m in range(3):
        ends[0, m], ends[1, m] = (q[m], p[m]) if swapped else (p[m], q[m])
    return swapped


@inner_allocating_kernel
def stored_ends(scene: PathScene, i: int, j: int, ends: Floats) -> bool:
    """Write the ends under which the path from i to j is stored.

    A path out of a zone is no path back, and begins with the point outside.

    Returns:
        Whether the path is stored in the opposite direction.
    """
    if scene.location[i] != INSIDE:
        return bool(ordered_ends(scene.xyz[i], scene.xyz[j], ends))
    copy_point(scene.xyz, i, ends, 0)
    copy_point(scene.xyz, j, ends, 1)
    return False


@allocating_kernel
def stored_path(scene: PathScene, i: int, j: int, path: Floats) -> int:
    """Write the known path from i to j into path (MAX_CORNERS, 3), if it is clear; O(zones n).

    Returns:
        Its number of points; 0: not known, or no longer clear.
    """
    ends, start_inside = np.empty((2, 3)), scene.location[i] == INSIDE
    no_skin = scene.location[i] == WITHIN_SKIN or scene.location[j] == WITHIN_SKIN
    floor = min(scene.xyz[i, 2], scene.xyz[j, 2])
    swapped = stored_ends(scene, i, j, ends)
    copy_point(ends, 0, path, 0)
    copy_point(ends, 1, path, 1)
    n = 0 if start_inside or not path_clears(scene.zones, path, 2, floor, no_skin) else 2
    if n == 0:
        n = load_path(scene.store, ends, path)
        first = 1 if start_inside else 0
        if start_inside:
            floor = min(path[1, 2], scene.xyz[j, 2])
        if n <= first or not path_clears(scene.zones, path[first:], n - first, floor, no_skin):
            return 0
    if swapped:
        reverse_points(path, 0, n)
    return n


def _join(address: int, i: int, between: int) -> float:
    """Store the known paths from i to k and from k to j as one.

    Args:
        address: of scene_addresses.
        between: k << 32 | j.

    Returns:
        Its length [m]; inf: they are not known, have too many points, or k is beyond the altitude
        limits.
    """
    scene, k, j = scene_at(address), between >> 32, between & 0xFFFFFFFF
    if not scene.limits[0] <= scene.xyz[k, 2] <= scene.limits[1]:
        return np.inf
    path, onward = np.empty((2 * MAX_CORNERS, 3)), np.empty((MAX_CORNERS, 3))
    n, more = stored_path(scene, i, k, path), stored_path(scene, k, j, onward)
    if n == 0 or more == 0 or n + more > MAX_CORNERS or scene.location[k] == INSIDE:
        return np.inf
    for m in range(1, more):
        copy_point(onward, m, path, n)
        n += 1
    length, ends = path_length(path, n), np.empty((2, 3))
    if stored_ends(scene, i, j, ends):
        reverse_points(path, 0, n)
    store_path(scene.store, path, n, ends)
    return length


@inner_allocating_kernel
def _easy_length(scene: PathScene, i: int, j: int) -> float:
    """Length [m] of the path from i to j that takes no search: stored, straight, or past one zone.

    NaN: there is none. O(zones)
    """
    path = np.empty((MAX_CORNERS, 3))
    n = stored_path(scene, i, j, path)
    if n > 0 or INSIDE in (scene.location[i], scene.location[j]):
        return path_length(path, n) if n > 0 else np.nan
    no_skin = scene.location[i] == WITHIN_SKIN or scene.location[j] == WITHIN_SKIN
    ends = np.empty((2, 3))
    ordered_ends(scene.xyz[i], scene.xyz[j], ends)
    n = easy_path(scene.zones, ends, scene.limits, no_skin, path)
    if n == 0:
        return np.nan
    store_path(scene.store, path, n, ends)
    return path_length(path, n)


def _find(address: int, i: int, j: int) -> float:
    """Length [m] of the path from point i to point j; inf: none, NaN: not known."""
    scene = scene_at(address)
    if i == j:
        return 0.0
    if scene.location[j] == INSIDE:
        return np.inf
    budget, to = ints_at(address)[BUDGET_INDEX], ints_at(address)[_PATH_INDEX]
    if to == 0 and is_exhausted(budget):
        return _easy_length(scene, i, j)
    work, p, q, first = new_work(budget), scene.xyz[i], scene.xyz[j], 0.0
    if scene.location[i] == INSIDE:
        p = _exit_point(scene, i, work)
        if work[2] or math.isnan(p[0]):
            return np.nan if work[2] else np.inf
        first = math.hypot(math.hypot(p[0] - scene.xyz[i, 0], p[1] - scene.xyz[i, 1]),
                           p[2] - scene.xyz[i, 2])
    ends = np.empty((2, 3))
    swapped = ordered_ends(p, q, ends)
    no_skin = scene.location[i] == WITHIN_SKIN or scene.location[j] == WITHIN_SKIN or (
        to != 0 and locate(scene.zones, p) != OUTSIDE)
    path = np.empty((MAX_CORNERS + 1, 3)) if to == 0 else carray(
        floats_at(to), (MAX_CORNERS + 1, 3))
    n, length = shortest_path(scene.zones, ends, scene.limits, no_skin, path[1:], work)
    if to != 0:
        path[0, 0], path[0, 1], path[0, 2] = n, length, 1.0 if swapped else 0.0
    elif n > 1:
        if scene.location[i] != INSIDE:
            if n > 2:
                store_path(scene.store, path[1:], n, ends)
        elif n < MAX_CORNERS:  # straight after the exit or not
            if swapped:
                reverse_points(path, 1, n)
            copy_point(scene.xyz, i, path, 0)
            stored_ends(scene, i, j, ends)
            store_path(scene.store, path, n + 1, ends)
    return first + length


def path_found(xyz: Floats, obstacles: Zones, limits: Floats,
               budget: SearchBudget | None) -> tuple[float, Floats, Floats]:
    """Search for the path between two points, and store it nowhere.

    Args:
        xyz: both points, (2, 3) [m]; the second is outside all zones.
        obstacles: rows of the enlarged zones.
        limits: altitude_min, altitude_max [m].
        budget: None: no limit.

    Returns:
        Length [m] of the path outside zones (inf: there is none, NaN: not known), its points, and
        the point where it leaves the zones that the first point is in: (0, 3) if it is in none.
    """
    scene = make_scene(xyz, obstacles, limits, budget or SearchBudget(), None)
    addresses, path = scene_addresses(scene), np.zeros((MAX_CORNERS + 1, 3))
    addresses[_PATH_INDEX] = path.ctypes.data
    if budget is None:
        addresses[BUDGET_INDEX] = 0
    found = _compiled(_find).ctypes(addresses.ctypes.data, 0, 1)
    if not math.isfinite(found):
        return found, path[:0], path[:0]
    n, length, swapped = int(path[0, 0]), float(path[0, 1]), path[0, 2] > 0.0
    points = path[1:n + 1]
    return (length, points[::-1] if swapped else points,
            scene.exits[:1] if scene.location[0] == INSIDE else path[:0])


def _time(address: int, i: int, j: int) -> float:
    """Flight time [s] along the known path from point i to point j.

    Args:
        address: of two int64: addresses of `scene_addresses` and of three float64 [m/s], the
            cruise, climb and descent speed.

    Returns:
        NaN: the path is not known.
    """
    at = ints_at(address)
    scene, speed, path = scene_at(at[0]), floats_at(at[1]), np.empty((MAX_CORNERS, 3))
    n = stored_path(scene, i, j, path)
    return path_time(path, n, speed[0], speed[1], speed[2]) if n > 0 else np.nan


@functools.cache
def _compiled(function: Any) -> Any:
    signature = numba.float64(numba.int64, numba.int64, numba.int64)
    return c_function(function, signature)


def find_address(zones: bool) -> int:
    """Address of `_find`, compiled apart so that callers compile fast; 0 without zones."""
    return int(_compiled(_find).address) if zones else 0


def join_address(zones: bool) -> int:
    """Address of `_join`; 0 without zones."""
    return int(_compiled(_join).address) if zones else 0


def time_address(zones: bool) -> int:
    """Return the address of the function that times paths, for kernels.

    Args:
        zones: whether there are any.

    Returns:
        0 without zones: legs are straight.
    """
    return int(_compiled(_time).address) if zones else 0
