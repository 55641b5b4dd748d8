# SPDX-License-Identifier: Apache-2.0
"""Recombination: always consistent, and optimal where all combinations can be tried."""
from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from plan_checks import make, random_problem, some_routes

from uav_task_alloc.solver.multipliers import reduced_costs
from uav_task_alloc.solver.pool import collect, column_of, empty_pool
from uav_task_alloc.solver.problem import Limits, Rules, make_problem
from uav_task_alloc.solver.recombine import GROUP_SIZE, classes_of, recombine, repack
from uav_task_alloc.solver.routes import (
    DISTANCE,
    NODE,
    copy,
    copy_into,
    empty_routes,
    insert,
    remove,
    total_cost,
    update_sums,
)
from uav_task_alloc.solver.warm import repair

WORK = 1e8


def filled(problem, seen):
    """A pool with all these routes."""
    pool = empty_pool(problem.arrays)
    for routes in seen:
        collect(problem.arrays, routes, pool)
    return pool


def cheapest(problem, pool, classes=None):
    """The cost of the best choice of one column or none for each UAV, by all of them."""
    a, rows = problem.arrays, [[(0.0, ())] for _ in range(problem.arrays.uavs)]
    classes = np.arange(a.uavs) if classes is None else classes
    for e in range(pool.size[0]):
        for u in np.flatnonzero(classes == classes[pool.uav[e]]):
            rows[u].append((pool.cost[e], tuple(pool.stops[pool.first[e]:pool.first[e + 1]])))
    least = np.inf
    for chosen in product(*rows):
        stops = [t for _, row in chosen for t in row]
        if len(stops) == len(set(stops)):
            out = set(range(a.uavs, a.ends)) - set(stops)
            least = min(least, sum(cost for cost, _ in chosen)
                        + sum(a.unassigned_cost[t - a.uavs] for t in out))
    return least


def of_few(a, best, pool, work, into):
    return repack(a, best, pool, np.arange(a.uavs), work, into)


@pytest.mark.parametrize('run', [recombine, of_few])
@pytest.mark.parametrize('returns', [False, True])
@pytest.mark.parametrize('leave', [0, 2])
@pytest.mark.parametrize('seed', range(6))
def test_it_finds_the_best_combination(seed, leave, returns, run):
    problem, rng = random_problem(3, 7, seed, returns=returns), np.random.default_rng(seed)
    a = problem.arrays
    a.unassigned_cost[:] = 500.0  # so that some tasks stay unassigned
    seen = [some_routes(problem, rng, leave) for _ in range(12)]
    pool = filled(problem, seen)
    optimum = cheapest(problem, pool)
    for best in seen[:4]:
        into = empty_routes(a)
        if not run(a, best, pool, WORK, into):
            copy_into(best, into)
        assert total_cost(a, into) == pytest.approx(optimum + a.empty_route_length.sum())
        assert into.sums[DISTANCE] == pytest.approx(into.length.sum())


@pytest.mark.parametrize('seed', range(6))
def test_the_bound_is_valid_and_reduced_costs_add_up(seed):
    problem, rng = random_problem(3, 7, seed), np.random.default_rng(seed)
    a, seen = problem.arrays, [some_routes(problem, rng, 1) for _ in range(12)]
    a.unassigned_cost[:] = 700.0
    pool = filled(problem, seen)
    for routes in seen[:4]:
        flown = np.array([column_of(a, routes, pool, u) if routes.tasks[u] else -1
                          for u in range(a.uavs)])
        out = np.flatnonzero(routes.uav_of[:a.ends] < 0)
        worth = pool.cost[flown[flown >= 0]].sum() + 700.0 * out.size
        reduced, bound = reduced_costs(a, pool, flown, worth, WORK)
        assert bound <= cheapest(problem, pool) + 1e-6
        assert min(map(np.min, reduced)) >= -1e-9
        assert worth == pytest.approx(
            bound + reduced.column[flown[flown >= 0]].sum() + reduced.stay[flown < 0].sum()
            + reduced.unassigned[out].sum())


def test_tasks_moved_to_neighbouring_uavs_are_moved_back():
    problem, rng = random_problem(40, 200), np.random.default_rng(1)
    a, good = problem.arrays, repair(problem, {})
    assert a.uavs > GROUP_SIZE
    worse = copy(good)
    for t in rng.choice(np.arange(a.uavs, a.ends), 20, replace=False):
        other = worse.uav_of[a.near[t - a.uavs, 0]]
        remove(a, worse, NODE(t))
        insert(a, worse, NODE(t), worse.prev[a.ends + other])
    into = empty_routes(a)
    assert total_cost(a, worse) > 1.01 * total_cost(a, good)
    assert recombine(a, worse, filled(problem, [good]), WORK, into)
    assert total_cost(a, into) <= total_cost(a, good) + 1e-6
    assert (into.uav_of[a.uavs:a.ends] >= 0).all()


@pytest.mark.parametrize('run', [recombine, of_few])
def test_a_best_beyond_range_or_an_empty_pool_or_no_work_changes_nothing(run):
    problem, rng = random_problem(2, 6, reach=1.0), np.random.default_rng(1)
    into = empty_routes(problem.arrays)
    pool = empty_pool(problem.arrays)
    assert not run(problem.arrays, some_routes(problem, rng), pool, WORK, into)
    problem = random_problem(2, 3)
    nothing = empty_routes(problem.arrays)
    assert not run(problem.arrays, nothing, empty_pool(problem.arrays), WORK, copy(nothing))
    problem = random_problem(3, 9)
    seen = [some_routes(problem, rng) for _ in range(9)]
    pool, worst = filled(problem, seen), max(seen, key=lambda r: r.sums[DISTANCE])
    into = empty_routes(problem.arrays)
    assert not run(problem.arrays, worst, pool, 0.0, into)
    assert run(problem.arrays, worst, pool, WORK, into)
    remove(problem.arrays, worst, NODE(problem.arrays.uavs))  # so that it leaves a task out
    assert not run(problem.arrays, worst, pool, 0.0, into)
    assert run(problem.arrays, worst, pool, WORK, into)


def exchanged(a, routes, uav_of):
    """The same with the route of UAV u flown by uav_of[u]."""
    new = empty_routes(a)
    for u, other in enumerate(uav_of):
        t = routes.next[u]
        while t < a.ends:
            insert(a, new, NODE(t), new.prev[a.ends + other])
            t = routes.next[t]
    update_sums(a, new)
    return new


@pytest.mark.parametrize('seed', range(6))
def test_few_uavs_that_are_alike_fly_each_others_routes(seed):
    uavs, tasks = make(4, 8, seed, 1e9)
    alike = [replace(uav, position=uavs[0].position) for uav in uavs[:3]]
    problem = make_problem([*alike, uavs[3]], tasks, {}, Limits(), Rules(returns=True))
    a, rng = problem.arrays, np.random.default_rng(seed)
    a.unassigned_cost[:] = 500.0
    classes = classes_of(a)
    assert classes.tolist() == [0, 0, 0, 1]
    seen, pool = [some_routes(problem, rng, 2) for _ in range(8)], empty_pool(a, classes)
    for routes in seen:
        collect(a, routes, pool)
    columns = int(pool.size[0])
    for routes in seen:  # the same routes, each flown by another of those alike
        collect(a, exchanged(a, routes, (1, 2, 0, 3)), pool)
    assert pool.size[0] == columns
    for routes in seen:  # and by one that is not alike
        collect(a, exchanged(a, routes, (3, 1, 2, 0)), pool)
    assert pool.size[0] > columns
    optimum = cheapest(problem, pool, classes)
    for best in seen[:4]:
        into = empty_routes(a)
        if not repack(a, best, pool, classes, WORK, into):
            copy_into(best, into)
        assert total_cost(a, into) == pytest.approx(optimum + a.empty_route_length.sum())
        assert into.sums[DISTANCE] == pytest.approx(into.length.sum())


def test_uavs_are_alike_if_they_start_end_fly_and_serve_alike():
    uavs, tasks = make(1, 5)
    same = [replace(uavs[0], id=f'u{i}') for i in range(7)]
    same[1] = replace(same[1], range=9.0)
    same[2] = replace(same[2], home=(1.0, 2.0, 3.0))
    same[3] = replace(same[3], position=(1.0, 2.0, 3.0), home=same[0].position)
    tasks[0] = replace(tasks[0], allowed_uavs=frozenset({'u0', 'u5'}))
    problem = make_problem(same, tasks, {'u6': (tasks[4],)}, Limits(), Rules(returns=True))
    assert classes_of(problem.arrays).tolist() == [0, 1, 2, 3, 4, 0, 5]
