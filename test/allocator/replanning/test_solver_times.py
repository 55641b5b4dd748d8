# SPDX-License-Identifier: Apache-2.0
"""What the solver of the allocator counts as time, and what the prediction makes of it."""
from dataclasses import replace

import pytest
from allocation import AllocatorDriver

from uav_task_alloc import plan
from uav_task_alloc.allocator.replanning import planning
from uav_task_alloc.model import Task

HOVERS = (0.0, 0.0, 0.0)  # [m/s]


@pytest.fixture
def made():
    return AllocatorDriver(plan=plan, solve_budget=0.02)


def at(name, x, **more):
    return Task(name, (float(x), 0.0, 50.0), **more)


def uav(made, **more):
    made.uav('a', 0.0, 0.0, 50.0, cruise_speed=10.0, **more)  # 4 s a stop


@pytest.mark.parametrize(('more', 'delay'), [
    ({}, 2.0),  # half of a stop: it may fly
    ({'velocity': HOVERS}, 4.0),
    ({'standby': True}, 8.0),
    ({'standby': True, 'home': (0.0, 0.0, 40.0), 'takeoff_height': 30.0, 'climb_speed': 2.0},
     18.0)])
def test_the_solver_counts_what_the_first_leg_of_a_list_loses(made, more, delay):
    uav(made, **more)
    made.add(at('t1', 500, latest=made.now + 500.0), at('t2', 1000, service_time=5.0))
    problem = made.begin()
    starts = planning.solve_problem(made.plan, problem, made.world.params,
                                    lambda: False).best.timetable().starts
    made.finish(problem)
    stops = made.lists['a'].stops
    assert [stop.start for stop in stops] == pytest.approx([50.0 + delay, 104.0 + delay], abs=0.1)
    assert [starts[stop.task.id] for stop in stops] == pytest.approx(
        [stop.start for stop in stops], abs=0.1)


def test_a_route_whose_deadline_the_first_stop_would_break_has_another_order(made):
    uav(made, velocity=HOVERS)
    made.add(at('near', 100), at('far', -600, latest=made.now + 86.0))  # 88 s with near first
    made.settle()
    assert made.route('a') == ('far', 'near')
    assert 'far' not in made.world.deadlines.late


def test_a_deadline_that_only_the_stop_breaks_is_unassigned_with_when_it_could_start(made):
    uav(made, velocity=HOVERS)
    assert made.add(at('t', 1000, latest=made.now + 102.0))[0].accepted
    made.settle()
    assert ('a' in made.lists, made.state('t')) == (False, 'UNASSIGNED')
    assert made.reason('t').startswith(
        'latest 1102.0 s cannot be kept: no UAV can start it before 1104.1 s (a)')


def test_of_a_service_under_way_only_the_rest_delays_the_next_task(made):
    uav(made, velocity=HOVERS)
    made.add(at('long', 0, service_time=60.0))
    made.settle()
    for seconds in (0.0, 50.0):
        made.now += seconds
        uav(made, velocity=HOVERS, active_task='long')
    made.add(at('next', 500, latest=made.now + 70.0))  # 10 s, 50 s of flight and 4 s of a stop
    made.settle()
    assert made.route('a') == ('long', 'next')


def windy(made, monkeypatch, *others):
    """UAVs at 0 and further on [m]; the wind has been measured, against those that fly east."""
    for uav_id, x in (('a', 0.0), *others):
        made.uav(uav_id, x, 0.0, 50.0, cruise_speed=10.0, velocity=HOVERS)
    monkeypatch.setattr(made.world.flights.wind, 'of', lambda _, speed: (speed, (-4.0, 0.0)))


@pytest.mark.parametrize('objective', ['distance', 'balanced'])
def test_a_deadline_that_the_wind_breaks_goes_to_a_uav_that_keeps_it(made, monkeypatch, objective):
    made.world.params = replace(made.world.params, objective=objective)
    windy(made, monkeypatch, ('b', 1050.0))
    made.add(at('t', 500, latest=made.now + 75.0))  # 83 s of flight, or 39 s
    made.settle()
    assert made.route('b') == ('t',)
    assert 't' not in made.world.deadlines.late


def test_a_deadline_that_the_wind_breaks_for_all_is_unassigned(made, monkeypatch):
    windy(made, monkeypatch)
    made.add(at('t', 500, latest=made.now + 75.0))
    made.settle()
    assert ('a' in made.lists, made.state('t')) == (False, 'UNASSIGNED')
    assert made.reason('t').startswith(
        'latest 1075.0 s cannot be kept: no UAV can start it before 1087.4 s (a)')
