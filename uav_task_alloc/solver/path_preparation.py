# SPDX-License-Identifier: Apache-2.0
"""Which ways around zones are sought before a solve, in which order, and for how long.

First those that are flown already, then the straight ones, then those around zones, each with
little work at first: one that takes long must not keep many easy ones from being found.
"""
from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise

import numpy as np

from uav_task_alloc.geometry.distances import Distances
from uav_task_alloc.geometry.search_budget import UNLIMITED, SearchBudget
from uav_task_alloc.model import Leg
from uav_task_alloc.solver.routes import Arrays, Ints

FLOWN, SOUGHT = 0.25, 0.5  # shares of the budget that are over when these searches end
_LEAST = 0.02  # [s] of budget: with less no way is found at all
ROUNDS = (0, 100_000, 1_000_000, 10_000_000, UNLIMITED)  # units of work that one search may take
_IN_FLIGHT = 20_000_000  # for a way that is flown already
IN_SEARCH = 1_000_000  # for one that bees ask for


class PathPreparation:
    """The search budget of one solve; `flown` are the legs of the previous plan by UAV."""

    def __init__(self, clock: Callable[[], float], began: float, budget: float,
                 stop: Callable[[], bool] | None = None,
                 flown: Mapping[str, tuple[Sequence[str], Sequence[Leg]]] | None = None) -> None:
        self.path_budget, self.flown = SearchBudget(self._over), flown or {}
        self._clock, self._began, self._budget = clock, began, max(budget, _LEAST)
        self._stop: Callable[[], bool] | None = stop
        self._share, self._heeds_stop = 1.0, True

    def _over(self) -> bool:
        if self._heeds_stop and self._stop is not None and self._stop():
            return True
        return self._clock() - self._began >= self._share * self._budget

    def begin(self, share: float, most: int, heeds_stop: bool = True) -> None:
        """Until this share of the budget is over each search may take `most` units of work.

        What is known of the ways that are flown does not depend on `stop`: an answer without them
        would take tasks away.
        """
        self._share, self._heeds_stop = share, heeds_stop
        self.path_budget.start_stage(most)

    def find_flown(self, ways: Distances, place: Mapping[str, int]) -> None:
        """Seek the legs that are flown already; `place` has UAVs' starts and tasks by id.

        What is not found is taken as it is flown, where that is still clear.
        """
        self.begin(FLOWN, _IN_FLIGHT, heeds_stop=False)
        rows = []
        for uav_id, (tasks, legs) in self.flown.items():
            stops = [place.get(name, -1) for name in (uav_id, *tasks)]
            via = [leg.via for leg in legs[:len(tasks)]]
            via += [()] * (len(tasks) - len(via))
            rows += [(i, j, points) for (i, j), points in zip(pairwise(stops), via, strict=True)
                     if i >= 0 and j >= 0]
        if not rows or not ways.zones:
            return
        ways.ensure([row[0] for row in rows], [row[1] for row in rows])
        for i, j, points in rows if self.path_budget.interrupted else ():
            if ways.given_up(i, j):
                ways.offer_path(i, j, points)

    def find_near(self, ways: Distances, a: Arrays, near: Ints) -> None:
        """Seek the ways from each task to the tasks near it (rows of `near`), and from starts."""
        n, count = near.shape
        tasks = np.arange(n) + a.uavs
        origins = np.concatenate([a.starts.T.ravel(), np.tile(tasks, count)])
        goals = np.concatenate([np.tile(tasks, a.starts.shape[1]), near.T.ravel() + a.uavs])
        for most in ROUNDS:
            self.begin(SOUGHT, most, heeds_stop=most > 0)
            ways.ensure(origins, goals)
            if self.path_budget.is_exhausted or not self.path_budget.interrupted:
                break
