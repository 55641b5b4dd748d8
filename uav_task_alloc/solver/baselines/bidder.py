# SPDX-License-Identifier: Apache-2.0
"""A UAV that bids: what each task would cost it at the cheapest place in its route."""
from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from uav_task_alloc.solver.baselines.leg_lengths import LegLengths
from uav_task_alloc.solver.problem import Problem
from uav_task_alloc.solver.routes import TINY, Floats, Ints


class Bidder:
    """UAV u, who knows its own legs, range and abilities only."""

    def __init__(self, problem: Problem, u: int, ways: LegLengths) -> None:
        a = problem.arrays
        self._start, self._uavs, self._onward = u, a.uavs, ways.onward
        self._last = ways.final[:, u]
        self._may, self._hard, self._strain = a.may[u], a.hard, float(a.strain[u])
        self._reach = float(a.reach[u])

    def costs(self, route: Sequence[int]) -> tuple[Floats, Ints]:
        """Metres that each task would add to a route of tasks, (n), and its cheapest place there.

        inf where it may not be added; metres beyond range count at their price. O(n len(route)).
        """
        taken = list(route)
        stops = [self._start, *(self._uavs + t for t in taken)]
        legs = np.append(self._onward[stops[:-1], taken], self._last[stops[-1]])
        before = self._onward[stops]  # (places, n)
        behind = np.vstack([self._onward[self._uavs:, taken].T, self._last[self._uavs:]])
        added = before + behind - legs[:, None]
        places = np.argmin(added, axis=0)
        cost = self._judged(float(legs.sum()), added[places, np.arange(places.size)])
        cost[~self._may] = np.inf
        cost[taken] = np.inf
        return cost, places

    def _judged(self, length: float, added: Floats) -> Floats:
        """Cost [m] of making a route of this length longer."""
        now, finite = length - self._reach, np.isfinite(added)
        after = now + added[finite]
        cost = np.full(added.shape, np.inf)
        if self._hard:
            cost[finite] = np.where(after <= TINY, added[finite], np.inf)
        else:
            cost[finite] = added[finite] + self._strain * (
                np.maximum(0.0, after) - max(0.0, now))
        return cost
