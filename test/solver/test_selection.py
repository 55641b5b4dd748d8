# SPDX-License-Identifier: Apache-2.0
"""Problems in which tasks must be left out: the proof of it, and the search for the best ones."""
import math
from dataclasses import replace

import numpy as np
import pytest
from plan_checks import check

from uav_task_alloc import Task, Uav, plan
from uav_task_alloc.solver.problem import Limits, Rules, make_problem
from uav_task_alloc.solver.routes import empty_routes
from uav_task_alloc.solver.selection import MOST_BOUNDED, must_leave_tasks, out_of_reach

HOME = Rules(returns=True)


def fleet_and_tasks(tasks=60, uavs=2, reach=math.inf, seed=0):
    rng = np.random.default_rng(seed)
    points, values = rng.uniform(0.0, 1000.0, (tasks, 2)), rng.integers(1, 101, tasks)
    return ([Uav(f'u{i}', (500.0, 500.0, 0.0), reach) for i in range(uavs)],
            [Task(f't{i}', (x, y, 0.0), value=float(value))
             for i, ((x, y), value) in enumerate(zip(points, values, strict=True))])


def is_proven(uavs, tasks, rules=HOME, budget=60.0):
    problem = make_problem(uavs, tasks, {}, Limits(), rules)
    return must_leave_tasks(problem, empty_routes(problem.arrays), budget)


@pytest.mark.parametrize('returns', [True, False])
@pytest.mark.parametrize('seed', range(3))
def test_it_is_not_said_where_all_tasks_can_be_served(seed, returns):
    uavs, tasks = fleet_and_tasks(30, seed=seed)
    served = plan(uavs, tasks, budget=60.0, max_iterations=3000,
                  route_end='home' if returns else 'hold')
    reach = {uav.id: sum(leg.length for leg in served.legs[uav.id]) for uav in uavs}
    tight = [replace(uav, range=reach[uav.id] + 1e-6) for uav in uavs]
    assert served.value == sum(task.value for task in tasks)
    assert not is_proven(tight, tasks, Rules(returns=returns))
    half = [replace(uav, range=0.5 * uav.range) for uav in tight]
    assert is_proven(half, tasks, Rules(returns=returns))


def test_the_bound_is_as_tight_as_a_tour_of_a_circle():
    points = [(math.cos(i * math.pi / 10.0), math.sin(i * math.pi / 10.0), 0.0)
              for i in range(20)]
    tasks = [Task(f't{i}', point) for i, point in enumerate(points[1:])]
    tour = 20 * math.dist(points[0], points[1])
    assert is_proven([Uav('u', points[0], 0.999 * tour)], tasks)
    assert not is_proven([Uav('u', points[0], 1.001 * tour)], tasks)


def test_tasks_out_of_reach_prove_nothing():
    uavs = [Uav('u', (0.0, 0.0, 0.0), 25.0), Uav('v', (100.0, 0.0, 0.0), 10.0)]
    tasks = [Task(name, (x, 0.0, 0.0)) for name, x in (
        ('near', 10.0), ('far', 50.0), ('other', 104.0), ('edge', 12.5), ('over', 12.6))]
    problem = make_problem(uavs, tasks, {}, Limits(), HOME)
    assert out_of_reach(problem).tolist() == [False, True, False, False, True]
    assert not is_proven(uavs, tasks)
    barred = [*tasks, Task('barred', (10.0, 0.0, 0.0), allowed_uavs=frozenset({'v'}))]
    problem = make_problem(uavs, barred, {}, Limits(), HOME)
    assert out_of_reach(problem).tolist() == [False, True, False, False, True, True]


def test_no_bound_is_computed_without_time_for_it_or_few_tasks_left():
    uavs, tasks = fleet_and_tasks(reach=500.0)
    assert is_proven(uavs, tasks)
    assert not is_proven(uavs, tasks, budget=0.001)
    assert not is_proven(uavs, tasks, Rules(returns=True, hard=False))
    assert not is_proven(uavs, [])
    assert not is_proven(*fleet_and_tasks(MOST_BOUNDED + 1, reach=500.0), budget=1e4)
    problem = make_problem(uavs, tasks, {}, Limits(), HOME)
    routes = empty_routes(problem.arrays)
    routes.uav_of[2:62] = 0
    assert not must_leave_tasks(problem, routes, 60.0)


def test_the_best_tasks_are_chosen_where_some_must_be_left_out():
    value = 0.0
    for seed in range(2):
        uavs, tasks = fleet_and_tasks(100, reach=2000.0, seed=seed)
        chosen = plan(uavs, tasks, budget=60.0, max_iterations=20_000, route_end='home')
        check(chosen, uavs, tasks)
        value += chosen.value
    assert value > 6000.0  # the search for tasks that can all be served finds 5712
