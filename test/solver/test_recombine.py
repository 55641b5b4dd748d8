# SPDX-License-Identifier: Apache-2.0
"""Routes put together anew: never wrong, and the best there is where all can be looked at."""
from itertools import product

import numpy as np
import pytest
from plan_checks import problem, some_routes

from uav_task_alloc.solver import routes as of
from uav_task_alloc.solver.multipliers import reduced_costs
from uav_task_alloc.solver.pool import collect, column_of, empty_pool
from uav_task_alloc.solver.recombine import GROUP, recombine
from uav_task_alloc.solver.warm import repaired

MUCH = 1e8


def filled(made, seen):
    """A pool with all these routes."""
    pool = empty_pool(made.arrays)
    for routes in seen:
        collect(made.arrays, routes, pool)
    return pool


def cheapest(made, pool):
    """The cost of the best choice of one column or none for each UAV, by all of them."""
    a, rows = made.arrays, [[(0.0, ())] for _ in range(made.arrays.uavs)]
    for e in range(pool.size[0]):
        rows[pool.uav[e]].append((pool.cost[e], tuple(
            pool.stops[pool.first[e]:pool.first[e + 1]])))
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
def test_it_finds_the_best_of_all_there_is(seed, leave, returns):
    made, rng = problem(3, 7, seed, returns=returns), np.random.default_rng(seed)
    a = made.arrays
    a.price[:] = 500.0  # so that some are left out and some are not
    seen = [some_routes(made, rng, leave) for _ in range(12)]
    pool = filled(made, seen)
    of_all = cheapest(made, pool)
    for best in seen[:4]:
        into = of.empty_routes(a)
        if not recombine(a, best, pool, MUCH, into):
            of.copy(best, into)
        assert of.cost_now(a, into) == pytest.approx(of_all + a.idle.sum())
        assert into.sums[of.DISTANCE] == pytest.approx(into.length.sum())


@pytest.mark.parametrize('seed', range(6))
def test_the_bound_is_one_and_reduced_costs_add_up(seed):
    made, rng = problem(3, 7, seed), np.random.default_rng(seed)
    a, seen = made.arrays, [some_routes(made, rng, 1) for _ in range(12)]
    a.price[:] = 700.0
    pool = filled(made, seen)
    for routes in seen[:4]:
        flown = np.array([column_of(a, routes, pool, u) if routes.tasks[u] else -1
                          for u in range(a.uavs)])
        out = np.flatnonzero(routes.on[:a.ends] < 0)
        worth = pool.cost[flown[flown >= 0]].sum() + 700.0 * out.size
        reduced, bound = reduced_costs(a, pool, flown, worth, MUCH)
        assert bound <= cheapest(made, pool) + 1e-6
        assert min(map(np.min, reduced)) >= -1e-9
        assert worth == pytest.approx(bound + reduced.column[flown[flown >= 0]].sum()
                                      + reduced.stay[flown < 0].sum() + reduced.left[out].sum())


def test_many_uavs_get_back_what_neighbours_took_from_each_other():
    made, rng = problem(40, 200), np.random.default_rng(1)
    a, good = made.arrays, repaired(made, {})
    assert a.uavs > GROUP
    worse = of.twin(good)
    for t in rng.choice(np.arange(a.uavs, a.ends), 20, replace=False):
        other = worse.on[a.near[t - a.uavs, 0]]
        of.remove(a, worse, of.NODE(t))
        of.insert(a, worse, of.NODE(t), worse.prev[a.ends + other])
    into = of.empty_routes(a)
    assert of.cost_now(a, worse) > 1.01 * of.cost_now(a, good)
    assert recombine(a, worse, filled(made, [good]), MUCH, into)
    assert of.cost_now(a, into) <= of.cost_now(a, good) + 1e-6
    assert (into.on[a.uavs:a.ends] >= 0).all()


def test_a_best_beyond_range_an_empty_pool_or_no_work_change_nothing():
    made, rng = problem(2, 6, reach=1.0), np.random.default_rng(1)
    into = of.empty_routes(made.arrays)
    assert not recombine(made.arrays, some_routes(made, rng), empty_pool(made.arrays), MUCH, into)
    made = problem(2, 3)
    nothing = of.empty_routes(made.arrays)
    assert not recombine(made.arrays, nothing, empty_pool(made.arrays), MUCH, of.twin(nothing))
    made = problem(3, 9)
    seen = [some_routes(made, rng) for _ in range(9)]
    pool, worst = filled(made, seen), max(seen, key=lambda r: r.sums[of.DISTANCE])
    into = of.empty_routes(made.arrays)
    assert not recombine(made.arrays, worst, pool, 0.0, into)
    assert recombine(made.arrays, worst, pool, MUCH, into)
