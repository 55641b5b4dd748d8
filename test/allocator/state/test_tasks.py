# SPDX-License-Identifier: Apache-2.0
"""Tasks: accepted, refused, changed, withdrawn, and how they end."""
import pytest
from allocation import AllocatorDriver, task

from uav_task_alloc.allocator.records import AnnouncementAction
from uav_task_alloc.model import Task


@pytest.fixture
def driver():
    driver = AllocatorDriver()
    driver.uav('a', 0.0, 0.0, 50.0)
    driver.uav('b', 1000.0, 0.0, 50.0)
    driver.add(('t1', 100, 0), ('t2', 200, 0), ('t3', 900, 0))
    driver.settle()
    return driver


def test_a_task_is_pending_until_a_uav_is_known():
    driver = AllocatorDriver()
    driver.add(('t1', 100, 0))
    driver.settle()
    assert (driver.state('t1'), driver.reason('t1')) == ('PENDING', 'no UAV known yet')
    assert driver.allocations[-1].revision == 1
    driver.uav('a', 0.0, 0.0, 50.0)
    driver.settle()
    assert (driver.state('t1'), driver.reason('t1')) == ('ASSIGNED', '')


def test_tasks_go_into_lists_with_arrival_times(driver):
    assert driver.route('a') == ('t1', 't2')
    assert driver.route('b') == ('t3',)
    first, second = driver.lists['a'].stops
    stop = 15.0 / 2.5  # [s] that a stop is expected to cost
    assert (first.leg.length, first.eta) == (100.0, pytest.approx(100.0 / 15.0 + 0.5 * stop))
    assert second.eta == pytest.approx(200.0 / 15.0 + 1.5 * stop)
    assert driver.lists['a'].distance == 200.0


def test_service_times_delay_what_comes_after():
    driver = AllocatorDriver()
    driver.uav('a', 0.0, 0.0, 50.0, cruise_speed=10.0)
    driver.add(Task('t1', (100.0, 0.0, 50.0), service_time=7.0), ('t2', 200, 0))
    driver.settle()
    assert [stop.eta for stop in driver.lists['a'].stops] == [12.0, 33.0]  # 4 s a stop


@pytest.mark.parametrize('speedup', [1.0, 8.0, 40.0])
def test_arrival_times_are_those_of_the_flight_however_fast_the_fleet_is_simulated(speedup):
    driver = AllocatorDriver()
    driver.uav('a', 0.0, 0.0, 50.0, cruise_speed=10.0)
    driver.add(Task('t1', (100.0, 0.0, 50.0), service_time=7.0), ('t2', 200, 0), ('t3', 300, 0))
    driver.settle()
    driver.now += 17.0 / speedup
    driver.uav('a', 105.0, 0.0, 50.0, cruise_speed=10.0)
    driver.event('COMPLETED', 't1', 'a')
    driver.core.tick(driver.now, driver.now)
    driver.take()
    assert driver.route('a') == ('t2', 't3')
    assert [stop.eta for stop in driver.lists['a'].stops] == [11.5, 25.5]
    driver.now += 5.0 / speedup  # another list is on board: this one is published again
    driver.uav('a', 155.0, 0.0, 50.0, cruise_speed=10.0, list_revision=9)
    driver.core.tick(driver.now, driver.now)
    driver.take()
    assert driver.lists['a'].revision == 10
    assert [stop.eta for stop in driver.lists['a'].stops] == pytest.approx([6.5, 20.5])


def test_a_burst_costs_one_solve():
    driver = AllocatorDriver()
    driver.uav('a', 0.0, 0.0, 50.0)
    for k in range(40):
        driver.now += 0.001
        driver.add((f't{k}', k, 0))
        driver.core.tick(driver.now, driver.now)
        assert driver.core.due(driver.now, driver.now) is None
    driver.settle()
    assert len(driver.solves) == 1
    assert len(driver.allocations) == 1
    assert len(driver.route('a')) == 40


def test_a_burst_without_end_is_solved_in_between():
    driver = AllocatorDriver()
    driver.uav('a', 0.0, 0.0, 50.0)
    due = []
    for k in range(100):
        driver.now += 0.01
        driver.add((f't{k}', k, 0))
        due.append(driver.core.due(driver.now, driver.now))
    assert sum(problem is not None for problem in due) == 1  # the first one is still running


def test_the_same_announcement_again_changes_nothing(driver):
    before = driver.world.tasks.records['t1']
    verdict, = driver.add(('t1', 100, 0))
    assert verdict.accepted
    driver.settle()
    assert driver.world.tasks.records['t1'] == before
    assert driver.solves == [driver.solves[0]]
    assert 'ADD of t1 ignored: duplicate: announced before, unchanged' in ''.join(driver.notes)


def test_what_is_announced_before_the_clock_begins_is_announced_when_it_begins():
    driver = AllocatorDriver(anticipate='learnt')
    driver.core.tick(driver.now, 0.0)
    driver.world.announce(AnnouncementAction.ADD, [task(('t1', 100, 0))], 0.0, driver.now)
    driver.core.tick(driver.now, 0.0)
    assert driver.world.tasks.records['t1'].since == 0.0
    driver.core.tick(driver.now, 1.8e9)
    driver.world.announce(AnnouncementAction.ADD, [task(('t2', 100, 0))], 1.8e9 + 5.0, driver.now)
    driver.core.tick(driver.now, 1.8e9 + 9.0)
    assert [record.since for record in driver.world.tasks.records.values()] == [1.8e9, 1.8e9 + 5.0]
    assert [row[0] for row in driver.world.announced.seen.seen] == [1.8e9, 1.8e9 + 5.0]
    assert 't1' in driver.world.tasks.unsaved


def test_another_task_under_a_known_id_is_refused_and_the_first_stays(driver):
    verdict, = driver.add(('t1', 500, 500))
    assert not verdict.accepted
    assert verdict.reason == 'duplicate id: another task was announced under it'
    driver.settle()
    assert driver.state('t1') == 'ASSIGNED'
    assert driver.world.tasks.records['t1'].task.position == (100.0, 0.0, 50.0)
    assert 't1' not in driver.world.tasks.rejected
    assert any("'t1' REJECTED: duplicate id" in note for note in driver.notes)


def test_a_replay_of_an_announcement_that_was_updated_since_is_known_again(driver):
    driver.add(('t1', 150, 0), action=AnnouncementAction.UPDATE)
    verdict, = driver.add(('t1', 100, 0))
    assert verdict.accepted
    assert driver.world.tasks.records['t1'].task.position[0] == 150.0


@pytest.mark.parametrize('action', ['update', 'cancel'])
def test_an_unknown_task_cannot_be_changed(driver, action):
    if action == 'update':
        verdict, = driver.add(('t9', 0, 0), action=AnnouncementAction.UPDATE)
    else:
        verdict, = driver.cancel('t9')
    assert not verdict.accepted
    assert verdict.reason == f'unknown task: nothing to {action}'
    assert driver.world.tasks.rejected['t9'][0] == verdict.reason


def test_a_refused_id_is_good_again_when_it_is_announced_well(driver):
    driver.world.refuse('t9', 'task t9: value = -1.0: expected a number in (0, inf]', driver.now)
    driver.add(('t9', 0, 10))
    assert 't9' not in driver.world.tasks.rejected


def test_a_task_of_any_time_is_not_compared_with_all_uavs_of_a_large_fleet(monkeypatch):
    driver, asked = AllocatorDriver(), []
    for k in range(50):
        driver.uav(f'u{k}', 10.0 * k, 0.0, 50.0)
    pace = driver.world.flights.pace
    monkeypatch.setattr(driver.world.flights, 'pace',
                        lambda uav_id: asked.append(uav_id) or pace(uav_id))
    assert driver.add(('t1', 100, 0), Task('t2', (100.0, 0.0, 50.0), latest=driver.now + 900.0))
    assert len(asked) <= 2


def test_refusals_are_bounded():
    driver = AllocatorDriver()
    for k in range(1200):
        driver.cancel(f't{k}')
    assert len(driver.world.tasks.rejected) == 1000
    assert 't1199' in driver.world.tasks.rejected


def test_an_updated_task_moves_in_its_list(driver):
    driver.add(('t1', 100, 50), action=AnnouncementAction.UPDATE)
    driver.settle()
    assert driver.lists['a'].revision == 2
    assert driver.lists['a'].stops[0].task.position == (100.0, 50.0, 50.0)
    assert 'b' not in [each.uav for each in driver.history[2:]]


def test_a_cancelled_task_leaves_its_list_and_stays_cancelled(driver):
    driver.cancel('t1')
    driver.settle()
    assert driver.route('a') == ('t2',)
    assert driver.state('t1') == 'CANCELLED'
    assert driver.cancel('t1')[0].accepted  # once more is harmless
    assert driver.add(('t1', 100, 0))[0].accepted  # a replay does not bring it back
    assert driver.state('t1') == 'CANCELLED'
    assert driver.event('COMPLETED', 't1', 'a', 1) == (
        "event COMPLETED of task 't1': it was cancelled")


def test_a_withdrawal_or_a_refused_change_that_is_repeated_publishes_no_statuses(driver):
    driver.cancel('t1')
    driver.settle()
    assert not driver.world.outbox.statuses
    driver.cancel('t1', 't1')
    driver.add(('t1', 5, 5), action=AnnouncementAction.UPDATE)
    driver.add(('t2', 5, 5))  # another task with its id
    assert not driver.world.outbox.statuses
    driver.cancel('t9')  # is REJECTED in them
    assert driver.world.outbox.statuses


def test_a_completed_task_leaves_the_list_without_a_solve(driver):
    assert driver.event('STARTED', 't1', 'a') == ''
    driver.core.tick(driver.now, driver.now)
    assert driver.state('t1') == 'ACTIVE'
    solves = len(driver.solves)
    assert driver.event('COMPLETED', 't1', 'a') == ''
    driver.settle()
    assert (driver.route('a'), driver.lists['a'].revision) == (('t2',), 2)
    assert len(driver.solves) == solves
    assert driver.state('t1') == 'COMPLETED'
    assert driver.lists['a'].distance == 100.0
    assert driver.event('COMPLETED', 't1', 'a', 1) == (
        "event COMPLETED of task 't1': it is COMPLETED already")
    assert not driver.add(('t1', 5, 5), action=AnnouncementAction.UPDATE)[0].accepted
    assert not driver.cancel('t1')[0].accepted


@pytest.mark.parametrize(('event', 'why'), [
    (('STARTED', 't9', 'a'), "event STARTED of task 't9': unknown task"),
    (('COMPLETED', 't1', 'z', 1), "event COMPLETED of task 't1': unknown UAV 'z'"),
    (('COMPLETED', 't1', 'b'),
     "event COMPLETED of task 't1': revision 1 of the list of b did not have it"),
    (('COMPLETED', 't1', 'a', 7),
     "event COMPLETED of task 't1': revision 7 of the list of a did not have it"),
    (('FAILED', 't3', 'a', 0),
     "event FAILED of task 't3': revision 0 of the list of a did not have it"),
])
def test_an_event_that_cannot_be_is_refused(driver, event, why):
    before = dict(driver.world.tasks.records)
    assert driver.event(*event) == why
    assert driver.world.tasks.records == before


def test_a_late_event_of_an_older_list_counts(driver):
    driver.add(('t4', 300, 0))
    driver.settle()
    assert driver.lists['a'].revision == 2
    assert driver.event('COMPLETED', 't1', 'a', revision=1) == ''
    assert driver.state('t1') == 'COMPLETED'


def test_what_was_flown_by_a_uav_believed_lost_is_not_flown_again(driver):
    driver.now += 10.0
    driver.uav('b', 1000.0, 0.0, 50.0)
    driver.settle(report=False)
    assert set(driver.route('b')) == {'t1', 't2', 't3'}
    assert driver.event('COMPLETED', 't1', 'a', revision=1) == ''
    assert driver.event('FAILED', 't2', 'a', revision=1) == (
        "event FAILED of task 't2': a does not have it any more")
    driver.uav('b', 1000.0, 0.0, 50.0)
    driver.settle(report=False)
    assert set(driver.route('b')) == {'t2', 't3'}
    assert driver.world.tasks.records['t1'].uav == 'a'


def test_a_task_that_failed_is_tried_by_another_uav_and_fails_when_none_is_left(driver):
    driver.event('FAILED', 't1', 'a', reason='refused by the autopilot')
    assert driver.reason('t1') == 'failed on a: refused by the autopilot'
    driver.settle()
    assert 't1' in driver.route('b')
    driver.event('FAILED', 't1', 'b', reason='too high')
    driver.settle()
    assert driver.state('t1') == 'FAILED'
    assert driver.reason('t1') == 'failed on b: too high; no other UAV can'
    assert 't1' not in driver.route('b') + driver.route('a')
    driver.add(Task('t1', (100.0, 0.0, 40.0)), action=AnnouncementAction.UPDATE)
    driver.settle()
    assert driver.state('t1') == 'ASSIGNED'  # changed, it gets another chance


def test_a_task_that_failed_on_all_available_uavs_waits_and_names_them(driver):
    driver.uav('b', 1000.0, 0.0, 50.0, available=False)
    driver.event('FAILED', 't1', 'a', reason='refused by the autopilot')
    driver.settle()
    assert driver.state('t1') == 'UNASSIGNED'
    assert driver.reason('t1') == 'failed on a; no other UAV that may fly it is available'


def test_a_task_is_not_tried_for_ever():
    driver = AllocatorDriver(max_attempts=2)
    for k in range(4):
        driver.uav(f'u{k}', 10.0 * k, 0.0, 50.0)
    driver.add(('t1', 100, 0))
    driver.settle()
    for _ in range(2):
        driver.event('FAILED', 't1', driver.world.tasks.records['t1'].uav)
        driver.settle()
    assert driver.state('t1') == 'FAILED'
    assert driver.reason('t1').endswith('no reason given; tried often enough')


def test_a_task_for_an_unknown_uav_waits_with_that_reason(driver):
    driver.add(Task('t4', (0.0, 10.0, 50.0), allowed_uavs=frozenset({'z'})))
    driver.settle()
    assert driver.state('t4') == 'UNASSIGNED'
    assert driver.reason('t4') == 'allowed for z only: not known yet'
    driver.uav('z', 0.0, 500.0, 50.0)
    driver.settle()
    assert driver.route('z') == ('t4',)


def test_a_task_that_no_uav_can_do_has_the_reason(driver):
    driver.add(Task('t4', (0.0, 10.0, 50.0), required_capabilities=frozenset({'gripper'})))
    driver.settle()
    assert (driver.state('t4'), driver.reason('t4')) == ('UNASSIGNED', 'no UAV can')
    assert 't4' in driver.allocations[-1].plan.unassigned
