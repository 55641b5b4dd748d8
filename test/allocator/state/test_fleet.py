# SPDX-License-Identifier: Apache-2.0
"""UAVs: heard, silent, back, taken out; what one flies stays with it."""
import math

import pytest
from allocation import Desk

from uav_task_alloc.allocator.records import UavReport
from uav_task_alloc.allocator.status import health_warnings
from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.geometry.zones import path_is_clear
from uav_task_alloc.model import ThreatZone


@pytest.fixture
def desk():
    desk = Desk(uav_timeout=5.0)
    desk.uav('a', 0.0, 0.0, 50.0)
    desk.uav('b', 1000.0, 0.0, 50.0)
    desk.add(('t1', 100, 0), ('t2', 200, 0), ('t3', 900, 0))
    desk.settle()
    return desk


def test_a_silent_uav_loses_its_tasks_and_its_list_is_withdrawn(desk):
    desk.now += 4.0
    desk.uav('b', 1000.0, 0.0, 50.0)
    desk.settle(report=False)
    assert desk.route('a') == ('t1', 't2')
    desk.now += 2.0
    desk.uav('b', 1000.0, 0.0, 50.0)
    desk.settle(report=False)
    assert (desk.route('a'), desk.lists['a'].revision) == ((), 2)
    assert set(desk.route('b')) == {'t1', 't2', 't3'}
    assert 'a silent' in desk.solves[-1]
    assert any('a silent for 5 s' in note for note in desk.notes)


def test_a_uav_that_is_back_is_considered_again(desk):
    desk.now += 6.0
    desk.uav('b', 1000.0, 0.0, 50.0)
    desk.settle(report=False)
    desk.uav('a', 0.0, 0.0, 50.0)
    desk.add(('t4', 10, 0))
    desk.settle()
    assert desk.route('a') == ('t4',)
    assert desk.lists['a'].revision == 3


def test_a_word_that_a_silent_uav_is_not_available_changes_nothing(desk):
    desk.settle(wait=6.0, report=False)
    desk.uav('b', 1000.0, 0.0, 50.0)
    desk.settle(report=False)
    solves = len(desk.solves)
    desk.uav('a', 0.0, 0.0, 50.0, available=False)
    desk.settle(report=False)
    desk.now += 6.0
    desk.uav('b', 1000.0, 0.0, 50.0)
    desk.core.tick(desk.now, desk.now)
    assert desk.begin() is None
    assert len(desk.solves) == solves


def test_when_all_are_silent_every_task_says_why_it_waits(desk):
    desk.settle(wait=6.0, report=False)
    assert desk.route('a') == desk.route('b') == ()
    assert (desk.state('t1'), desk.reason('t1')) == ('UNASSIGNED', 'no UAV available')
    desk.uav('a', 0.0, 0.0, 50.0)
    desk.settle(report=False)
    assert set(desk.route('a')) == {'t1', 't2', 't3'}


def test_an_unavailable_uav_loses_its_tasks(desk):
    desk.uav('a', 0.0, 0.0, 50.0, available=False)
    desk.settle()
    assert desk.route('a') == ()
    assert set(desk.route('b')) == {'t1', 't2', 't3'}


def test_an_operator_takes_a_uav_out_and_puts_it_back(desk):
    assert desk.world.set_available('a', False, desk.now) == ''
    desk.settle(wait=1.0)
    assert desk.route('a') == ()
    assert desk.world.set_available('a', True, desk.now) == ''
    desk.add(('t4', 10, 0))
    desk.settle()
    assert desk.route('a') == ('t4',)
    assert desk.world.set_available('z', False, desk.now) == (
        "uav_id = 'z': expected a known UAV")


def test_what_is_flown_stays_first_where_it_is(desk):
    desk.uav('b', 1000.0, 0.0, 50.0, active_task='t3')
    desk.core.tick(desk.now, desk.now)
    assert desk.state('t3') == 'ACTIVE'
    assert desk.begin() is None  # flying it is no reason to plan anew
    desk.uav('c', 899.0, 0.0, 50.0)
    desk.add(('t4', 999, 0))
    assert desk.begin().locked == {'b': ('t3',)}


def test_started_locks_as_the_report_does(desk):
    desk.event('STARTED', 't1', 'a')
    desk.uav('a', 0.0, 0.0, 50.0)  # a report that is older than the event
    desk.add(('t4', 10, 0))
    assert desk.begin().locked == {'a': ('t1',)}


def test_what_began_during_a_solve_is_not_taken_away_by_its_answer(desk):
    def swap(uavs, tasks, zones=(), **more):
        more['warm'] = None
        return desk.plan(uavs[::-1], [t for t in tasks if t.id != 't1'], zones, **more)

    desk.add(('t4', 10, 0))
    problem = desk.begin()
    desk.event('STARTED', 't2', 'a')
    desk.finish(problem)
    assert desk.route('a')[0] == 't2'
    assert 't2' not in desk.route('b')


def test_nobody_holds_a_task_that_another_one_flies(desk):
    desk.uav('b', 1000.0, 0.0, 50.0, active_task='t1')  # the list of a has it
    desk.add(('t4', 10, 0))
    assert desk.begin().locked == {}


def test_unknown_range_and_speed_are_the_defaults():
    desk = Desk(default_range=777.0, default_cruise_speed=7.0)
    desk.uav('a', 0.0, 0.0, 50.0)
    desk.uav('b', 0.0, 9.0, 50.0, range=5.0, cruise_speed=6.0, home=(1.0, 2.0, 3.0))
    desk.uav('a', 5.0, 0.0, 50.0)
    desk.add(('t1', 100, 0))
    a, b = desk.begin().uavs
    assert (a.range, a.cruise_speed, a.home) == (777.0, 7.0, (0.0, 0.0, 50.0))
    assert (b.range, b.cruise_speed, b.home) == (5.0, 6.0, (1.0, 2.0, 3.0))


@pytest.mark.parametrize(('change', 'text'), [
    ({'position': (math.nan, 0.0, 0.0)}, 'uav a: position = (nan, 0.0, 0.0): expected three fin'),
    ({'range': -1.0}, 'uav a: range_remaining = -1.0: expected a number in [0, inf]'),
    ({'cruise_speed': math.inf}, 'uav a: cruise_speed = inf: expected a number in [0, 10000]'),
    ({'home': (0.0, math.inf, 0.0)}, 'uav a: home = (0.0, inf, 0.0)'),
])
def test_a_bad_report_is_refused_in_words(change, text):
    with pytest.raises(InvalidValue) as error:
        UavReport(**{'uav_id': 'a', 'position': (0.0, 0.0, 0.0), **change})
    assert str(error.value).startswith(text)


def test_made_up_uavs_are_bounded():
    desk = Desk()
    refused = [desk.uav(f'u{k}', 0.0, 0.0, 0.0) for k in range(1001)]
    assert refused[-1] == "uav_id = 'u1000': expected one of the 1000 UAVs known already"
    assert not any(refused[:-1])


def test_a_uav_that_holds_a_list_of_an_earlier_life_gets_a_higher_revision():
    desk = Desk()
    desk.uav('a', 0.0, 0.0, 50.0, list_revision=41)
    desk.core.tick(desk.now, desk.now)
    desk.take()
    assert (desk.lists['a'].revision, desk.lists['a'].stops) == (42, ())
    desk.add(('t1', 100, 0))
    desk.settle()
    assert desk.lists['a'].revision == 43
    assert desk.event('COMPLETED', 't1', 'a', revision=40) == ''  # who knows; it was flown


def test_a_low_battery_sends_a_uav_home_and_its_tasks_to_the_others():
    desk = Desk(battery_reserve=0.2)
    desk.uav('a', 0.0, 0.0, 50.0, home=(0.0, -500.0, 0.0), battery=0.9)
    desk.uav('b', 1000.0, 0.0, 50.0, battery=0.9)
    desk.add(('t1', 100, 0), ('t2', 900, 0))
    desk.settle()
    desk.uav('a', 50.0, 0.0, 50.0, home=(0.0, -500.0, 0.0), battery=0.19, active_task='t1')
    desk.settle()
    assert (desk.route('a'), desk.lists['a'].returns) == ((), True)
    assert set(desk.route('b')) == {'t1', 't2'}
    assert 'a battery 19 %: below the reserve, it returns home' in desk.solves[-1]
    assert health_warnings(desk.world, '')[0] == 'battery low: a'


def test_a_way_home_on_a_low_battery_leads_around_a_zone():
    desk = Desk()
    dome = ThreatZone.hemisphere('dome', (500.0, 5.0, 0.0), 100.0)
    desk.world.set_zones([dome], (), desk.now)
    desk.uav('a', 0.0, 0.0, 50.0, battery=0.9)
    desk.add(('t1', 1000, 0))
    desk.settle()
    desk.uav('a', 1000.0, 0.0, 50.0, battery=0.1)
    desk.settle()
    home = [(1000.0, 0.0, 50.0), *desk.lists['a'].end_via, (0.0, 0.0, 50.0)]
    assert len(home) > 2
    assert path_is_clear(home, [dome])


def test_a_battery_is_good_again_when_it_is_well_above_the_reserve():
    desk = Desk(battery_reserve=0.2)
    low = []
    for battery in (0.5, 0.19, 0.21, None, 0.0, 0.29, 0.31, 0.25):
        desk.uav('a', 0.0, 0.0, 50.0, battery=battery)
        low.append(desk.world.fleet.records['a'].low)
    assert low == [False, True, True, True, True, True, False, False]


@pytest.mark.parametrize('battery', [None, 0.0])
def test_a_battery_that_was_never_told_is_not_low(battery):
    desk = Desk()
    desk.uav('a', 0.0, 0.0, 50.0, battery=battery)
    desk.add(('t1', 100, 0))
    desk.settle()
    assert desk.route('a') == ('t1',)


def test_a_position_that_jumps_is_told_once_and_planned_for():
    desk = Desk(position_jump=200.0, uav_timeout=5.0)
    desk.uav('a', 0.0, 0.0, 50.0)
    desk.add(('t1', 100, 0))
    desk.settle()
    for k in range(6):  # between two places, ten times a second
        desk.now += 0.1
        desk.uav('a', 5000.0 * (k % 2 == 0), 0.0, 50.0)
    desk.settle()
    assert sum('a jumped by 5000 m' in note for note in desk.notes) == 1
    assert desk.solves[-1] == 'a jumped'
    assert [stop.leg.length for stop in desk.world.lists.get('a').stops] == [100.0]


def test_who_flies_or_was_not_heard_for_a_while_does_not_jump():
    desk = Desk(position_jump=200.0)
    desk.uav('a', 0.0, 0.0, 50.0, cruise_speed=20.0)
    for seconds, x in ((0.1, 150.0), (3.0, 900.0), (60.0, 9000.0)):
        desk.now += seconds
        desk.core.tick(desk.now, desk.now)
        desk.uav('a', x, 0.0, 50.0, cruise_speed=20.0)
    desk.take()
    assert not any('jumped' in note for note in desk.notes)


def test_a_uav_that_comes_back_under_another_id_leaves_its_tasks_to_itself(desk):
    for _ in range(3):
        desk.now += 2.0
        desk.uav('c', 10.0, 0.0, 50.0)
        desk.uav('b', 1000.0, 0.0, 50.0)
        desk.settle(report=False)
    assert desk.route('a') == ()
    assert set(desk.route('c')) >= {'t1', 't2'}
    assert health_warnings(desk.world, '')[0] == 'silent: a'


def test_published_clocks_that_jump_change_no_list(desk):
    told = len(desk.history)
    for stamp in (0.0, 1e9, 5.0, 2e9):
        desk.now += 1.0
        for uav_id, x in (('a', 0.0), ('b', 1000.0)):
            report = UavReport(uav_id, (x, 0.0, 50.0))
            desk.world.update_uav(report, desk.now, stamp)
        desk.core.tick(desk.now, stamp)
        assert desk.core.due(desk.now, stamp) is None
        desk.take()
    assert len(desk.history) == told
    assert not any(record.silent for record in desk.world.fleet.records.values())


def test_tasks_after_the_one_being_flown_stay_as_far_as_committed():
    desk = Desk(locked_tasks=3)
    desk.uav('a', 0.0, 0.0, 50.0)
    desk.add(*((f't{k}', 100 * k, 0) for k in range(1, 6)))
    desk.settle()
    desk.add(('t9', 1, 1))
    assert desk.begin().locked == {}  # it does not fly yet
    desk.event('STARTED', 't1', 'a')
    assert desk.world.locked_tasks() == {'a': ('t1', 't2', 't3')}
    desk.cancel('t2')
    assert desk.world.locked_tasks() == {'a': ('t1', 't3', 't4')}


def test_nothing_is_committed_where_nothing_shall_be():
    desk = Desk(locked_tasks=0)
    desk.uav('a', 0.0, 0.0, 50.0)
    desk.add(('t1', 100, 0))
    desk.settle()
    desk.event('STARTED', 't1', 'a')
    assert desk.world.locked_tasks() == {}
