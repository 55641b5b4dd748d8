# SPDX-License-Identifier: Apache-2.0
"""A plan that counts the next tasks keeps UAVs for them, and breaks nothing for that."""
import functools
import math
from dataclasses import replace

import numpy as np
import pytest
from allocation import AllocatorDriver

from uav_task_alloc.allocator.replanning import planning
from uav_task_alloc.allocator.replanning.plan_acceptance import accepted_plan
from uav_task_alloc.model import Task
from uav_task_alloc.solver.solve import plan

AREA = (-5000.0, -5000.0, 5000.0, 5000.0)
SPOT = (3000.0, 0.0)  # [m] where tasks came from
ROUNDS = functools.partial(plan, clock=lambda: 0.0)  # as many iterations as a test wants


def solver(*args, max_iterations=None, **options):
    return ROUNDS(*args, max_iterations=200 if max_iterations is None else max_iterations,
                  **options)


def fleet(*places, seen=60, **params):
    """UAVs without tasks that are sent nowhere to wait, as no mode is known, and tasks at SPOT."""
    driver = AllocatorDriver(None, solver, **{
        'anticipate': 'learnt', 'anticipate_area': AREA, 'objective': 'response',
        'default_range': 60_000.0, 'replan_margin': 0.0, 'locked_tasks': 0, **params})
    rng = np.random.default_rng(7)
    for k in range(seen):
        x, y = rng.normal(SPOT, 300.0)
        driver.add((f's{k}', x, y))
        driver.cancel(f's{k}')
    for k, (x, y) in enumerate(places):
        driver.uav(f'u{k}', x, y, 50.0, home=(0.0, 0.0, 0.0))
    driver.settle()
    return driver


def owner(driver, task_id):
    return next(uav_id for uav_id, each in driver.world.lists_in_force().items()
                if task_id in each.task_ids)


NEAR, OTHER = SPOT, (-300.0, 0.0)  # 1500 and 1800 m from the task
TASK = Task('t', (1500.0, 0.0, 50.0), service_time=60.0)


@pytest.mark.parametrize(('params', 'expected'), [
    ({}, 'u1'), ({'anticipate': 'off'}, 'u0'), ({'objective': 'distance'}, 'u0'),
    ({'objective': 'balanced'}, 'u0'), ({'route_end': 'home'}, 'u0'),
    ({'approval': 'all'}, None)])
def test_the_uav_where_tasks_come_from_stays_there_for_little_more_response(params, expected):
    driver = fleet(NEAR, OTHER, **params)
    driver.add(TASK)
    problem = driver.begin()
    assert (problem.outlook is None) == (params != {})
    driver.finish(problem)
    if expected:
        assert owner(driver, 't') == expected


def test_a_task_that_waits_too_long_goes_to_the_nearest():
    driver = fleet(NEAR, (-4500.0, 0.0))
    driver.add(TASK)
    driver.settle()
    assert owner(driver, 't') == 'u0'


def test_a_deadline_that_only_the_nearest_keeps_is_kept():
    driver = fleet(NEAR, OTHER)
    driver.add(replace(TASK, latest=driver.now + 112.0))
    driver.settle()
    assert owner(driver, 't') == 'u0'


def test_a_task_is_not_moved_to_a_uav_that_may_not_fly_it():
    driver = fleet(NEAR, OTHER)
    driver.add(replace(TASK, allowed_uavs=frozenset({'u0'})))
    driver.settle()
    assert owner(driver, 't') == 'u0'


def test_a_pinned_task_stays():
    driver = fleet(NEAR, OTHER)
    driver.add(TASK)
    driver.order('PIN', 'u0', 't')
    driver.settle()
    assert owner(driver, 't') == 'u0'


def test_a_plan_is_the_same_each_time_and_does_not_change_without_news():
    routes = []
    for _ in range(2):
        driver = fleet(NEAR, OTHER, (0.0, 3000.0), (2000.0, -2000.0))
        rng = np.random.default_rng(3)
        driver.add(*(Task(f't{k}', (*rng.uniform(-4000.0, 4000.0, 2), 50.0)) for k in range(8)))
        driver.settle()
        routes.append({u: each.task_ids for u, each in driver.world.lists_in_force().items()})
        driver.world.request_replan('again', driver.now)
        driver.settle()
        assert routes[-1] == {u: each.task_ids
                              for u, each in driver.world.lists_in_force().items()}
    assert routes[0] == routes[1]


def mixed_task(rng, k, now):
    """A point, with a deadline, a window, a UAV of its own, or a path."""
    x, y = rng.uniform(-4000.0, 4000.0, 2)
    place, kind = (float(x), float(y), 50.0), int(rng.integers(6))
    more = [{}, {}, {'latest': now + rng.uniform(100.0, 900.0)},
            {'earliest': now + 200.0, 'latest': now + 700.0},
            {'allowed_uavs': frozenset({f'u{rng.integers(4)}'})},
            {'path': (place, (place[0] + 300.0, place[1], 50.0)), 'reversible': True}][kind]
    return Task(f't{k}', place, value=float(rng.uniform(0.5, 2.0)), service_time=30.0, **more)


@pytest.mark.parametrize('seed', range(6))
def test_no_promise_of_a_mixed_plan_is_broken(seed):
    rng = np.random.default_rng(seed)
    driver = fleet(*rng.uniform(-4000.0, 4000.0, (4, 2)), locked_tasks=1)
    driver.add(*(mixed_task(rng, k, driver.now) for k in range(9)))
    answer = planning.solve_problem(solver, driver.begin(), driver.world.params, lambda: False)
    accepted, covered = accepted_plan(answer, 0.0), answer.covered
    assert covered.unassigned.keys() == accepted.unassigned.keys()
    tasks, before = {task.id: task for task in answer.problem.tasks}, accepted.timetable().starts
    for name, start in covered.timetable().starts.items():
        if tasks[name].latest < math.inf:
            assert start <= max(tasks[name].latest, before[name]) + 0.01
    for uav_id, row in covered.routes.items():
        assert all(tasks[name].allowed_uavs is None or uav_id in tasks[name].allowed_uavs
                   for name in row)


def test_a_move_that_the_solver_does_not_confirm_is_not_made():
    driver = fleet(NEAR, OTHER)
    driver.add(TASK)
    problem = driver.begin()

    def refuses(*args, warm=None, max_iterations=None, **options):
        """Serves the task by the nearest UAV, whatever it starts from."""
        return solver(*args, warm=None, max_iterations=max_iterations, **options)

    answer = planning.solve_problem(refuses, problem, driver.world.params, lambda: False)
    assert answer.covered.routes['u0'] == ('t',)
