# SPDX-License-Identifier: Apache-2.0
"""Exchange of the ends of routes: it costs less, and what routes sum up stays true."""
import math
from dataclasses import replace

import numpy as np
import pytest
from test_timed_search import mixed_problem

from uav_task_alloc.model import Task, Uav
from uav_task_alloc.objective import OBJECTIVES
from uav_task_alloc.solver.problem import Limits, Rules, make_problem
from uav_task_alloc.solver.rng import rng_state
from uav_task_alloc.solver.timed import columns as at
from uav_task_alloc.solver.timed.arrays import LINK, node_count
from uav_task_alloc.solver.timed.order import route_order, set_order
from uav_task_alloc.solver.timed.problem import empty_timed_routes, make_timed
from uav_task_alloc.solver.timed.round import begin_round, empty_round
from uav_task_alloc.solver.timed.route_sums import cost_of
from uav_task_alloc.solver.timed.ruin import insert_removed, list_absent, ruin_strings
from uav_task_alloc.solver.timed.tails import exchange_tails
from uav_task_alloc.solver.timed.warm import first_plan
from uav_task_alloc.solver.warm import WarmState


def timed(fleet, work, **rules):
    """A problem with time."""
    return make_timed(make_problem(fleet, work, {}, Limits(), Rules(returns=True, **rules)), {})


def set_routes(problem, routes):
    """Routes of these tasks, by UAV."""
    a, order = problem.arrays, np.arange(node_count(problem.arrays)).astype(LINK)
    for u, uav in enumerate(problem.base.uavs):
        row = [a.uavs + problem.base.index[name] for name in routes.get(uav.id, ())]
        nodes = [u, *row, a.ends + u]
        order[nodes[:-1]] = nodes[1:]
    found = empty_timed_routes(a)
    set_order(a, found, order)
    return found


def names(problem, routes):
    """The tasks of each route."""
    a, found = problem.arrays, {}
    for u, uav in enumerate(problem.base.uavs):
        found[uav.id], t = [], routes.link[u, at.NEXT]
        while t < a.ends:
            found[uav.id].append(problem.base.tasks[t - a.uavs].id)
            t = routes.link[t, at.NEXT]
    return found


def exchanged(problem, routes):
    """How often ends were exchanged at all tasks until no exchange is left."""
    a, total = problem.arrays, 0
    while True:
        count = exchange_tails(a, routes, empty_round(a), 0, a.ends - a.uavs)
        total += count
        if count == 0:
            return total


@pytest.mark.parametrize('objective', ['distance', 'response'])
def test_sums_after_exchanges_are_those_of_routes_set_at_once(objective):
    total = 0
    for seed in range(6):
        fleet, work = mixed_problem(seed, uavs=7, tasks=50)
        problem = timed(fleet, work, objective=OBJECTIVES[objective])
        a, routes, w, rng = problem.arrays, empty_timed_routes(problem.arrays), empty_round(
            problem.arrays), rng_state(seed)
        set_order(a, routes, first_plan(problem, WarmState())[0].order)
        for _ in range(20):  # rounds that are all kept make the routes worse
            begin_round(routes, w)
            list_absent(a, routes, w)
            ruin_strings(a, routes, w, 10.0, 10, 0.0, rng)
            insert_removed(a, routes, w, 1.0, 0.0, 0.3, math.inf, rng)
        before = cost_of(a, routes.sums)
        total += exchanged(problem, routes)
        assert cost_of(a, routes.sums) <= before + 1e-6
        order = np.zeros(node_count(a), LINK)
        route_order(a, routes, order)
        fresh = empty_timed_routes(a)
        set_order(a, fresh, order)
        assert fresh.sums == pytest.approx(routes.sums, abs=1e-6)
        assert fresh.route == pytest.approx(routes.route, abs=1e-6)
        assert fresh.counts.tolist() == routes.counts.tolist()
        assert fresh.empty.tolist() == routes.empty.tolist()
        flown = routes.link[:, at.OF_UAV] != a.uavs
        assert fresh.link[flown].tolist() == routes.link[flown].tolist()
    assert total > 10


CROSSED = {'a': ('n1', 's2'), 'b': ('s1', 'n2')}


def crossing(**limits):
    """Two tasks north and two tasks south of one base, and two UAVs."""
    fleet = [Uav(name, (0.0, 0.0, 0.0), payload_capacity=10.0) for name in 'ab']
    places = {'n1': (0.0, 400.0), 'n2': (100.0, 400.0), 's1': (0.0, -400.0), 's2': (100.0, -400.0)}
    return fleet, [Task(name, (*place, 0.0), **{'latest': 1e4, 'payload': 4.0,
                                                **limits.get(name, {})})
                   for name, place in places.items()]


def test_ends_of_crossing_routes_are_exchanged():
    problem = timed(*crossing())
    routes = set_routes(problem, CROSSED)
    assert exchanged(problem, routes) == 1
    assert names(problem, routes) == {'a': ['n1', 'n2'], 'b': ['s1', 's2']}


@pytest.mark.parametrize('limits', [
    {'n2': {'allowed_uavs': frozenset('b')}, 's1': {'allowed_uavs': frozenset('b')},
     'n1': {'allowed_uavs': frozenset('a')}},
    {'n1': {'payload': 6.0}, 'n2': {'payload': 6.0}},
    {'n1': {'earliest': 990.0, 'latest': 991.0}, 'n2': {'latest': 900.0}},
], ids=['allowed', 'load', 'window'])
def test_ends_are_not_exchanged_where_that_is_not_allowed(limits):
    fleet, work = crossing(**limits)
    problem = timed(fleet, work)
    routes = set_routes(problem, CROSSED)
    before = routes.sums.copy()
    assert exchanged(problem, routes) == 0
    assert routes.sums.tolist() == before.tolist()
    assert names(problem, routes) == {name: [*row] for name, row in CROSSED.items()}


def test_routes_are_given_to_the_uavs_of_nearer_bases():
    fleet = [Uav(name, (x, 0.0, 0.0)) for name, x in (('a', 0.0), ('b', 900.0), ('c', 2000.0))]
    work = [Task(f't{i}', (800.0 + 50.0 * i, 100.0, 0.0), latest=1e4) for i in range(3)]
    problem = timed(fleet, work)
    routes = set_routes(problem, {'a': ('t0', 't1', 't2')})
    assert exchanged(problem, routes) == 1
    assert names(problem, routes) == {'a': [], 'b': ['t0', 't1', 't2'], 'c': []}
    fleet = [replace(uav, payload_capacity=3.0) for uav in fleet[:2]]
    work = [replace(task, payload=1.0) for task in (
        Task('far', (0.0, 100.0, 0.0), latest=1e4), *work)]
    problem = timed(fleet, work)
    routes = set_routes(problem, {'a': ('t0', 't1', 't2'), 'b': ('far',)})
    assert exchanged(problem, routes) == 1
    assert names(problem, routes) == {'a': ['far'], 'b': ['t0', 't1', 't2']}
