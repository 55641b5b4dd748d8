# SPDX-License-Identifier: Apache-2.0
"""Many plans as rows of arrays, an order of tasks and a UAV for each, evaluated by eq 2.12.

Plans serve every task that some UAV can serve alone; ranges are soft here (P of eq 2.12), and
plans are trimmed to hard ranges before they are offered to the recorder.
"""
from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from uav_task_alloc.solver.baselines.leg_lengths import all_leg_lengths, routes_of
from uav_task_alloc.solver.problem import Problem
from uav_task_alloc.solver.recorder import Recorder
from uav_task_alloc.solver.routes import TINY, Floats, Ints, Routes


class Coding:
    """Decodes rows for a problem; k tasks are numbered within `tasks`."""

    def __init__(self, problem: Problem) -> None:
        self.problem, self._legs = problem, all_leg_lengths(problem)
        able = self._able()
        self.tasks: Ints = np.flatnonzero(able.any(axis=0))  # (k) servable tasks
        self.able = able[:, self.tasks]  # (m, k)
        self.choices: Ints = self.able.sum(axis=0)  # (k) number of UAVs that can serve each
        self._uavs: Ints = np.argsort(~self.able, axis=0, kind='stable')  # (m, k) able first
        self._onward = self._legs.onward[:, self.tasks]

    def _able(self) -> NDArray[np.bool_]:
        """(m, n) whether a UAV can serve a task alone."""
        a = self.problem.arrays
        alone = self._legs.onward[:a.uavs] + self._legs.final[a.uavs:].T
        able: NDArray[np.bool_] = a.compatible & np.isfinite(alone)
        return able & (alone <= a.range_left[:, None] + TINY) if a.hard else able

    def uav(self, tasks: Ints, key: Floats) -> Ints:
        """The UAV that each key in [0, 1) selects for its task."""
        place = np.minimum((key * self.choices[tasks]).astype(np.int64),
                           self.choices[tasks] - 1)
        uavs: Ints = self._uavs[place, tasks]
        return uavs

    def rows(self, order: Ints, uav_of: Ints) -> Ints:
        """Orders of tasks (p, k), grouped by UAV; uav_of (p, k) by task."""
        by_uav = np.argsort(np.take_along_axis(uav_of, order, 1), axis=1, kind='stable')
        return np.take_along_axis(order, by_uav, 1)

    def fits(self, row: Ints, uav_of: Ints) -> Floats:
        """Eq 2.12 of plans (p): tasks by UAV as `rows` gives them, UAVs by task. O(p (k + m))."""
        a, weights = self.problem.arrays, self.problem.rules.weights
        p, m = len(row), a.uavs
        uav = np.take_along_axis(uav_of, row, 1)
        stop = m + self.tasks[row]
        first = np.ones(row.shape, np.bool_)
        first[:, 1:] = uav[:, 1:] != uav[:, :-1]
        last = np.ones(row.shape, np.bool_)
        last[:, :-1] = first[:, 1:]
        before = np.where(first, uav, np.roll(stop, 1, axis=1))
        legs = self._onward[before, row] + np.where(last, self._legs.final[stop, uav], 0.0)
        slot = uav + m * np.arange(p)[:, None]
        length = np.bincount(slot.ravel(), legs.ravel(), p * m).reshape(p, m)
        used = np.bincount(slot.ravel(), minlength=p * m).reshape(p, m) > 0
        length += np.where(used, 0.0, a.empty_route_length)
        most = np.minimum(a.range_left, 1e300)  # a route without a path is infinite: no inf - inf
        excess = np.maximum(0.0, length - most).sum(axis=1)
        value = self.problem.arrays.value[self.tasks].sum()
        fits: Floats = (weights.distance * length.sum(axis=1) + weights.value / value
                        + weights.penalty * excess)  # eq 2.12
        return fits

    def routes(self, row: Ints, uav_of: Ints) -> Routes:
        """One plan as routes, within ranges where they are hard."""
        rows: list[list[int]] = [[] for _ in range(self.problem.arrays.uavs)]
        for task in row:
            rows[uav_of[task]].append(int(self.tasks[task]))
        return routes_of(self.problem, rows)


class Generations(Protocol):
    """Plans that are replaced by better ones, generation by generation."""

    fits: Floats  # (p) eq 2.12 of each plan

    def routes(self, plan: int) -> Routes:
        """One of the plans."""

    def advance(self) -> None:
        """The next generation."""


def evolve(recorder: Recorder, make: Callable[[Coding], Generations]) -> None:
    """Offer the best plan of each generation until the budget ends.

    Args:
        recorder: of the problem; nothing is offered where no task can be served.
        make: the first generation of a problem.

    Raises:
        InvalidValue: there are too many tasks for a table of leg lengths.
    """
    if not recorder.problem.uavs or not recorder.problem.tasks:
        return
    coding = Coding(recorder.problem)
    if not len(coding.tasks):
        return
    plans, offered = make(coding), np.inf
    while True:
        best = int(np.argmin(plans.fits))
        if plans.fits[best] < offered:
            offered = float(plans.fits[best])
            recorder.offer(plans.routes(best))
        recorder.count()
        if recorder.over():
            return
        plans.advance()
