# SPDX-License-Identifier: Apache-2.0
"""The route pool: a column for each set of tasks, none that may not be flown, and an end to it."""
import numpy as np
import pytest
from plan_checks import problem, some_routes

from uav_task_alloc.solver import routes as of
from uav_task_alloc.solver.pool import COLUMNS, collect, column_of, empty_pool


def test_the_shortest_order_of_a_route_is_kept():
    made = problem(1, 5)
    a, pool, rng = made.arrays, empty_pool(made.arrays), np.random.default_rng(1)
    seen = [some_routes(made, rng) for _ in range(30)]
    for routes in seen:
        collect(a, routes, pool)
    assert pool.size[0] == 1
    assert pool.cost[0] == pytest.approx(min(r.length[0] for r in seen) - a.idle[0])


def test_a_route_is_found_by_its_uav_and_tasks():
    made, rng = problem(2, 6), np.random.default_rng(1)
    a, pool, routes = made.arrays, empty_pool(made.arrays), some_routes(made, rng)
    assert [column_of(a, routes, pool, u) for u in range(2)] == [-1, -1]
    collect(a, routes, pool)
    for u in range(2):
        e = column_of(a, routes, pool, u)
        assert pool.uav[e] == u
        assert {*pool.stops[pool.first[e]:pool.first[e + 1]]} == {
            t for t in range(a.uavs, a.ends) if routes.on[t] == u}


@pytest.mark.parametrize('hard', [True, False])
def test_routes_beyond_range_are_collected_only_where_they_may_be_flown(hard):
    made = problem(2, 6, reach=1.0, hard=hard)
    a, pool, routes = made.arrays, empty_pool(made.arrays), some_routes(
        made, np.random.default_rng(1))
    collect(a, routes, pool)
    assert pool.size[0] == (0 if hard else 2)
    if not hard:  # at their price
        assert pool.cost[:2] == pytest.approx([
            routes.length[u] - a.idle[u] + a.strain[u] * (routes.length[u] - 1.0)
            for u in pool.uav[:2]])


def test_where_there_is_no_more_room_it_begins_anew_and_stays_right():
    made, rng = problem(3, 60), np.random.default_rng(1)
    a, pool, largest, fell = made.arrays, empty_pool(made.arrays), 0, False
    for _ in range(COLUMNS // 2):
        collect(a, some_routes(made, rng), pool)
        fell |= pool.size[0] < largest
        largest = max(largest, pool.size[0])
    assert fell
    assert largest <= COLUMNS
    for e in range(pool.size[0]):
        u, stops = pool.uav[e], pool.stops[pool.first[e]:pool.first[e + 1]]
        legs = zip([u, *stops], [*stops, a.ends + u], strict=True)
        assert pool.cost[e] == pytest.approx(sum(of.step(a, i, j) for i, j in legs) - a.idle[u])
