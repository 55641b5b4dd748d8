# SPDX-License-Identifier: Apache-2.0
"""Warm starts with time: what still holds of the earlier plan stays; payloads on board too."""
from dataclasses import replace

import numpy as np
import pytest

from uav_task_alloc.model import Task, Uav
from uav_task_alloc.objective import OBJECTIVES
from uav_task_alloc.solver.problem import Limits, Rules, make_problem
from uav_task_alloc.solver.solve import plan
from uav_task_alloc.solver.timed import solve
from uav_task_alloc.solver.timed.colony import WARM_AND_FRESH, TimedColony
from uav_task_alloc.solver.timed.order import route_order
from uav_task_alloc.solver.timed.problem import make_timed
from uav_task_alloc.solver.timed.warm import first_plan
from uav_task_alloc.solver.warm import WarmState

BASE = (0.0, 0.0, 0.0)


def line(count, **options):
    return [Task(f't{i}', (100.0 * (i + 1), 0.0, 0.0), **options) for i in range(count)]


def test_an_earlier_plan_stays_where_it_still_holds():
    uavs, tasks = [Uav('a', BASE), Uav('b', (0.0, 500.0, 0.0))], line(6, latest=500.0)
    before = plan(uavs, tasks, budget=0.02)
    after = plan(uavs, tasks, budget=0.0, warm=before)
    assert after.routes == before.routes
    assert after.warm_started


def test_an_earlier_plan_stays_where_no_time_is_left_to_try_places(monkeypatch):
    monkeypatch.setattr(solve, 'LEAST_PLACES', 0)
    uavs, tasks = [Uav('a', BASE), Uav('b', (0.0, 500.0, 0.0))], line(6, latest=500.0)
    before = plan(uavs, tasks, budget=0.02)
    assert plan(uavs, tasks, budget=0.0, warm=before).routes == before.routes


def test_a_task_that_is_too_late_by_now_leaves_the_plan():
    uav = Uav('a', BASE, cruise_speed=10.0)
    tasks = [*line(2, latest=60.0), Task('new', (-100.0, 0.0, 0.0))]
    before = plan([uav], tasks, budget=0.02)
    later = [replace(task, latest=5.0) if task.id == 't1' else task for task in tasks]
    after = plan([uav], later, budget=0.02, warm=before)
    assert set(after.unassigned) == {'t1'}


def test_trips_of_an_earlier_plan_stay():
    uav = Uav('a', BASE, range=250.0, turnaround=10.0)
    tasks = [Task('t0', (100.0, 0.0, 0.0)), Task('t1', (-100.0, 0.0, 0.0))]
    before = plan([uav], tasks, budget=0.05, trips=2, route_end='home')
    assert before.trips['a'] in ((('t0',), ('t1',)), (('t1',), ('t0',)))
    after = plan([uav], tasks, budget=0.0, trips=2, route_end='home', warm=before)
    assert after.trips == before.trips


def test_payload_on_board_stays_with_its_uav():
    a, b = (Uav(name, BASE, payload_capacity=2.0) for name in 'ab')
    tasks = [Task('parcel', (1000.0, 0.0, 0.0), payload=1.0)]
    before = plan([a], tasks, budget=0.02)
    flying = replace(a, position=(100.0, 0.0, 50.0), home=BASE)
    near = replace(b, position=(990.0, 0.0, 0.0), home=None)
    after = plan([near, flying], tasks, budget=0.02, warm=before)
    assert after.routes['a'] == ('parcel',)


def test_locked_tasks_stay_first_and_count_against_windows_of_others():
    uav = Uav('a', BASE, cruise_speed=10.0)
    tasks = [Task('held', (500.0, 0.0, 0.0), service_time=100.0),
             Task('near', (100.0, 0.0, 0.0), latest=120.0), Task('open', (0.0, 50.0, 0.0))]
    found = plan([uav], tasks, budget=0.02, locked={'a': ['held']})
    assert found.routes['a'] == ('held', 'open')
    assert found.unassigned['near'] == 'latest 120 s; the earliest arrival is 190 s (a)'


def after_a_loss(objective):
    """A plan of 40 tasks of four UAVs, and what is asked when the last of them is lost."""
    uavs = [Uav(f'u{i}', (300.0 * i, 0.0, 0.0)) for i in range(4)]
    tasks = [Task(f't{i}', (30.0 * i, 100.0, 0.0)) for i in range(40)]
    before = plan(uavs, tasks, budget=9.0, max_iterations=200, objective=objective)
    return uavs[:3], tasks, before


@pytest.mark.parametrize(('objective', 'some'), [('finish', True), ('balanced', False)])
def test_half_of_a_search_for_an_early_finish_begins_at_new_routes_after_a_loss(
        objective, some, monkeypatch):
    uavs, tasks, before = after_a_loss(objective)
    begun = []
    monkeypatch.setattr(solve, 'TimedColony', lambda problem, first, seed, params, begin: (
        begun.append(begin is not None) or TimedColony(problem, first, seed, params, begin)))
    plan(uavs, tasks, budget=9.0, max_iterations=100, warm=before, objective=objective)
    left = [task for task in tasks if task.id not in before.routes['u3']]
    plan(uavs, [*left, tasks[-1]], budget=9.0, max_iterations=100, warm=before,
         objective=objective)  # a single new task
    assert begun == [some, False]


@pytest.mark.parametrize(('rounds', 'fresh'), [(1000, True), (10, False)])
def test_a_search_goes_on_from_other_routes_where_there_are_rounds_enough(rounds, fresh):
    uavs, tasks, before = after_a_loss('finish')
    rules = Rules(objective=OBJECTIVES['finish'])
    problem = make_timed(make_problem(uavs, tasks, {}, Limits(), rules), {})
    first, begin = first_plan(problem, before.state)[0], first_plan(problem, WarmState())[0]
    colony = TimedColony(problem, first, 1, WARM_AND_FRESH, begin)
    colony.fly(0.0, 0.02, rounds)
    colony.fly(0.3, 0.5, 0)
    held = colony.best.order.copy()
    colony.fly(0.51, 0.52, 0)
    order = np.empty_like(begin.order)
    route_order(colony.arrays, colony.routes, order)
    assert (order == begin.order).all() == fresh
    assert (colony.best.order == held).all()
