# SPDX-License-Identifier: Apache-2.0
"""The demand as the allocator learns it: its area of work, and what was announced so far.

Importing this module loads the compiled kernels.
"""
from __future__ import annotations

import functools
import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from uav_task_alloc.allocator.state.seen_tasks import SeenTask, SeenTasks
from uav_task_alloc.anticipation.demand import Demand, Observation
from uav_task_alloc.anticipation.places import MOVE_PRICES, ROUNDS, Waiting, choose_places
from uav_task_alloc.anticipation.spread import load_spread_kernels
from uav_task_alloc.kernel_cache import NOTICE, KernelWork
from uav_task_alloc.params import AllocatorParams

_Floats = NDArray[np.float64]
_LEAST_SIDE = 400.0  # [m] of an area around tasks
_STEPS = 8.0  # to which the corners are rounded outwards, of the side rounded up to a power of 2
_WORK = KernelWork(6.0, 40)
Area = tuple[float, float, float, float]  # west, south, east, north [m] ENU


def area_around(seen: Sequence[SeenTask]) -> Area | None:
    """Return a square around tasks that changes seldom while more are announced.

    Args:
        seen: in any order.

    Returns:
        None where there are none.
    """
    if not seen:
        return None
    low, high = (tuple(pick(each[axis] for each in seen) for axis in (1, 2))
                 for pick in (min, max))
    side = max(_LEAST_SIDE, *(b - a for a, b in zip(low, high, strict=True)))
    step = 2.0 ** math.ceil(math.log2(side)) / _STEPS
    first = [math.floor((a - 0.5 * step) / step) for a in low]
    most = max(math.ceil((b + 0.5 * step) / step) - k for k, b in zip(first, high, strict=True))
    west, south = first[0] * step, first[1] * step
    return west, south, west + most * step, south + most * step


class LearntDemand:
    """A `Demand` that follows the announcements that are kept.

    `demand` is None without an area. `distance`: (c, c) [m] between its cells.
    """

    def __init__(self) -> None:
        self.demand: Demand | None = None
        self.distance: _Floats = np.zeros((0, 0))
        self.area: Area | None = None
        self._version, self._count = -1, 0
        self._basis: object = None  # the area that is given, and how often all was forgotten

    def follow(self, seen: SeenTasks, params: AllocatorParams) -> None:
        """Learn what was announced since the last call.

        Args:
            seen: announcements.
            params: with the area, where it is given.
        """
        fixed = params.anticipate_area
        given = (fixed[0], fixed[1], fixed[2], fixed[3]) if fixed else None
        basis = given, seen.forgotten
        if (seen.version, basis) == (self._version, self._basis):
            return
        rows = seen.seen
        area = given or area_around(rows)
        new = rows[len(rows) - (seen.version - self._version):]
        if (area != self.area or self.demand is None or basis != self._basis
                or len(rows) != self._count + len(new)):
            self._begin(area)
            new = rows
        if self.demand is not None:
            for row in new:
                self.demand.add(Observation(*row))
        self._version, self._count, self._basis = seen.version, len(rows), basis

    def _begin(self, area: Area | None) -> None:
        """Begin without an announcement."""
        self.area, self.demand = area, None
        if area is not None:
            self.demand = Demand(np.array(area[:2]), np.array(area[2:]))
            x, y = self.demand.cells.x, self.demand.cells.y
            self.distance = np.hypot(x[:, None] - x[None, :], y[:, None] - y[None, :])

    def weight(self, learnt: bool, now: float) -> _Floats:
        """Return the weight of each cell; (c,), its sum is 1; requires a demand.

        Args:
            learnt: as announced, else the same everywhere.
            now: [s] clock of the node.
        """
        assert self.demand is not None
        inside = self.demand.cells.inside
        return self.demand.weight(now) if learnt else inside / inside.sum()


@functools.cache
def load_waiting_kernels() -> None:
    """Load the kernels, compile those not on disk yet; further calls do nothing."""
    learnt, one = LearntDemand(), np.ones(1)
    waiting = Waiting(one, 0.0 * one, 0.0 * one, 0.0 * one, one, one, np.zeros((1, 2)),
                      np.zeros(1, np.int64), np.zeros(1))
    with NOTICE.until_loaded('waiting places', _WORK):
        learnt.follow(SeenTasks([(0, [(0.0, 0.0, 0.0, 1.0)])]), AllocatorParams())
        weight = learnt.weight(True, 0.0)
        assert learnt.demand is not None
        choose_places(learnt.demand.cells, learnt.distance, weight, waiting, MOVE_PRICES, ROUNDS,
                      np.zeros((4, weight.size)))
        load_spread_kernels()
