# SPDX-License-Identifier: Apache-2.0
"""Waits before tasks: holds at the stop before, later take-offs, and when they are sent again."""
import math
from dataclasses import replace

import pytest
from flight_bench import FlightBench
from mission_bench import ORIGIN, PROFILES, task_list
from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.mavlink import autopilots
from uav_task_alloc.mavlink.mission.items import Hold, TaskList, alike, mission_items
from uav_task_alloc.mavlink.mission.waits import Waits

BOTH = pytest.mark.parametrize('kind', ['ardupilot', 'px4'])


def timed(names, revision=1, stamp=0.0, *, waits=(), begins=(), service=4.0):
    """A list with waits [s], and ROS times [s] of services, by position."""
    tasks = task_list(names, revision, service=service)
    stops = [replace(stop, wait=dict(enumerate(waits)).get(n, 0.0),
                     begin=dict(enumerate(begins)).get(n, 0.0))
             for n, stop in enumerate(tasks.stops)]
    return replace(tasks, stops=tuple(stops), stamp=stamp)


def holds(waits, tasks):
    return [stop.hold and (stop.hold.place, stop.hold.seconds)
            for stop in waits.with_holds(tasks).stops]


def place(name):
    return task_list(name).stops[0].task.position


@pytest.mark.parametrize('rules', [PROFILES['px4'].rules, PROFILES['ardupilot'].rules,
                                   autopilots.ARDUPLANE.rules])
def test_a_wait_is_an_item_at_the_stop_before_that_belongs_to_the_leg(rules):
    tasks = timed('AB')
    stops = (tasks.stops[0], replace(tasks.stops[1], via=((50.0, 160.0, 50.0),),
                                     hold=Hold(place('A'), 30.2)))
    items = mission_items(replace(tasks, stops=stops), rules, ORIGIN)
    assert [(item.task, item.completes, item.holds) for item in items] == [
        ('A', True, False), ('B', False, True), ('B', False, False), ('B', True, False)]
    assert items[1].position == place('A')
    assert items[1].params[0] == 30.0
    assert items[1].command == (d.MAV_CMD_NAV_LOITER_TIME if rules.loiters
                                else d.MAV_CMD_NAV_WAYPOINT)


@pytest.mark.parametrize('at', ['A', 'B'])
def test_a_hold_is_never_like_the_item_of_the_task_at_its_place(at):
    tasks = timed('AB', service=6.0)
    for seconds in (5.6, 6.0, 6.4):
        stops = (tasks.stops[0], replace(tasks.stops[1], hold=Hold(place(at), seconds)))
        items = mission_items(replace(tasks, stops=stops), PROFILES['ardupilot'].rules, ORIGIN)
        own = [item for item in items if item.completes]
        hold, = (item for item in items if item.holds)
        assert not any(alike(item, hold) for item in own)


def test_a_hold_stays_within_5_s_and_is_sent_anew_beyond():
    waits, first = Waits(), timed('AB', waits=[0.0, 40.0], begins=[10.0, 90.0])
    waits.assign(first, set(), True, None)
    assert holds(waits, first) == [None, (place('A'), 40.0)]
    version = waits.version
    later = timed('AB', 2, waits=[0.0, 35.5], begins=[14.0, 90.0])
    waits.assign(later, set(), True, None)
    assert holds(waits, later) == [None, (place('A'), 40.0)]
    assert waits.version == version
    late = timed('AB', 3, waits=[0.0, 34.0], begins=[16.0, 90.0])
    waits.assign(late, set(), True, None)
    assert holds(waits, late) == [None, (place('A'), 34.0)]
    assert waits.version > version
    gone = timed('AB', 4, waits=[0.0, 0.0], begins=[60.0, 95.0])
    waits.assign(gone, set(), True, None)
    assert holds(waits, gone) == [None, None]


def test_a_hold_that_runs_is_sent_anew_only_if_the_service_is_at_another_time():
    waits = Waits()
    both = timed('AB', waits=[0.0, 40.0], begins=[10.0, 90.0])
    waits.assign(both, set(), True, None)
    hold = mission_items(waits.with_holds(both), PROFILES['px4'].rules, ORIGIN)[1]
    assert hold.holds
    for remaining in (30.0, 12.0):  # it shrinks while it is flown
        one = timed('B', 2, waits=[remaining], begins=[90.0])
        waits.assign(one, {'A'}, True, hold)
        assert holds(waits, one) == [(place('A'), 40.0)]
    moved = timed('B', 3, waits=[72.0], begins=[150.0])
    waits.assign(moved, {'A'}, True, hold)
    assert holds(waits, moved) == [(place('A'), 72.0)]


def test_a_vehicle_on_the_leg_holds_at_the_task_and_never_flies_back():
    waits = Waits()
    both = timed('AB', waits=[0.0, 40.0], begins=[10.0, 90.0])
    waits.assign(both, set(), True, None)
    leg = mission_items(waits.with_holds(both), PROFILES['px4'].rules, ORIGIN)[-1]
    one = timed('B', 2, waits=[3.0], begins=[90.0])
    waits.note_active(one, leg)
    assert holds(waits, one) == [None]  # the hold is over
    waits.assign(one, {'A'}, True, leg)
    assert holds(waits, one) == [None]
    early = timed('B', 3, waits=[25.0], begins=[90.0])
    waits.assign(early, {'A'}, True, leg)
    assert holds(waits, early) == [(place('B'), 25.0)]
    again = timed('B', 4, waits=[22.0], begins=[90.0])
    waits.assign(again, {'A'}, True, leg)
    assert holds(waits, again) == [(place('B'), 25.0)]


def test_on_the_ground_the_take_off_is_later_and_no_item_waits():
    waits = Waits()
    tasks = timed('AB', stamp=1000.0, waits=[60.0, 0.0], begins=[1080.0, 1100.0])
    waits.assign(tasks, set(), False, None)
    assert holds(waits, tasks) == [None, None]
    assert waits.grounded(1000.0) == waits.grounded(1059.9) == (
        'its departure: task A begins later')
    assert waits.grounded(1060.0) == ''
    assert waits.grounded(500.0) == ''  # the clock went back: it says nothing
    waits.assign(timed('AB', 2, stamp=1020.0), set(), False, None)
    assert waits.grounded(1030.0) == ''


def test_a_take_off_waits_as_long_by_a_clock_that_is_behind_that_of_the_allocator():
    waits = Waits()
    tasks = timed('AB', stamp=1000.0, waits=[60.0, 0.0], begins=[1080.0, 1100.0])
    waits.assign(tasks, set(), False, None)
    assert waits.grounded(700.0) == waits.grounded(759.9) == 'its departure: task A begins later'
    assert waits.grounded(760.0) == waits.grounded(690.0) == ''


def clocked(bench, offset=1000.0):
    """Let ROS time pass with the bench, from 1000 s on."""
    executor = bench.executor()
    executor.policy = replace(bench.policy, clock=offset + bench.now)


@BOTH
def test_services_begin_when_the_plan_says_and_each_task_is_flown_once(kind):
    bench = FlightBench(kind).discover()
    clocked(bench)
    start = 1000.0 + bench.now
    bench.assign(timed('ABC', stamp=start, waits=[40.0, 30.0, 0.0],
                       begins=[start + 80.0, start + 130.0, start + 145.0]))
    took_off = []

    def step():
        clocked(bench)
        if bench.vehicles[1].flight.armed and not took_off:
            took_off.append(bench.now)
        return bench.completed() == ['A', 'B', 'C']

    assert bench.run(step, 400.0)
    assert 40.0 <= took_off[0] + 1000.0 - start <= 45.0
    reached = [(e.t, tuple(map(round, e.point))) for e in bench.truth[1]
               if e.name == 'item_reached']
    at = {name: [t for t, point in reached if point == tuple(map(round, place(name)))]
          for name in 'ABC'}
    assert [len(at[name]) for name in 'ABC'] == [2, 1, 1]  # A, and the wait for B there
    assert 28.0 <= at['A'][1] - at['A'][0] <= 34.0
    assert bench.completed() == ['A', 'B', 'C']


@BOTH
def test_a_new_list_during_a_hold_leaves_it_and_a_later_task_prolongs_it(kind):
    bench = FlightBench(kind).discover()
    first = timed('AB', stamp=0.0, waits=[0.0, 60.0], begins=[0.0, 500.0])
    bench.assign(first)
    assert bench.run(lambda: bench.completed() == ['A'], 200.0)
    bench.run(limit=10.0)
    uploads = bench.onboard().latest_upload.started_at
    bench.assign(timed('B', 2, waits=[48.0], begins=[500.0]))
    bench.run(limit=5.0)
    assert bench.onboard().latest_upload.started_at == uploads
    assert bench.onboard().revision == 2
    bench.assign(timed('B', 3, waits=[90.0], begins=[550.0]))
    begun = bench.now
    assert bench.run(lambda: bench.completed() == ['A', 'B'], 300.0)
    assert bench.now - begun >= 90.0
    assert bench.onboard().latest_upload.started_at > uploads


@BOTH
@pytest.mark.parametrize('other', [
    timed('C', 2, waits=[0.0]), TaskList(2, (), True, ((100.0, 100.0, 70.0),)),
    TaskList(2, (), True)], ids=['another task', 'home by a point', 'home'])
def test_a_hold_ends_where_its_task_is_taken_away(kind, other):
    bench = FlightBench(kind).discover()
    bench.assign(timed('AB', waits=[0.0, 600.0], begins=[0.0, 900.0]))
    assert bench.run(lambda: bench.completed() == ['A'], 200.0)
    bench.run(limit=10.0)
    held = bench.vehicles[1].flight.body.position
    assert math.dist(held, place('A')) < 5.0
    bench.assign(other)
    assert bench.run(lambda: math.dist(bench.vehicles[1].flight.body.position, held) > 20.0, 15.0)


@BOTH
@pytest.mark.parametrize(('names', 'height'), [('BD', None), ('BDC', None), ('BCD', None),
                                               ('BD', 70.0)])
def test_a_hold_in_which_the_list_changes_ends_when_it_was_to_end(kind, names, height):
    bench = FlightBench(kind).discover()
    bench.assign(timed('ABD', waits=[0.0, 40.0], begins=[0.0, 900.0]))
    assert bench.run(lambda: bench.completed() == ['A'], 200.0)
    begun = bench.now
    bench.run(limit=30.0)
    x, y, z = bench.vehicles[1].flight.body.position
    changed = timed(names, 2, waits=[10.0], begins=[900.0])
    if height is not None:
        first = replace(changed.stops[0], via=((x + 10.0, y, height),))
        changed = replace(changed, stops=(first, *changed.stops[1:]))
    bench.assign(changed)
    assert bench.run(lambda: math.dist(bench.vehicles[1].flight.body.position, (x, y, z)) > 5.0,
                     100.0)
    assert 40.0 <= bench.now - begun <= 47.0
