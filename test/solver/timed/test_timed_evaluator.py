# SPDX-License-Identifier: Apache-2.0
"""The evaluator of plans with time, on routes whose times are worked out by hand.

UAVs fly 10 m/s, so 100 m take 10 s.
"""
import math
from dataclasses import replace

import pytest

from uav_task_alloc.model import Task, Uav
from uav_task_alloc.objective import Objective
from uav_task_alloc.solver.problem import Rules
from uav_task_alloc.solver.timed.evaluator import evaluate_routes
from uav_task_alloc.solver.timed.schedule import Held

UAV = Uav('u', (0.0, 0.0, 0.0), cruise_speed=10.0)
IN_AIR = replace(UAV, home=(0.0, 500.0, 0.0))
HOLD, HOME = Rules(), Rules(returns=True)
SWAPS = Rules(returns=True, trips=2)


def at(name, x, **values):
    return Task(name, (x, 0.0, 0.0), **values)


def run(uav, tasks, trips, rules=HOLD, **options):
    return evaluate_routes([uav], tasks, rules, {'u': trips}, **options)


def with_objective(rules=HOLD, **coefficients):
    return replace(rules, objective=Objective(**coefficients))


def test_times_follow_from_legs_and_services():
    tasks = [at('a', 100.0, service_time=5.0), at('b', 300.0, service_time=7.0)]
    found = run(UAV, tasks, [['a', 'b']], HOME)
    assert found.timetable.arrivals == {'a': 10.0, 'b': 35.0}
    assert found.timetable.ends == {'u': 72.0}
    assert (found.distance, found.finish, found.violations) == (600.0, 72.0, ())


def test_a_climb_sets_the_time_of_a_leg():
    slow = replace(UAV, climb_speed=1.0, descent_speed=0.5)
    found = run(slow, [Task('a', (100.0, 0.0, 40.0))], [['a']], HOME)
    assert found.timetable.arrivals == {'a': 40.0}
    assert found.finish == 120.0


def test_a_uav_on_the_ground_takes_off_so_that_it_does_not_wait_in_the_air():
    found = run(UAV, [at('a', 100.0, earliest=60.0)], [['a']])
    assert found.timetable.departures == {'u': (50.0,)}
    assert found.timetable.starts == found.timetable.arrivals == {'a': 60.0}


def test_a_uav_in_the_air_waits_there_and_its_endurance_passes():
    tasks = [at('a', 100.0, earliest=60.0)]
    found = run(replace(IN_AIR, endurance=59.0), tasks, [['a']])
    assert (found.timetable.arrivals, found.timetable.starts) == ({'a': 10.0}, {'a': 60.0})
    assert found.violations == ('u, trip 1 takes 60.0 s, the endurance is 59.0 s',)
    assert run(replace(IN_AIR, endurance=60.0), tasks, [['a']]).violations == ()


def test_a_uav_in_the_air_that_is_available_later_uses_its_endurance_meanwhile():
    uav = replace(IN_AIR, available_from=30.0, endurance=39.0)
    found = run(uav, [at('a', 100.0)], [['a']])
    assert found.timetable.arrivals == {'a': 40.0}
    assert found.violations == ('u, trip 1 takes 40.0 s, the endurance is 39.0 s',)


LATER = [at('a', 100.0), at('b', 200.0, earliest=100.0)]


def test_waiting_at_a_later_task_is_avoided_where_nobody_asks_for_a_fast_response():
    found = run(UAV, LATER, [['a', 'b']])
    assert found.timetable.departures == {'u': (80.0,)}
    assert found.timetable.starts == {'a': 90.0, 'b': 100.0}


def test_a_response_is_not_delayed_to_avoid_waiting():
    found = run(UAV, LATER, [['a', 'b']], with_objective(response=1.0))
    assert found.timetable.departures == {'u': (0.0,)}
    assert found.timetable.response == (10.0 + 100.0) / 2


def test_a_response_is_delayed_as_far_as_endurance_needs():
    found = run(replace(UAV, endurance=60.0), LATER, [['a', 'b']], with_objective(response=1.0))
    assert found.timetable.departures == {'u': (40.0,)}
    assert found.timetable.starts == {'a': 50.0, 'b': 100.0}
    assert found.violations == ()


def test_a_latest_start_limits_how_far_a_departure_is_postponed():
    tasks = [replace(LATER[0], latest=30.0), LATER[1]]
    found = run(replace(UAV, endurance=79.0), tasks, [['a', 'b']])
    assert found.timetable.departures == {'u': (20.0,)}
    assert found.violations == ('u, trip 1 takes 80.0 s, the endurance is 79.0 s',)
    assert run(replace(UAV, endurance=80.0), tasks, [['a', 'b']]).violations == ()


def test_soft_lateness_is_accepted_for_endurance_and_priced():
    tasks = [replace(LATER[0], latest=30.0), LATER[1]]
    soft = with_objective(lateness=2.0)
    found = run(replace(UAV, endurance=60.0), tasks, [['a', 'b']], soft)
    assert found.timetable.late == {'a': 20.0}
    assert (found.lateness, found.cost, found.violations) == (20.0, 200.0 + 2.0 * 20.0, ())


def test_a_service_after_its_latest_start_is_a_violation():
    found = run(UAV, [at('a', 100.0, latest=9.5)], [['a']])
    assert found.violations == ('u starts a at 10.0 s, its latest is 9.5 s',)
    assert found.timetable.late == {'a': 0.5}


def test_the_window_of_a_locked_task_is_no_rule():
    found = run(UAV, [at('a', 100.0, latest=9.5)], [['a']], held=Held({'u': ('a',)}))
    assert (found.violations, found.timetable.late) == ((), {'a': 0.5})


def test_no_uav_sets_out_before_the_release():
    tasks = [at('a', 100.0), at('b', 200.0, release=50.0)]
    found = run(IN_AIR, tasks, [['a', 'b']])
    assert found.timetable.arrivals == {'a': 10.0, 'b': 60.0}
    assert run(UAV, tasks[1:], [['b']]).timetable.departures == {'u': (50.0,)}


def test_a_payload_is_taken_on_at_the_base_after_its_release():
    tasks = [at('a', 100.0), at('b', 200.0, release=50.0, payload=1.0)]
    found = run(replace(UAV, payload_capacity=1.0), tasks, [['a', 'b']])
    assert found.timetable.departures == {'u': (50.0,)}
    assert found.timetable.arrivals == {'a': 60.0, 'b': 70.0}


def test_loads_are_limited_for_each_trip():
    tasks = [at('a', 100.0, payload=2.0), at('b', 200.0, payload=1.5)]
    uav = replace(UAV, payload_capacity=3.0, turnaround=30.0)
    assert run(uav, tasks, [['a', 'b']]).violations == (
        'u, trip 1 carries 3.5 kg, the capacity is 3 kg',)
    found = run(uav, tasks, [['a'], ['b']], SWAPS)
    assert found.violations == ()
    assert found.timetable.departures == {'u': (0.0, 50.0)}
    assert found.timetable.arrivals == {'a': 10.0, 'b': 70.0}
    assert found.distance == 600.0


def test_a_uav_in_the_air_serves_only_the_payloads_that_it_has_on_board():
    tasks = [at('a', 100.0, payload=2.0), at('b', 200.0, payload=2.0)]
    found = run(replace(IN_AIR, aboard=frozenset('a')), tasks, [['a', 'b']])
    assert found.violations == ('u is in the air without the payload of b',)
    assert run(IN_AIR, tasks, [['a', 'b']], held=Held({'u': ('a', 'b')})).violations == ()
    assert run(IN_AIR, tasks, [['a', 'b']],
               held=Held(aboard={'u': frozenset('ab')})).violations == ()


def test_nobody_else_serves_a_payload_that_is_on_board():
    tasks = [at('a', 100.0, payload=2.0), at('b', 200.0)]
    flying = replace(IN_AIR, aboard=frozenset('ab'), turnaround=5.0, payload_capacity=2.0)
    other = replace(UAV, id='v', payload_capacity=2.0)
    found = evaluate_routes([flying, other], tasks, HOLD, {'v': [['a', 'b']]})
    assert found.violations == ('v, trip 1 serves a, whose payload is on board of u',)
    found = evaluate_routes([flying, other], tasks, SWAPS, {'u': [['b'], ['a']]})
    assert found.violations == ('u, trip 2 serves a, whose payload is on board of u',)


def test_a_second_trip_has_the_full_battery():
    tasks = [at('a', 100.0), at('b', 400.0)]
    uav = replace(UAV, range=250.0, endurance=25.0, full_range=800.0, full_endurance=80.0,
                  turnaround=5.0)
    assert run(uav, tasks, [['a'], ['b']], SWAPS).violations == ()
    assert run(replace(uav, full_range=799.0, full_endurance=79.0), tasks, [['a'], ['b']],
               SWAPS).violations == ('u, trip 2 is 800.0 m long, the range is 799.0 m',
                                     'u, trip 2 takes 80.0 s, the endurance is 79.0 s')


def test_a_first_trip_may_be_a_way_home():
    uav = replace(IN_AIR, turnaround=5.0, payload_capacity=1.0)
    found = run(uav, [at('a', 0.0, payload=1.0)], [[], ['a']], replace(SWAPS, returns=False))
    assert found.violations == ()
    assert found.timetable.departures == {'u': (0.0, 55.0)}
    assert found.timetable.arrivals == {'a': 105.0}


@pytest.mark.parametrize(('uav', 'rules', 'text'), [
    (UAV, SWAPS, 'u makes 2 trips, at most 1 are allowed'),
    (replace(UAV, turnaround=5.0), HOME, 'u makes 2 trips, at most 1 are allowed'),
    (replace(UAV, turnaround=5.0, available_until=64.0), SWAPS,
     'u ends at 65.0 s, it is available until 64.0 s'),
])
def test_trips_and_availability_are_limited(uav, rules, text):
    assert run(uav, [at('a', 100.0), at('b', 200.0)], [['a'], ['b']], rules).violations == (text,)


def test_a_uav_begins_when_it_is_available():
    found = run(replace(UAV, available_from=7.0), [at('a', 100.0)], [['a']])
    assert found.timetable.arrivals == {'a': 17.0}


def test_soft_ranges_and_endurances_are_priced_as_metres():
    tasks, soft = [at('a', 100.0)], Rules(hard=False)
    found = run(replace(UAV, range=60.0, endurance=8.0), tasks, [['a']], soft)
    assert (found.violations, found.penalty) == ((), pytest.approx(40.0 + 20.0))
    assert found.cost == pytest.approx(100.0 + 100.0 * 60.0)


def test_ability_and_ids_are_checked():
    tasks = [at('a', 100.0, required_capabilities={'camera'}), at('b', 200.0, allowed_uavs={'v'}),
             at('c', 300.0)]
    found = evaluate_routes([UAV, replace(UAV, id='v')], tasks, HOLD,
                     {'u': [['a', 'b', 'c', 'd']], 'v': [['c']], 'w': []},
                     held=Held({'u': ('c',)}))
    assert found.violations == (
        'w is no UAV', 'u serves d, which is no task', 'v serves c, which u serves',
        'u may not serve a', 'u may not serve b', "u begins with a, b, c, locked are ['c']")


def test_a_task_that_is_not_served_has_its_price():
    tasks = [at('a', 100.0, value=3.0), at('b', 200.0, value=5.0)]
    found = run(UAV, tasks, [['a']], with_objective(unserved=7.0))
    assert (found.cost, found.value) == (100.0 + 35.0, 3.0)
    assert run(UAV, tasks, [[]]).finish == 0.0


def test_the_cost_has_all_terms():
    tasks = [at('a', 100.0, value=3.0, latest=4.0, announced=-5.0), at('b', 200.0)]
    prices = with_objective(distance=0.5, finish=2.0, response=3.0, lateness=4.0, unserved=5.0)
    assert run(UAV, tasks, [['a']], prices).cost == pytest.approx(
        0.5 * 100.0 + 2.0 * 10.0 + 3.0 * (3.0 * 15.0 / 4.0) + 4.0 * 6.0 + 5.0 * 1.0)


def test_other_legs_than_straight_ones_are_taken():
    found = run(UAV, [at('a', 100.0)], [['a']], leg=lambda uav, start, end: (123.0, 45.0))
    assert (found.distance, found.finish) == (123.0, 45.0)
    none = run(UAV, [at('a', 1.0)], [['a']], leg=lambda *ends: (math.inf, math.inf))
    assert none.violations == ('u, trip 1 has a leg without a safe way',)


def test_lengths_of_public_instances_are_cut():
    tasks = [at('a', 12.39), at('b', 24.0)]
    found = run(replace(UAV, cruise_speed=1.0), tasks, [['a', 'b']], replace(HOLD, grain=10.0))
    assert found.timetable.arrivals == {'a': pytest.approx(12.3), 'b': pytest.approx(23.9)}
    assert found.distance == pytest.approx(23.9)
