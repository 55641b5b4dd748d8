# SPDX-License-Identifier: Apache-2.0
"""Recombination with time: the best combination of what was seen, with no UAV too many."""
import math
from itertools import combinations

import numpy as np
import pytest
from test_tails import names, set_routes, timed

from uav_task_alloc.model import Task, Uav
from uav_task_alloc.objective import Objective
from uav_task_alloc.solver.problem import Rules
from uav_task_alloc.solver.rng import rng_state
from uav_task_alloc.solver.solve import plan
from uav_task_alloc.solver.timed import columns as at
from uav_task_alloc.solver.timed.arrays import LINK
from uav_task_alloc.solver.timed.insertion import insert_in_order
from uav_task_alloc.solver.timed.intensify import MANY_TASKS, Intensifier, is_large, may_be_large
from uav_task_alloc.solver.timed.order import route_order
from uav_task_alloc.solver.timed.problem import empty_timed_routes
from uav_task_alloc.solver.timed.recombine import (
    collect_timed,
    empty_timed_pool,
    recombined,
)
from uav_task_alloc.solver.timed.search import BEST_COST, empty_incumbent

WORK = 1e8


def two_bases(seed, tasks=8):
    """Three UAVs at one base, one at another, tasks with windows and loads between them."""
    rng = np.random.default_rng(seed)
    fleet = [Uav(f'u{i}', (0.0 if i < 3 else 1500.0, 0.0, 0.0), payload_capacity=4.0)
             for i in range(4)]
    opens = rng.uniform(0.0, 300.0, tasks)
    work = [Task(f't{i}', (*rng.uniform(0.0, 1500.0, 2), 0.0), earliest=opens[i],
                 latest=opens[i] + 300.0, payload=1.0) for i in range(tasks)]
    return timed(fleet, work)


def some_routes(problem, rng):
    """All tasks inserted in random order; some of them may have no place."""
    a, routes = problem.arrays, empty_timed_routes(problem.arrays)
    insert_in_order(a, routes, rng.permutation(np.arange(a.uavs, a.ends)), False, 1 << 40,
                    rng_state(0))
    return routes


def pool_of(problem, seen):
    pool = empty_timed_pool(problem.arrays, problem.base.arrays)
    for routes in seen:
        assert collect_timed(problem.arrays, routes, pool)
    return pool


def cost(problem, routes):
    a = problem.arrays
    empty = a.weight[at.BY_DISTANCE] * a.begin[:, at.EMPTY_LENGTH].sum()
    return (a.weight[at.BY_DISTANCE] * routes.sums[at.METRES] - empty
            + routes.sums[at.UNSERVED_COST])


def least_cost(problem, rows):
    """The least cost of columns without a common task, of no class more than it has UAVs.

    rows: of each column its cost, class and tasks by index.
    """
    a, least, members = problem.arrays, math.inf, np.diff(problem.arrays.first_member)
    for count in range(a.uavs + 1):
        for chosen in combinations(rows, count):
            served = frozenset[int]().union(*(row[2] for row in chosen))
            used = np.bincount([row[1] for row in chosen], minlength=len(members))
            if len(served) == sum(len(row[2]) for row in chosen) and (used <= members).all():
                least = min(least, sum(row[0] for row in chosen) + sum(
                    a.unserved[i] for i in range(a.ends - a.uavs) if i not in served))
    return least


def cheapest(problem, timed_pool):
    """The least cost of the columns of a pool."""
    pool, ends = timed_pool.pool, problem.arrays.ends
    return least_cost(problem, [
        (pool.cost[e], int(timed_pool.class_of[e]),
         frozenset((pool.stops[pool.first[e]:pool.first[e + 1]] - ends).tolist()))
        for e in range(pool.size[0])])


@pytest.mark.parametrize('seed', range(6))
def test_it_finds_the_best_combination(seed):
    problem, rng = two_bases(seed), np.random.default_rng(seed)
    seen = [some_routes(problem, rng) for _ in range(5)]
    pool = pool_of(problem, seen)
    optimum = cheapest(problem, pool)
    for routes in seen:
        found = recombined(problem.arrays, problem.base.arrays, routes, pool, WORK)
        if found is not None:
            tasks = problem.base.tasks
            routes = set_routes(problem, {
                uav.id: [tasks[t - problem.arrays.uavs].id for t in row]
                for uav, row in zip(problem.base.uavs, found, strict=True)})
        assert cost(problem, routes) == pytest.approx(optimum)
        assert routes.counts[at.INFEASIBLE] == 0


def test_uavs_that_are_alike_may_fly_each_others_routes_but_no_more_than_there_are():
    fleet = [Uav(name, (0.0, 0.0, 0.0), payload_capacity=2.0) for name in 'abc']
    work = [Task(f'{side}{i}', (x, 300.0 * i, 0.0), latest=1e4, payload=1.0)
            for side, x in (('w', -900.0), ('m', 0.0), ('e', 900.0)) for i in (1, 2)]
    good = {'w': ('w1', 'w2'), 'm': ('m1', 'm2'), 'e': ('e1', 'e2')}
    for uavs in (3, 2):
        problem = timed(fleet[:uavs], work)
        seen = [set_routes(problem, {'a': row}) for row in good.values()]  # all flown by the first
        worse = set_routes(problem, dict(zip('abc', (
            ('w1', 'm2'), ('w2', 'm1'), ('e1', 'e2')), strict=True)))
        found = recombined(problem.arrays, problem.base.arrays, worse,
                           pool_of(problem, seen), WORK)
        if uavs == 2:  # the best combination takes three: it is not flown
            assert found is None
        else:
            flown = {frozenset(work[t - uavs].id for t in row) for row in found if row}
            assert flown == {frozenset(row) for row in good.values()}


def test_who_flies_one_of_the_routes_that_are_kept_goes_on_with_it():
    fleet = [Uav(name, (0.0, 0.0, 0.0)) for name in 'abc']
    work = [Task(f'{side}{i}', (x, 300.0 * i, 0.0), latest=1e4)
            for side, x in (('w', -900.0), ('m', 0.0), ('e', 900.0)) for i in (1, 2)]
    problem = timed(fleet, work)
    good = set_routes(problem, {'a': ('w1', 'w2'), 'b': ('m1', 'm2'), 'c': ('e1', 'e2')})
    worse = set_routes(problem, {'a': ('m1', 'w2'), 'b': ('m2', 'w1'), 'c': ('e1', 'e2')})
    found = recombined(problem.arrays, problem.base.arrays, worse, pool_of(problem, [good]), WORK)
    assert [work[t - 3].id for t in found[2]] == ['e1', 'e2']


def test_the_search_goes_on_from_what_was_recombined():
    problem = two_bases(1)
    rng = np.random.default_rng(1)
    intensifier = Intensifier(problem, problem.arrays)
    seen = [some_routes(problem, rng) for _ in range(9)]
    a, best, routes = problem.arrays, empty_incumbent(problem.arrays), None
    worst = max(seen, key=lambda each: cost(problem, each))
    route_order(a, worst, best.order)
    best.score[:2] = cost(problem, worst), worst.sums[at.SERVED_WORTH]
    for each in seen:
        collect_timed(a, each, intensifier._pool)
    routes = empty_timed_routes(a)
    before = best.score[BEST_COST]
    intensifier.recombine(best, routes, 1e6)
    assert best.score[BEST_COST] < before
    order = np.zeros(best.order.size, LINK)
    route_order(a, routes, order)
    assert order.tolist() == best.order.tolist()
    assert any(names(problem, routes).values())


def test_it_is_for_many_tasks_single_trips_and_costs_that_add_up_by_route():
    fleet = [Uav('u', (0.0, 0.0, 0.0), turnaround=5.0)]
    work = [Task(f't{i}', (1.0 + i, 0.0, 0.0), latest=1e6) for i in range(MANY_TASKS)]
    assert is_large(timed(fleet, work))
    assert not is_large(timed(fleet, work[:-1]))
    assert not is_large(timed(fleet, work, trips=2))
    assert not is_large(timed(fleet, work, objective=Objective(finish=1.0)))
    assert may_be_large(work, Rules())
    assert not may_be_large(work[:-1], Rules())
    assert not may_be_large(work, Rules(objective=Objective(finish=1.0)))


def test_a_plan_of_many_tasks_is_valid_and_repeatable():
    rng = np.random.default_rng(3)
    fleet = [Uav(f'u{i}', (0.0, 0.0, 0.0), payload_capacity=12.0) for i in range(40)]
    opens = rng.uniform(0.0, 600.0, MANY_TASKS)
    work = [Task(f't{i}', (*rng.uniform(-2000.0, 2000.0, 2), 0.0), earliest=opens[i],
                 latest=opens[i] + 400.0, payload=1.0) for i in range(MANY_TASKS)]
    first, again = (plan(fleet, work, budget=60.0, max_iterations=3000, route_end='home', seed=5)
                    for _ in range(2))
    assert not first.unassigned
    assert first.routes == again.routes
