# SPDX-License-Identifier: Apache-2.0
"""The joint choice of waiting places: the fleet as arrays, and what is chosen as places.

Importing this module loads the compiled kernels.
"""
from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from uav_task_alloc.allocator.list_records import UavList
from uav_task_alloc.allocator.replan_records import FleetOutlook
from uav_task_alloc.allocator.replanning.demand_area import LearntDemand
from uav_task_alloc.allocator.state.safe_paths import SafePaths
from uav_task_alloc.allocator.state.seen_tasks import SeenTasks
from uav_task_alloc.anticipation.intensity import Cells
from uav_task_alloc.anticipation.places import ROUNDS, Waiting, choose_places, move_prices
from uav_task_alloc.model import Point
from uav_task_alloc.params import AllocatorParams

_MOST_IDLE = 12  # UAVs that may move in one choice: a callback ends
_NEAR = 1.0  # [m] the same place


class WaitingChoice:
    """Chooses places by the demand learnt so far."""

    def __init__(self) -> None:
        self.demand = LearntDemand()
        self._turn = 0  # of the idle UAVs, where there are many
        self._free: tuple[object, NDArray[np.float64]] | None = None  # cells outside zones

    def places(self, learnt: bool, idle: Mapping[str, tuple[float, float, float]],
               others: Sequence[tuple[float, Point, float]],
               present: Mapping[str, tuple[Point, Point]], paths: SafePaths,
               stamp: float) -> dict[str, Point]:
        """Return the places [m] ENU of the UAVs that are to move.

        Args:
            learnt: by what was announced, else evenly.
            idle: height [m], way that the battery allows [m] and speed [m/s], by id.
            others: when [s] each other UAV is free, where, and its speed [m/s].
            present: position, and present place [m] ENU of the idle UAVs, by id.
            paths: around the zones.
            stamp: [s] published clock.

        Returns:
            By id; empty while no area is known.
        """
        demand = self.demand.demand
        if demand is None or not idle:
            return {}
        ids = list(idle)
        movable = {ids[(self._turn + k) % len(ids)] for k in range(min(_MOST_IDLE, len(ids)))}
        self._turn = (self._turn + _MOST_IDLE) % len(ids) if len(ids) > _MOST_IDLE else 0
        waiting = _arrays(idle, movable, others, present)
        before = waiting.place.copy()
        height = float(np.median([each[0] for each in idle.values()]))
        cells = self._outside_zones(demand.cells, paths, height)
        choose_places(cells, self.demand.distance, self.demand.weight(learnt, stamp), waiting,
                      move_prices(len(idle) + len(others)), ROUNDS, np.zeros((4, cells.x.size)))
        moved = np.hypot(*(waiting.place - before).T) > _NEAR
        return {uav_id: (float(waiting.place[k, 0]), float(waiting.place[k, 1]), idle[uav_id][0])
                for k, uav_id in enumerate(ids) if moved[k]}

    def outlook(self, seen: SeenTasks, params: AllocatorParams, lists: Iterable[UavList],
                stamp: float) -> FleetOutlook | None:
        """Return where the next task is expected, for plans.

        Args:
            seen: announcements.
            params: with `anticipate`, and the area where it is given.
            lists: in force.
            stamp: [s] published clock.

        Returns:
            At the middles of 2 x 2 cells; None while no area is known.
        """
        self.demand.follow(seen, params)
        demand = self.demand.demand
        if demand is None:
            return None
        pairs = demand.cells.across // 2
        x, y, weight = (each.reshape(pairs, 2, pairs, 2) for each in (
            demand.cells.x, demand.cells.y,
            self.demand.weight(params.anticipate == 'learnt', stamp)))
        return FleetOutlook(
            x.mean((1, 3)).ravel(), y.mean((1, 3)).ravel(), weight.sum((1, 3)).ravel(),
            demand.mean_value or 1.0, {each.uav: place for each in lists
                                       if (place := each.waiting_place) is not None})

    def _outside_zones(self, cells: Cells, paths: SafePaths, height: float) -> Cells:
        """The cells, without those whose centres are inside a zone."""
        key = paths, round(height), self.demand.area
        if self._free is None or self._free[0] != key:
            free = np.array([0.0 if paths.around((float(x), float(y), height), wide=True) else 1.0
                             for x, y in zip(cells.x, cells.y, strict=True)])
            self._free = key, free
        return cells._replace(inside=cells.inside * self._free[1])


def _arrays(idle: Mapping[str, tuple[float, float, float]], movable: set[str],
            others: Sequence[tuple[float, Point, float]],
            present: Mapping[str, tuple[Point, Point]]) -> Waiting:
    """The fleet as arrays, idle UAVs first; one that may not move now is free at its place."""
    rows, places = [], []
    for uav_id, (_, reach, speed) in idle.items():
        position, place = present[uav_id]
        x, y = (position if uav_id in movable else place)[:2]
        rows.append((float(uav_id in movable), 0.0, x, y, speed, reach))
        places.append(place[:2])
    for free_in, (x, y, _), speed in others:
        rows.append((0.0, free_in, x, y, speed, 0.0))
        places.append((x, y))
    columns = np.ascontiguousarray(np.array(rows, float).T)
    return Waiting(columns[0], columns[1], columns[2], columns[3], columns[4], columns[5],
                   np.array(places, float), np.zeros(len(rows), np.int64), np.zeros(len(rows)))
