# SPDX-License-Identifier: Apache-2.0
"""Which paths around zones are searched for before a solve, in which order, and for how long.

First the legs that are flown already, then straight ones, then those around zones, each with a
small work limit at first, so that one hard search does not prevent many easy ones.
"""
from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from itertools import pairwise, zip_longest
from typing import NamedTuple

import numpy as np

from uav_task_alloc.geometry.distances import Distances
from uav_task_alloc.geometry.search_budget import UNLIMITED, SearchBudget
from uav_task_alloc.model import Leg, Point
from uav_task_alloc.solver.routes import Arrays, Ints

FLOWN_SHARE, NEAR_SHARE = 0.25, 0.5  # shares of the budget at which these searches end
_LEAST_SHARE = 0.2  # of the budget that a search has however late it begins
_MIN_BUDGET = 0.02  # [s] shorter budgets are taken as this: else no path is found at all
WORK_LIMITS = (0, 100_000, 1_000_000, 10_000_000, UNLIMITED)  # of one search, in units of work
_FLOWN_LIMIT = 20_000_000  # of a search for a leg that is flown already
_MOST_OFFERED = 16  # points of a way home over tasks
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
            distances: of the problem; a leg not found keeps its known path, where that is clear; a
                way home not found follows that of the earlier plan, at once or from its last task.
            place: indices in `distances` where UAV starts and tasks are entered and left, by id;
                those of tasks flown from their first points.
            home: index in `distances` of the home of each UAV that returns, by id.
        """
        routes = [_flown_route(
            [(leave, enter) if name in self.reversed else (enter, leave)
             for name in (uav_id, *tasks) for enter, leave in [place.get(name, (-1, -1))]],
            [leg.via for leg in legs], home.get(uav_id, -1))
            for uav_id, (tasks, legs) in self.flown.items()]
        legs = [pair for route in routes for pair in route.legs()]
        if not legs or not distances.zones:
            return
        pairs = legs + [pair for route in routes for pair in route.ways_home()]
        for share, most in ((math.inf, 0), (FLOWN_SHARE, _FLOWN_LIMIT)):
            self.begin(share, most, heeds_stop=False)
            distances.ensure(*np.array(pairs).T)
        if self.path_budget.interrupted or self.path_budget.is_exhausted:
            for route in routes:
                route.offer(distances)

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


class _FlownRoute(NamedTuple):
    """What is left of the route of a UAV in the earlier plan."""

    stops: list[tuple[int, int]]  # entered and left, in `Distances`: the start (-1: gone), tasks
    via: list[tuple[Point, ...]]  # [m] of the legs to them, and of the way home if it is known
    home: int  # in `Distances`; -1: it does not return

    def legs(self) -> list[tuple[int, int]]:
        """From each stop to the next one."""
        return [(i, j) for (_, i), (j, _) in pairwise(self.stops) if i >= 0]

    def ways_home(self) -> list[tuple[int, int]]:
        """From each task."""
        return [(i, self.home) for _, i in self.stops[1:]] if self.home >= 0 else []

    def offer(self, distances: Distances) -> None:
        """Take the earlier paths of legs that are not found, as far as they are clear."""
        for (_, i), (j, _), via in zip(self.stops, self.stops[1:], self.via, strict=False):
            if i >= 0 and distances.given_up(i, j):
                distances.offer_path(i, j, via)
        if self.home >= 0 and len(self.via) == len(self.stops):
            self._offer_ways_home(distances)

    def _offer_ways_home(self, distances: Distances) -> None:
        """From each task to the way home of the earlier plan, or over the tasks after it."""
        leaves = [leave for _, leave in self.stops[1:]]
        if not np.isnan(distances.known_lengths(leaves, len(leaves) * [self.home])).any():
            return
        way_home = rest = self.via[-1]
        for (enter, leave), via in zip(self.stops[:0:-1], self.via[-2::-1], strict=True):
            if distances.given_up(leave, self.home) and not distances.offer_path(
                    leave, self.home, way_home):
                distances.offer_path(leave, self.home, rest)
            leg = distances.stored_leg(leave, self.home)
            rest = (distances.point(leave), *(leg.via if leg else rest))
            rest = (distances.point(enter), *rest) if enter != leave else rest
            rest = (*via, *rest)[-_MOST_OFFERED:]


def _flown_route(stops: Sequence[tuple[int, int]], via: Sequence[tuple[Point, ...]],
                 home: int) -> _FlownRoute:
    """A route without the tasks that are gone (-1), whose legs are joined."""
    left, joined, points = [stops[0]], list[tuple[Point, ...]](), tuple[Point, ...]()
    for stop, leg in zip_longest(stops[1:], via[:len(stops)], fillvalue=()):
        points += tuple(leg)
        if stop and stop[0] >= 0:
            left.append(stop)
            joined.append(points)
            points = ()
    return _FlownRoute(left, [*joined, points] if len(via) >= len(stops) else joined, home)
