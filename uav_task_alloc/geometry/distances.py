# SPDX-License-Identifier: Apache-2.0
"""Lengths of the safe ways between numbered points, for kernels: known, or found when asked for.

`length(pairs, i, j)` may be called in any kernel, also without the GIL. Up to DENSE_MAX points the
lengths fill a square table (NaN: not asked for yet); beyond, there is a cache of the last answers.
A way not found with the effort allowed counts as none until more is allowed.
"""
from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.geometry.detour import as_points, check_limits, way_between
from uav_task_alloc.geometry.numba_pointers import float_of, floats_at, ints_at
from uav_task_alloc.geometry.obstacles import Ints, Obstacles, all_around, pack
from uav_task_alloc.geometry.path_store import PathStore, remember
from uav_task_alloc.geometry.scene import (
    CAUGHT,
    EFFORT,
    INSIDE,
    SNUG,
    addresses,
    finder,
    joiner,
    kept_as,
    kept_way,
    make_scene,
)
from uav_task_alloc.geometry.search_budget import CUT, MOST, OVER, SearchBudget
from uav_task_alloc.geometry.shortest_path import is_clear
from uav_task_alloc.geometry.table import LengthTable, forget
from uav_task_alloc.geometry.taut import MAX_CORNERS, length_of
from uav_task_alloc.kernel import allocating_kernel
from uav_task_alloc.model import Leg, Point, ThreatZone

DENSE_MAX = 2048  # points; the table takes 8 n^2 bytes
CACHE_SIZE = 1 << 20  # answers kept beyond that; a power of two
MOST_LOOKS = 20_000_000  # at pairs and changed zones; beyond, the table begins anew


class _Addresses(NamedTuple):
    """Sizes and addresses; see geometry/numba_pointers.py for why."""

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
    join: int  # C function (scene, i, k << 32 | j) -> length [m]; 0 where there are no zones


class Pairs(_Addresses):
    """What `length` needs inside a kernel; made by Distances, opaque to everybody else."""

    owner: object  # keeps alive what the addresses point to

    def __reduce__(self) -> str:
        raise TypeError('Pairs hold addresses of this process: make Distances anew elsewhere')


@allocating_kernel
def length(pairs: Pairs, i: int, j: int) -> float:
    """Length [m] of the shortest safe way from point i to point j; inf: there is none."""
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


@allocating_kernel
def _sought(pairs: Pairs, i: int, j: int, known: float) -> float:
    """Length [m] found now; -w - 1: not with w units of work, NaN: there was no time at all.

    known: what an earlier search that was cut short left.
    """
    state = ints_at(ints_at(pairs.scene)[EFFORT])
    if state[OVER] != 0:
        return known
    if -known > state[MOST]:
        state[CUT] += 1
        return known
    found = float_of(pairs.find, pairs.scene, i, j)
    if found == found:
        return float(found)
    state[CUT] += 1
    return known if state[OVER] != 0 else -1.0 - state[MOST]


@allocating_kernel
def _find_for_table(pairs: Pairs, i: int, j: int) -> float:
    slot, table = ints_at(pairs.slot), floats_at(pairs.table)
    place = slot[i] * pairs.row + slot[j]
    found = _sought(pairs, i, j, table[place])
    table[place] = found
    caught = ints_at(ints_at(pairs.scene)[CAUGHT])
    if caught[i] != INSIDE and caught[j] != INSIDE:
        table[slot[j] * pairs.row + slot[i]] = found
    return found if found >= 0.0 else np.inf


@allocating_kernel
def _find_for_cache(pairs: Pairs, i: int, j: int) -> float:
    keys, answers = ints_at(pairs.keys), floats_at(pairs.answers)
    caught = ints_at(ints_at(pairs.scene)[CAUGHT])
    if j < i and caught[i] != INSIDE and caught[j] != INSIDE:
        i, j = j, i
    key = i * pairs.points + j
    place = (key * 0x9E3779B1 >> 8) & (CACHE_SIZE - 1)
    if keys[place] == key and answers[place] >= 0.0:
        return float(answers[place])
    found = _sought(pairs, i, j, answers[place] if keys[place] == key else np.nan)
    if found == found:
        keys[place], answers[place] = key, found
    return found if found >= 0.0 else np.inf


@allocating_kernel
def _known(pairs: Pairs, i: int, j: int) -> float:
    """The length [m], if it is known; otherwise NaN or negative."""
    if pairs.row > 0:
        slot = ints_at(pairs.slot)
        return float(floats_at(pairs.table)[slot[i] * pairs.row + slot[j]])
    if pairs.zones == 0:
        return length(pairs, i, j)
    keys, answers = ints_at(pairs.keys), floats_at(pairs.answers)
    for a, b in ((i, j), (j, i)):
        key = a * pairs.points + b
        place = (key * 0x9E3779B1 >> 8) & (CACHE_SIZE - 1)
        if keys[place] == key:
            return float(answers[place])
    return np.nan


@allocating_kernel
def _learn(pairs: Pairs, i: int, j: int, found: float) -> None:
    """The way from i, which need not be back, to j, which is outside all zones."""
    caught = ints_at(ints_at(pairs.scene)[CAUGHT])
    if pairs.row > 0:
        slot, table = ints_at(pairs.slot), floats_at(pairs.table)
        table[slot[i] * pairs.row + slot[j]] = found
        if caught[i] != INSIDE:
            table[slot[j] * pairs.row + slot[i]] = found
    elif pairs.zones > 0:
        key = (i * pairs.points + j if caught[i] == INSIDE
               else min(i, j) * pairs.points + max(i, j))
        place = (key * 0x9E3779B1 >> 8) & (CACHE_SIZE - 1)
        ints_at(pairs.keys)[place], floats_at(pairs.answers)[place] = key, found


@allocating_kernel
def length_over(pairs: Pairs, i: int, k: int, j: int) -> float:
    """Length [m] of the way from i to j: as `length`, or over point k where none is known.

    inf: nor are the ways from i to k and on to j kept.
    """
    found = length(pairs, i, j)
    if found < np.inf or pairs.zones == 0:
        return found
    found = float_of(pairs.join, pairs.scene, i, (k << 32) | j)
    if found < np.inf:
        _learn(pairs, i, j, found)
    return float(found)


@allocating_kernel
def _ensure(pairs: Pairs, origins: Ints, goals: Ints) -> None:
    for m in range(origins.size):
        length(pairs, origins[m], goals[m])


class Distances:
    """Detour lengths between points 0..n-1; asymmetric only where a point lies inside a zone.

    Immutable to its user: `updated` gives another one, which takes over all that still holds.
    """

    def __init__(self, points: ArrayLike, zones: Sequence[ThreatZone] = (), *,
                 clearance: float = 0.0, altitude_min: float = -np.inf,
                 altitude_max: float = np.inf, effort: SearchBudget | None = None,
                 _before: Distances | None = None, _table: LengthTable | None = None) -> None:
        self.points = np.ascontiguousarray(points, dtype=np.float64).reshape(-1, 3)
        if not np.isfinite(self.points).all():
            raise InvalidValue('points', self.points, 'finite coordinates [m]')
        self.zones, self.clearance = tuple(zones), clearance
        limits = check_limits(altitude_min, altitude_max)
        same = _before is not None and _before.zones == self.zones
        self._obstacles: Obstacles = (_before._obstacles if _before and same
                                      else pack(self.zones, clearance))
        self._store: PathStore = _before._store if _before else PathStore()
        self.effort = effort or SearchBudget()
        self._scene = make_scene(self.points, self._obstacles.rows, limits, self.effort,
                                 self._store)
        dense = bool(self.zones) and len(self.points) <= DENSE_MAX
        self._table = _table or LengthTable(len(self.points) if dense else 0)
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
                      finder(bool(self.zones)), joiner(bool(self.zones)))
        pairs.owner = (self._obstacles, self._scene, self._store, self.effort, slot, cells, keys,
                       answers, scene)
        return pairs

    def updated(self, points: ArrayLike | None = None,
                zones: Sequence[ThreatZone] | None = None,
                effort: SearchBudget | None = None) -> Distances:
        """For other points, in any order, or zones that came, moved or vanished."""
        new_points = self.points if points is None else np.asarray(points, dtype=np.float64)
        new_zones = self.zones if zones is None else tuple(zones)
        low, high = self._scene.limits
        table = None
        if self.zones and new_zones and len(new_points) <= DENSE_MAX >= len(self.points):
            table = self._table if new_zones == self.zones else self._still_true(new_zones)
        return Distances(new_points, new_zones, clearance=self.clearance, altitude_min=low,
                         altitude_max=high, effort=effort, _before=self, _table=table)

    def _still_true(self, zones: tuple[ThreatZone, ...]) -> LengthTable | None:
        """The table without what other zones change; None: all would take longer to look at."""
        before, after = set(self.zones), set(zones)
        gone, come = before - after, after - before
        if (len(gone) + len(come)) * self._table.used ** 2 > MOST_LOOKS:
            return None
        table = self._table.copy()
        left, new = pack(tuple(gone), self.clearance), pack(tuple(come), self.clearance)
        forget(table.cells, table.places, table.used, left.rows, new.rows)
        return table

    def ensure(self, origins: ArrayLike, goals: ArrayLike) -> None:
        """Find the lengths of these pairs now; all others are found when asked for."""
        _ensure(self.pairs, np.asarray(origins, dtype=np.int64).ravel(),
                np.asarray(goals, dtype=np.int64).ravel())

    def suggest(self, i: int, j: int, via: Sequence[Point]) -> bool:
        """Take this way from i to j, or the rest of it from one of its points on, if it is clear.

        For one that no way was found for in the time; whether it is taken.
        """
        scene = self._scene
        if INSIDE in (scene.caught[i], scene.caught[j]):
            return False
        snug = bool(scene.caught[i] == SNUG or scene.caught[j] == SNUG)
        ends, way = np.empty((2, 3)), np.empty((MAX_CORNERS, 3))
        turned = kept_as(scene, i, j, ends)
        for first in range(len(via) + 1 if len(via) < MAX_CORNERS - 1 else 0):
            rest = [self._point(i), *via[first:], self._point(j)]
            way[:len(rest)] = rest[::-1] if turned else rest
            if is_clear(scene.zones, way, len(rest), min(ends[0, 2], ends[1, 2]), snug):
                remember(self._store.address, way, len(rest), ends)
                _learn(self.pairs, i, j, length_of(way, len(rest)))
                return True
        return False

    def length(self, i: int, j: int) -> float:
        """Length [m] of the way from i to j; inf where there is none."""
        return float(length(self.pairs, i, j))

    def leg(self, i: int, j: int) -> Leg:
        """The way from i to j with its detour points.

        One whose length is known is looked up, or found again whatever that takes; else none is
        found where no effort is left.
        """
        scene = self._scene
        if i == j:
            return Leg((), 0.0)
        if scene.caught[j] == INSIDE:
            return Leg((), math.inf)
        known = _known(self.pairs, i, j)
        if known >= 0.0:
            way = np.empty((MAX_CORNERS, 3))
            n = kept_way(scene, i, j, way)
            if n and abs(length_of(way, n) - known) < 1e-6:
                return Leg(as_points(way[1:n - 1]), known)
        metres, points = way_between(
            self._obstacles, self._point(i), self._point(j), scene.limits,
            bool(scene.caught[i] == INSIDE), None if known >= 0.0 else self.effort)
        return Leg(points, math.inf if math.isnan(metres) else metres)

    def given_up(self, i: int, j: int) -> bool:
        """Whether the way from i to j was not found in the time; there may be one."""
        return bool(self.zones) and not _known(self.pairs, i, j) >= 0.0 and (
            bool(self._scene.caught[j] != INSIDE) and i != j)

    def is_inside(self, i: int) -> bool:
        """Whether point i is inside an enlarged zone."""
        return bool(self._scene.caught[i] == INSIDE)

    def zones_around(self, i: int) -> tuple[str, ...]:
        """Ids of the enlarged zones that point i is inside of."""
        return tuple(self.zones[k].id
                     for k in all_around(self._obstacles.rows, *self._point(i)))

    def _point(self, i: int) -> Point:
        x, y, z = self.points[i]
        return float(x), float(y), float(z)
