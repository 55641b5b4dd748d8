# SPDX-License-Identifier: Apache-2.0
"""A bee colony on one thread: scouts construct routes, employed and onlooker bees search."""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uav_task_alloc.solver.bidding import Bidding
from uav_task_alloc.solver.pool import empty_pool
from uav_task_alloc.solver.problem import Problem
from uav_task_alloc.solver.recombine import recombine
from uav_task_alloc.solver.rng import rng_state
from uav_task_alloc.solver.routes import (
    EXCESS,
    TINY,
    VALUE,
    Routes,
    copy,
    copy_into,
    is_better,
    total_cost,
    update_sums,
)
from uav_task_alloc.solver.ruin import empty_log
from uav_task_alloc.solver.scouts import Scouts
from uav_task_alloc.solver.search import search, trim_to_range
from uav_task_alloc.solver.selection import out_of_reach

PHASES = (0.0, 0.45, 0.92, 1.0)  # shares of the budget: cooling, second cooling, constant
WORK = 150.0  # stops of the pool read by `recombine` per round of the whole search
# times the first cost of an unassigned task: what one costs there at least. At that first cost, as
# in a search that passes to and fro, combinations that serve fewer tasks are often the cheapest
RECOMBINED_COST = 3.0


@dataclass(frozen=True, slots=True)
class ColonyParams:
    """Parameters of a colony; temperatures in mean leg lengths to the nearest neighbour."""

    start_temperature: float = 3.0  # of the first cooling
    end_temperature: float = 0.1  # of both coolings, and kept after them
    reheat_temperature: float = 1.0  # at the start of the second cooling
    employed_ruin: float = 10.0  # tasks that an employed bee removes in a round
    onlooker_ruin: float = 20.0  # tasks that an onlooker removes
    employed: float = 0.5  # least shares of the work
    onlookers: float = 0.2  # least share
    scouts: float = 0.01  # least share
    range_penalty: float = 5.0  # [m/m] first cost of a metre beyond range
    most_penalty: float = 1000.0  # [m/m] upper bound of that cost
    cost_growth: float = 300.0  # upper bound of the cost of an unassigned task over the first
    least_rounds: float = 20.0  # between two updates of these costs
    string_floor: float = 1.0  # tasks that a string may have, also where the mean route has fewer
    skipped: float = 0.0  # probability that a round passes over an unassigned task near its seed
    by_value: float = 0.0  # share of rounds that insert about the most valuable tasks first
    selects: bool = False  # tasks have to be left out; no search is spent on those out of reach
    learning: bool = True  # False: Q is frozen
    bidding: bool = True  # False: the shares of the work are fixed


class Colony:
    """Bees with routes of their own; `best` is the best of them.

    Args:
        problem: what is solved.
        start: the first routes.
        seed: of the random numbers.
        params: of the colony.
        learnt: Q tables of an earlier problem, as Scouts.learnt returned them.
    """

    def __init__(self, problem: Problem, start: Routes, seed: int, params: ColonyParams,
                 learnt: object = None) -> None:
        arrays = problem.arrays
        self.arrays = arrays._replace(range_penalty=arrays.range_penalty.copy(),
                                      unassigned_cost=arrays.unassigned_cost.copy(),
                                      max_unassigned_cost=(
                                          params.cost_growth * arrays.unassigned_cost))
        self.params, self.best, self.routes = params, copy(start), copy(start)
        self._scratch, self._phase = copy(start), 0
        self._pool = empty_pool(arrays)
        self._rng, self._log = rng_state(seed), empty_log(arrays)
        self.scouts = Scouts(problem, self.arrays, self._rng, learnt, params.learning)
        self._scale = problem.scale
        floors = {'employed': params.employed, 'onlooker': params.onlookers,
                  'scout': params.scouts}
        self._bids = Bidding({kind: floor for kind, floor in floors.items() if floor > 0.0})
        if arrays.hard:
            self.arrays.range_penalty[:] = params.range_penalty
        self._log.settings[:] = (params.skipped, params.by_value, params.least_rounds,
                                 params.most_penalty, params.string_floor)
        if params.selects:
            self.arrays.unassigned_cost[out_of_reach(problem)] = 0.0
            update_sums(self.arrays, self.best)
        self._recombined_cost = RECOMBINED_COST * self.arrays.unassigned_cost

    def temperature(self, spent: float) -> float:
        """Temperature [m] after this share of the budget."""
        p, begin, end = self.params, PHASES[self._phase], PHASES[self._phase + 1]
        first = (p.start_temperature, p.reheat_temperature, p.end_temperature)[self._phase]
        share = min(1.0, max(0.0, (spent - begin) / (end - begin)))
        return float(self._scale * first * (p.end_temperature / first) ** share)

    def fly(self, spent: float, until: float, rounds: int) -> int:
        """Run one flight of the kind of bee whose turn it is.

        Args:
            spent: share of the budget used so far.
            until: share used after the flight, for the temperatures.
            rounds: rounds of search of the flight.

        Returns:
            The rounds of search done: 0 where scouts flew.
        """
        p = self.params
        if until > PHASES[self._phase + 1] and spent > 0.0:
            self._phase += 1
            self._intensify(WORK * rounds / max(1e-6, until - spent))
        costs = {'employed': rounds * p.employed_ruin, 'onlooker': rounds * p.onlooker_ruin,
                 'scout': self.scouts.work / 5.0}
        kind = self._bids.next({each: costs[each] for each in self._bids.shares()})
        before = total_cost(self.arrays, self.best)
        start, end = self.temperature(spent), self.temperature(until)
        if kind == 'scout':
            self.scouts.fly(self.best)
        elif kind == 'employed':
            self._search(self.routes, p.employed_ruin, start, end, rounds)
        else:
            self._search(self.routes, p.onlooker_ruin, start, end, rounds)
        self._trim_current()
        gain = before - total_cost(self.arrays, self.best)
        self._bids.pay(kind, costs[kind], max(0.0, gain) if p.bidding else 0.0)
        return 0 if kind == 'scout' else rounds

    def _intensify(self, work: float) -> None:
        """Continue from the best, after a search for a cheaper combination in the pool."""
        a = self.arrays
        raised = a._replace(unassigned_cost=np.maximum(a.unassigned_cost, self._recombined_cost))
        if recombine(raised, self.best, self._pool, work, self._scratch) and (
                is_better(a, self._scratch, self.best)):
            copy_into(self._scratch, self.best)
        update_sums(a, self.best)  # penalties and costs have changed since
        copy_into(self.best, self.routes)

    def _trim_current(self) -> None:
        """Where the best leaves tasks out, try the current routes, trimmed to the ranges."""
        a = self.arrays
        if a.hard and self.best.sums[VALUE] < self.routes.sums[VALUE] and (
                self.routes.sums[EXCESS] > a.excess_floor + TINY):
            copy_into(self.routes, self._scratch)
            trim_to_range(a, self._scratch)
            if is_better(a, self._scratch, self.best):
                copy_into(self._scratch, self.best)

    def _search(self, routes: Routes, mean: float, start: float, end: float,
                rounds: int) -> int:
        return int(search(self.arrays, routes, self.best, self._log, self._pool, mean, start, end,
                          rounds, self._rng))
