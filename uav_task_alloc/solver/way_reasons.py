# SPDX-License-Identifier: Apache-2.0
"""Why no safe way leads to a task, or home from it; and the way of a UAV that serves it alone."""
from __future__ import annotations

import math

import numpy as np

from uav_task_alloc.geometry.pairs import Pairs, length
from uav_task_alloc.kernel import allocating_kernel
from uav_task_alloc.solver.problem import Problem
from uav_task_alloc.solver.routes import Floats, Ints

NOT_IN_TIME = ('no safe path past the zones found in the time; searched for again with the next '
               'plan')


@allocating_kernel
def _least_shortage(pairs: Pairs, uavs: Ints, short: Floats, range_left: Floats, home: int,
                    ends: Ints, ways: int, path_length: float) -> tuple[float, int]:
    """Length [m] of the way of the UAV with the least shortage, and its index. O(m)

    uavs: those that may serve the task, by `short`; short, range_left: (m,) [m]; home: index in
    `pairs` of the first home, -1: none returns; ends: both ends of the task in `pairs`; ways: 2
    where it may be flown from its last point, too; path_length [m]. Returns inf, -1: none has one.
    """
    least, metres, best = math.inf, math.inf, -1
    for u in uavs:
        if short[u] >= least:
            break  # the others lack more
        need = math.inf
        for k in range(ways):
            way = length(pairs, u, ends[k]) + path_length
            if home >= 0:
                way += length(pairs, ends[1 - k], home + u)
            need = min(need, way)
        if need < math.inf and (best < 0 or need - range_left[u] < least):
            least, metres, best = need - range_left[u], need, u
    return metres, best


class WayReasons:
    """Reasons of unassigned tasks that follow from the ways to them, and home from them.

    Args:
        problem: what was solved; paths that are not known yet are searched for in its budget.

    Arguments of methods:
        i: index of the task.
    """

    def __init__(self, problem: Problem) -> None:
        self._problem = problem
        m = len(problem.uavs)
        self._no_shortage, self._no_limit = np.zeros(m), np.full(m, math.inf)
        self._zones_at_home: dict[int, tuple[str, ...]] = {}

    def least_shortage(self, i: int, short: Floats) -> tuple[float, int]:
        """What a UAV needs for a task alone, after its locked tasks.

        Args:
            i: index of the task.
            short: (m,) [m] which each UAV lacks at least; the longer ways are not searched for.

        Returns:
            Length [m] of the way of the UAV that lacks least of its range, and its index; inf, -1:
            there is no safe way.
        """
        order = np.argsort(short, kind='stable')
        able = self._problem.arrays.compatible[order, i]
        return self._least(i, order[able], short, self._problem.arrays.range_left)

    def reason(self, i: int) -> str:
        """The reason of a task to which, or home from which, there is no safe path.

        Returns:
            Empty where there is one.
        """
        if not self._problem.distances.zones:
            return ''
        # without limits none lacks less than the first UAV that has a way: no other is asked
        _, found = self._least(i, self._able(i), self._no_shortage, self._no_limit)
        return self.without_way(i) if found < 0 else ''

    def without_way(self, i: int) -> str:
        """The reason of a task for which `least_shortage` has found no way.

        Returns:
            A text for users.
        """
        if self._given_up(i):
            return NOT_IN_TIME
        everyone = self._problem.arrays.compatible[:, i].all()
        return self._no_path_home(i) or 'unreachable: no safe path past the zones' + (
            '' if everyone else ' for the UAVs that may serve it')

    def _able(self, i: int) -> Ints:
        return np.flatnonzero(self._problem.arrays.compatible[:, i])

    def _least(self, i: int, able: Ints, short: Floats, range_left: Floats) -> tuple[float, int]:
        problem, task = self._problem, self._problem.tasks[i]
        a, place = problem.arrays, problem.arrays.uavs + i
        ends = np.array([place, problem.ends.get(task.id, place)])
        metres, u = _least_shortage(
            a.pairs, able, short, range_left, a.ends if problem.rules.returns else -1, ends,
            2 if task.path and task.reversible else 1, task.path_length)
        return float(metres), int(u)

    def _given_up(self, i: int) -> bool:
        """Whether a search for a path to the task, or home from it, ran out of budget."""
        a, distances, able = self._problem.arrays, self._problem.distances, self._able(i)
        there = np.full(able.size, a.uavs + i)
        return bool(np.isnan(distances.known_lengths(able, there)).any() or (
            self._problem.rules.returns
            and np.isnan(distances.known_lengths(there, a.ends + able)).any()))

    def _no_path_home(self, i: int) -> str:
        """The reason of a task that a UAV can reach, but from which none returns; else empty."""
        problem, able = self._problem, self._able(i)
        a, uavs = problem.arrays, problem.uavs
        lengths = problem.distances.known_lengths(able, np.full(able.size, a.uavs + i))
        reaching = able[lengths < math.inf].tolist()
        if not problem.rules.returns or not reaching:
            return ''
        inside = [f'home of {uavs[u].id} is inside zone {", ".join(zones)}'
                  for u in reaching if (zones := self._zones_around_home(u))]
        return '; '.join(['no safe path home', *inside])

    def _zones_around_home(self, u: int) -> tuple[str, ...]:
        if u not in self._zones_at_home:
            self._zones_at_home[u] = self._problem.distances.zones_around(
                self._problem.arrays.ends + u)
        return self._zones_at_home[u]
