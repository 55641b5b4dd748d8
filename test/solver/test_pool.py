# SPDX-License-Identifier: Apache-2.0
"""The route pool: a column for each set of tasks, allowed routes only, limited size."""
import numpy as np
import pytest
from plan_checks import random_problem, some_routes

from uav_task_alloc.solver.pool import MAX_COLUMNS, collect, column_of, empty_pool
from uav_task_alloc.solver.routes import leg_length


def test_the_shortest_order_of_a_route_is_kept():
    problem = random_problem(1, 5)
    a, pool, rng = problem.arrays, empty_pool(problem.arrays), np.random.default_rng(1)
    seen = [some_routes(problem, rng) for _ in range(30)]
    for routes in seen:
        collect(a, routes, pool)
    assert pool.size[0] == 1
    assert pool.cost[0] == pytest.approx(min(r.length[0] for r in seen) - a.empty_route_length[0])


def test_a_column_is_looked_up_by_uav_and_tasks():
    problem, rng = random_problem(2, 6), np.random.default_rng(1)
    a, pool, routes = problem.arrays, empty_pool(problem.arrays), some_routes(problem, rng)
    assert [column_of(a, routes, pool, u) for u in range(2)] == [-1, -1]
    collect(a, routes, pool)
    for u in range(2):
        e = column_of(a, routes, pool, u)
        assert pool.uav[e] == u
        assert {*pool.stops[pool.first[e]:pool.first[e + 1]]} == {
            t for t in range(a.uavs, a.ends) if routes.uav_of[t] == u}


@pytest.mark.parametrize('hard', [True, False])
def test_routes_beyond_range_are_collected_only_where_ranges_are_soft(hard):
    problem = random_problem(2, 6, reach=1.0, hard=hard)
    a, pool, routes = problem.arrays, empty_pool(problem.arrays), some_routes(
        problem, np.random.default_rng(1))
    collect(a, routes, pool)
    assert pool.size[0] == (0 if hard else 2)
    if not hard:  # with their penalty
        assert pool.cost[:2] == pytest.approx([
            routes.length[u] - a.empty_route_length[u]
            + a.range_penalty[u] * (routes.length[u] - 1.0)
            for u in pool.uav[:2]])


def test_a_full_pool_is_emptied_and_stays_consistent():
    problem, rng = random_problem(3, 60), np.random.default_rng(1)
    a, pool, largest, emptied = problem.arrays, empty_pool(problem.arrays), 0, False
    for _ in range(MAX_COLUMNS // 2):
        collect(a, some_routes(problem, rng), pool)
        emptied |= pool.size[0] < largest
        largest = max(largest, pool.size[0])
    assert emptied
    assert largest <= MAX_COLUMNS
    for e in range(pool.size[0]):
        u, stops = pool.uav[e], pool.stops[pool.first[e]:pool.first[e + 1]]
        legs = zip([u, *stops], [*stops, a.ends + u], strict=True)
        assert pool.cost[e] == pytest.approx(
            sum(leg_length(a, i, j) for i, j in legs) - a.empty_route_length[u])
