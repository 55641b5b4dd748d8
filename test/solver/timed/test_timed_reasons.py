# SPDX-License-Identifier: Apache-2.0
"""Reasons with time: each says what prevents a task, with numbers that are true."""
import math

from uav_task_alloc.model import Task, Uav
from uav_task_alloc.objective import Objective
from uav_task_alloc.solver.solve import plan
from uav_task_alloc.solver.timed import solve
from uav_task_alloc.solver.timed.reasons import NO_PLACE_IN_TIME

BASE = (0.0, 0.0, 0.0)


def reason(uavs, task, **options):
    return plan(uavs, [task], budget=0.01, **options).unassigned[task.id]


def test_a_task_that_is_too_late_names_the_earliest_arrival():
    uavs = [Uav('far', (3000.0, 0.0, 0.0), cruise_speed=10.0),
            Uav('near', BASE, cruise_speed=10.0)]
    task = Task('t', (1000.0, 0.0, 0.0), latest=60.0)
    assert reason(uavs, task) == 'latest 60 s; the earliest arrival is 100 s (near)'


def test_a_task_without_time_to_try_all_places_says_so(monkeypatch):
    monkeypatch.setattr(solve, 'LEAST_PLACES', 0)
    uav = Uav('a', BASE, cruise_speed=10.0)
    tasks = [Task('there', (1000.0, 0.0, 0.0), value=2.0, latest=101.0),
             Task('opposite', (-900.0, 0.0, 0.0), latest=101.0)]
    assert plan([uav], tasks, budget=0.0).unassigned == {'opposite': NO_PLACE_IN_TIME}
    assert plan([uav], tasks, budget=0.01).unassigned == {
        'opposite': 'left out: windows do not suffice for all tasks'}


def test_a_payload_that_is_too_heavy_names_the_largest_capacity():
    task = Task('t', (10.0, 0.0, 0.0), payload=5.0)
    uavs = [Uav('a', BASE, payload_capacity=1.0), Uav('b', BASE, payload_capacity=2.0)]
    assert reason(uavs, task) == 'payload 5 kg; the largest capacity is 2 kg (b)'


def test_a_payload_is_not_taken_on_in_the_air():
    uav = Uav('a', (5.0, 0.0, 50.0), home=BASE, payload_capacity=9.0)
    assert reason([uav], Task('t', (10.0, 0.0, 0.0), payload=5.0)) == (
        'payload 5 kg; every UAV that could carry it is in the air')


def test_endurance_names_what_is_needed_and_what_there_is():
    uav = Uav('a', BASE, cruise_speed=10.0, endurance=150.0)
    assert reason([uav], Task('t', (1000.0, 0.0, 0.0)), route_end='home') == (
        'no UAV can serve it: a needs 200 s in the air and has 150 s')


def test_a_task_after_the_availability_of_all_says_so():
    uav = Uav('a', BASE, cruise_speed=10.0, available_until=150.0)
    assert reason([uav], Task('t', (1000.0, 0.0, 0.0)), route_end='home') == (
        'no UAV can serve it: a would end at 200 s and is available until 150 s')


def test_tasks_that_compete_say_what_does_not_suffice():
    uav = Uav('a', BASE, cruise_speed=10.0)
    tasks = [Task('east', (500.0, 0.0, 0.0), latest=50.0, value=2.0),
             Task('west', (-500.0, 0.0, 0.0), latest=50.0)]
    found = plan([uav], tasks, budget=0.05)
    assert found.unassigned == {'west': 'left out: windows do not suffice for all tasks'}


def test_a_task_with_a_small_prize_is_not_worth_its_way():
    found = plan([Uav('a', BASE)], [Task('t', (1000.0, 0.0, 0.0))], budget=0.01,
                 objective=Objective(unserved=10.0))
    assert found.unassigned == {'t': 'left out: it is not worth its way'}
    assert found.cost == 10.0
    assert math.isclose(plan([Uav('a', BASE)], [Task('t', (1000.0, 0.0, 0.0))], budget=0.01,
                             objective=Objective(unserved=2000.0)).cost, 1000.0)
