# SPDX-License-Identifier: Apache-2.0
"""Tasks: accepted, refused, changed, withdrawn, and how they end."""
import pytest
from allocation import Desk

from uav_task_alloc.allocator.records import AnnouncementAction
from uav_task_alloc.model import Task


@pytest.fixture
def desk():
    desk = Desk()
    desk.uav('a', 0.0, 0.0, 50.0)
    desk.uav('b', 1000.0, 0.0, 50.0)
    desk.add(('t1', 100, 0), ('t2', 200, 0), ('t3', 900, 0))
    desk.settle()
    return desk


def test_a_task_is_pending_until_a_uav_is_heard():
    desk = Desk()
    desk.add(('t1', 100, 0))
    desk.settle()
    assert (desk.state('t1'), desk.reason('t1')) == ('PENDING', 'no UAV known yet')
    assert desk.allocations[-1].revision == 1
    desk.uav('a', 0.0, 0.0, 50.0)
    desk.settle()
    assert (desk.state('t1'), desk.reason('t1')) == ('ASSIGNED', '')


def test_tasks_go_into_lists_with_arrival_times(desk):
    assert desk.route('a') == ('t1', 't2')
    assert desk.route('b') == ('t3',)
    first, second = desk.lists['a'].stops
    assert (first.leg.length, first.eta) == (100.0, pytest.approx(100.0 / 15.0))
    assert second.eta == pytest.approx(200.0 / 15.0)
    assert desk.lists['a'].distance == 200.0


def test_service_times_delay_what_comes_after():
    desk = Desk()
    desk.uav('a', 0.0, 0.0, 50.0, cruise_speed=10.0)
    desk.add(Task('t1', (100.0, 0.0, 50.0), service_time=7.0), ('t2', 200, 0))
    desk.settle()
    assert [stop.eta for stop in desk.lists['a'].stops] == [10.0, 27.0]


def test_a_burst_costs_one_solve():
    desk = Desk()
    desk.uav('a', 0.0, 0.0, 50.0)
    for k in range(40):
        desk.now += 0.001
        desk.add((f't{k}', k, 0))
        desk.core.tick(desk.now, desk.now)
        assert desk.core.due(desk.now, desk.now) is None
    desk.settle()
    assert len(desk.solves) == 1
    assert len(desk.allocations) == 1
    assert len(desk.route('a')) == 40


def test_a_burst_without_end_is_solved_in_between():
    desk = Desk()
    desk.uav('a', 0.0, 0.0, 50.0)
    due = []
    for k in range(100):
        desk.now += 0.01
        desk.add((f't{k}', k, 0))
        due.append(desk.core.due(desk.now, desk.now))
    assert sum(problem is not None for problem in due) == 1  # the first one is still running


def test_the_same_announcement_again_changes_nothing(desk):
    before = desk.world.tasks.records['t1']
    verdict, = desk.add(('t1', 100, 0))
    assert verdict.accepted
    desk.settle()
    assert desk.world.tasks.records['t1'] == before
    assert desk.solves == [desk.solves[0]]
    assert 'ADD of t1 ignored: duplicate: announced before, unchanged' in ''.join(desk.notes)


def test_another_task_under_a_known_id_is_refused_and_the_first_stays(desk):
    verdict, = desk.add(('t1', 500, 500))
    assert not verdict.accepted
    assert verdict.reason == 'duplicate id: another task was announced under it'
    desk.settle()
    assert desk.state('t1') == 'ASSIGNED'
    assert desk.world.tasks.records['t1'].task.position == (100.0, 0.0, 50.0)
    assert 't1' not in desk.world.tasks.rejected
    assert any("'t1' REJECTED: duplicate id" in note for note in desk.notes)


def test_a_replay_of_an_announcement_that_was_updated_since_is_known_again(desk):
    desk.add(('t1', 150, 0), action=AnnouncementAction.UPDATE)
    verdict, = desk.add(('t1', 100, 0))
    assert verdict.accepted
    assert desk.world.tasks.records['t1'].task.position[0] == 150.0


@pytest.mark.parametrize('action', ['update', 'cancel'])
def test_an_unknown_task_cannot_be_changed(desk, action):
    if action == 'update':
        verdict, = desk.add(('t9', 0, 0), action=AnnouncementAction.UPDATE)
    else:
        verdict, = desk.cancel('t9')
    assert not verdict.accepted
    assert verdict.reason == f'unknown task: nothing to {action}'
    assert desk.world.tasks.rejected['t9'][0] == verdict.reason


def test_a_refused_id_is_good_again_when_it_is_announced_well(desk):
    desk.world.refuse('t9', 'task t9: value = -1.0: expected a number in (0, inf]', desk.now)
    desk.add(('t9', 0, 10))
    assert 't9' not in desk.world.tasks.rejected


def test_refusals_are_bounded():
    desk = Desk()
    for k in range(1200):
        desk.cancel(f't{k}')
    assert len(desk.world.tasks.rejected) == 1000
    assert 't1199' in desk.world.tasks.rejected


def test_an_updated_task_moves_in_its_list(desk):
    desk.add(('t1', 100, 50), action=AnnouncementAction.UPDATE)
    desk.settle()
    assert desk.lists['a'].revision == 2
    assert desk.lists['a'].stops[0].task.position == (100.0, 50.0, 50.0)
    assert 'b' not in [each.uav for each in desk.history[2:]]


def test_a_cancelled_task_leaves_its_list_and_stays_cancelled(desk):
    desk.cancel('t1')
    desk.settle()
    assert desk.route('a') == ('t2',)
    assert desk.state('t1') == 'CANCELLED'
    assert desk.cancel('t1')[0].accepted  # once more is harmless
    assert desk.add(('t1', 100, 0))[0].accepted  # a replay does not bring it back
    assert desk.state('t1') == 'CANCELLED'
    assert desk.event('COMPLETED', 't1', 'a', 1) == (
        "event COMPLETED of task 't1': it was cancelled")


def test_a_completed_task_leaves_the_list_without_a_solve(desk):
    assert desk.event('STARTED', 't1', 'a') == ''
    desk.core.tick(desk.now, desk.now)
    assert desk.state('t1') == 'ACTIVE'
    solves = len(desk.solves)
    assert desk.event('COMPLETED', 't1', 'a') == ''
    desk.settle()
    assert (desk.route('a'), desk.lists['a'].revision) == (('t2',), 2)
    assert len(desk.solves) == solves
    assert desk.state('t1') == 'COMPLETED'
    assert desk.lists['a'].distance == 100.0
    assert desk.event('COMPLETED', 't1', 'a', 1) == (
        "event COMPLETED of task 't1': it is COMPLETED already")
    assert not desk.add(('t1', 5, 5), action=AnnouncementAction.UPDATE)[0].accepted
    assert not desk.cancel('t1')[0].accepted


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
def test_an_event_that_cannot_be_is_refused(desk, event, why):
    before = dict(desk.world.tasks.records)
    assert desk.event(*event) == why
    assert desk.world.tasks.records == before


def test_a_late_event_of_an_older_list_counts(desk):
    desk.add(('t4', 300, 0))
    desk.settle()
    assert desk.lists['a'].revision == 2
    assert desk.event('COMPLETED', 't1', 'a', revision=1) == ''
    assert desk.state('t1') == 'COMPLETED'


def test_what_was_flown_by_a_uav_believed_lost_is_not_flown_again(desk):
    desk.now += 10.0
    desk.uav('b', 1000.0, 0.0, 50.0)
    desk.settle(report=False)
    assert set(desk.route('b')) == {'t1', 't2', 't3'}
    assert desk.event('COMPLETED', 't1', 'a', revision=1) == ''
    assert desk.event('FAILED', 't2', 'a', revision=1) == (
        "event FAILED of task 't2': a does not have it any more")
    desk.uav('b', 1000.0, 0.0, 50.0)
    desk.settle(report=False)
    assert set(desk.route('b')) == {'t2', 't3'}
    assert desk.world.tasks.records['t1'].uav == 'a'


def test_a_task_that_failed_is_tried_by_another_uav_and_fails_when_nobody_is_left(desk):
    desk.event('FAILED', 't1', 'a', reason='refused by the autopilot')
    assert desk.reason('t1') == 'failed on a: refused by the autopilot'
    desk.settle()
    assert 't1' in desk.route('b')
    desk.event('FAILED', 't1', 'b', reason='too high')
    desk.settle()
    assert desk.state('t1') == 'FAILED'
    assert desk.reason('t1') == 'failed on b: too high; no other UAV can'
    assert 't1' not in desk.route('b') + desk.route('a')
    desk.add(Task('t1', (100.0, 0.0, 40.0)), action=AnnouncementAction.UPDATE)
    desk.settle()
    assert desk.state('t1') == 'ASSIGNED'  # changed, it gets another chance


def test_a_task_that_failed_on_all_who_are_there_waits_and_says_on_whom(desk):
    desk.uav('b', 1000.0, 0.0, 50.0, available=False)
    desk.event('FAILED', 't1', 'a', reason='refused by the autopilot')
    desk.settle()
    assert desk.state('t1') == 'UNASSIGNED'
    assert desk.reason('t1') == 'failed on a; no other UAV that may fly it is available'


def test_a_task_is_not_tried_for_ever():
    desk = Desk(max_attempts=2)
    for k in range(4):
        desk.uav(f'u{k}', 10.0 * k, 0.0, 50.0)
    desk.add(('t1', 100, 0))
    desk.settle()
    for _ in range(2):
        desk.event('FAILED', 't1', desk.world.tasks.records['t1'].uav)
        desk.settle()
    assert desk.state('t1') == 'FAILED'
    assert desk.reason('t1').endswith('no reason given; tried often enough')


def test_a_task_for_a_uav_nobody_heard_of_waits_and_says_so(desk):
    desk.add(Task('t4', (0.0, 10.0, 50.0), allowed_uavs=frozenset({'z'})))
    desk.settle()
    assert desk.state('t4') == 'UNASSIGNED'
    assert desk.reason('t4') == 'allowed for z only: not known yet'
    desk.uav('z', 0.0, 500.0, 50.0)
    desk.settle()
    assert desk.route('z') == ('t4',)


def test_a_task_that_nobody_can_do_says_why(desk):
    desk.add(Task('t4', (0.0, 10.0, 50.0), required_capabilities=frozenset({'gripper'})))
    desk.settle()
    assert (desk.state('t4'), desk.reason('t4')) == ('UNASSIGNED', 'nobody can')
    assert 't4' in desk.allocations[-1].plan.unassigned
