# SPDX-License-Identifier: Apache-2.0
"""What a search of many tasks with time does between its rounds: ends of routes, recombination."""
from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from uav_task_alloc.model import Task
from uav_task_alloc.solver.colony import WORK
from uav_task_alloc.solver.problem import Rules
from uav_task_alloc.solver.rng import rng_state
from uav_task_alloc.solver.timed import columns as at
from uav_task_alloc.solver.timed.arrays import LINK, TimedArrays, TimedRoutes, node_count
from uav_task_alloc.solver.timed.order import set_order
from uav_task_alloc.solver.timed.problem import TimedProblem
from uav_task_alloc.solver.timed.recombine import collect_timed, empty_timed_pool, recombined
from uav_task_alloc.solver.timed.round import Round
from uav_task_alloc.solver.timed.search import Incumbent
from uav_task_alloc.solver.timed.tails import exchange_tails
from uav_task_alloc.solver.timed.warm import LEAST_PLACES, fill_routes, no_routes

MANY_TASKS = 200  # tasks from which on it is worth to compile further kernels
TAIL_SHARE = 0.25  # of the tasks, at which ends of routes are exchanged after a flight
COLLECT_FROM = 0.5  # share of the budget from which on routes are collected
SHARES = (0.6, 0.75, 0.87, 0.97)  # of the budget, at which the best routes are recombined


def is_large(problem: TimedProblem) -> bool:
    """Whether a problem has many tasks, single trips, no paths, and costs that add up by route."""
    a = problem.arrays
    return bool(a.ends - a.uavs >= MANY_TASKS and a.visits == 0 and a.paths.ndim == 1
                and a.weight[at.BY_FINISH] == 0.0)


def may_be_large(tasks: Sequence[Task], rules: Rules) -> bool:
    """Whether is_large may hold for a problem with these tasks."""
    return (len(tasks) >= MANY_TASKS and rules.objective.finish == 0.0
            and not any(task.path for task in tasks))


class Intensifier:
    """Improves the routes of a colony, and collects them.

    Args:
        problem: a large one.
        arrays: the colony's own, with its prices.
    """

    def __init__(self, problem: TimedProblem, arrays: TimedArrays) -> None:
        self._arrays, self._base, self._prizes = arrays, problem.base.arrays, problem.prizes
        self._pool = empty_timed_pool(arrays, self._base)
        self._next, self._done = 0, 0

    def improve(self, routes: TimedRoutes, scratch: Round, spent: float) -> None:
        """Exchange ends of routes and collect the routes.

        Args:
            routes: the present ones of the search; are changed.
            scratch: is overwritten.
            spent: share of the budget used so far.
        """
        tasks = self._arrays.ends - self._arrays.uavs
        count = max(1, int(TAIL_SHARE * tasks))
        exchange_tails(self._arrays, routes, scratch, self._next, count)
        self._next = (self._next + count) % tasks
        if spent >= COLLECT_FROM:
            collect_timed(self._arrays, routes, self._pool)

    def is_due(self, spent: float) -> bool:
        """Whether the best routes are to be recombined after this share of the budget."""
        due = self._done < len(SHARES) and spent >= SHARES[self._done]
        self._done += due
        return due

    def recombine(self, best: Incumbent, routes: TimedRoutes, rounds: float) -> None:
        """Go on from the best routes, recombined with those collected if that is better.

        Args:
            best: is overwritten with what is better.
            routes: are overwritten with the best.
            rounds: of the whole search, about.
        """
        a = self._arrays
        set_order(a, routes, best.order)
        found = recombined(a, self._base, routes, self._pool, WORK * rounds)
        if found is None:
            return
        fly_instead(a, found, self._prizes, best, routes)


def fly_instead(a: TimedArrays, found: Sequence[Sequence[int]], prizes: bool, best: Incumbent,
                routes: TimedRoutes) -> None:
    """Keep other routes, with more tasks inserted where that is possible, if they are better.

    Args:
        a: the problem.
        found: task nodes by UAV.
        prizes: whether tasks may be left out because they are not worth their way.
        best: is overwritten with what is better.
        routes: are overwritten with the best.
    """
    order = np.arange(node_count(a)).astype(LINK)
    for u, tasks in enumerate(found):
        nodes = [u, *tasks, a.ends + u]
        order[nodes[:-1]] = nodes[1:]
    set_order(a, routes, order)
    every = np.arange(a.uavs, a.ends)
    fill_routes(a, routes, no_routes(a), every[order[a.uavs:a.ends] == every], prizes,
                LEAST_PLACES, best, rng_state(0))
    set_order(a, routes, best.order)
