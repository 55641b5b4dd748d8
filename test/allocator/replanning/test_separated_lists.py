# SPDX-License-Identifier: Apache-2.0
"""Lists of the allocator are apart: heights and waits that stay, returns at their heights."""
import math
from dataclasses import replace

import pytest
from allocation import AllocatorDriver

from uav_task_alloc.allocator.core import make_safe_paths
from uav_task_alloc.allocator.list_records import ListStop, UavList
from uav_task_alloc.allocator.replanning.from_now import separation_of
from uav_task_alloc.allocator.replanning.separated_lists import planned_flights
from uav_task_alloc.allocator.replanning.task_lists import build_task_list
from uav_task_alloc.model import Leg, Task, Uav
from uav_task_alloc.params import AllocatorParams
from uav_task_alloc.separation.conflicts import find_conflicts
from uav_task_alloc.separation.flight_legs import leg_times
from uav_task_alloc.separation.volumes import flight_volumes

ON = {'separation__horizontal': 10.0, 'separation__vertical': 5.0, 'separation__time': 2.0}
SPEEDS = {'cruise_speed': 10.0, 'climb_speed': 2.5, 'descent_speed': 1.5}


def conflicts(driver):
    world = driver.world
    rule = separation_of(driver.world.params)
    rule = rule if rule.on else replace(rule, horizontal=10.0)
    flights = planned_flights(world, world.lists_in_force(), driver.now)
    return find_conflicts(flight_volumes(flights.values(), rule), rule)


def crossing(**params):
    driver = AllocatorDriver(**params)
    driver.uav('a', 0.0, 200.0, 50.0, home=(0.0, 0.0, 0.0), **SPEEDS)
    driver.uav('b', 200.0, 0.0, 50.0, home=(300.0, 0.0, 0.0), **SPEEDS)
    driver.add(Task('ta', (400.0, 200.0, 50.0), allowed_uavs={'a'}),
               Task('tb', (200.0, 400.0, 50.0), allowed_uavs={'b'}))
    driver.settle()
    return driver


def test_lists_that_cross_get_other_heights_and_stay_so():
    assert conflicts(crossing())
    driver = crossing(**ON)
    assert conflicts(driver) == []
    heights = [point[2] for stop in driver.lists['b'].stops for point in stop.leg.via]
    assert heights == [55.5, 55.5]
    assert driver.lists['a'].stops[0].leg.via == ()
    before = len(driver.history)
    for y in (20.0, 60.0):
        driver.uav('b', 200.0, y, 55.5, home=(300.0, 0.0, 0.0), **SPEEDS)
        driver.uav('a', y, 200.0, 50.0, home=(0.0, 0.0, 0.0), **SPEEDS)
        driver.world.request_replan('test', driver.now)
        driver.settle(2.0, report=False)
    assert len(driver.history) == before
    assert conflicts(driver) == []


def test_a_new_task_gives_way_to_the_leg_under_way():
    driver = AllocatorDriver(**ON)
    driver.uav('a', 0.0, 200.0, 50.0, **SPEEDS)
    driver.uav('b', 200.0, 0.0, 50.0, **SPEEDS)
    driver.add(Task('tb', (200.0, 400.0, 50.0), allowed_uavs={'b'}))
    driver.settle()
    driver.add(Task('ta', (400.0, 200.0, 50.0), allowed_uavs={'a'}))
    driver.settle()
    assert driver.lists['b'].stops[0].leg.via == ()
    assert {point[2] for point in driver.lists['a'].stops[0].leg.via} == {55.5}
    assert conflicts(driver) == []


def test_uavs_of_one_base_take_off_one_after_the_other_and_return_at_the_height_of_their_task():
    driver = AllocatorDriver(route_end='home', **ON)
    for k in range(4):
        driver.uav(f'u{k}', 3.0 * k, 0.0, 0.0, home=(3.0 * k, 0.0, 0.0), standby=True, **SPEEDS)
        angle = 1.5 * k
        driver.add(Task(f't{k}', (300.0 * math.cos(angle), 300.0 * math.sin(angle), 50.0),
                        allowed_uavs={f'u{k}'}))
    driver.settle()
    assert conflicts(driver) == []
    waits = sorted(driver.lists[f'u{k}'].stops[0].wait for k in range(4))
    assert waits[0] == 0.0
    assert waits[1] > 3.0
    for k in range(4):
        end_via = driver.lists[f'u{k}'].end_via
        assert end_via[-1][:2] == (3.0 * k, 0.0)
        assert end_via[-1][2] >= 50.0


def test_a_take_off_that_has_begun_is_planned_up_to_its_end_with_tasks_and_without():
    driver = AllocatorDriver(route_end='home', **ON)
    climbs = {'mode': 'TAKEOFF', 'home': (0.0, 0.0, 0.0), 'takeoff_height': 60.0, **SPEEDS}
    driver.uav('a', 0.0, 0.0, 20.0, **climbs)
    driver.add(Task('ta', (90.0, 0.0, 40.0)))
    driver.settle(report=False)
    column = ((0.0, 0.0, 20.0), (0.0, 0.0, 60.0))
    flight = planned_flights(driver.world, driver.world.lists_in_force(), driver.now)['a']
    assert flight.legs[0].flown()[:2] == column
    assert driver.lists['a'].stops[0].leg.via == ()
    driver.cancel('ta')
    driver.settle(report=False)
    flight = planned_flights(driver.world, driver.world.lists_in_force(), driver.now)['a']
    assert [leg.lands for leg in flight.legs] == [True]
    assert flight.legs[0].flown()[:2] == column


def test_what_is_minutes_ahead_is_left_to_later_plans_and_stays_in_the_lists():
    driver = crossing(background_budget=0.05, **ON)
    driver.add(*(Task(f'ta{k}', (1400.0 + 600.0 * k, 200.0, 50.0), allowed_uavs={'a'})
                 for k in range(3)),
               *(Task(f'tb{k}', (200.0, 1400.0 + 600.0 * k, 50.0), allowed_uavs={'b'})
                 for k in range(3)))
    driver.settle()
    lists, world = driver.lists, driver.world
    assert lists['a'].task_ids == ('ta', 'ta0', 'ta1', 'ta2')
    assert lists['b'].task_ids == ('tb', 'tb0', 'tb1', 'tb2')
    flights = planned_flights(world, world.lists_in_force(), driver.now)
    assert [len(each.legs) for each in flights.values()] == [2, 2]
    assert all(each.goes_on for each in flights.values())
    assert conflicts(driver) == []
    assert {point[2] for uav_id in 'ab' for stop in lists[uav_id].stops
            for point in stop.leg.via} == {55.5}


def test_a_plan_that_ends_before_all_are_apart_is_completed_by_the_next_ones():
    driver = AllocatorDriver(route_end='home', background_budget=0.05, solve_budget=0.02, **ON)
    for k in range(10):
        driver.uav(f'u{k}', 6.0 * k, 0.0, 0.0, home=(6.0 * k, 0.0, 0.0), standby=True, **SPEEDS)
        angle = 0.7 * k
        driver.add(Task(f't{k}', (300.0 * math.cos(angle), 300.0 * math.sin(angle), 50.0),
                        allowed_uavs={f'u{k}'}))
    driver.settle()
    first = conflicts(driver)
    assert first
    assert any(note.startswith('no change was found in time') for note in driver.notes)
    for _ in range(20):
        driver.world.request_replan('test', driver.now)
        driver.settle(report=False)
    assert not [each for each in conflicts(driver) if 0 in each.legs]


def test_a_uav_lost_above_the_base_lets_the_others_take_off_after_half_a_minute():
    driver = AllocatorDriver(route_end='home', uav_timeout=3.0, **ON)
    driver.uav('lost', 4.0, 0.0, 40.0, home=(4.0, 0.0, 0.0), **SPEEDS)
    driver.uav('u', 0.0, 0.0, 0.0, home=(0.0, 0.0, 0.0), standby=True, **SPEEDS)
    driver.add(Task('t', (0.0, 300.0, 50.0), allowed_uavs={'u'}),
               Task('l', (4.0, 60.0, 40.0), allowed_uavs={'lost'}))
    driver.settle()
    assert driver.lists['u'].stops[0].wait > 5.0  # until it has landed
    waits = []
    for _ in range(8):
        driver.now += 6.0
        driver.uav('u', 0.0, 0.0, 0.0, home=(0.0, 0.0, 0.0), standby=True, **SPEEDS)
        driver.core.tick(driver.now, driver.now)
        driver.world.request_replan('test', driver.now)
        driver.settle(report=False)
        waits.append(driver.world.lists.restamped(
            'u', driver.now, driver.world.flights.of('u', driver.now)).stops[0].wait)
    assert driver.world.uav_record('lost').silent
    assert waits[0] > 5.0
    assert waits[-1] == 0.0


def test_two_legs_under_way_that_meet_are_logged_once():
    driver = AllocatorDriver()
    driver.uav('a', 0.0, 200.0, 50.0, **SPEEDS)
    driver.uav('b', 200.0, 0.0, 50.0, **SPEEDS)
    driver.add(Task('ta', (400.0, 200.0, 50.0), allowed_uavs={'a'}),
               Task('tb', (200.0, 400.0, 50.0), allowed_uavs={'b'}))
    driver.settle()
    driver.world.params = replace(driver.world.params, **ON)
    for _ in range(3):
        driver.world.request_replan('test', driver.now)
        driver.settle()
    assert driver.notes.count('the plan cannot keep a and b apart') == 1
    assert driver.levels['the plan cannot keep a and b apart'] == 'warning'


def test_without_separation_lists_have_no_waits_and_heights():
    driver = crossing(route_end='home')
    assert all(each.end_via == () and each.stops[0].begin_after == 0.0
               for each in driver.lists.values())


def test_the_leg_under_way_keeps_its_heights_though_the_straight_one_is_shorter():
    work = Task('t', (100.0, 0.0, 50.0))
    via = ((0.0, 0.0, 60.0), (100.0, 0.0, 60.0))
    published = UavList('u', 1, (ListStop(work, Leg(via, 120.0), 0.0),))
    uav = Uav('u', (30.0, 0.0, 60.0))
    paths = make_safe_paths((), AllocatorParams())
    kept, dropped = (build_task_list(uav, [work], False, {}, published, paths, keep=keep)[0]
                     for keep in (True, False))
    assert kept.stops[0].leg.via == via
    assert dropped.stops[0].leg.via == ()


def test_a_uav_that_hovers_up_to_a_release_is_planned_to_set_out_then():
    driver = AllocatorDriver(**ON)
    driver.uav('u', 0.0, 0.0, 50.0, **SPEEDS)
    driver.add(Task('t', (300.0, 0.0, 50.0), release=driver.now + 40.0))
    driver.settle()
    world = driver.world
    flight = planned_flights(world, world.lists_in_force(), driver.now)['u']
    times = leg_times(flight, flight.legs[0], 0.0, True)
    assert times.begin == flight.legs[0].release > 30.0


def waits_at_the_stop_before():
    """`a` waits at its first task up to 100 s for a second one, as of a plan long ago."""
    driver = AllocatorDriver(**ON)
    driver.uav('a', 0.0, 0.0, 50.0, **SPEEDS)
    driver.add(Task('ta0', (0.0, 0.0, 50.0), allowed_uavs={'a'}),
               Task('ta', (300.0, 0.0, 50.0), allowed_uavs={'a'}))
    driver.settle()
    lists = driver.world.lists.lists
    first, later = lists['a'].stops
    lists['a'] = replace(lists['a'], stops=(first, replace(later, begin_after=driver.now + 130.0)))
    driver.event('COMPLETED', 'ta0', 'a')
    driver.core.tick(driver.now, driver.now)
    driver.uav('a', 0.0, 0.0, 50.0, velocity=(0.0, 0.0, 0.0), **SPEEDS)
    return driver


def test_a_uav_that_waits_at_the_stop_before_is_planned_there_and_not_at_its_task():
    driver = waits_at_the_stop_before()
    world = driver.world
    flight = planned_flights(world, world.lists_in_force(), driver.now)['a']
    assert leg_times(flight, flight.legs[0], 0.0, True).begin > 80.0
    assert flight.legs[0].movable


def test_a_wait_that_has_begun_ends_when_the_conflict_is_over():
    driver = waits_at_the_stop_before()
    driver.world.request_replan('test', driver.now)
    driver.settle(report=False)
    assert driver.lists['a'].stops[0].wait == 0.0
    assert driver.lists['a'].stops[0].begin_after == 0.0


def test_the_leg_after_a_take_off_that_has_begun_may_get_another_height():
    driver = AllocatorDriver(**ON)
    climbs = {'mode': 'TAKEOFF', 'takeoff_height': 60.0, **SPEEDS}
    driver.uav('a', 0.0, 0.0, 20.0, home=(0.0, 0.0, 0.0), **climbs)
    driver.add(Task('t', (0.0, 300.0, 50.0), allowed_uavs={'a'}))
    driver.settle()
    world = driver.world
    flight = planned_flights(world, world.lists_in_force(), driver.now)['a']
    assert flight.legs[0].movable
    assert flight.legs[0].points == ((0.0, 0.0, 20.0), (0.0, 300.0, 50.0))


def strip(name, *xs, uav, y=0.0):
    return Task(name, (xs[0], y, 50.0), path=tuple((x, y, 50.0) for x in xs), allowed_uavs={uav})


TO_POINTS = (Task('ta', (1500.0, 0.0, 50.0), allowed_uavs={'a'}),
             Task('tb', (0.0, 0.0, 50.0), allowed_uavs={'b'}))
TO_A_STRIP = strip('ta', 100.0, 1500.0, uav='a'), strip('tb', 0.0, -90.0, uav='b')
PAST_A_STRIP = strip('ta', 100.0, 1500.0, uav='a'), strip('tb', 0.0, -90.0, uav='b', y=10.5)
ON_STRIPS = strip('ta', 100.0, 1500.0, uav='a'), strip('tb', 1900.0, 0.0, uav='b')


@pytest.mark.parametrize(('tasks', 'changed', 'holding'), [
    (TO_POINTS, 'a', ['b']),  # until a has passed above it
    (TO_A_STRIP, 'b', ['a']),  # which is on its path
    (PAST_A_STRIP, 'b', ['a']),  # apart, but not by as much as the monitor wants
    (ON_STRIPS, '', ['a', 'b'])])  # the paths keep their height
def test_of_two_that_hold_for_each_other_one_gets_another_height_from_where_it_stands(
        tasks, changed, holding):
    driver = AllocatorDriver(**ON)
    more = {'mode': 'ON_MISSION', 'authority': 'HELD', **SPEEDS}

    def report(a, b, speed):
        driver.uav('a', a, 0.0, 50.0, velocity=(speed, 0.0, 0.0), **more)
        driver.uav('b', b, tasks[1].position[1], 50.0, velocity=(-speed, 0.0, 0.0), **more)

    report(0.0, 2000.0, 10.0)
    driver.add(*tasks)
    driver.settle(report=False)
    lists = driver.world.lists.lists
    for each in 'ab':
        lists[each] = replace(lists[each], stops=tuple(
            replace(stop, leg=Leg((), 1500.0)) for stop in lists[each].stops))
    report(700.0, 780.0, 10.0)
    driver.core.separate(driver.now, driver.now)
    report(720.0, 760.0, 0.0)
    more['mode'] = 'HOLD'
    for _ in range(4):
        driver.now += 5.0
        report(720.0, 760.0, 0.0)
        driver.core.separate(driver.now, driver.now)
        driver.settle(0.5, report=False)
    assert {each: [len(stop.leg.via) for stop in lists[each].stops] for each in 'ab'} == {
        each: [2 * (each == changed)] for each in 'ab'}
    assert sorted(driver.core.separation.monitor.holding) == holding
