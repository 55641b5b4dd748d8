# SPDX-License-Identifier: Apache-2.0
"""What an allocator remembers is bounded: ended tasks go, open ones stay, a flood is refused."""
from allocation import Desk

from uav_task_alloc.allocator import tasks, world
from uav_task_alloc.allocator.restore import saved


def flown(count, **params):
    desk = Desk(**params)
    desk.uav('a', 0.0, 0.0, 50.0)
    for k in range(count):
        desk.add((f't{k}', 100.0 * k, 0.0))
        desk.settle()
        desk.event('COMPLETED', f't{k}', 'a')
        desk.settle()
    return desk


def test_only_the_newest_ended_tasks_are_remembered():
    desk = flown(6, keep_ended=3)
    assert sorted(desk.world.tasks.records) == ['t3', 't4', 't5']
    assert desk.world.lists._carried.keys() <= {('a', f't{k}') for k in (3, 4, 5)}


def test_what_is_forgotten_leaves_the_journal_too():
    desk = flown(3, keep_ended=3)
    desk.core.written()
    desk.add(('t3', 0.0, 0.0))
    desk.settle()
    desk.event('COMPLETED', 't3', 'a')
    desk.settle()
    assert [row.id for row in desk.core.rows() if row.body is None] == ['t0']


def test_an_open_task_is_never_forgotten_however_old():
    desk = Desk(keep_ended=0)
    desk.add(('t0', 0.0, 0.0))
    for k in range(1, 4):
        desk.add((f't{k}', 0.0, 0.0))
        desk.cancel(f't{k}')
        desk.settle()
    assert list(desk.world.tasks.records) == ['t0']


def test_the_order_in_which_tasks_ended_survives_a_restart():
    before = flown(4)
    after = Desk(saved(before.core.rows()), keep_ended=2)
    after.settle()
    assert sorted(after.world.tasks.records) == ['t2', 't3']


def test_more_open_tasks_than_can_be_held_are_refused(monkeypatch):
    monkeypatch.setattr(tasks, 'MOST_OPEN', 2)
    desk = Desk()
    verdicts = desk.add(*((f't{k}', 0.0, 0.0) for k in range(3)))
    assert [v.accepted for v in verdicts] == [True, True, False]
    assert verdicts[2].reason == 'open tasks = 2: expected fewer'
    desk.cancel('t0')
    assert desk.add(('t2', 0.0, 0.0))[0].accepted


def test_made_up_uavs_do_not_keep_a_real_one_out(monkeypatch):
    monkeypatch.setattr(world, 'MOST_UAVS', 2)
    desk = Desk()
    desk.uav('a', 0.0, 0.0, 50.0)
    desk.add(('t0', 100.0, 0.0))
    desk.settle()
    desk.uav('ghost', 0.0, 0.0, 50.0)
    assert 'expected one of the 2 UAVs' in desk.uav('b', 0.0, 0.0, 50.0)
    for _ in range(4):  # the ghost falls silent
        desk.now += 2.0
        desk.uav('a', 0.0, 0.0, 50.0)
        desk.settle(hear=False)
    assert desk.uav('b', 0.0, 0.0, 50.0) == ''
    assert sorted(desk.world.fleet.records) == ['a', 'b']


def test_finding_33_an_event_of_a_forgotten_task_is_none_of_its_namesake():
    desk = flown(1, keep_ended=0)
    before = desk.world.lists.get('a').revision
    desk.add(('t0', 0.0, 0.0))
    desk.settle()
    held = desk.world.lists.get('a').revision
    assert 'did not have it' in desk.event('COMPLETED', 't0', 'a', revision=before)
    assert 'did not have it' in desk.event('COMPLETED', 't0', 'a', revision=before)
    desk.settle()
    assert desk.state('t0') == 'ASSIGNED'
    assert desk.world.lists.get('a').revision == held + 1  # the list is the answer, once a second
    assert desk.event('COMPLETED', 't0', 'a') == ''


def test_finding_33_an_event_for_a_revision_that_is_yet_to_come_is_not_answered():
    desk = flown(0)
    desk.add(('t0', 0.0, 0.0))
    desk.settle()
    assert 'did not have it' in desk.event('COMPLETED', 't0', 'a', revision=77)
    desk.settle()
    assert desk.world.lists.get('a').revision == 1
