# SPDX-License-Identifier: Apache-2.0
"""Values at the ends of what messages may hold: refused by name, or without effect on others."""
import math

import pytest
from allocation import AllocatorDriver

from uav_task_alloc import plan
from uav_task_alloc.allocator.records import UavReport
from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.model import Task


def driver(**params):
    return AllocatorDriver(None, plan, solve_budget=0.01, objective='balanced', **params)


@pytest.mark.parametrize('turnaround', [math.inf, 3e38, 1e10])
def test_a_battery_change_that_never_ends_is_followed_by_no_trip(turnaround):
    made = driver(trips=2, route_end='home')
    made.uav('a', 0.0, 0.0, 50.0, home=(0.0, 0.0, 0.0), battery=0.9)
    made.uav('b', 300.0, 0.0, 50.0, home=(300.0, 0.0, 0.0), battery=0.1, range=500.0,
             full_range=5000.0, turnaround=turnaround)
    made.add(Task('t1', (290.0, 0.0, 50.0)))
    made.settle()
    assert made.route('a') == ('t1',)
    assert not made.world.later


def test_an_infinite_turnaround_is_no_battery_change():
    assert UavReport('a', (0.0, 0.0, 0.0), turnaround=math.inf).turnaround is None


def test_a_task_of_the_longest_service_does_not_stop_the_plans_of_others():
    made = driver()
    made.uav('a', 0.0, 0.0, 50.0, cruise_speed=15.0, endurance=900.0)
    made.add(Task('long', (100.0, 0.0, 50.0), service_time=1e9), ('t1', 200, 0))
    made.settle()
    assert made.route('a') == ('t1',)
    assert made.state('long') == 'UNASSIGNED'


@pytest.mark.parametrize('name', ['cruise_speed', 'climb_speed', 'descent_speed'])
def test_a_speed_at_which_nothing_arrives_is_refused(name):
    with pytest.raises(InvalidValue, match=rf'uav a: {name} = 1e-40: expected a .*\[0\.01, '):
        UavReport('a', (0.0, 0.0, 0.0), **{name: 1e-40})


def test_a_foreign_revision_with_no_room_after_it_is_refused():
    made = AllocatorDriver()
    with pytest.raises(InvalidValue, match=r'uav a: list_revision = 1073741825: expected at most'):
        made.uav('a', 0.0, 0.0, 50.0, list_revision=2**30 + 1)
    made.uav('a', 0.0, 0.0, 50.0, list_revision=2**30)
    made.add(('t1', 100, 0))
    made.settle()
    revision = made.lists['a'].revision
    assert revision > 2**30
    made.uav('a', 0.0, 0.0, 50.0, list_revision=revision)  # its own list
    made.settle()
    assert made.route('a') == ('t1',)
