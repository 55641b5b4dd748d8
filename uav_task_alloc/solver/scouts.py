# SPDX-License-Identifier: Apache-2.0
"""Scouts: bees that construct routes by chained Q and learn from the ranking (eq 2.14)."""
from __future__ import annotations

import functools

import numpy as np

from uav_task_alloc.solver.insertion import place_all
from uav_task_alloc.solver.problem import Problem
from uav_task_alloc.solver.rng import RngState
from uav_task_alloc.solver.routes import (
    Arrays,
    Routes,
    copy_into,
    empty_routes,
    is_better,
    total_cost,
)
from uav_task_alloc.solver.tables import (
    RANK_DECAY,
    Tables,
    construct,
    fresh_tables,
    reinforce,
    to_learnt,
)

BEES = 8  # flights between two updates of the tables


class Scouts:
    """A swarm of scouts with their Q tables.

    Args:
        problem: for the ids of learnt rows.
        arrays: of the problem.
        rng: state of the random numbers, uint64 (1,).
        learnt: tables of an earlier solve; None: none.
        learning: False freezes Q.
    """

    def __init__(self, problem: Problem, arrays: Arrays, rng: RngState, learnt: object = None,
                 learning: bool = True) -> None:
        self.arrays, self.rng, self.learning = arrays, rng, learning
        self._problem, self._learnt = problem, learnt
        self._bees: list[Routes] = []
        self._sums = np.zeros(arrays.uavs)
        n = arrays.ends - arrays.uavs
        self.work = float(BEES * n * (arrays.uavs + 1) * max(1, arrays.near.shape[1]))

    @functools.cached_property
    def tables(self) -> Tables:
        """The Q tables, allocated for the first flight: a short solve has no time for them."""
        return fresh_tables(self._problem, self._learnt)

    def learnt(self) -> object:
        """The Q tables for the next warm start."""
        return to_learnt(self._problem, self.tables) if self._bees else self._learnt

    def fly(self, best: Routes) -> bool:
        """Construct routes with all scouts; copy a better one to `best`; whether there was one.

        Args:
            best: the best so far; replaced by a better one.
        """
        a, improved = self.arrays, False
        if not self._bees:
            self._bees = [empty_routes(a) for _ in range(BEES)]
        penalty = a.range_penalty.copy()
        if a.hard:
            a.range_penalty[:] = np.inf
        for bee in self._bees:
            construct(a, bee, self.tables, self._sums, self.rng)
            unassigned = np.flatnonzero(bee.uav_of[a.uavs:a.ends] < 0) + a.uavs
            if unassigned.size:
                place_all(a, bee, unassigned)
            if is_better(a, bee, best):
                copy_into(bee, best)
                improved = True
        if self.learning:
            self._learn(best)
        a.range_penalty[:] = penalty
        return improved

    def _learn(self, best: Routes) -> None:
        """Reinforce the best routes, then the bees by rank (eq 2.14), each with reward k / fit."""
        a = self.arrays
        ranked = sorted(self._bees, key=lambda bee: total_cost(a, bee))
        goal = max(total_cost(a, best), 1e-9)
        for rank, bee in enumerate([best, *ranked[:4]]):
            share = (1.0 - RANK_DECAY) * RANK_DECAY ** rank
            reinforce(a, bee, self.tables, share, min(1.0, goal / max(total_cost(a, bee), 1e-9)))
