# SPDX-License-Identifier: Apache-2.0
"""A bee colony on one thread: scouts construct routes, employed and onlooker bees search."""
from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from uav_task_alloc.solver.bidding import Bidding
from uav_task_alloc.solver.packing import MOST_PACKED
from uav_task_alloc.solver.pool import empty_pool
from uav_task_alloc.solver.problem import UNASSIGNED_LEGS, Problem
from uav_task_alloc.solver.recombine import classes_of, recombine, repack
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

WORK = 150.0  # stops of the pool read by `recombine` per round of the whole search
# times the first cost of an unassigned task: what one costs there at least. At that first cost, as
# in a search that passes to and fro, combinations that serve fewer tasks are often the cheapest
RECOMBINED_COST = 3.0
MANY_LEFT_OUT = 0.05  # share of tasks from which on few UAVs choose among all columns


class Cooling(NamedTuple):
    """A part of a search at falling temperatures, which begins at the best routes so far."""

    begin: float  # share of the budget after which it begins
    first: float  # temperature then
    last: float  # temperature at its end


COOLINGS = Cooling(0.0, 3.0, 0.1), Cooling(0.45, 1.0, 0.1), Cooling(0.92, 0.1, 0.1)


@dataclass(frozen=True, slots=True)
class ColonyParams:
    """Parameters of a colony; temperatures in mean leg lengths to the nearest neighbour."""

    coolings: tuple[Cooling, ...] = COOLINGS  # one after the other
    heats: bool = False  # COOLINGS begin at more where routes return to bases far away
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
    # tasks may have to be left out: no search is spent on those out of reach, and temperatures
    # follow the cost of leaving one out, until all within reach are served
    selects: bool = False
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
        self._scratch, self._cooling = copy(start), 0
        few = params.selects and arrays.uavs <= MOST_PACKED
        self._classes = classes_of(arrays) if few else np.arange(arrays.uavs)
        self._pool = empty_pool(arrays, self._classes)
        self._rng, self._log = rng_state(seed), empty_log(arrays)
        self.scouts = Scouts(problem, self.arrays, self._rng, learnt, params.learning)
        self._scale, self._coolings = problem.scale, params.coolings
        self._unit = problem.scale  # [m] of a temperature of 1
        self._complete = math.inf  # value of all tasks, while some may have to be left out
        floors = {'employed': params.employed, 'onlooker': params.onlookers,
                  'scout': params.scouts}
        self._bids = Bidding({kind: floor for kind, floor in floors.items() if floor > 0.0})
        if arrays.hard:
            self.arrays.range_penalty[:] = params.range_penalty
        self._log.settings[:] = (params.skipped, params.by_value, params.least_rounds,
                                 params.most_penalty, params.string_floor)
        if params.selects:
            self._select(out_of_reach(problem))
        elif params.heats:
            self._coolings = self._heated(0.0)
        self._recombined_cost = RECOMBINED_COST * self.arrays.unassigned_cost

    def _select(self, out: NDArray[np.bool_]) -> None:
        """Spend no search on tasks out of reach; let temperatures follow the cost of the others.

        Where bases are far, a task costs more than its legs to its neighbours to leave out, and at
        temperatures of these legs the first choice of tasks would hardly change.
        """
        a = self.arrays
        a.unassigned_cost[out] = 0.0
        update_sums(a, self.best)
        if not out.all():
            self._unit = float(a.unassigned_cost[~out].mean()) / UNASSIGNED_LEGS
            self._complete = float(a.value[~out].sum()) * (1.0 - 1e-9)

    def _heated(self, spent: float) -> tuple[Cooling, ...]:
        """COOLINGS for what is left of the budget; temperatures in self._scale.

        Where routes return to bases far away, it costs about a leg from there to see whether one
        route less is shorter.
        """
        first = self.arrays.start_length[:, 0]
        finite, heat = first[np.isfinite(first)], 1.0
        if self.params.heats and self.arrays.returns and finite.size:
            heat = max(1.0, float(finite.mean()) / (COOLINGS[0].first * self._scale))
        return tuple(each._replace(begin=spent + (1.0 - spent) * each.begin,
                                   first=each.first * (heat if each.first > each.last else 1.0))
                     for each in COOLINGS)

    def _all_served(self, spent: float) -> None:
        """Go on from the best, which serves all tasks within reach, to shorter routes."""
        self._complete, self._unit, self._cooling = math.inf, self._scale, 0
        self._coolings = self._heated(spent)
        update_sums(self.arrays, self.best)
        copy_into(self.best, self.routes)

    def temperature(self, spent: float) -> float:
        """Temperature [m] after this share of the budget."""
        begin, first, last = self._coolings[self._cooling]
        share = min(1.0, max(0.0, (spent - begin) / (self._next_cooling(1.0) - begin)))
        return float(self._unit * first * (last / first) ** share)

    def _next_cooling(self, default: float) -> float:
        """Share of the budget after which the next cooling begins; the default: there is none."""
        later = self._coolings[self._cooling + 1:]
        return later[0].begin if later else default

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
        if self.best.sums[VALUE] >= self._complete:
            self._all_served(spent)
        if until > self._next_cooling(math.inf) and spent > 0.0:
            while until > self._next_cooling(math.inf):
                self._cooling += 1
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
        few = a.uavs <= MOST_PACKED and (self.params.selects or float(
            np.mean(self.best.uav_of[a.uavs:a.ends] < 0)) > MANY_LEFT_OUT)
        found = (repack(raised, self.best, self._pool, self._classes, work, self._scratch) if few
                 else recombine(raised, self.best, self._pool, work, self._scratch))
        if found and is_better(a, self._scratch, self.best):
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
