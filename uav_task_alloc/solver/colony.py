# SPDX-License-Identifier: Apache-2.0
"""A colony of bees on one thread: scouts construct, employed and onlooker bees search."""
from __future__ import annotations

from dataclasses import dataclass

from uav_task_alloc.solver import routes as of
from uav_task_alloc.solver.bidding import Bidding
from uav_task_alloc.solver.pool import empty_pool
from uav_task_alloc.solver.problem import Problem
from uav_task_alloc.solver.recombine import recombine
from uav_task_alloc.solver.rng import chance
from uav_task_alloc.solver.routes import EXCESS, TINY, VALUE, Routes
from uav_task_alloc.solver.ruin import empty_log
from uav_task_alloc.solver.scouts import Scouts
from uav_task_alloc.solver.search import relieve, search

PHASES = (0.0, 0.45, 0.92, 1.0)  # shares of the budget at which bees cool, cool again, stay cold
WORK = 150.0  # looks at stops of the pool for each round of the whole search


@dataclass(frozen=True, slots=True)
class ColonyParams:
    """How bees behave; temperatures in mean ways to the nearest neighbour."""

    hot: float = 3.0
    cold: float = 0.1
    again: float = 1.0  # the second time they begin to cool here
    some: float = 10.0  # tasks that an employed bee takes out in a round
    many: float = 20.0  # an onlooker
    employed: float = 0.5  # least shares of the work
    onlookers: float = 0.2
    scouts: float = 0.01
    strain: float = 5.0  # [m/m] what a metre beyond range costs at first
    learning: bool = True  # False: Q stays as it is
    bids: bool = True  # False: kinds keep their first shares


class Colony:
    """Bees around routes of their own; `best` is what they found."""

    def __init__(self, problem: Problem, start: Routes, seed: int, habits: ColonyParams,
                 learnt: object = None) -> None:
        arrays = problem.arrays
        self.arrays = arrays._replace(strain=arrays.strain.copy(), price=arrays.price.copy())
        self.habits, self.best, self.routes = habits, of.twin(start), of.twin(start)
        self._spare, self._phase = of.twin(start), 0
        self._pool = empty_pool(arrays)
        self._rng, self._log = chance(seed), empty_log(arrays)
        self.scouts = Scouts(problem, self.arrays, self._rng, learnt, habits.learning)
        self._scale = problem.scale
        floors = {'employed': habits.employed, 'onlooker': habits.onlookers,
                  'scout': habits.scouts}
        self._bids = Bidding({kind: floor for kind, floor in floors.items() if floor > 0.0})
        if arrays.hard:
            self.arrays.strain[:] = habits.strain

    def temperature(self, spent: float) -> float:
        """[m] after this share of the budget."""
        h, begin, end = self.habits, PHASES[self._phase], PHASES[self._phase + 1]
        hot = (h.hot, h.again, h.cold)[self._phase]
        share = min(1.0, max(0.0, (spent - begin) / (end - begin)))
        return float(self._scale * hot * (h.cold / hot) ** share)

    def fly(self, spent: float, until: float, rounds: int) -> int:
        """Let the kind that bid most fly while the budget goes from `spent` to `until`.

        Returns the rounds of search that took place.
        """
        h = self.habits
        if until > PHASES[self._phase + 1] and spent > 0.0:
            self._phase += 1
            self._go_home(WORK * rounds / max(1e-6, until - spent))
        costs = {'employed': rounds * h.some, 'onlooker': rounds * h.many,
                 'scout': self.scouts.work / 5.0}
        kind = self._bids.next({each: costs[each] for each in self._bids.shares()})
        before = of.cost_now(self.arrays, self.best)
        hot, cold = self.temperature(spent), self.temperature(until)
        if kind == 'scout':
            self.scouts.fly(self.best)
        elif kind == 'employed':
            self._search(self.routes, h.some, hot, cold, rounds)
        else:
            self._search(self.routes, h.many, hot, cold, rounds)
        self._salvage()
        gain = before - of.cost_now(self.arrays, self.best)
        self._bids.pay(kind, costs[kind], max(0.0, gain) if h.bids else 0.0)
        return 0 if kind == 'scout' else rounds

    def _go_home(self, work: float) -> None:
        """Go on from the best, after a look for something shorter in the pool."""
        a = self.arrays
        if recombine(a, self.best, self._pool, work, self._spare) and (
                of.better_now(a, self._spare, self.best)):
            of.copy(self._spare, self.best)
        of.copy(self.best, self.routes)
        of.total(a, self.routes)  # strain and prices have changed since

    def _salvage(self) -> None:
        """Where the best leaves tasks out, see what the routes are worth within ranges."""
        a = self.arrays
        if a.hard and self.best.sums[VALUE] < self.routes.sums[VALUE] and (
                self.routes.sums[EXCESS] > a.excess_floor + TINY):
            of.copy(self.routes, self._spare)
            relieve(a, self._spare)
            if of.better_now(a, self._spare, self.best):
                of.copy(self._spare, self.best)

    def _search(self, routes: Routes, mean: float, hot: float, cold: float, rounds: int) -> int:
        a = self.arrays
        found = int(search(a, routes, self.best, self._log, self._pool, mean, hot, cold,
                           rounds, self._rng))
        return found
