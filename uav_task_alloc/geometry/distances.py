# SPDX-License-Identifier: Apache-2.0
"""Lengths of the safe ways between numbered points, as kernels want them: known, or found on demand.

`length(pairs, i, j)` may be called in any kernel, also without the GIL. Up to DENSE_MAX places the
lengths fill a square table (NaN: not asked for yet); beyond, a cache of the last answers.
"""
from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numba
import numpy as np
from numpy.typing import ArrayLike, NDArray

from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.geometry.detour import check_limits, way_between
from uav_task_alloc.geometry.exits import way_out
from uav_task_alloc.geometry.obstacles import Floats, Ints, Obstacles, contains, first_around, pack
from uav_task_alloc.geometry.table import Table, forget
from uav_task_alloc.geometry.taut import MAX_CORNERS
from uav_task_alloc.geometry.ways import shortest
from uav_task_alloc.model import Leg, Point, ThreatZone

DENSE_MAX = 2048  # places; the table takes 8 n^2 bytes
CACHE_SIZE = 1 << 20  # answers kept beyond that


class Scene(NamedTuple):
    """Points among zones, as the kernel that finds one way takes them."""

    xyz: Floats  # (n, 3) [m]
    caught: NDArray[np.bool_]  # inside a zone
    out: Floats  # (n, 3) [m], where a caught point is outside first; NaN: nowhere
    obstacles: Obstacles
    limits: Floats  # altitude_min, altitude_max [m]


class Pairs(NamedTuple):
    """What `length` needs inside a kernel; made by Distances, opaque to everybody else."""

    scene: Scene
    slot: Ints  # row and column of each point in the table
    table: Floats  # [m], NaN: unknown; empty: no zones, or too many points
    keys: Ints  # i * n + j of each cached answer
    answers: Floats  # [m]
    find: Any  # (scene, i, j) -> length [m], compiled apart so that callers compile fast


@numba.njit(cache=True, nogil=True)
def _straight(scene: Scene, i: int, j: int) -> float:
    dx = scene.xyz[i, 0] - scene.xyz[j, 0]
    dy = scene.xyz[i, 1] - scene.xyz[j, 1]
    dz = scene.xyz[i, 2] - scene.xyz[j, 2]
    return math.sqrt(dx * dx + dy * dy + dz * dz)


@numba.njit(cache=True, nogil=True)
def length(pairs: Pairs, i: int, j: int) -> float:
    """Length [m] of the shortest safe way from point i to point j; inf: there is none."""
    if pairs.table.shape[0] > 0:
        known = pairs.table[pairs.slot[i], pairs.slot[j]]
        return known if known == known else _look_up(pairs, i, j)
    if pairs.scene.obstacles.kind.size == 0:
        return _straight(pairs.scene, i, j)
    key = i * pairs.slot.size + j
    place = (key * 0x9E3779B1 >> 8) & (pairs.keys.size - 1)
    if pairs.keys[place] != key:
        pairs.answers[place], pairs.keys[place] = pairs.find(pairs.scene, i, j), key
    return float(pairs.answers[place])


@numba.njit(cache=True, nogil=True)
def _look_up(pairs: Pairs, i: int, j: int) -> float:
    found = pairs.find(pairs.scene, i, j)
    pairs.table[pairs.slot[i], pairs.slot[j]] = found
    if not pairs.scene.caught[i] and not pairs.scene.caught[j]:
        pairs.table[pairs.slot[j], pairs.slot[i]] = found
    return float(found)


@numba.njit(cache=True, nogil=True)
def _ensure(pairs: Pairs, origins: Ints, goals: Ints) -> None:
    for m in range(origins.size):
        length(pairs, origins[m], goals[m])


def _find(scene: Scene, i: int, j: int) -> float:
    """Length [m] of the way from i to j, looked for anew."""
    if i == j:
        return 0.0
    if scene.caught[j]:
        return np.inf
    ends, first = np.empty((2, 3)), 0.0
    p, q = scene.xyz[i], scene.xyz[j]
    if scene.caught[i]:
        p = scene.out[i]
        if math.isnan(p[0]):
            return np.inf
        first = math.sqrt(((p - scene.xyz[i]) ** 2).sum())
    backwards = p[0] > q[0] or p[0] == q[0] and (p[1] > q[1] or p[1] == q[1] and p[2] > q[2])
    ends[0], ends[1] = (q, p) if backwards else (p, q)
    return first + shortest(scene.obstacles, ends, scene.limits, np.empty((MAX_CORNERS, 3)))[1]


@functools.cache
def _finder(zones: bool) -> Any:
    """`_find` as a function pointer of fixed type; without zones a cheap stand-in."""
    scene = numba.typeof(_scene(np.zeros((0, 3)), pack(()), check_limits(0.0, 0.0)))
    signature = numba.float64(scene, numba.int64, numba.int64)
    return numba.cfunc(signature, cache=True)(_find if zones else _straight.py_func)


@numba.njit(cache=True, nogil=True)
def _catch(o: Obstacles, xyz: Floats, limits: Floats, caught: NDArray[np.bool_],
           out: Floats) -> None:
    for i in range(xyz.shape[0]):
        if first_around(o, xyz[i, 0], xyz[i, 1], xyz[i, 2], True) >= 0:
            caught[i], out[i] = True, way_out(o, xyz[i], limits)


def _scene(xyz: Floats, obstacles: Obstacles, limits: Floats) -> Scene:
    caught, out = np.zeros(len(xyz), np.bool_), np.full((len(xyz), 3), np.nan)
    if obstacles.kind.size:
        _catch(obstacles, xyz, limits, caught, out)
    return Scene(xyz, caught, out, obstacles, limits)


class Distances:
    """Detour lengths between points 0..n-1; asymmetric only where a point lies inside a zone.

    Immutable to its user: `updated` gives another one and takes over every length that still holds.
    """

    def __init__(self, points: ArrayLike, zones: Sequence[ThreatZone] = (), *,
                 clearance: float = 0.0, altitude_min: float = -np.inf,
                 altitude_max: float = np.inf, _table: Table | None = None) -> None:
        self.points = np.ascontiguousarray(points, dtype=np.float64).reshape(-1, 3)
        if not np.isfinite(self.points).all():
            raise InvalidValue('points', self.points, 'finite coordinates [m]')
        self.zones, self.clearance = tuple(zones), clearance
        limits = check_limits(altitude_min, altitude_max)
        scene = _scene(self.points, pack(self.zones, clearance), limits)
        dense = bool(zones) and len(self.points) <= DENSE_MAX
        cached = CACHE_SIZE if zones and not dense else 0
        self._table = _table or Table(len(self.points) if dense else 0)
        slot = self._table.slots(self.points) if dense else np.arange(len(self.points))
        self.pairs = Pairs(scene, slot, self._table.cells, np.full(cached, -1, np.int64),
                           np.empty(cached), _finder(bool(zones)))

    def updated(self, points: ArrayLike | None = None,
                zones: Sequence[ThreatZone] | None = None) -> Distances:
        """For other points, in any order, or zones that came, moved or vanished."""
        new_points = self.points if points is None else np.asarray(points, dtype=np.float64)
        new_zones = self.zones if zones is None else tuple(zones)
        low, high = self.pairs.scene.limits
        table = None
        if self.zones and new_zones and len(new_points) <= DENSE_MAX >= len(self.points):
            table = self._table
            if new_zones != self.zones:
                table = table.copy()
                self._forget(table, new_zones)
        return Distances(new_points, new_zones, clearance=self.clearance, altitude_min=low,
                         altitude_max=high, _table=table)

    def _forget(self, table: Table, zones: tuple[ThreatZone, ...]) -> None:
        gone = pack([z for z in self.zones if z not in zones], self.clearance)
        come = pack([z for z in zones if z not in self.zones], self.clearance)
        forget(table.cells, table.places, table.used, gone, come)

    def ensure(self, origins: ArrayLike, goals: ArrayLike) -> None:
        """Find the lengths of these pairs now; all others are found when asked for."""
        _ensure(self.pairs, np.asarray(origins, dtype=np.int64).ravel(),
                np.asarray(goals, dtype=np.int64).ravel())

    def length(self, i: int, j: int) -> float:
        """Length [m] of the way from i to j; inf where there is none."""
        return float(length(self.pairs, i, j))

    def leg(self, i: int, j: int) -> Leg:
        """The way from i to j with its detour points."""
        scene = self.pairs.scene
        if i == j:
            return Leg((), 0.0)
        if scene.caught[j]:
            return Leg((), math.inf)
        metres, points = way_between(scene.obstacles, self._point(i), self._point(j),
                                     scene.limits, bool(scene.caught[i]))
        return Leg(points, metres)

    def zones_around(self, i: int) -> tuple[str, ...]:
        """Ids of the enlarged zones that point i is inside of."""
        return tuple(zone.id for k, zone in enumerate(self.zones)
                     if contains(self.pairs.scene.obstacles, k, *self.points[i], True))

    def _point(self, i: int) -> Point:
        x, y, z = self.points[i]
        return float(x), float(y), float(z)
