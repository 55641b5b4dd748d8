# SPDX-License-Identifier: Apache-2.0
"""Constructing bees: they grow routes by chained Q and learn from each other's rank."""
from __future__ import annotations

import functools

import numpy as np

from uav_task_alloc.solver import routes as of
from uav_task_alloc.solver.insertion import place_all
from uav_task_alloc.solver.problem import Problem
from uav_task_alloc.solver.rng import Chance
from uav_task_alloc.solver.routes import Arrays, Routes
from uav_task_alloc.solver.tables import DECAY, Tables, construct, fresh_tables, keep, reinforce

BEES = 8  # that fly before the tables are changed


class Scouts:
    """A swarm of constructing bees with their tables; `learning` False freezes Q."""

    def __init__(self, problem: Problem, arrays: Arrays, rng: Chance, learnt: object = None,
                 learning: bool = True) -> None:
        self.arrays, self.rng, self.learning = arrays, rng, learning
        self._problem, self._learnt = problem, learnt
        self._bees: list[Routes] = []
        self._sums = np.zeros(arrays.uavs)
        n = arrays.ends - arrays.uavs
        self.work = float(BEES * n * (arrays.uavs + 1) * max(1, arrays.near.shape[1]))

    @functools.cached_property
    def tables(self) -> Tables:
        """Made when the first bee flies: a short solve has no time for them."""
        return fresh_tables(self._problem, self._learnt)

    def learnt(self) -> object:
        """What the next warm start wants."""
        return keep(self._problem, self.tables) if self._bees else self._learnt

    def fly(self, best: Routes) -> bool:
        """One flight of all; `best` is improved if a bee brings better, and learnt from."""
        a, found = self.arrays, False
        if not self._bees:
            self._bees = [of.empty_routes(a) for _ in range(BEES)]
        strain = a.strain.copy()
        if a.hard:
            a.strain[:] = np.inf
        for bee in self._bees:
            construct(a, bee, self.tables, self._sums, self.rng)
            left = np.flatnonzero(bee.on[a.uavs:a.ends] < 0) + a.uavs
            if left.size:
                place_all(a, bee, left)
            if of.better_now(a, bee, best):
                of.copy(bee, best)
                found = True
        if self.learning:
            self._learn(best)
        a.strain[:] = strain
        return found

    def _learn(self, best: Routes) -> None:
        """The recorder's best first, then the bees by rank (eq 2.14), each by k / fit."""
        a = self.arrays
        ranked = sorted(self._bees, key=lambda bee: of.cost_now(a, bee))
        goal = max(of.cost_now(a, best), 1e-9)
        for rank, bee in enumerate([best, *ranked[:4]]):
            share = (1.0 - DECAY) * DECAY ** rank
            reinforce(a, bee, self.tables, share, min(1.0, goal / max(of.cost_now(a, bee), 1e-9)))


