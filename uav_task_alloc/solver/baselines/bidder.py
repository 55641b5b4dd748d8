# SPDX-License-Identifier: Apache-2.0
"""A bidding UAV: the cost of each task at the cheapest place of its route."""
from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from uav_task_alloc.solver.baselines.leg_lengths import LegLengths
from uav_task_alloc.solver.problem import Problem
from uav_task_alloc.solver.routes import TINY, Floats, Ints


class Bidder:
    """Bidder of UAV u; uses only its own legs, range and compatible tasks."""

    def __init__(self, problem: Problem, u: int, legs: LegLengths) -> None:
        a = problem.arrays
        self._start, self._uavs, self._onward = u, a.uavs, legs.onward
        self._last = legs.final[:, u]
        self._compatible, self._hard = a.compatible[u], a.hard
        self._penalty = float(a.range_penalty[u])
        self._range = float(a.range_left[u])

    def costs(self, route: Sequence[int]) -> tuple[Floats, Ints]:
        """Cost of adding each task to a route. O(n len(route)).

        Args:
            route: tasks in order.

        Returns:
            (n) metres added, with the penalty of metres beyond range, inf: not allowed; (n) the
            cheapest place of each task in the route.
        """
        taken = list(route)
        stops = [self._start, *(self._uavs + t for t in taken)]
        legs = np.append(self._onward[stops[:-1], taken], self._last[stops[-1]])
        before = self._onward[stops]  # (places, n)
        after = np.vstack([self._onward[self._uavs:, taken].T, self._last[self._uavs:]])
        added = before + after - legs[:, None]
        places = np.argmin(added, axis=0)
        cost = self._with_range(float(legs.sum()), added[places, np.arange(places.size)])
        cost[~self._compatible] = np.inf
        cost[taken] = np.inf
        return cost, places

    def _with_range(self, length: float, added: Floats) -> Floats:
        """Cost [m] of adding these metres to a route of this length [m]."""
        now, finite = length - self._range, np.isfinite(added)
        after = now + added[finite]
        cost = np.full(added.shape, np.inf)
        if self._hard:
            cost[finite] = np.where(after <= TINY, added[finite], np.inf)
        else:
            cost[finite] = added[finite] + self._penalty * (
                np.maximum(0.0, after) - max(0.0, now))
        return cost
