# SPDX-License-Identifier: Apache-2.0
"""The pool of a search of few UAVs: the best combination of what was seen, UAVs alike or not."""
import numpy as np
import pytest
from test_tails import names, set_routes, timed
from test_timed_recombine import least_cost, some_routes, two_bases

from uav_task_alloc.model import Task, Uav
from uav_task_alloc.objective import Objective
from uav_task_alloc.solver.colony import RECOMBINED_COST
from uav_task_alloc.solver.packing import MOST_PACKED
from uav_task_alloc.solver.pool import MAX_COLUMNS
from uav_task_alloc.solver.problem import Limits, Rules, make_problem
from uav_task_alloc.solver.timed import columns as at
from uav_task_alloc.solver.timed.colony import COLD, SELECTION, TimedColony
from uav_task_alloc.solver.timed.order import route_order
from uav_task_alloc.solver.timed.problem import empty_timed_routes, make_timed
from uav_task_alloc.solver.timed.recombine import cost_of_route
from uav_task_alloc.solver.timed.route_pool import (
    collect_routes,
    combined,
    may_combine,
    route_pool,
)
from uav_task_alloc.solver.timed.search import BEST_WORTH
from uav_task_alloc.solver.timed.warm import first_plan
from uav_task_alloc.solver.warm import WarmState

WORK = 1e8


def pool_of(problem, seen):
    pool = route_pool(problem.base.arrays, True)
    for routes in seen:
        collect_routes(problem.arrays, routes, pool)
    return pool


def cost(problem, routes):
    a = problem.arrays
    return sum(cost_of_route(a, routes, u) for u in range(a.uavs)) + routes.sums[at.UNSERVED_COST]


def cheapest(problem, pool):
    """The least cost of the columns of a pool."""
    a = problem.arrays
    return least_cost(problem, [
        (pool.cost[e], int(a.class_of[pool.uav[e]]),
         frozenset((pool.stops[pool.first[e]:pool.first[e + 1]] - a.uavs).tolist()))
        for e in range(pool.size[0])])


def flown(problem, found):
    """Routes of these nodes by UAV."""
    tasks = problem.base.tasks
    return set_routes(problem, {uav.id: [tasks[t - problem.arrays.uavs].id for t in row]
                                for uav, row in zip(problem.base.uavs, found, strict=True)})


@pytest.mark.parametrize('seed', range(10))
def test_it_finds_the_best_combination(seed):
    problem, rng = two_bases(seed, 12), np.random.default_rng(seed)
    assert np.diff(problem.arrays.first_member).tolist() == [3, 1]
    seen, gains = [some_routes(problem, rng) for _ in range(4)], 0
    pool = pool_of(problem, seen)
    optimum = cheapest(problem, pool)
    for routes in (*seen, empty_timed_routes(problem.arrays)):
        found = combined(problem.arrays, problem.base.arrays, routes, pool, WORK)
        if found is not None:
            before, routes = cost(problem, routes), flown(problem, found)
            assert cost(problem, routes) < before
            gains += 1
        assert cost(problem, routes) == pytest.approx(optimum)
        assert routes.counts[at.INFEASIBLE] == 0
    assert gains


def sides():
    """Three UAVs that are alike, and the routes of a good plan: a pair of tasks on each side."""
    fleet = [Uav(name, (0.0, 0.0, 0.0), payload_capacity=2.0) for name in 'abc']
    work = [Task(f'{side}{i}', (x, 300.0 * i, 0.0), latest=1e4, payload=1.0)
            for side, x in (('w', -900.0), ('m', 0.0), ('e', 900.0)) for i in (1, 2)]
    return timed(fleet, work), (('w1', 'w2'), ('m1', 'm2'), ('e1', 'e2'))


def test_uavs_that_are_alike_may_fly_each_others_routes():
    problem, good = sides()
    seen = [set_routes(problem, {'a': row}) for row in good]  # all flown by the first
    pool = pool_of(problem, [*seen, *seen])
    assert pool.size[0] == 3
    worse = set_routes(problem, dict(zip('abc', (
        ('w1', 'm2'), ('w2', 'm1'), ('e1', 'e2')), strict=True)))
    found = combined(problem.arrays, problem.base.arrays, worse, pool, WORK)
    assert {*map(tuple, names(problem, flown(problem, found)).values())} == {*good}
    assert combined(problem.arrays, problem.base.arrays, flown(problem, found), pool, WORK) is None
    assert combined(problem.arrays, problem.base.arrays, worse, pool, 0.0) is None  # no work


@pytest.mark.parametrize('share', [0.5, 0.2])  # of what the way to a task costs, of its price
def test_a_combination_that_serves_more_is_found_at_a_low_price(share):
    problem, good = sides()
    a, less = problem.arrays, set_routes(problem, {'a': good[0], 'b': good[1], 'c': ('e1',)})
    way = cost_of_route(a, set_routes(problem, {'c': good[2]}), 2) - cost_of_route(a, less, 2)
    a.unserved[:-1], a.unserved[-1] = 1e5, share * way
    less = set_routes(problem, {'a': good[0], 'b': good[1], 'c': ('e1',)})
    pool = pool_of(problem, [less, set_routes(problem, {'c': good[2]})])
    found = combined(a, problem.base.arrays, less, pool, WORK)
    if share * RECOMBINED_COST > 1.0:
        assert {*map(tuple, names(problem, flown(problem, found)).values())} == {*good}
    else:
        assert found is None


def test_the_search_goes_on_from_a_better_combination():
    problem, good = sides()
    colony = TimedColony(problem, first_plan(problem, WarmState())[0], 0, SELECTION)
    a, worse = colony.arrays, set_routes(problem, {'a': good[0]})
    route_order(a, worse, colony.best.order)
    colony.best.score[:2] = cost(problem, worse), worse.sums[at.SERVED_WORTH]
    for row in good:
        collect_routes(a, set_routes(problem, {'b': row}), colony._pool)
    colony._flown = 10_000  # rounds, by which the work is limited
    colony.fly(0.3, 0.4, 0)
    assert colony.best.score[BEST_WORTH] == 6.0
    assert {*map(tuple, names(problem, colony.routes).values())} == {*good}


def test_a_search_collects_the_routes_that_it_flies():
    problem, _ = sides()
    colony = TimedColony(problem, first_plan(problem, WarmState())[0], 0, SELECTION)
    colony.fly(0.0, 0.2, 200)
    pool, a = colony._pool, colony.arrays
    assert 0 < pool.size[0] <= MAX_COLUMNS
    for e in range(pool.size[0]):
        row = pool.stops[pool.first[e]:pool.first[e + 1]]
        routes = set_routes(problem, {problem.base.uavs[pool.uav[e]].id: [
            problem.base.tasks[t - a.uavs].id for t in row]})
        assert pool.cost[e] == pytest.approx(cost_of_route(a, routes, pool.uav[e]))
        assert routes.counts[at.INFEASIBLE] == 0


def test_it_is_for_few_uavs_single_trips_and_costs_that_add_up_by_route():
    fleet = [Uav(f'u{i}', (0.0, 0.0, 0.0), turnaround=5.0) for i in range(MOST_PACKED + 1)]
    work = [Task(f't{i}', (1.0 + i, 0.0, 0.0), latest=1e6) for i in range(9)]
    line = [*work, Task('line', (0.0, 0.0, 0.0), path=((0.0, 0.0, 0.0), (9.0, 0.0, 0.0)))]
    for uavs, tasks, rules, expected in (
            (fleet[:2], work, {}, True), (fleet[:-1], work, {}, True), (fleet, work, {}, False),
            (fleet[:1], work, {}, False), (fleet[:2], line, {}, False),
            (fleet[:2], work, {'trips': 2}, False),
            (fleet[:2], work, {'objective': Objective(finish=1.0)}, False)):
        problem = timed(uavs, tasks, **rules)
        assert may_combine(uavs, tasks, Rules(**rules)) == expected
        assert _collects(problem, SELECTION) == expected
        assert not _collects(problem, COLD)
    locked = make_timed(make_problem(fleet[:2], line, {'u0': (line[-1],)}, Limits(), Rules()), {})
    assert not _collects(locked, SELECTION)


def _collects(problem, params):
    """Whether a search with these parameters collects its routes."""
    colony = TimedColony(problem, first_plan(problem, WarmState())[0], 0, params)
    collect_routes(problem.arrays, set_routes(problem, {'u0': ['t1']}), colony._pool)
    return bool(colony._pool.size[0] > 0)
