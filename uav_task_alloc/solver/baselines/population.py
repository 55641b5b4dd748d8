# SPDX-License-Identifier: Apache-2.0
"""Many plans at once as rows of numbers, judged by eq 2.12 in numpy: an order and a UAV for each.

Plans serve every task that some UAV can serve alone; ranges are soft here (P of eq 2.12), and
what the recorder is offered is trimmed to hard ones.
"""
from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from uav_task_alloc.solver.baselines.leg_lengths import all_ways, routes_of
from uav_task_alloc.solver.problem import Problem
from uav_task_alloc.solver.routes import TINY, Floats, Ints, Routes


class Coding:
    """What rows of numbers mean for a problem; tasks are counted among those in `work`."""

    def __init__(self, problem: Problem) -> None:
        self.problem, self._ways = problem, all_ways(problem)
        able = self._able()
        self.work: Ints = np.flatnonzero(able.any(axis=0))  # tasks that somebody can serve
        self.able = able[:, self.work]  # (m, k)
        self.choices: Ints = self.able.sum(axis=0)  # (k) how many UAVs can serve each
        self._uavs: Ints = np.argsort(~self.able, axis=0, kind='stable')  # (m, k) these first
        self._onward = self._ways.onward[:, self.work]

    def _able(self) -> NDArray[np.bool_]:
        """(m, n) whether a UAV can serve a task when it flies for that alone."""
        a = self.problem.arrays
        alone = self._ways.onward[:a.uavs] + self._ways.final[a.uavs:].T
        able: NDArray[np.bool_] = a.may & np.isfinite(alone)
        return able & (alone <= a.reach[:, None] + TINY) if a.hard else able

    def uav(self, tasks: Ints, choice: Floats) -> Ints:
        """The UAV that a number in [0, 1) means for each task."""
        place = np.minimum((choice * self.choices[tasks]).astype(np.int64),
                           self.choices[tasks] - 1)
        found: Ints = self._uavs[place, tasks]
        return found

    def rows(self, order: Ints, who: Ints) -> Ints:
        """Orders of tasks (p, k) with UAVs' tasks side by side; who (p, k) by task."""
        by_uav = np.argsort(np.take_along_axis(who, order, 1), axis=1, kind='stable')
        return np.take_along_axis(order, by_uav, 1)

    def fits(self, row: Ints, who: Ints) -> Floats:
        """Eq 2.12 of plans (p): tasks by UAV as `rows` gives them, UAVs by task. O(p (k + m))."""
        a, weights = self.problem.arrays, self.problem.rules.weights
        p, m = len(row), a.uavs
        uav = np.take_along_axis(who, row, 1)
        stop = m + self.work[row]
        first = np.ones(row.shape, np.bool_)
        first[:, 1:] = uav[:, 1:] != uav[:, :-1]
        last = np.ones(row.shape, np.bool_)
        last[:, :-1] = first[:, 1:]
        before = np.where(first, uav, np.roll(stop, 1, axis=1))
        legs = self._onward[before, row] + np.where(last, self._ways.final[stop, uav], 0.0)
        slot = uav + m * np.arange(p)[:, None]
        length = np.bincount(slot.ravel(), legs.ravel(), p * m).reshape(p, m)
        used = np.bincount(slot.ravel(), minlength=p * m).reshape(p, m) > 0
        length += np.where(used, 0.0, a.idle)
        beyond = np.maximum(0.0, length - a.reach).sum(axis=1)
        value = self.problem.arrays.value[self.work].sum()
        fits: Floats = (weights.distance * length.sum(axis=1) + weights.value / value
                        + weights.penalty * beyond)  # eq 2.12
        return fits

    def routes(self, row: Ints, who: Ints) -> Routes:
        """One plan as routes, within ranges where they are hard."""
        rows: list[list[int]] = [[] for _ in range(self.problem.arrays.uavs)]
        for task in row:
            rows[who[task]].append(int(self.work[task]))
        return routes_of(self.problem, rows)
