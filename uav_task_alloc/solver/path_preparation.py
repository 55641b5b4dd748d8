# SPDX-License-Identifier: Apache-2.0
"""Which paths around zones are searched for before a solve, in which order, and for how long.

First the legs that are flown already, then straight ones, then those around zones, each with a
small work limit at first, so that one hard search does not prevent many easy ones.
"""
from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from itertools import pairwise

import numpy as np

from uav_task_alloc.geometry.distances import Distances
from uav_task_alloc.geometry.search_budget import UNLIMITED, SearchBudget
from uav_task_alloc.model import Leg
from uav_task_alloc.solver.routes import Arrays, Ints

FLOWN_SHARE, NEAR_SHARE = 0.25, 0.5  # shares of the budget at which these searches end
_LEAST_SHARE = 0.2  # of the budget that a search has however late it begins
_MIN_BUDGET = 0.02  # [s] shorter budgets are taken as this: else no path is found at all
WORK_LIMITS = (0, 100_000, 1_000_000, 10_000_000, UNLIMITED)  # of one search, in units of work
_FLOWN_LIMIT = 20_000_000  # of a search for a leg that is flown already
SEARCH_LIMIT = 1_000_000  # of a search that the solver causes


class PathPreparation:
    """The path searches of one solve.

    Args:
        clock: [s], monotonic.
        began: [s] when the solve began.
        budget: [s] of the solve.
        stop: returns True to end the solve.
        flown: by UAV id the task ids and legs of the earlier plan.
    """

    def __init__(self, clock: Callable[[], float], began: float, budget: float,
                 stop: Callable[[], bool] | None = None,
                 flown: Mapping[str, tuple[Sequence[str], Sequence[Leg]]] | None = None) -> None:
        self.path_budget, self.flown = SearchBudget(self._over), flown or {}
        self._clock, self._began, self._budget = clock, began, max(budget, _MIN_BUDGET)
        self._stop: Callable[[], bool] | None = stop
        self._limit, self._heeds_stop = self._budget, True  # [s] since the solve began
        self.reversed: Collection[str] = ()  # of `flown`: from their last points

    def _over(self) -> bool:
        if self._heeds_stop and self._stop is not None and self._stop():
            return True
        return self._clock() - self._began >= self._limit

    def begin(self, share: float, most: int, heeds_stop: bool = True) -> None:
        """Allow each search `most` units of work until this share of the budget is used.

        The search for legs that are flown ignores `stop`: without them tasks of the earlier plan
        would be dropped. So they would where the budget was used up before, as of a large problem
        or on a busy computer: each search has a fifth of it in any case.

        Args:
            share: of the budget, in [0, 1].
            most: units of work; 0: a straight leg only.
            heeds_stop: whether `stop` ends the searches.
        """
        elapsed = self._clock() - self._began
        self._limit = self._budget * max(share, elapsed / self._budget + _LEAST_SHARE)
        self._heeds_stop = heeds_stop
        self.path_budget.start_stage(most)

    def find_flown(self, distances: Distances, place: Mapping[str, tuple[int, int]],
                   home: Mapping[str, int]) -> None:
        """Search for the legs that are flown already, and for those home from their ends.

        Straight ones are found however late it is.

        Args:
            distances: of the problem; a leg not found keeps its known path, where that is clear.
            place: indices in `distances` where UAV starts and tasks are entered and left, by id;
                those of tasks flown from their first points.
            home: index in `distances` of the home of each UAV that returns, by id.
        """
        rows, ways_home = [], []
        for uav_id, (tasks, legs) in self.flown.items():
            stops = [place.get(name, (-1, -1))[::-1 if name in self.reversed else 1]
                     for name in (uav_id, *tasks)]
            via = [leg.via for leg in legs[:len(tasks)]]
            via += [()] * (len(tasks) - len(via))
            rows += [(i, j, points)
                     for ((_, i), (j, _)), points in zip(pairwise(stops), via, strict=True)
                     if i >= 0 and j >= 0]
            if uav_id in home:
                ways_home += [(i, home[uav_id]) for _, i in stops[1:] if i >= 0]
        if not rows or not distances.zones:
            return
        pairs = np.array([*(row[:2] for row in rows), *ways_home]).T
        for share, most in ((math.inf, 0), (FLOWN_SHARE, _FLOWN_LIMIT)):
            self.begin(share, most, heeds_stop=False)
            distances.ensure(*pairs)
        late = self.path_budget.interrupted or self.path_budget.is_exhausted
        for i, j, points in rows if late else ():
            if distances.given_up(i, j):
                distances.offer_path(i, j, points)

    def find_near(self, distances: Distances, a: Arrays, near: Ints) -> None:
        """Search for the paths to each task from near tasks (n, k) and from near starts."""
        n, count = near.shape
        tasks = np.arange(n) + a.uavs
        origins = np.concatenate([a.starts.T.ravel(), np.tile(tasks, count)])
        goals = np.concatenate([np.tile(tasks, a.starts.shape[1]), near.T.ravel() + a.uavs])
        for most in WORK_LIMITS:
            self.begin(NEAR_SHARE, most, heeds_stop=most > 0)
            distances.ensure(origins, goals)
            if self.path_budget.is_exhausted or not self.path_budget.interrupted:
                break
