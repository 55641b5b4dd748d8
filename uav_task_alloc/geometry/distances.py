# SPDX-License-Identifier: Apache-2.0
"""Lengths of the safe ways between numbered points, for kernels: known, or found when asked for.

`length(pairs, i, j)` may be called in any kernel, also without the GIL. Up to DENSE_MAX points the
lengths fill a square table (NaN: not asked for yet); beyond, there is a cache of the last answers.
"""
from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import ArrayLike

from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.geometry.detour import check_limits, way_between
from uav_task_alloc.geometry.memory import float_of, floats_at, ints_at
from uav_task_alloc.geometry.obstacles import Ints, Obstacles, contains, pack
from uav_task_alloc.geometry.scene import CAUGHT, INSIDE, addresses, finder, make_scene
from uav_task_alloc.geometry.table import Table, forget
from uav_task_alloc.model import Leg, Point, ThreatZone

DENSE_MAX = 2048  # points; the table takes 8 n^2 bytes
CACHE_SIZE = 1 << 20  # answers kept beyond that; a power of two


class _Addresses(NamedTuple):
    """Sizes and addresses; see geometry/memory.py for why."""

    points: int
    zones: int
    xyz: int  # float64 (points, 3) [m]
    row: int  # length of a row of the table; 0: no table
    slot: int  # int64: row and column of each point in the table
    table: int  # float64 [m], NaN: unknown
    keys: int  # int64: i * points + j of each answer in the cache
    answers: int  # float64 [m]
    scene: int  # what `find` reads
    find: int  # C function (scene, i, j) -> length [m]; 0 where there are no zones


class Pairs(_Addresses):
    """What `length` needs inside a kernel; made by Distances, opaque to everybody else."""

    owner: object  # keeps alive what the addresses point to

    def __reduce__(self) -> str:
        raise TypeError('Pairs hold addresses of this process: make Distances anew elsewhere')


@numba.njit(cache=True, nogil=True)
def length(pairs: Pairs, i: int, j: int) -> float:
    """Length [m] of the shortest safe way from point i to point j; inf: there is none."""
    if pairs.row > 0:
        slot = ints_at(pairs.slot)
        known = floats_at(pairs.table)[slot[i] * pairs.row + slot[j]]
        return known if known == known else _find_for_table(pairs, i, j)
    if pairs.zones > 0:
        return _find_for_cache(pairs, i, j)
    xyz = floats_at(pairs.xyz)
    dx, dy, dz = xyz[3 * i] - xyz[3 * j], xyz[3 * i + 1] - xyz[3 * j + 1], xyz[
        3 * i + 2] - xyz[3 * j + 2]
    return math.sqrt(dx * dx + dy * dy + dz * dz)


@numba.njit(cache=True, nogil=True)
def _find_for_table(pairs: Pairs, i: int, j: int) -> float:
    slot, table = ints_at(pairs.slot), floats_at(pairs.table)
    found = float_of(pairs.find, pairs.scene, i, j)
    table[slot[i] * pairs.row + slot[j]] = found
    caught = ints_at(ints_at(pairs.scene)[CAUGHT])
    if caught[i] != INSIDE and caught[j] != INSIDE:
        table[slot[j] * pairs.row + slot[i]] = found
    return float(found)


@numba.njit(cache=True, nogil=True)
def _find_for_cache(pairs: Pairs, i: int, j: int) -> float:
    keys, answers = ints_at(pairs.keys), floats_at(pairs.answers)
    caught = ints_at(ints_at(pairs.scene)[CAUGHT])
    if j < i and caught[i] != INSIDE and caught[j] != INSIDE:
        i, j = j, i
    key = i * pairs.points + j
    place = (key * 0x9E3779B1 >> 8) & (CACHE_SIZE - 1)
    if keys[place] != key:
        answers[place] = float_of(pairs.find, pairs.scene, i, j)
        keys[place] = key
    return float(answers[place])


@numba.njit(cache=True, nogil=True)
def _ensure(pairs: Pairs, origins: Ints, goals: Ints) -> None:
    for m in range(origins.size):
        length(pairs, origins[m], goals[m])


class Distances:
    """Detour lengths between points 0..n-1; asymmetric only where a point lies inside a zone.

    Immutable to its user: `updated` gives another one, which takes over all that still holds.
    """

    def __init__(self, points: ArrayLike, zones: Sequence[ThreatZone] = (), *,
                 clearance: float = 0.0, altitude_min: float = -np.inf,
                 altitude_max: float = np.inf, _table: Table | None = None,
                 _obstacles: Obstacles | None = None) -> None:
        self.points = np.ascontiguousarray(points, dtype=np.float64).reshape(-1, 3)
        if not np.isfinite(self.points).all():
            raise InvalidValue('points', self.points, 'finite coordinates [m]')
        self.zones, self.clearance = tuple(zones), clearance
        self._obstacles = _obstacles or pack(self.zones, clearance)
        limits = check_limits(altitude_min, altitude_max)
        self._scene = make_scene(self.points, self._obstacles.rows, limits)
        dense = bool(self.zones) and len(self.points) <= DENSE_MAX
        self._table = _table or Table(len(self.points) if dense else 0)
        self.pairs = self._pairs(dense)

    def _pairs(self, dense: bool) -> Pairs:
        slot = self._table.slots(self.points) if dense else np.zeros(0, np.int64)
        cells = self._table.cells
        cached = CACHE_SIZE if self.zones and not dense else 0
        keys, answers = np.full(cached, -1, np.int64), np.empty(cached)
        scene = addresses(self._scene)
        pairs = Pairs(len(self.points), len(self.zones), self.points.ctypes.data,
                      len(cells) if dense else 0, slot.ctypes.data, cells.ctypes.data,
                      keys.ctypes.data, answers.ctypes.data, scene.ctypes.data,
                      finder(bool(self.zones)))
        pairs.owner = self._obstacles, self._scene, slot, cells, keys, answers, scene
        return pairs

    def updated(self, points: ArrayLike | None = None,
                zones: Sequence[ThreatZone] | None = None) -> Distances:
        """For other points, in any order, or zones that came, moved or vanished."""
        new_points = self.points if points is None else np.asarray(points, dtype=np.float64)
        new_zones = self.zones if zones is None else tuple(zones)
        low, high = self._scene.limits
        table = None
        if self.zones and new_zones and len(new_points) <= DENSE_MAX >= len(self.points):
            table = self._table
            if new_zones != self.zones:
                table = table.copy()
                self._forget(table, new_zones)
        return Distances(new_points, new_zones, clearance=self.clearance, altitude_min=low,
                         altitude_max=high, _table=table,
                         _obstacles=self._obstacles if new_zones == self.zones else None)

    def _forget(self, table: Table, zones: tuple[ThreatZone, ...]) -> None:
        gone = pack([z for z in self.zones if z not in zones], self.clearance)
        come = pack([z for z in zones if z not in self.zones], self.clearance)
        forget(table.cells, table.places, table.used, gone.rows, come.rows)

    def ensure(self, origins: ArrayLike, goals: ArrayLike) -> None:
        """Find the lengths of these pairs now; all others are found when asked for."""
        _ensure(self.pairs, np.asarray(origins, dtype=np.int64).ravel(),
                np.asarray(goals, dtype=np.int64).ravel())

    def length(self, i: int, j: int) -> float:
        """Length [m] of the way from i to j; inf where there is none."""
        return float(length(self.pairs, i, j))

    def leg(self, i: int, j: int) -> Leg:
        """The way from i to j with its detour points."""
        scene = self._scene
        if i == j:
            return Leg((), 0.0)
        if scene.caught[j] == INSIDE:
            return Leg((), math.inf)
        metres, points = way_between(self._obstacles, self._point(i), self._point(j),
                                     scene.limits, bool(scene.caught[i] == INSIDE))
        return Leg(points, metres)

    def zones_around(self, i: int) -> tuple[str, ...]:
        """Ids of the enlarged zones that point i is inside of."""
        x, y, z = self._point(i)
        return tuple(zone.id for zone, row in zip(self.zones, self._obstacles.rows, strict=True)
                     if contains(row, x, y, z, True))

    def _point(self, i: int) -> Point:
        x, y, z = self.points[i]
        return float(x), float(y), float(z)
