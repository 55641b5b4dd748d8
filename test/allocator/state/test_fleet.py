# SPDX-License-Identifier: Apache-2.0
"""UAVs: known, silent, back, switched off; the task under way stays with its UAV."""
import math

import pytest
from allocation import AllocatorDriver

from uav_task_alloc import plan
from uav_task_alloc.allocator.records import UavReport
from uav_task_alloc.allocator.status import health_warnings
from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.geometry.zones import path_is_clear
from uav_task_alloc.model import Task, ThreatZone


@pytest.fixture
def driver():
    driver = AllocatorDriver(uav_timeout=5.0)
    driver.uav('a', 0.0, 0.0, 50.0)
    driver.uav('b', 1000.0, 0.0, 50.0)
    driver.add(('t1', 100, 0), ('t2', 200, 0), ('t3', 900, 0))
    driver.settle()
    return driver


def test_a_silent_uav_loses_its_tasks_and_its_list_is_withdrawn(driver):
    driver.now += 4.0
    driver.uav('b', 1000.0, 0.0, 50.0)
    driver.settle(report=False)
    assert driver.route('a') == ('t1', 't2')
    driver.now += 2.0
    driver.uav('b', 1000.0, 0.0, 50.0)
    driver.settle(report=False)
    assert (driver.route('a'), driver.lists['a'].revision) == ((), 2)
    assert set(driver.route('b')) == {'t1', 't2', 't3'}
    assert 'a silent' in driver.solves[-1]
    assert any('a silent for 5 s' in note for note in driver.notes)


def test_a_uav_that_is_back_is_considered_again(driver):
    driver.now += 6.0
    driver.uav('b', 1000.0, 0.0, 50.0)
    driver.settle(report=False)
    driver.uav('a', 0.0, 0.0, 50.0)
    driver.add(('t4', 10, 0))
    driver.settle()
    assert driver.route('a') == ('t4',)
    assert driver.lists['a'].revision == 3


def test_a_report_that_a_silent_uav_is_not_available_changes_nothing(driver):
    driver.settle(wait=6.0, report=False)
    driver.uav('b', 1000.0, 0.0, 50.0)
    driver.settle(report=False)
    solves = len(driver.solves)
    driver.uav('a', 0.0, 0.0, 50.0, available=False)
    driver.settle(report=False)
    driver.now += 6.0
    driver.uav('b', 1000.0, 0.0, 50.0)
    driver.core.tick(driver.now, driver.now)
    assert driver.begin() is None
    assert len(driver.solves) == solves


def test_when_all_are_silent_every_task_has_the_reason(driver):
    driver.settle(wait=6.0, report=False)
    assert driver.route('a') == driver.route('b') == ()
    assert (driver.state('t1'), driver.reason('t1')) == (
        'UNASSIGNED', 'no UAV available: a is silent, b is silent')
    driver.uav('a', 0.0, 0.0, 50.0)
    driver.settle(report=False)
    assert set(driver.route('a')) == {'t1', 't2', 't3'}


def test_an_unavailable_uav_loses_its_tasks(driver):
    driver.uav('a', 0.0, 0.0, 50.0, available=False)
    driver.settle()
    assert driver.route('a') == ()
    assert set(driver.route('b')) == {'t1', 't2', 't3'}


def test_an_operator_takes_a_uav_out_and_puts_it_back(driver):
    assert driver.world.set_available('a', False, driver.now) == ''
    driver.settle(wait=1.0)
    assert driver.route('a') == ()
    assert driver.world.set_available('a', True, driver.now) == ''
    driver.add(('t4', 10, 0))
    driver.settle()
    assert driver.route('a') == ('t4',)
    assert driver.world.set_available('z', False, driver.now) == (
        "uav_id = 'z': expected a known UAV")


def test_the_task_under_way_stays_first_on_its_uav(driver):
    driver.uav('b', 1000.0, 0.0, 50.0, active_task='t3')
    driver.core.tick(driver.now, driver.now)
    assert driver.state('t3') == 'ACTIVE'
    assert driver.begin() is None  # flying it is no reason to plan again
    driver.uav('c', 899.0, 0.0, 50.0)
    driver.add(('t4', 999, 0))
    assert driver.begin().locked == {'b': ('t3',)}


def test_started_locks_as_the_report_does(driver):
    driver.event('STARTED', 't1', 'a')
    driver.uav('a', 0.0, 0.0, 50.0)  # a report that is older than the event
    driver.add(('t4', 10, 0))
    assert driver.begin().locked == {'a': ('t1',)}


def test_what_began_during_a_solve_is_not_taken_away_by_its_answer(driver):
    def reversed_plan(uavs, tasks, zones=(), **more):
        more['warm'] = None
        return driver.plan(uavs[::-1], [t for t in tasks if t.id != 't1'], zones, **more)

    driver.add(('t4', 10, 0))
    problem = driver.begin()
    driver.event('STARTED', 't2', 'a')
    driver.finish(problem)
    assert driver.route('a')[0] == 't2'
    assert 't2' not in driver.route('b')


def test_a_task_is_not_locked_on_two_uavs(driver):
    driver.uav('b', 1000.0, 0.0, 50.0, active_task='t1')  # the list of a has it
    driver.add(('t4', 10, 0))
    assert driver.begin().locked == {}


def test_unknown_range_and_speed_are_the_defaults():
    driver = AllocatorDriver(default_range=777.0, default_cruise_speed=7.0)
    driver.uav('a', 0.0, 0.0, 50.0)
    driver.uav('b', 0.0, 9.0, 50.0, range=5.0, cruise_speed=6.0, home=(1.0, 2.0, 3.0))
    driver.uav('a', 5.0, 0.0, 50.0)
    driver.add(('t1', 100, 0))
    a, b = driver.begin().uavs
    assert (a.range, a.cruise_speed, a.home) == (777.0, 7.0, (0.0, 0.0, 50.0))
    assert (b.range, b.cruise_speed, b.home) == (5.0, 6.0, (1.0, 2.0, 3.0))


@pytest.mark.parametrize(('change', 'text'), [
    ({'position': (math.nan, 0.0, 0.0)}, 'uav a: position = (nan, 0.0, 0.0): expected three fin'),
    ({'range': -1.0}, 'uav a: range_remaining = -1.0: expected a number in [0, inf]'),
    ({'cruise_speed': math.inf}, 'uav a: cruise_speed = inf: expected a number in [0.01, 10000]'),
    ({'home': (0.0, math.inf, 0.0)}, 'uav a: home = (0.0, inf, 0.0)'),
])
def test_a_bad_report_is_refused_in_words(change, text):
    with pytest.raises(InvalidValue) as error:
        UavReport(**{'uav_id': 'a', 'position': (0.0, 0.0, 0.0), **change})
    assert str(error.value).startswith(text)


def test_made_up_uavs_are_bounded():
    driver = AllocatorDriver()
    refused = [driver.uav(f'u{k}', 0.0, 0.0, 0.0) for k in range(1001)]
    assert refused[-1] == "uav_id = 'u1000': expected one of the 1000 UAVs known already"
    assert not any(refused[:-1])


def test_a_uav_that_holds_a_list_of_a_previous_run_gets_a_higher_revision():
    driver = AllocatorDriver()
    driver.uav('a', 0.0, 0.0, 50.0, list_revision=41)
    driver.core.tick(driver.now, driver.now)
    driver.take()
    assert (driver.lists['a'].revision, driver.lists['a'].stops) == (42, ())
    driver.add(('t1', 100, 0))
    driver.settle()
    assert driver.lists['a'].revision == 43
    assert driver.event('COMPLETED', 't1', 'a', revision=40) == ''  # cannot be checked


def test_a_low_battery_sends_a_uav_home_and_its_tasks_to_the_others():
    driver = AllocatorDriver(battery_reserve=0.2)
    driver.uav('a', 0.0, 0.0, 50.0, home=(0.0, -500.0, 0.0), battery=0.9)
    driver.uav('b', 1000.0, 0.0, 50.0, battery=0.9)
    driver.add(('t1', 100, 0), ('t2', 900, 0))
    driver.settle()
    driver.uav('a', 50.0, 0.0, 50.0, home=(0.0, -500.0, 0.0), battery=0.19, active_task='t1')
    driver.settle()
    assert (driver.route('a'), driver.lists['a'].returns) == ((), True)
    assert set(driver.route('b')) == {'t1', 't2'}
    assert 'a battery 19 %: below the reserve, it returns home' in driver.solves[-1]
    assert health_warnings(driver.world, '')[0] == 'battery low: a'


def test_a_path_home_on_a_low_battery_leads_around_a_zone():
    driver = AllocatorDriver()
    dome = ThreatZone.hemisphere('dome', (500.0, 5.0, 0.0), 100.0)
    driver.world.set_zones([dome], (), driver.now)
    driver.uav('a', 0.0, 0.0, 50.0, battery=0.9)
    driver.add(('t1', 1000, 0))
    driver.settle()
    driver.uav('a', 1000.0, 0.0, 50.0, battery=0.1)
    driver.settle()
    home = [(1000.0, 0.0, 50.0), *driver.lists['a'].end_via, (0.0, 0.0, 50.0)]
    assert len(home) > 2
    assert path_is_clear(home, [dome])


def test_a_battery_is_good_again_when_it_is_well_above_the_reserve():
    driver = AllocatorDriver(battery_reserve=0.2)
    low = []
    for battery in (0.5, 0.19, 0.21, None, 0.0, 0.29, 0.31, 0.25):
        driver.uav('a', 0.0, 0.0, 50.0, battery=battery)
        low.append(driver.world.fleet.records['a'].low)
    assert low == [False, True, True, True, True, True, False, False]


def test_a_payload_that_waits_for_a_uav_on_the_ground_is_planned_when_one_lands():
    driver = AllocatorDriver(plan=plan, route_end='home')
    able = {'home': (0.0, 0.0, 0.0), 'payload_capacity': 2.0}
    driver.uav('a', 100.0, 0.0, 50.0, **able)
    driver.add(Task('p', (100.0, 0.0, 30.0), payload=1.0))
    driver.settle()
    assert driver.state('p') == 'UNASSIGNED'
    assert 'is in the air' in driver.reason('p')
    driver.uav('a', 0.0, 0.0, 0.0, standby=True, **able)
    driver.settle()
    assert driver.route('a') == ('p',)
    assert driver.solves[-1] == 'a is on the ground'
    driver.uav('a', 0.0, 0.0, 20.0, **able)
    driver.uav('a', 0.0, 0.0, 0.0, standby=True, **able)  # no task waits for that
    assert driver.begin() is None


def test_a_later_trip_begins_when_its_uav_has_landed_with_a_good_battery():
    driver = AllocatorDriver(plan=plan, route_end='home', trips=2)
    able = {'home': (0.0, 0.0, 0.0), 'payload_capacity': 2.0, 'full_range': 20000.0,
            'turnaround': 30.0, 'range': 19000.0, 'battery': 0.95}
    driver.uav('a', 100.0, 0.0, 50.0, **able)
    driver.add(Task('p', (100.0, 0.0, 30.0), payload=1.0))
    driver.settle()
    assert (driver.state('p'), driver.reason('p')) == ('ASSIGNED', 'after battery change 1 of a')
    driver.uav('a', 0.0, 0.0, 0.0, standby=True, **able)
    driver.settle()
    assert driver.route('a') == ('p',)


def test_a_task_out_of_range_is_planned_when_a_uav_has_another_battery():
    driver = AllocatorDriver(plan=plan, route_end='home')
    home = {'home': (0.0, 0.0, 0.0), 'standby': True, 'full_range': 3000.0}
    driver.uav('a', 0.0, 0.0, 0.0, range=1200.0, battery=0.4, **home)
    driver.add(Task('far', (1000.0, 0.0, 30.0)))
    driver.settle()
    assert driver.state('far') == 'UNASSIGNED'
    driver.uav('a', 0.0, 0.0, 0.0, range=3000.0, battery=1.0, **home)
    driver.settle()
    assert driver.route('a') == ('far',)
    assert driver.solves[-1] == 'a has another battery'


@pytest.mark.parametrize('battery', [None, 0.0])
def test_a_battery_that_was_never_reported_is_not_low(battery):
    driver = AllocatorDriver()
    driver.uav('a', 0.0, 0.0, 50.0, battery=battery)
    driver.add(('t1', 100, 0))
    driver.settle()
    assert driver.route('a') == ('t1',)


def test_a_position_that_jumps_is_logged_once_and_planned_for():
    driver = AllocatorDriver(position_jump=200.0, uav_timeout=5.0)
    driver.uav('a', 0.0, 0.0, 50.0)
    driver.add(('t1', 100, 0))
    driver.settle()
    for k in range(6):  # between two places, ten times a second
        driver.now += 0.1
        driver.uav('a', 5000.0 * (k % 2 == 0), 0.0, 50.0)
    driver.settle()
    assert sum('a jumped by 5000 m' in note for note in driver.notes) == 1
    assert driver.solves[-1] == 'a jumped'
    assert [stop.leg.length for stop in driver.world.lists.get('a').stops] == [100.0]


def test_a_uav_that_two_sources_report_is_a_warning_while_they_do():
    driver, text = AllocatorDriver(position_jump=200.0), 'reported from two places in turn, '
    driver.uav('a', 0.0, 0.0, 50.0)
    for k in range(6):
        driver.now += 0.1
        driver.uav('a', 5000.0 * (k % 2 == 0), 0.0, 50.0)
        driver.uav('b', 5000.0 * (k > 2), 0.0, 50.0)  # jumps once
    assert health_warnings(driver.world, '') == [f'{text}expected one source each: a']
    for _ in range(3):  # one source has ended
        driver.now += 1.0
        driver.uav('a', 0.0, 0.0, 50.0)
    assert health_warnings(driver.world, '') == []


def test_flight_and_silence_are_no_jumps():
    driver = AllocatorDriver(position_jump=200.0)
    driver.uav('a', 0.0, 0.0, 50.0, cruise_speed=20.0)
    for seconds, x in ((0.1, 150.0), (3.0, 900.0), (60.0, 9000.0)):
        driver.now += seconds
        driver.core.tick(driver.now, driver.now)
        driver.uav('a', x, 0.0, 50.0, cruise_speed=20.0)
    driver.take()
    assert not any('jumped' in note for note in driver.notes)


def test_a_uav_that_comes_back_under_another_id_leaves_its_tasks_to_itself(driver):
    for _ in range(3):
        driver.now += 2.0
        driver.uav('c', 10.0, 0.0, 50.0)
        driver.uav('b', 1000.0, 0.0, 50.0)
        driver.settle(report=False)
    assert driver.route('a') == ()
    assert set(driver.route('c')) >= {'t1', 't2'}
    assert health_warnings(driver.world, '')[0] == 'silent: a'


@pytest.mark.parametrize(('fields', 'text'), [
    ({'battery': 0.1}, 'battery low: u00, u01'), ({}, 'silent: u00, u01')])
def test_a_warning_names_twenty_uavs_and_how_many_more_there_are(fields, text):
    driver = AllocatorDriver(battery_reserve=0.2, uav_timeout=2.0)
    for k in range(23):
        driver.uav(f'u{k:02}', 0.0, 0.0, 50.0, **fields)
    driver.now += 0.0 if fields else 3.0
    driver.core.tick(driver.now, driver.now)
    warning = next(each for each in health_warnings(driver.world, '') if each.startswith(text))
    assert warning.endswith('u19 and 3 more')


def test_published_clocks_that_jump_change_no_list(driver):
    published = len(driver.history)
    for stamp in (0.0, 1e9, 5.0, 2e9):
        driver.now += 1.0
        for uav_id, x in (('a', 0.0), ('b', 1000.0)):
            report = UavReport(uav_id, (x, 0.0, 50.0))
            driver.world.update_uav(report, driver.now, stamp)
        driver.core.tick(driver.now, stamp)
        assert driver.core.due(driver.now, stamp) is None
        driver.take()
    assert len(driver.history) == published
    assert not any(record.silent for record in driver.world.fleet.records.values())


def test_tasks_after_the_one_being_flown_stay_as_far_as_committed():
    driver = AllocatorDriver(locked_tasks=3)
    driver.uav('a', 0.0, 0.0, 50.0)
    driver.add(*((f't{k}', 100 * k, 0) for k in range(1, 6)))
    driver.settle()
    driver.add(('t9', 1, 1))
    assert driver.begin().locked == {}  # it does not fly yet
    driver.event('STARTED', 't1', 'a')
    assert driver.world.locked_tasks() == {'a': ('t1', 't2', 't3')}
    driver.cancel('t2')
    assert driver.world.locked_tasks() == {'a': ('t1', 't3', 't4')}


def test_no_task_is_locked_with_locked_tasks_0():
    driver = AllocatorDriver(locked_tasks=0)
    driver.uav('a', 0.0, 0.0, 50.0)
    driver.add(('t1', 100, 0))
    driver.settle()
    driver.event('STARTED', 't1', 'a')
    assert driver.world.locked_tasks() == {}


def test_a_task_that_is_served_is_locked_with_locked_tasks_0_too():
    driver = AllocatorDriver(locked_tasks=0)
    driver.uav('a', 0.0, 0.0, 50.0)
    driver.add(Task('t1', (100.0, 0.0, 50.0), service_time=60.0), ('t2', 200, 0))
    driver.settle()
    driver.event('STARTED', 't1', 'a')
    driver.uav('a', 60.0, 0.0, 50.0, active_task='t1')
    assert driver.world.locked_tasks() == {}
    driver.uav('a', 100.0, 0.0, 50.0, active_task='t1')
    assert driver.world.locked_tasks() == {'a': ('t1',)}


def test_a_task_names_the_uavs_that_may_fly_it_and_cannot_now(driver):
    driver.uav('c', 500.0, 0.0, 50.0, capabilities=frozenset({'camera'}))
    driver.uav('d', 600.0, 0.0, 50.0, available=False)
    driver.add(Task('photo', (50.0, 0.0, 50.0), required_capabilities={'camera'}),
               Task('only_d', (60.0, 0.0, 50.0), allowed_uavs={'d'}))
    driver.settle()
    assert driver.state('photo') == 'ASSIGNED'
    assert driver.reason('only_d') == 'no UAV can; those that may fly it cannot now: ' \
                                      'd is not available'
    driver.uav('c', 500.0, 0.0, 50.0, capabilities=frozenset({'camera'}), available=False)
    driver.settle()
    assert driver.reason('photo') == 'no UAV can; those that may fly it cannot now: ' \
                                     'c is not available'
    driver.add(Task('lidar', (50.0, 0.0, 50.0), required_capabilities={'lidar'}))
    driver.settle()
    assert driver.reason('lidar') == 'no UAV can'
