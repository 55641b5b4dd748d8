# SPDX-License-Identifier: Apache-2.0
"""A colony for problems with time: bees that ruin and recreate routes of their own."""
from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import chain

import numpy as np

from uav_task_alloc.solver.colony import WORK
from uav_task_alloc.solver.rng import rng_state
from uav_task_alloc.solver.ruin import BLINK_RATE
from uav_task_alloc.solver.timed import columns as at
from uav_task_alloc.solver.timed.intensify import Intensifier, fly_instead, is_large
from uav_task_alloc.solver.timed.order import set_order
from uav_task_alloc.solver.timed.problem import (
    MAX_UNSERVED_GROWTH,
    TimedProblem,
    empty_timed_routes,
)
from uav_task_alloc.solver.timed.rebuild import rebuild
from uav_task_alloc.solver.timed.round import empty_round
from uav_task_alloc.solver.timed.route_pool import combined, may_combine, route_pool
from uav_task_alloc.solver.timed.search import Incumbent, Rises, anneal, copy_incumbent
from uav_task_alloc.solver.timed.ways import TURN_BIT

LEAST_PRICE, MOST_PRICE = 0.1, 100.0  # of excess, over the first price
DECISION = 0.02  # share of the budget after which the rounds in all are estimated
# share after which a search through excess ends that found nothing better; temperature then
GIVING_UP, GIVEN_UP = 0.6, 1.0
# rounds a task from which on passing through excess pays: where durations or trips are limited,
# and where only windows and loads are
PRICED_ROUNDS, PRICED_WINDOW_ROUNDS = 200.0, 1500.0
MOST_EARLY = 0.5  # share of the last end of a route: no end before that counts
FRESH_ROUNDS = 15.0  # rounds a task from which on a second search from new routes pays
LABELS_FROM = 0.6  # least share of the budget after which routes are rebuilt by labels
LABELS_A_ROUND = 0.5  # that may be made then for each round of search
# probability that a place is passed over where there are at most FEW_TASKS, not BLINK_RATE: the
# cheapest places of all of them are soon the same in each round
FEW_TASKS, FEW_BLINKS = 10, 0.1

Coolings = tuple[tuple[float, float], ...]


@dataclass(frozen=True, slots=True)
class TimedParams:
    """Parameters of a colony; temperatures in mean legs to the nearest neighbour."""

    # share of the budget from which on the search goes on from its best, temperature then
    coolings: Coolings = ((0.0, 10.0),)
    pool_coolings: Coolings = ()  # in place of them where routes are combined
    end_temperature: float = 0.1  # of each
    short_end_temperature: float = 0.3  # the same where there are few rounds
    ruin: float = 15.0  # tasks that a round removes
    first_price: float = 3.0  # of a second, metre or mean load of excess, in what one costs to fly
    absent: int = 10  # absent tasks that a round tries to insert, besides those it removes
    skipped: float = 0.0  # probability that a round passes over one of them
    by_value: float = 0.0  # share of rounds that insert about the most valuable tasks first
    least_price: float = 0.0  # of a task after a cooling, over what served ones cost by value
    nearly_last: float = 3.0  # temperatures before the last end of a route from which all count
    unserved_growth: float = 1.3  # factor by which the price of few absent tasks rises
    by_gaps: bool = False  # TimedArrays.gaps; so it is where tasks have prizes
    by_labels: bool = False  # the best routes are rebuilt by labels
    intensifies: bool = False  # where there are many tasks, also as an Intensifier does


COLD = TimedParams(intensifies=True)
# where many tasks have to be left out: the choice of tasks, more than their order
SELECTION = TimedParams(coolings=((0.0, 60.0), (0.6, 6.0)), end_temperature=1.3,
                        pool_coolings=((0.0, 60.0), (0.25, 60.0), (0.45, 60.0), (0.65, 60.0),
                                       (0.85, 10.0), (0.95, 1.3), (0.985, 1.3)),
                        short_end_temperature=1.3, ruin=10.0, skipped=0.3, by_value=0.3,
                        least_price=10.0, by_gaps=True, by_labels=True, first_price=math.inf)
WARM = TimedParams(coolings=((0.0, 0.3),), end_temperature=0.02,
                   short_end_temperature=0.02, first_price=math.inf)
# many tasks are new: half of the time each from the earlier routes, and from new ones
WARM_AND_FRESH = replace(WARM, coolings=(*WARM.coolings, (0.5, COLD.coolings[0][1])))


class TimedColony:
    """Bees with routes of their own; `best` is the best of them.

    Args:
        problem: what is solved.
        start: the first routes.
        seed: of the random numbers.
        params: of the colony.
        begin: other routes, which a search with the parameters WARM_AND_FRESH goes on from in its
            second half, where there are enough rounds for it.
    """

    def __init__(self, problem: TimedProblem, start: Incumbent, seed: int,
                 params: TimedParams, begin: Incumbent | None = None) -> None:
        arrays = problem.arrays
        gaps = (params.by_gaps or problem.prizes) and arrays.visits == 0
        self.arrays = arrays._replace(price=arrays.price.copy(), unserved=arrays.unserved.copy(),
                                      weight=arrays.weight.copy(), gaps=gaps)
        self.best = copy_incumbent(start)
        if not problem.prizes:
            self._let_none_be_cheap(start)
        self._params, self._scale = params, problem.scale
        self._goal, self._decided = problem.base.rules.objective, False
        self.routes = empty_timed_routes(self.arrays)
        set_order(self.arrays, self.routes, start.order)
        self._begin, self._base = begin, problem.base.arrays
        held = chain.from_iterable(problem.base.locked.values())
        self._pool = route_pool(self._base, bool(params.pool_coolings) and may_combine(
            problem.base.uavs, (*problem.base.tasks, *held), problem.base.rules))
        self._coolings = params.pool_coolings if self._pool.uav.size else params.coolings
        self._price, self._flown = arrays.price, 0
        self._gains = 1  # improvements, from when on excess is allowed
        self._cooling, self._rebuilt = 0, False
        self._end_temperature = params.end_temperature
        self._round, self._rng = empty_round(self.arrays), rng_state(seed)
        tasks = arrays.ends - arrays.uavs
        growth = 1.0 if problem.prizes else params.unserved_growth
        self._intensifier = (Intensifier(problem, self.arrays)
                             if params.intensifies and is_large(problem) else None)
        self._rises = Rises(np.full(4, math.inf), np.full(4, math.inf), growth,
                            MAX_UNSERVED_GROWTH * arrays.unserved, params.absent,
                            params.skipped, params.by_value,
                            FEW_BLINKS if tasks <= FEW_TASKS else BLINK_RATE, problem.prizes)

    def _let_none_be_cheap(self, start: Incumbent) -> None:
        """Where all tasks are served, let each cost as much to leave out as the most valuable.

        One of little value would cost less than to serve it, and no plan without it is better.
        """
        a, nodes = self.arrays, np.arange(self.arrays.uavs, self.arrays.ends)
        prices = a.unserved[start.order[nodes] & ~TURN_BIT != nodes]
        if prices.size and prices.size == np.count_nonzero(a.unserved):
            np.maximum(a.unserved, prices.max(), out=a.unserved, where=a.unserved > 0.0)

    def _allow_excess(self) -> None:
        """Set prices of excess, which the best has none of, where it is not allowed so far."""
        a, goal = self.arrays, self._goal
        pace, loads = float(a.pace[:, 0].min()), a.fixed[a.uavs:a.ends, at.LOAD]
        second = max(1e-9, goal.distance / pace + (goal.finish + goal.response) / a.uavs)
        load = self._scale / float(loads[loads > 0.0].mean()) if loads.any() else 1.0
        first = self._params.first_price * np.array([second, load, second * pace, second * pace])
        first[~np.isinf(a.price)] = math.inf  # excess that is allowed keeps its own price
        np.copyto(a.price, first, where=np.isfinite(first))
        self._rises = self._rises._replace(least=LEAST_PRICE * first, most=MOST_PRICE * first)
        self._gains = 0

    def _forbid_excess(self) -> None:
        """Go on from the best without excess: windows may be too tight for it."""
        np.copyto(self.arrays.price, self._price)
        self._rises = self._rises._replace(least=np.full(4, math.inf), most=np.full(4, math.inf))
        self._coolings, self._gains = (*self._coolings[:1], (GIVING_UP, GIVEN_UP)), 1

    def _raise_prices(self) -> None:
        """Let a task left out cost much more than those served cost, each by its value.

        Its first price follows the legs between neighbours, which are short where tasks lie in
        clusters: routes that serve less value could cost less than those that serve more, and the
        temperatures, which follow those legs too, are low. Both rise by the same factor.
        """
        a, (cost, worth, *_) = self.arrays, self.best.score.tolist()
        some = a.unserved > 0.0
        if self._params.least_price > 0.0 and worth > 0.0 and some.any():
            rows, before = a.fixed[a.uavs:a.ends], a.unserved[some].sum()
            least = self._params.least_price * cost / worth * rows[:, at.WORTH]
            least += rows[:, at.WEIGHT] * rows[:, at.ANNOUNCED]  # as at first
            np.maximum(a.unserved, least, out=a.unserved, where=some)
            np.maximum(self._rises.max_unserved, a.unserved, out=self._rises.max_unserved)
            self._scale *= float(a.unserved[some].sum() / before)

    def _intensify(self, intensifier: Intensifier, spent: float) -> None:
        """Improve the routes after this share of the budget, apart from rounds of search."""
        if intensifier.is_due(spent):
            intensifier.recombine(self.best, self.routes, self._flown / spent)
        intensifier.improve(self.routes, self._round, spent)

    def _temperature(self, spent: float) -> float:
        """Temperature in cost after this share of the budget."""
        began, first = self._coolings[self._cooling]
        share = min(1.0, (spent - began) / (self._next_cooling(1.0) - began))
        return float(self._scale * first * (self._end_temperature / first) ** share)

    def _next_cooling(self, default: float) -> float:
        """Share of the budget after which the next cooling begins."""
        later = self._coolings[self._cooling + 1:]
        return later[0][0] if later else default

    def _restart(self, spent: float) -> None:
        """Begin the next cooling from the best, with higher prices and better combinations."""
        while spent >= self._next_cooling(math.inf):
            self._cooling += 1
        self._raise_prices()
        if self._begin is not None:
            self._end_temperature = COLD.short_end_temperature
        set_order(self.arrays, self.routes, (self._begin or self.best).order)
        if self._pool.size[0] > 0:
            found = combined(self.arrays, self._base, self.routes, self._pool,
                             WORK * self._flown / spent)
            if found is not None:
                fly_instead(self.arrays, found, self._rises.prizes, self.best, self.routes)
        if self._params.by_labels and spent >= LABELS_FROM and not self._rebuilt:
            self._rebuilt = True
            rebuild(self.arrays, self.routes, self.best, self._rises.prizes,
                    self._flown / spent * LABELS_A_ROUND)

    def _lead_to_early_ends(self, temperature: float) -> None:
        """Let the search count all ends that are nearly the last one, as columns.py defines.

        A route that ends last is often one of several: to shorten one of them alone gains nothing.
        Not where tasks may be left out, served late or beyond a range at a price: with all these
        ends that price would be too low.
        """
        weight, ends = self.arrays.weight, self.routes.route[:, at.END]
        priced = (self._rises.prizes or weight[at.BY_LATENESS] > 0.0
                  or weight[at.BY_EXCESS] < math.inf)
        if weight[at.BY_FINISH] > 0.0 and not priced:
            early = self._params.nearly_last * temperature / weight[at.BY_FINISH]
            weight[at.FINISH_FROM] = ends.max() - min(early, MOST_EARLY * ends.max())
            self.routes.sums[at.BEYOND] = np.maximum(0.0, ends - weight[at.FINISH_FROM]).sum()

    def fly(self, spent: float, until: float, rounds: int) -> int:
        """Run rounds of search.

        Args:
            spent: share of the budget used so far.
            until: share used after them, for the temperatures.
            rounds: their number.

        Returns:
            That number.
        """
        if not self._decided and spent >= DECISION:
            self._decided = True
            tasks = self.arrays.ends - self.arrays.uavs
            if self._begin is not None and self._flown / spent < FRESH_ROUNDS * tasks:
                self._params, self._coolings, self._begin = WARM, WARM.coolings, None
            least = PRICED_ROUNDS if self.arrays.whole else PRICED_WINDOW_ROUNDS
            if (self._flown / spent >= least * tasks
                    and math.isfinite(self._params.first_price)):
                self._allow_excess()
            else:
                self._end_temperature = self._params.short_end_temperature
        if self._gains == 0 and spent >= GIVING_UP:
            self._forbid_excess()
        if spent >= self._next_cooling(math.inf):
            self._restart(spent)
        if self._intensifier:
            self._intensify(self._intensifier, spent)
        self._lead_to_early_ends(self._temperature(spent))
        self._gains += anneal(self.arrays, self.routes, self._round, self.best, self._pool,
                              self._rises, self._params.ruin, self._temperature(spent),
                              self._temperature(until), rounds, self._rng)
        self._flown += rounds
        return rounds
