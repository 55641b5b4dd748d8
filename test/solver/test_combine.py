# SPDX-License-Identifier: Apache-2.0
"""Routes put together anew: never wrong, and the best there is where all can be looked at."""
from itertools import product

import numpy as np
import pytest
from plan_checks import make

from uav_task_alloc.solver import combine as by, routes as of
from uav_task_alloc.solver.problem import Limits, Rules, make_problem
from uav_task_alloc.solver.warm import repaired

MUCH = 1e8


def problem(uavs=3, tasks=7, seed=1, reach=1e9, **rules):
    return make_problem(*make(uavs, tasks, seed, reach), {}, Limits(), Rules(**rules))


def some_routes(made, rng, leave=0):
    """Tasks at random on UAVs at random, all but a few."""
    a, routes = made.arrays, of.empty_routes(made.arrays)
    for t in rng.permutation(np.arange(a.uavs, a.ends))[leave:]:
        of_uav = rng.integers(a.uavs)
        of.insert(a, routes, of.NODE(t), routes.prev[a.ends + of_uav])
    of.total(a, routes)
    return routes


def cheapest(made, known):
    """The cost of the best choice of one remembered route or none for each UAV, by all of them."""
    a, rows = made.arrays, [[(0.0, ())] for _ in range(made.arrays.uavs)]
    for e in range(known.size[0]):
        rows[known.uav[e]].append((known.cost[e], tuple(
            known.stops[known.first[e]:known.first[e + 1]])))
    least = np.inf
    for chosen in product(*rows):
        stops = [t for _, row in chosen for t in row]
        if len(stops) == len(set(stops)):
            out = set(range(a.uavs, a.ends)) - set(stops)
            least = min(least, sum(cost for cost, _ in chosen)
                        + sum(a.price[t - a.uavs] for t in out))
    return least


@pytest.mark.parametrize('returns', [False, True])
@pytest.mark.parametrize('leave', [0, 2])
@pytest.mark.parametrize('seed', range(6))
def test_it_finds_the_best_of_all_that_was_remembered(seed, leave, returns):
    made, rng = problem(seed=seed, returns=returns), np.random.default_rng(seed)
    a, known = made.arrays, by.empty_memory(made.arrays)
    a.price[:] = 500.0  # so that some are left out and some are not
    seen = [some_routes(made, rng, leave) for _ in range(12)]
    for routes in seen:
        by.remember(a, routes, known)
    of_all = cheapest(made, known)
    for best in seen[:4]:
        into = of.empty_routes(a)
        if by.combine(a, best, known, MUCH, into):
            assert of.cost_now(a, into) == pytest.approx(of_all + a.idle.sum())
            assert into.sums[of.DISTANCE] == pytest.approx(into.length.sum())
        else:
            assert of.cost_now(a, best) == pytest.approx(of_all + a.idle.sum())


def test_the_shortest_order_of_a_route_is_kept():
    made = problem(1, 5)
    a, known, rng = made.arrays, by.empty_memory(made.arrays), np.random.default_rng(1)
    seen = [some_routes(made, rng) for _ in range(30)]
    for routes in seen:
        by.remember(a, routes, known)
    assert known.size[0] == 1
    assert known.cost[0] == pytest.approx(min(r.length[0] for r in seen) - a.idle[0])


@pytest.mark.parametrize('hard', [True, False])
def test_routes_beyond_range_are_remembered_only_where_they_may_be_flown(hard):
    made = problem(2, 6, reach=1.0, hard=hard)
    known = by.empty_memory(made.arrays)
    routes = some_routes(made, np.random.default_rng(1))
    by.remember(made.arrays, routes, known)
    assert known.size[0] == (0 if hard else 2)
    if not hard:  # at their price
        assert known.cost[:2] == pytest.approx(
            [routes.length[u] - made.arrays.idle[u] + made.arrays.strain[u] * (
                routes.length[u] - 1.0) for u in known.uav[:2]])


def test_where_there_is_no_more_room_it_begins_anew_and_stays_right():
    made, rng = problem(3, 60), np.random.default_rng(1)
    a, known = made.arrays, by.empty_memory(made.arrays)
    largest, fell = 0, False
    for _ in range(by.ROUTES // 2):
        by.remember(a, some_routes(made, rng), known)
        fell |= known.size[0] < largest
        largest = max(largest, known.size[0])
    assert fell
    assert largest <= by.ROUTES
    best, into = repaired(made, {}), of.empty_routes(a)
    if by.combine(a, best, known, 0.0, into):
        assert of.cost_now(a, into) < of.cost_now(a, best)
    for e in range(known.size[0]):
        stops = known.stops[known.first[e]:known.first[e + 1]]
        places = [known.uav[e], *stops]
        assert known.cost[e] == pytest.approx(sum(
            of.step(a, i, j) for i, j in zip(places, [*stops, a.ends + known.uav[e]],
                                             strict=True)) - a.idle[known.uav[e]])


def test_many_uavs_exchange_in_groups():
    made = problem(40, 200, reach=2000.0)
    a, known = made.arrays, by.empty_memory(made.arrays)
    best, rng, into = repaired(made, {}), np.random.default_rng(1), of.empty_routes(made.arrays)
    worse = of.twin(best)
    for _ in range(300):  # tasks change hands at random; every such route is remembered
        of.copy(best, worse)
        for t in rng.integers(a.uavs, a.ends, 3):
            of.remove(a, worse, of.NODE(t))
            of.insert(a, worse, of.NODE(t), worse.prev[a.ends + rng.integers(a.uavs)])
        by.remember(a, worse, known)
    start = some_routes(made, rng)
    by.remember(a, start, known)
    assert by.combine(a, start, known, MUCH, into) or start.sums[of.EXCESS] > 0.0
    of.copy(worse, start)
    if start.sums[of.EXCESS] == 0.0:
        assert not by.combine(a, start, known, MUCH, into) or (
            of.cost_now(a, into) < of.cost_now(a, start))


def test_nothing_remembered_nothing_found():
    made = problem(2, 3)
    routes = of.empty_routes(made.arrays)
    assert not by.combine(made.arrays, routes, by.empty_memory(made.arrays), MUCH,
                          of.twin(routes))
