# SPDX-License-Identifier: Apache-2.0
"""Exact optima of tiny problems with time, against answers known by reasoning."""
from dataclasses import replace

import numpy as np
import pytest

from uav_task_alloc.model import Task, Uav
from uav_task_alloc.objective import Objective
from uav_task_alloc.solver.problem import Rules
from uav_task_alloc.solver.timed.evaluator import evaluate_routes
from uav_task_alloc.solver.timed.schedule import Held
from uav_task_alloc.study import exact
from uav_task_alloc.study.exact import exact_plan
from uav_task_alloc.study.small_problems import small_problem

UAV = Uav('u', (0.0, 0.0, 0.0), cruise_speed=10.0)
LINE = [Task(name, (x, 0.0, 0.0)) for name, x in (('a', 100.0), ('b', -200.0), ('c', 300.0))]


def with_objective(**coefficients):
    return Rules(objective=Objective(**coefficients))


def test_the_shortest_route_is_found():
    found = exact_plan([UAV], LINE, Rules())
    assert (found.cost, found.routes) == (700.0, {'u': (('b', 'a', 'c'),)})


def test_the_fastest_finish_shares_the_tasks():
    found = exact_plan([UAV, replace(UAV, id='v')], LINE, with_objective(distance=0.0, finish=1.0))
    assert found.cost == 30.0
    assert sorted(found.routes.values()) == [(('a', 'c'),), (('b',),)]


def test_the_fastest_response_serves_the_near_task_first():
    found = exact_plan([UAV], LINE, with_objective(distance=0.0, response=1.0))
    assert found.routes == {'u': (('a', 'c', 'b'),)}
    assert found.cost == pytest.approx((10.0 + 30.0 + 80.0) / 3)


def test_a_task_that_is_not_worth_its_way_is_left_out():
    found = exact_plan([UAV], LINE, with_objective(unserved=150.0))
    assert (found.cost, found.value, found.routes) == (400.0, 1.0, {'u': (('a',),)})


def test_the_most_value_is_served_where_not_all_can_be():
    tasks = [replace(LINE[0], latest=10.0), replace(LINE[1], latest=30.0, value=3.0), LINE[2]]
    found = exact_plan([UAV], tasks, Rules())
    assert found.value == 4.0
    assert found.routes == {'u': (('b', 'c'),)}


def test_loads_make_trips():
    tasks = [replace(task, payload=1.0) for task in LINE]
    uav = replace(UAV, payload_capacity=2.0, turnaround=1.0)
    found = exact_plan([uav], tasks, Rules(returns=True, trips=3))
    assert sorted(found.routes['u'], key=len) in ([('b',), ('a', 'c')], [('b',), ('c', 'a')])
    assert found.cost == 1000.0


def test_locked_tasks_stay_first():
    found = exact_plan([UAV, replace(UAV, id='v')], LINE, Rules(), held=Held({'v': ('c',)}))
    assert found.routes['v'][0][0] == 'c'
    assert found.cost == 700.0


@pytest.mark.parametrize('seed', range(3))
def test_no_random_plan_is_better(seed):
    rng = np.random.default_rng(seed)
    tasks = [Task(f't{i}', (*rng.uniform(0.0, 500.0, 2), 0.0), latest=rng.uniform(20.0, 200.0),
                  payload=float(rng.integers(0, 2))) for i in range(4)]
    uavs = [Uav(name, (*rng.uniform(0.0, 500.0, 2), 0.0), cruise_speed=10.0, endurance=90.0,
                payload_capacity=1.0, turnaround=9.0) for name in 'uv']
    rules = Rules(returns=True, trips=2, objective=Objective(0.01, 1.0, 1.0, 2.0, 50.0))
    best = exact_plan(uavs, tasks, rules)
    assert evaluate_routes(uavs, tasks, rules, best.routes).cost == pytest.approx(best.cost)
    for _ in range(500):
        rows = {name: [[], []] for name in 'uv'}
        for i in rng.permutation(5)[:rng.integers(1, 5)]:
            if i < 4:
                rows['uv'[rng.integers(2)]][rng.integers(2)].append(f't{i}')
        rows = {name: [row for row in pair if row] for name, pair in rows.items()}
        found = evaluate_routes(uavs, tasks, rules, rows)
        assert found.violations or found.cost >= best.cost - 1e-9


@pytest.mark.parametrize('seed', range(6))
def test_labels_find_what_trying_all_routes_finds(seed, monkeypatch):
    rng = np.random.default_rng((seed, 5))
    tasks = [Task(f't{i}', (*rng.uniform(0.0, 500.0, 2), 0.0), float(rng.integers(1, 4)),
                  service_time=float(rng.integers(0, 9)), latest=rng.uniform(20.0, 200.0),
                  earliest=-9.0 if seed % 2 else rng.uniform(0.0, 20.0), release=4.0 * (seed > 3))
             for i in range(5)]
    uavs = [Uav(name, (*rng.uniform(0.0, 500.0, 2), 0.0), cruise_speed=10.0, home=(9.0, 9.0, 9.0),
                available_from=3.0, available_until=150.0 + 99.0 * seed) for name in 'uv']
    late, left = (3.0, 40.0) if seed % 3 else (np.inf, np.inf)
    rules = Rules(returns=seed % 2 == 0, objective=Objective(0.01, 1.0, 1.0, late, left))
    by_labels = exact_plan(uavs, tasks, rules)
    monkeypatch.setattr(exact, '_is_plain', lambda *_: False)
    by_trying = exact_plan(uavs, tasks, rules)
    assert (by_labels.cost, by_labels.value) == pytest.approx((by_trying.cost, by_trying.value))
    found = evaluate_routes(uavs, tasks, rules, by_labels.routes)
    assert found.cost == pytest.approx(by_labels.cost)


@pytest.mark.parametrize('seed', range(8))
def test_labels_find_the_directions_of_paths_within_ranges(seed, monkeypatch):
    drawn = small_problem(seed, 4, 2, paths=0.8, plain=True)
    by_labels = exact_plan(drawn.uavs, drawn.tasks, drawn.rules)
    found = evaluate_routes(drawn.uavs, drawn.tasks, drawn.rules, by_labels.routes,
                            reversed=by_labels.reversed)
    assert not found.violations
    assert found.cost == pytest.approx(by_labels.cost)
    monkeypatch.setattr(exact, '_is_plain', lambda *_: False)
    by_trying = exact_plan(drawn.uavs, drawn.tasks, drawn.rules)
    assert (by_labels.cost, by_labels.value) == pytest.approx((by_trying.cost, by_trying.value))
