# SPDX-License-Identifier: Apache-2.0
"""Lengths and legs of safe paths between numbered points; new points and zones keep what is valid.

Kernels read and search lengths through `Distances.pairs`. A path not found within the budget
counts as none until a greater budget is allowed.
"""
from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.geometry.detour import as_points, check_limits, path_between
from uav_task_alloc.geometry.obstacles import Floats, Obstacles, containing_zones, pack
from uav_task_alloc.geometry.pairs import (
    CACHE_SIZE,
    Pairs,
    ensure_lengths,
    known_length,
    length,
    read_known_lengths,
    take_path,
)
from uav_task_alloc.geometry.path_store import PathStore
from uav_task_alloc.geometry.polyline import polyline_length
from uav_task_alloc.geometry.scene import (
    INSIDE,
    find_address,
    join_address,
    make_scene,
    scene_addresses,
    stored_path,
)
from uav_task_alloc.geometry.search_budget import SearchBudget
from uav_task_alloc.geometry.table import LengthTable, invalidate
from uav_task_alloc.geometry.taut import MAX_CORNERS
from uav_task_alloc.model import Leg, Point, ThreatZone

DENSE_MAX = 2048  # points; the table takes 8 n^2 bytes
MAX_CHECKS = 20_000_000  # of pairs against changed zones; beyond, the table starts empty


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
        ensure_lengths(self.pairs, np.asarray(origins, dtype=np.int64).ravel(),
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
            rest = [self.point(i), *via[first:], self.point(j)]
            path[:len(rest)] = rest
            if take_path(self.pairs, i, j, path, len(rest)):
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
        known = known_length(self.pairs, i, j)
        stored = self.stored_leg(i, j)
        if stored is not None:
            return stored
        metres, points = path_between(
            self._obstacles, self.point(i), self.point(j), scene.limits,
            None if known >= 0.0 else self.budget)
        return Leg(points, math.inf if math.isnan(metres) else metres)

    def stored_leg(self, i: int, j: int) -> Leg | None:
        """The path from i to j, where its length is known; never searches.

        Returns:
            None where it is not stored, or not any more.
        """
        known = known_length(self.pairs, i, j)
        if not known >= 0.0:
            return None
        path = np.empty((MAX_CORNERS, 3))
        n = stored_path(self._scene, i, j, path)
        points = as_points(path[:n])
        is_it = n and abs(polyline_length(points) - known) < 1e-6
        return Leg(points[1:-1], known) if is_it else None

    def given_up(self, i: int, j: int) -> bool:
        """Whether the path from i to j was not found in the time; there may be one."""
        return bool(self.zones) and not known_length(self.pairs, i, j) >= 0.0 and (
            bool(self._scene.location[j] != INSIDE) and i != j)

    def known_lengths(self, origins: ArrayLike, goals: ArrayLike) -> Floats:
        """Lengths of paths without a search for them.

        Args:
            origins: (n,) indices of points.
            goals: (n,) indices of points.

        Returns:
            float64 (n,) [m]; inf: there is no path, NaN: it was not searched for yet, or not found
            in the time.
        """
        start, end = (np.asarray(each, dtype=np.int64).ravel() for each in (origins, goals))
        known = np.empty(start.size)
        read_known_lengths(self.pairs, start, end, known)
        known[known < 0.0] = math.nan
        known[np.isnan(known) & (self._scene.location[end] == INSIDE)] = math.inf
        known[start == end] = 0.0
        return known

    def is_inside(self, i: int) -> bool:
        """Whether point i is inside an enlarged zone."""
        return bool(self._scene.location[i] == INSIDE)

    def zones_around(self, i: int) -> tuple[str, ...]:
        """Ids of the enlarged zones that point i is inside of."""
        if not self.zones:  # the kernel is not loaded
            return ()
        return tuple(self.zones[k].id
                     for k in containing_zones(self._obstacles.rows, *self.point(i)))

    def point(self, i: int) -> Point:
        """Return point i [m]."""
        x, y, z = self.points[i]
        return float(x), float(y), float(z)
