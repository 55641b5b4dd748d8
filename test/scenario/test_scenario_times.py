# SPDX-License-Identifier: Apache-2.0
"""Times, loads and the objective of scenario files."""
import math

import pytest

from uav_task_alloc import scenario
from uav_task_alloc.errors import ScenarioError
from uav_task_alloc.objective import Objective

UAV = 'uavs:\n  - {id: u1, position: [0, 0, 0]}\n'
TIMED = """objective: {finish: 1, lateness: 2.5}
trips: 3
uavs:
  - {id: u1, position: [0, 0, 0], endurance: 900, full_range: 9000, full_endurance: 1200,
     turnaround: 60, payload_capacity: 2.5, climb_speed: 2.5, descent_speed: 1.5,
     available_from: 10, available_until: 3600}
tasks:
  - {id: t1, position: [1, 2, 3], earliest: 60, latest: 90.5, release: 5, payload: 0.5}
  - {id: t2, position: [1, 2, 4]}
"""


def test_times_loads_and_the_objective_are_read_and_written():
    read = scenario.parse(TIMED)
    uav, task = read.uavs[0].uav, read.tasks[0].task
    assert (uav.endurance, uav.full_range, uav.full_endurance, uav.turnaround) == (
        900.0, 9000.0, 1200.0, 60.0)
    assert (uav.payload_capacity, uav.climb_speed, uav.descent_speed) == (2.5, 2.5, 1.5)
    assert (uav.available_from, uav.available_until, read.trips) == (10.0, 3600.0, 3)
    assert (task.earliest, task.latest, task.release, task.payload) == (60.0, 90.5, 5.0, 0.5)
    assert read.objective == Objective(finish=1.0, lateness=2.5)
    assert scenario.parse(scenario.to_yaml(read)) == read
    assert scenario.parse(UAV).objective is None  # plan: distance; flights: as the parameter
    named = scenario.parse('objective: balanced\n' + UAV)
    assert named.objective == 'balanced'
    assert scenario.parse(scenario.to_yaml(named)) == named


@pytest.mark.parametrize(('old', 'new', 'text'), [
    ('latest: 90.5', 'latest: 59', 's.yaml:8: scenario.tasks[0]: task t1: latest = 59.0: expected '
     'at least earliest = 60'),
    ('payload: 0.5', 'payload: -1', 's.yaml:8: scenario.tasks[0].payload = -1: expected a number '
     'in [0, 1e+06]'),
    ('earliest: 60', 'earliest: soon', 's.yaml:8: scenario.tasks[0].earliest = soon: expected a '
     'number in (-inf, 1e+09]'),
    ('available_until: 3600', 'available_until: 9', 's.yaml:6: scenario.uavs[0]: uav u1: '
     'available_until = 9.0: expected at least available_from = 10'),
    ('climb_speed: 2.5', 'climb_speed: 0', 's.yaml:5: scenario.uavs[0].climb_speed = 0: expected '
     'a number in (0, inf]'),
    ('trips: 3', 'trips: 0', 's.yaml:2: scenario.trips = 0: expected a whole number in [1, 64]'),
    ('{finish: 1, lateness: 2.5}', 'fast', 's.yaml:1: scenario.objective = fast: expected one of '
     'distance, finish, response, balanced'),
    ('lateness: 2.5', 'late: 2.5', "s.yaml:1: scenario.objective: unknown key 'late': expected "
     "one of distance, finish, response, lateness, unserved; nearest is 'lateness'"),
    ('lateness: 2.5', 'lateness: 1e10', 's.yaml:1: scenario.objective: objective: lateness = '
     '10000000000.0: expected a number in [0, 1e+09], or inf'),
])
def test_a_wrong_time_is_refused_with_its_line(old, new, text):
    assert old in TIMED
    with pytest.raises(ScenarioError) as refused:
        scenario.parse(TIMED.replace(old, new), 's.yaml')
    assert str(refused.value) == text


def test_keys_that_only_plans_use_are_listed():
    plain = scenario.parse(UAV)
    timed = scenario.parse(UAV.replace('}', ', endurance: 600, available_from: 5}') + 'trips: 2\n')
    assert plain.keys_of_plan_only() == ()
    assert timed.keys_of_plan_only() == ('available_from',)


def test_windows_of_a_scenario_are_moved_to_another_clock():
    first, second = (timed.task for timed in scenario.parse(TIMED).tasks)
    moved = scenario.from_zero(first, 1000.0)
    assert (moved.earliest, moved.latest, moved.release, moved.payload) == (
        1060.0, 1090.5, 1005.0, 0.5)
    assert scenario.from_zero(second, 1000.0) == second


def test_objective_and_trips_of_a_scenario_are_parameters_of_the_allocator():
    given = scenario.fleet_parameters(scenario.parse(UAV + 'objective: finish\ntrips: 2\n'))
    assert (given['allocator']['objective'], given['allocator']['trips']) == ('finish', 2)
    priced = scenario.fleet_parameters(scenario.parse(UAV + 'objective: {finish: 2}\n'))
    assert priced['allocator']['objective_weights'] == [1.0, 2.0, 0.0, math.inf, math.inf]
    plain = scenario.fleet_parameters(scenario.parse(UAV))['allocator']
    assert not {'objective', 'objective_weights'} & plain.keys()
