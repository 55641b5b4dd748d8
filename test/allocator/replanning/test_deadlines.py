# SPDX-License-Identifier: Apache-2.0
"""Windows, deadlines and trips in the allocator: with the real solver over virtual time."""
import math
from dataclasses import replace

import pytest
from allocation import AllocatorDriver

from uav_task_alloc import plan
from uav_task_alloc.allocator.records import AnnouncementAction
from uav_task_alloc.allocator.replanning import planning
from uav_task_alloc.allocator.status import health_warnings
from uav_task_alloc.model import Task
from uav_task_alloc.work.pieces import Work
from uav_task_alloc.work.values import Kind

SPEED = 10.0  # [m/s]


def driver(**params):
    params.setdefault('solve_budget', 0.02)
    return AllocatorDriver(plan=plan, **params)


def at(name, x, y=0.0, **more):
    return Task(name, (float(x), float(y), 50.0), **more)


def uav(made, uav_id, x, y=0.0, **more):
    return made.uav(uav_id, float(x), float(y), 50.0, cruise_speed=SPEED, **more)


def report(made, places, seconds=0.0, **more):
    """UAVs report where they are, after some time."""
    made.now += seconds
    for uav_id, (x, y) in places.items():
        uav(made, uav_id, x, y, **more)
    made.core.tick(made.now, made.now)
    made.settle(report=False)


@pytest.mark.parametrize('path', [((1000, 0, 50), (100, 0, 50)), ((100, 0, 50), (1000, 0, 50))])
def test_a_deadline_that_one_end_of_a_line_keeps_is_accepted(path):
    made = driver()
    uav(made, 'a', 0)
    latest = made.now + 40.0
    work = Work(Task('line', path[0], latest=latest), Kind.LINE, path)
    assert made.add(work)[0].accepted
    made.settle()
    stop, = made.lists['a'].stops
    assert stop.entry == (100.0, 0.0, 50.0)
    assert made.now + stop.start < latest
    late = replace(work, task=replace(work.task, id='late', latest=made.now + 5.0))
    assert 'cannot be kept' in made.add(late)[0].reason


def test_a_uav_waits_for_a_window_and_the_start_is_expected_at_its_begin():
    made = driver()
    uav(made, 'a', 0)
    opens = made.now + 60.0
    made.add(at('t', 100, earliest=opens, latest=opens + 30.0, service_time=5.0))
    made.settle()
    stop, stamp = made.lists['a'].stops[0], made.lists['a'].stamp
    assert stop.eta == pytest.approx(10.0 + 2.0, abs=0.5)  # 4 s a stop
    assert stamp + stop.start == pytest.approx(opens)
    assert made.world.deadlines.expected['t'] == pytest.approx(opens)


def test_a_deadline_orders_a_route_whose_shortest_order_would_miss_it():
    made = driver()
    uav(made, 'a', 0)
    made.add(at('near', 100), at('far', 1000, latest=made.now + 105.0),
             at('back', -200))
    made.settle()
    assert made.route('a')[-1] == 'back'  # 1400 m with it first


@pytest.mark.parametrize(('epoch', 'text'), [
    (1000.0, 'latest 1050.0 s cannot be kept: the earliest possible start is 1100.0 s (a)'),
    (1_800_000_000.0, 'latest 08:00:50 UTC cannot be kept: the earliest possible start is '
                      '08:01:40 UTC (a)')])
def test_what_cannot_be_kept_is_refused_with_the_times_of_the_clock(epoch, text):
    made = driver()
    made.now = epoch
    uav(made, 'a', 0)
    verdict, = made.add(at('t', 1000, latest=epoch + 50.0))
    assert (verdict.accepted, verdict.reason) == (False, text)
    assert made.world.tasks.rejected['t'][0] == text


def test_a_latest_in_the_past_and_a_payload_too_heavy_are_refused():
    made = driver()
    uav(made, 'a', 0, payload_capacity=2.0)
    past, heavy = made.add(at('t', 10, latest=made.now - 90.0), at('h', 10, payload=3.0))
    assert past.reason == 'latest 910.0 s is 90 s in the past: it is 1000.0 s'
    assert heavy.reason == 'payload 3 kg; the largest capacity is 2 kg (a)'


def test_an_accepted_task_stays_when_an_update_of_it_is_refused():
    made = driver()
    uav(made, 'a', 0)
    task = at('t', 500, latest=made.now + 80.0)
    made.add(task)
    made.settle()
    verdict, = made.add(replace(task, latest=made.now + 5.0), action=AnnouncementAction.UPDATE)
    assert not verdict.accepted
    assert made.route('a') == ('t',)
    made.now += 100.0
    assert made.add(task)[0].unchanged  # a replay is none


def test_a_deadline_that_no_uav_can_keep_is_unassigned_with_times_of_the_clock():
    made = driver()
    made.add(at('t', 1000, latest=made.now + 50.0))  # no UAV is known yet: nothing is refused
    uav(made, 'a', 0)
    made.settle()
    assert made.state('t') == 'UNASSIGNED'
    assert made.reason('t') == (
        'latest 1050.0 s cannot be kept: no UAV can start it before 1102.1 s (a); an update with '
        'a later `latest` would help')
    report(made, {'a': (0, 0)}, seconds=60.0)
    made.core.world.request_replan('test', made.now)
    made.settle()
    assert 'its latest 1050.0 s has passed' in made.reason('t')


def test_a_task_in_no_list_says_when_its_latest_has_passed_without_another_plan():
    made = driver(background_budget=0.0)
    uav(made, 'a', 0, payload_capacity=2.0, home=(500.0, 0.0, 0.0))
    made.add(at('p', 100, payload=1.0, latest=made.now + 60.0), at('q', 100, payload=1.0,
                                                                   latest=made.now + 500.0))
    made.settle()
    assert made.reason('p').endswith('no UAV on the ground can carry it')
    solves = list(made.solves)
    report(made, {'a': (0, 0)}, 61.0, payload_capacity=2.0, home=(500.0, 0.0, 0.0))
    assert made.reason('p').endswith(
        'has passed; an update with a later `latest` would help')
    assert made.reason('q').endswith('no UAV on the ground can carry it')
    assert made.solves == solves


def test_no_uav_in_the_air_is_said_to_keep_the_deadline_of_a_payload():
    made = driver()
    uav(made, 'a', 0, payload_capacity=2.0, home=(500.0, 0.0, 0.0))
    made.uav('b', 0.0, 0.0, 0.0, cruise_speed=SPEED, standby=True, payload_capacity=0.5,
             home=(0.0, 0.0, 0.0))
    made.add(at('p', 100, payload=1.0, latest=made.now + 60.0))
    made.settle()
    assert made.reason('p') == ('payload 1 kg; every UAV that could carry it is in the air; '
                                'no UAV on the ground can carry it')
    made.uav('b', 0.0, 0.0, 0.0, cruise_speed=SPEED, standby=True, payload_capacity=2.0,
             home=(0.0, 0.0, 0.0), available=False)
    made.settle()
    assert 'b could start it at' in made.reason('p')


@pytest.mark.parametrize('objective', ['distance', 'balanced'])
def test_an_accepted_deadline_is_not_dropped_for_a_task_of_more_value(objective):
    made = driver(objective=objective)
    uav(made, 'a', 0)
    made.add(at('low', 500, value=1.0, latest=made.now + 55.0))
    made.settle()
    made.add(at('high', -500, value=100.0, latest=made.now + 55.0))
    made.settle()
    assert made.route('a') == ('low',)
    assert made.state('high') == 'UNASSIGNED'
    assert made.reason('high').startswith('left out: ')


def test_a_task_that_fits_is_added_before_and_after_an_accepted_deadline():
    made = driver()
    uav(made, 'a', 0)
    made.add(at('low', 500, latest=made.now + 70.0))
    made.settle()
    made.add(at('on_the_way', 250, 10, value=9.0), at('later', 900, value=9.0))
    made.settle()
    assert made.route('a') == ('on_the_way', 'low', 'later')


def late_fleet():
    """A UAV on its way to a deadline, slower than planned; another one that is switched off."""
    made = driver(locked_tasks=1)
    uav(made, 'a', 0)
    uav(made, 'b', 1000, 300)
    made.world.set_available('b', False, made.now)
    made.add(at('t', 1000, latest=made.now + 110.0))
    made.settle()
    assert made.event('STARTED', 't', 'a') == ''
    return made


def test_a_late_task_is_reported_with_how_much_and_what_would_help():
    made = late_fleet()
    uav(made, 'b', 1000, 300)
    for k in range(1, 31):
        report(made, {'a': (5.0 * k, 0)}, seconds=1.0)
    task = made.world.tasks.records['t']
    assert task.state.name == 'ACTIVE'
    assert 'after its latest 1110.0 s; b could start it at ' in task.reason
    assert task.reason.endswith('if it were available')
    expected = made.world.deadlines.expected['t']
    assert expected == pytest.approx(made.now + 85.0, abs=8.0)
    lines = [note for note in made.notes if "task 't' will be late" in note]
    assert len(lines) == 1
    assert made.levels[lines[0]] == 'warning'


def test_a_task_that_is_late_goes_to_a_uav_that_can_keep_its_deadline():
    made = late_fleet()
    made.world.params = replace(made.world.params, locked_tasks=0)
    made.world.set_available('b', True, made.now)
    for k in range(1, 31):
        report(made, {'a': (5.0 * k, 0), 'b': (1000, 300)}, seconds=1.0)
    assert made.route('b') == ('t',)
    assert made.world.deadlines.texts == {}


def test_predictions_of_a_flight_as_planned_change_nothing():
    made = driver()
    uav(made, 'a', 0)
    made.add(at('t1', 500), at('t2', 900, earliest=made.now + 200.0))
    made.settle()
    published, allocations = len(made.history), len(made.allocations)
    for k in range(1, 40):
        report(made, {'a': (SPEED * k, 0)}, seconds=1.0)
    assert (len(made.history), len(made.allocations)) == (published, allocations)


def test_a_wait_that_changes_is_sent_again_and_small_changes_are_not():
    made = driver()
    uav(made, 'a', 0)
    made.add(at('t1', 500), at('t2', 900, earliest=made.now + 200.0))
    made.settle()
    report(made, {'a': (0, 0)}, seconds=3.0)
    assert made.lists['a'].stops[1].wait == pytest.approx(110.0 - 6.0, abs=0.5)
    report(made, {'a': (0, 0)}, seconds=4.0)
    assert made.lists['a'].stops[1].wait == pytest.approx(103.0 - 6.0, abs=0.5)


def test_a_wait_that_is_far_away_is_sent_again_only_for_a_greater_change():
    made = driver()
    uav(made, 'a', 0)
    made.add(at('t1', 500), at('t2', 900, earliest=made.now + 2000.0))
    made.settle()
    sent = made.lists['a'].revision
    report(made, {'a': (0, 0)}, seconds=35.0)
    assert made.lists['a'].revision == sent
    report(made, {'a': (0, 0)}, seconds=10.0)
    assert made.lists['a'].revision == sent + 1


def test_the_announcement_of_a_task_survives_a_restart():
    made = driver()
    made.add(at('t', 10))
    row = made.core.rows()[0]
    assert row.body['since'] == 1000.0
    from uav_task_alloc.allocator.persistence.restore import restored_state
    assert restored_state([row]).tasks[0].since == 1000.0
    del row.body['since']  # of an earlier version
    assert restored_state([row]).tasks[0].since == row.body['stamp']


def test_without_times_the_problem_is_that_of_distances_alone():
    made = driver()
    uav(made, 'a', 0)
    tasks = [at('t1', 500), at('t2', 900)]
    made.add(*tasks)
    problem = made.begin()
    assert problem.tasks[0] is made.world.tasks.records['t1'].task
    from uav_task_alloc.allocator.replanning.from_now import from_now
    assert from_now(problem) is problem
    assert all(math.isinf(task.latest) for task in problem.tasks)


FULL = {'full_range': 3000.0, 'turnaround': 60.0, 'home': (0.0, 0.0, 50.0)}


def test_a_later_trip_is_counted_on_and_published_after_the_battery_change():
    made = driver(trips=3, route_end='home')
    uav(made, 'a', 0, range=3000.0, battery=1.0, standby=True, **FULL)
    made.add(at('t1', 1200), at('t2', -1200))
    made.settle()
    first, = made.route('a')
    second = {'t1': 't2', 't2': 't1'}[first]
    assert made.lists['a'].returns
    assert (made.state(second), made.reason(second)) == ('ASSIGNED', 'after battery change 1 of a')
    assert made.world.deadlines.expected[second] == pytest.approx(
        made.now + 8.0 + 244.0 + 60.0 + 120.0, abs=3.0)  # 4 s a take-off, 4 s a stop
    x = 1200.0 if first == 't1' else -1200.0
    uav(made, 'a', x, range=1800.0, battery=0.6, active_task=first, **FULL)
    assert made.event('COMPLETED', first, 'a') == ''
    made.settle(wait=120.0)
    assert made.lists['a'].stops == ()
    for battery, metres, listed in ((0.19, 600.0, ()), (1.0, 3000.0, (second,))):
        uav(made, 'a', 0, range=metres, battery=battery, standby=True, **FULL)
        made.settle(wait=1.0)
        assert made.world.lists.get('a').task_ids == listed
        assert made.state(second) == 'ASSIGNED'


def test_take_off_and_landing_use_endurance_beside_the_legs():
    for seconds, state in ((300.0, 'UNASSIGNED'), (345.0, 'ASSIGNED')):
        made = driver(route_end='home')
        made.uav('a', 0.0, 0.0, 0.0, cruise_speed=SPEED, standby=True, endurance=seconds,
                 climb_speed=2.5, descent_speed=1.5)
        made.add(at('t', 1200))  # 240 s of legs, 4 s of a stop
        made.settle()  # 24 s to climb to 50 m, 4 s to return at 60 m, 40 s down, 5 % for the rest
        assert made.state('t') == state


def test_silence_during_a_battery_change_is_no_fault_until_it_takes_too_long():
    made = driver(trips=2, route_end='home', uav_timeout=3.0)
    for uav_id, battery in (('a', 0.3), ('b', 1.0)):
        uav(made, uav_id, 0, range=900.0, battery=battery, standby=True, **FULL)
    made.settle()
    made.settle(wait=4.0, report=False)
    assert any(note == 'a silent for 3 s at its base: its battery may be out'
               for note in made.notes)
    assert 'silent: b' in health_warnings(made.world, '', '', made.now)
    made.settle(wait=200.0, report=False)
    assert 'silent: a, b' in health_warnings(made.world, '', '', made.now)


def test_with_one_trip_a_task_out_of_range_is_left_out_until_the_uav_is_full_again():
    made = driver(route_end='home')
    uav(made, 'a', 0, range=600.0, battery=0.19, standby=True, **FULL)
    made.add(at('t1', 1200))
    made.settle()
    assert made.state('t1') == 'UNASSIGNED'
    uav(made, 'a', 0, range=3000.0, battery=1.0, standby=True, **FULL)
    made.settle(wait=1.0)
    assert made.route('a') == ('t1',)


def test_a_uav_whose_battery_nobody_changes_is_no_longer_counted_on():
    made = driver(trips=2, route_end='home')
    for wait, state in ((0.0, 'ASSIGNED'), (200.0, 'UNASSIGNED')):
        made.now += wait
        uav(made, 'a', 0, range=600.0, battery=0.1, standby=True, **FULL)
        if not wait:
            made.add(at('t1', 1200))
        made.world.request_replan('test', made.now)
        made.settle()
        assert made.state('t1') == state
    assert made.reason('t1') == 'no UAV available: a is low on battery'


@pytest.mark.parametrize('step', [500.0, -500.0])
def test_a_jump_of_the_clock_causes_one_plan_and_nothing_is_lost(step):
    made = driver()
    uav(made, 'a', 0)
    made.add(at('t', 500, latest=made.now + 400.0))
    made.settle()
    stamp = made.now + step
    for _ in range(5):
        made.now += 1.0
        stamp += 1.0
        made.core.tick(made.now, stamp)
        made.world.update_uav(made.world.fleet.records['a'].report, made.now, stamp)
        problem = made.core.due(made.now, stamp)
        if problem is not None:
            answer = planning.solve_problem(plan, problem, made.world.params, lambda: False)
            made.core.adopt(answer, made.now, stamp)
        made.take()
    way = 'forward' if step > 0.0 else 'back'
    lines = [note for note in made.notes if 'clock jumped' in note]
    assert len(lines) == 1
    assert f'jumped {way} by {501 if step > 0 else 499}.0 s' in lines[0]
    if step > 0.0:
        assert 'its latest 1400.0 s has passed' in made.reason('t')
    else:
        assert (made.state('t'), made.route('a')) == ('ASSIGNED', ('t',))


def test_a_clock_that_stands_still_delays_no_plan_and_no_silence():
    made = driver()
    stamp = made.now
    uav(made, 'a', 0)
    made.add(at('t', 500))
    made.settle()
    made.add(at('t2', 600))
    for _ in range(10):
        made.now += 1.0
        made.core.tick(made.now, stamp)
        problem = made.core.due(made.now, stamp)
        if problem is not None:
            made.core.adopt(planning.solve_problem(
                plan, problem, made.world.params, lambda: False), made.now, stamp)
    assert made.world.fleet.records['a'].silent
    assert made.state('t2') == 'UNASSIGNED'
    assert made.world.tasks.is_open('t2')
