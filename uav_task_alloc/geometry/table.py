# SPDX-License-Identifier: Apache-2.0
"""A square table of lengths between points, which grows, and which zone changes invalidate."""
from __future__ import annotations

import math

import numpy as np

from uav_task_alloc.geometry.obstacles import (
    Floats,
    Ints,
    Zone,
    Zones,
    blocked,
    box_distance,
    contains,
)
from uav_task_alloc.kernel import allocating_kernel, inner_allocating_kernel

SPARE = 64  # rows for points to come
_STRAIGHT = 1.0 + 1e-12  # a path is straight if its length is at most this times the distance


class LengthTable:
    """Lengths [m] by slot; a point keeps its slot, so that older users of the table stay valid.

    Args:
        places: number of points that it has to hold at first.

    Attributes:
        cells: float64 (size, size). NaN: not known yet; -w - 1: not found with w units of work.
        places: float64 (size, 3), the point of each slot [m].
        used: number of slots in use.
    """

    def __init__(self, places: int) -> None:
        size = places + places // 4 + SPARE if places else 0
        self.cells = np.full((size, size), np.nan)
        self.places = np.zeros((size, 3))
        self.used = 0
        self._slots: dict[tuple[float, float, float], int] = {}

    def slots(self, points: Floats) -> Ints:
        """The slots of points; new points get new ones, in a larger table if need be.

        Args:
            points: (n, 3) [m].

        Returns:
            int64 (n,).
        """
        keys = list(map(tuple, points.tolist()))
        fresh = [key for key in dict.fromkeys(keys) if key not in self._slots]
        if self.used + len(fresh) > len(self.cells):
            self._rebuild(keys)
            fresh = [key for key in dict.fromkeys(keys) if key not in self._slots]
        for key in fresh:
            self.places[self.used], self._slots[key] = key, self.used
            self.used += 1
        return np.array([self._slots[key] for key in keys], np.int64)

    def copy(self) -> LengthTable:
        """The same lengths in cells of its own."""
        other = LengthTable(0)
        other.cells, other.places = self.cells.copy(), self.places.copy()
        other.used, other._slots = self.used, dict(self._slots)
        return other

    def _rebuild(self, wanted: list[tuple[float, ...]]) -> None:
        """A new table with the known points among the wanted; the old cells are left."""
        keep = [key for key in dict.fromkeys(wanted) if key in self._slots]
        old = np.array([self._slots[key] for key in keep], np.int64)
        other = LengthTable(len(dict.fromkeys(wanted)))
        other.cells[:len(old), :len(old)] = self.cells[np.ix_(old, old)]
        other.places[:len(old)], other.used = self.places[old], len(old)
        self.cells, self.places, self.used = other.cells, other.places, other.used
        self._slots = {key: s for s, key in enumerate(keep)}


@inner_allocating_kernel
def _touches(zone: Zone, p: Floats, q: Floats, known: float, near_p: float,
             near_q: float, added: bool) -> bool:
    """Whether a zone that was added or removed may change the known length of a path p q."""
    if math.isinf(known) or known < 0.0:
        return not added
    if near_p + near_q > known:
        return False
    dx, dy, dz = p[0] - q[0], p[1] - q[1], p[2] - q[2]
    if known > _STRAIGHT * math.sqrt(dx * dx + dy * dy + dz * dz):
        return True
    return added and blocked(zone, p[0], p[1], p[2], q[0], q[1], q[2], min(p[2], q[2]), False)


@inner_allocating_kernel
def _invalidate_for(cells: Floats, places: Floats, used: int, zone: Zone,
                    added: bool) -> None:
    """As `invalidate`, for one zone; O(used^2)."""
    near, inside = np.empty(used), np.zeros(used, np.bool_)
    for i in range(used):
        near[i] = box_distance(zone, places[i, 0], places[i, 1], places[i, 2])
        inside[i] = contains(zone, places[i, 0], places[i, 1], places[i, 2], True)
    for i in range(used):
        for j in range(used):
            known = cells[i, j]
            if known == known and (inside[i] or inside[j] or _touches(
                    zone, places[i], places[j], known, near[i], near[j], added)):
                cells[i, j] = np.nan


@allocating_kernel
def invalidate(cells: Floats, places: Floats, used: int, removed: Zones, added: Zones) -> None:
    """Forget every length that the removal or addition of zones may change; O(zones used^2).

    Args:
        cells: of a LengthTable; set to NaN.
        places: of the LengthTable.
        used: of the LengthTable.
        removed: rows of zones that are no longer there.
        added: rows of zones that are new.
    """
    for k in range(removed.size):
        _invalidate_for(cells, places, used, removed[k], False)
    for k in range(added.size):
        _invalidate_for(cells, places, used, added[k], True)
