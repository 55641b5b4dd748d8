# SPDX-License-Identifier: Apache-2.0
"""Lengths of safe paths between numbered points, for kernels: known, or searched for when needed.

`length(pairs, i, j)` may be called in any kernel, also without the GIL. Up to DENSE_MAX points the
lengths fill a square table (NaN: not known yet); beyond, there is a cache of the last ones. A path
not found within the budget counts as none until a greater budget is allowed.
"""
from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.geometry.detour import as_points, check_limits, path_between
from uav_task_alloc.geometry.numba_pointers import call_float, floats_at, ints_at
from uav_task_alloc.geometry.obstacles import Floats, Ints, Obstacles, containing_zones, pack
from uav_task_alloc.geometry.path_store import PathStore, store_path
from uav_task_alloc.geometry.points import path_length, reverse_points
from uav_task_alloc.geometry.polyline import polyline_length
from uav_task_alloc.geometry.scene import (
    BUDGET_INDEX,
    INSIDE,
    LOCATION_INDEX,
    WITHIN_SKIN,
    find_address,
    join_address,
    make_scene,
    scene_addresses,
    scene_at,
    stored_ends,
    stored_path,
)
from uav_task_alloc.geometry.search_budget import CUT_SHORT, EXHAUSTED, MAX_UNITS, SearchBudget
from uav_task_alloc.geometry.shortest_path import path_clears
from uav_task_alloc.geometry.table import LengthTable, invalidate
from uav_task_alloc.geometry.taut import MAX_CORNERS
from uav_task_alloc.kernel import allocating_kernel, inner_allocating_kernel
from uav_task_alloc.model import Leg, Point, ThreatZone

DENSE_MAX = 2048  # points; the table takes 8 n^2 bytes
CACHE_SIZE = 1 << 20  # lengths kept beyond that; a power of two
MAX_CHECKS = 20_000_000  # of pairs against changed zones; beyond, the table starts empty


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


@inner_allocating_kernel
def _search_length(pairs: Pairs, i: int, j: int, known: float) -> float:
    """Search for a length now; `known` is what an earlier search left that was cut short.

    Returns:
        [m]; -w - 1: not found with w units of work; NaN: there was no time to search.
    """
    state = ints_at(ints_at(pairs.scene)[BUDGET_INDEX])
    if state[EXHAUSTED] != 0:
        return known
    if -known > state[MAX_UNITS]:
        state[CUT_SHORT] += 1
        return known
    found = call_float(pairs.find, pairs.scene, i, j)
    if found == found:
        return float(found)
    state[CUT_SHORT] += 1
    return known if state[EXHAUSTED] != 0 else -1.0 - state[MAX_UNITS]


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
def _known_length(pairs: Pairs, i: int, j: int) -> float:
    """The length [m] if it is known; NaN or negative otherwise. O(1)"""
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
def _ensure(pairs: Pairs, origins: Ints, goals: Ints) -> None:
    """Search for the lengths of all pairs (origins[m], goals[m]), int64 (n,)."""
    for m in range(origins.size):
        length(pairs, origins[m], goals[m])


@allocating_kernel
def _take_path(pairs: Pairs, i: int, j: int, path: Floats, n: int) -> bool:
    """Store path[:n] from i to j, if it is clear, or leave it reversed; O(zones n)."""
    scene, ends = scene_at(pairs.scene), np.empty((2, 3))
    if stored_ends(scene, i, j, ends):
        reverse_points(path, 0, n)
    no_skin = scene.location[i] == WITHIN_SKIN or scene.location[j] == WITHIN_SKIN
    if not path_clears(scene.zones, path, n, min(ends[0, 2], ends[1, 2]), no_skin):
        return False
    store_path(scene.store, path, n, ends)
    _store_length(pairs, i, j, path_length(path, n))
    return True


class Distances:
    """Lengths of safe paths between points 0..n-1; asymmetric only where a point is inside a zone.

    Immutable to its user: `updated` returns another one, which takes over all that is still valid.

    Args:
        points: (n, 3), ENU [m].
        zones: each is enlarged by its margin and `clearance`.
        clearance: [m].
        altitude_min: lowest waypoint [m].
        altitude_max: highest waypoint [m].
        budget: what searches may spend; None: no limit.

    Arguments of methods:
        i, j: indices of points, in 0..n-1.

    Raises:
        InvalidValue: a point is not finite, the clearance is negative, or the limits are reversed.
    """

    def __init__(self, points: ArrayLike, zones: Sequence[ThreatZone] = (), *,
                 clearance: float = 0.0, altitude_min: float = -np.inf,
                 altitude_max: float = np.inf, budget: SearchBudget | None = None,
                 _previous: Distances | None = None, _table: LengthTable | None = None) -> None:
        self.points = np.ascontiguousarray(points, dtype=np.float64).reshape(-1, 3)
        if not np.isfinite(self.points).all():
            raise InvalidValue('points', self.points, 'finite coordinates [m]')
        self.zones, self.clearance = tuple(zones), clearance
        limits = check_limits(altitude_min, altitude_max)
        same = _previous is not None and _previous.zones == self.zones
        self._obstacles: Obstacles = (_previous._obstacles if _previous and same
                                      else pack(self.zones, clearance))
        self._store: PathStore = _previous._store if _previous else PathStore()
        self.budget = budget or SearchBudget()
        self._scene = make_scene(self.points, self._obstacles.rows, limits, self.budget,
                                 self._store)
        dense = bool(self.zones) and len(self.points) <= DENSE_MAX
        self._table = _table or LengthTable(len(self.points) if dense else 0)
        self.pairs = self._pairs(dense)

    def _pairs(self, dense: bool) -> Pairs:
        slot = self._table.slots(self.points) if dense else np.zeros(0, np.int64)
        cells = self._table.cells
        cached = CACHE_SIZE if self.zones and not dense else 0
        keys, lengths = np.full(cached, -1, np.int64), np.empty(cached)
        scene = scene_addresses(self._scene)
        pairs = Pairs(len(self.points), len(self.zones), self.points.ctypes.data,
                      len(cells) if dense else 0, slot.ctypes.data, cells.ctypes.data,
                      keys.ctypes.data, lengths.ctypes.data, scene.ctypes.data,
                      find_address(bool(self.zones)), join_address(bool(self.zones)))
        pairs.owner = (self._obstacles, self._scene, self._store, self.budget, slot, cells, keys,
                       lengths, scene)
        return pairs

    def updated(self, points: ArrayLike | None = None,
                zones: Sequence[ThreatZone] | None = None,
                budget: SearchBudget | None = None) -> Distances:
        """Distances for other points, in any order, or for zones that changed.

        Args:
            points: (n, 3), ENU [m]; None: the same.
            zones: None: the same.
            budget: None: no limit.

        Returns:
            New distances; those that are still valid are taken over.

        Raises:
            InvalidValue: as the constructor.
        """
        new_points = self.points if points is None else np.asarray(points, dtype=np.float64)
        new_zones = self.zones if zones is None else tuple(zones)
        low, high = self._scene.limits
        table = None
        if self.zones and new_zones and len(new_points) <= DENSE_MAX >= len(self.points):
            table = self._table if new_zones == self.zones else self._still_valid(new_zones)
        return Distances(new_points, new_zones, clearance=self.clearance, altitude_min=low,
                         altitude_max=high, budget=budget, _previous=self, _table=table)

    def _still_valid(self, zones: tuple[ThreatZone, ...]) -> LengthTable | None:
        """The table without what other zones change; None: that takes too long."""
        before, after = set(self.zones), set(zones)
        removed, added = before - after, after - before
        if (len(removed) + len(added)) * self._table.used ** 2 > MAX_CHECKS:
            return None
        table = self._table.copy()
        left, new = pack(tuple(removed), self.clearance), pack(tuple(added), self.clearance)
        invalidate(table.cells, table.places, table.used, left.rows, new.rows)
        return table

    def ensure(self, origins: ArrayLike, goals: ArrayLike) -> None:
        """Search for the lengths of pairs now; all others are searched for when first needed.

        Args:
            origins: (n,) indices of points.
            goals: (n,) indices of points.
        """
        _ensure(self.pairs, np.asarray(origins, dtype=np.int64).ravel(),
                np.asarray(goals, dtype=np.int64).ravel())

    def offer_path(self, i: int, j: int, via: Sequence[Point]) -> bool:
        """Take a path from i to j, or its remainder from one of its points on, if that is clear.

        For pairs whose path was not found within the budget.

        Args:
            i, j: indices of points.
            via: [m] ENU, without both ends.

        Returns:
            Whether it was taken.
        """
        scene = self._scene
        if INSIDE in (scene.location[i], scene.location[j]):
            return False
        path = np.empty((MAX_CORNERS, 3))
        for first in range(len(via) + 1 if len(via) < MAX_CORNERS - 1 else 0):
            rest = [self._point(i), *via[first:], self._point(j)]
            path[:len(rest)] = rest
            if _take_path(self.pairs, i, j, path, len(rest)):
                return True
        return False

    def length(self, i: int, j: int) -> float:
        """Length [m] of the path from i to j; inf where there is none."""
        return float(length(self.pairs, i, j))

    def leg(self, i: int, j: int) -> Leg:
        """The path from i to j with its detour points.

        A path whose length is known is loaded, or searched for again without a limit; any other is
        searched for within the budget.

        Returns:
            Of infinite length where there is none.
        """
        scene = self._scene
        if i == j:
            return Leg((), 0.0)
        if scene.location[j] == INSIDE:
            return Leg((), math.inf)
        known = _known_length(self.pairs, i, j)
        if known >= 0.0:
            path = np.empty((MAX_CORNERS, 3))
            n = stored_path(scene, i, j, path)
            points = as_points(path[:n])
            if n and abs(polyline_length(points) - known) < 1e-6:
                return Leg(points[1:-1], known)
        metres, points = path_between(
            self._obstacles, self._point(i), self._point(j), scene.limits,
            None if known >= 0.0 else self.budget)
        return Leg(points, math.inf if math.isnan(metres) else metres)

    def given_up(self, i: int, j: int) -> bool:
        """Whether the path from i to j was not found in the time; there may be one."""
        return bool(self.zones) and not _known_length(self.pairs, i, j) >= 0.0 and (
            bool(self._scene.location[j] != INSIDE) and i != j)

    def is_inside(self, i: int) -> bool:
        """Whether point i is inside an enlarged zone."""
        return bool(self._scene.location[i] == INSIDE)

    def zones_around(self, i: int) -> tuple[str, ...]:
        """Ids of the enlarged zones that point i is inside of."""
        if not self.zones:  # the kernel is not loaded
            return ()
        return tuple(self.zones[k].id
                     for k in containing_zones(self._obstacles.rows, *self._point(i)))

    def _point(self, i: int) -> Point:
        x, y, z = self.points[i]
        return float(x), float(y), float(z)
