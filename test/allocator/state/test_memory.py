# SPDX-License-Identifier: Apache-2.0
"""What an allocator remembers is bounded: ended tasks go, open ones stay, a flood is refused."""
from allocation import Desk

from uav_task_alloc.allocator.persistence.restore import restored_state
from uav_task_alloc.allocator.state import admission, tasks
from uav_task_alloc.allocator.status import health_warnings


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
    assert desk.world.lists._contained.keys() <= {('a', f't{k}') for k in (3, 4, 5)}


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
    after = Desk(restored_state(before.core.rows()), keep_ended=2)
    after.settle()
    assert sorted(after.world.tasks.records) == ['t2', 't3']


def test_more_open_tasks_than_can_be_held_are_refused(monkeypatch):
    monkeypatch.setattr(tasks, 'MAX_OPEN', 2)
    desk = Desk()
    verdicts = desk.add(*((f't{k}', 0.0, 0.0) for k in range(3)))
    assert [v.accepted for v in verdicts] == [True, True, False]
    assert verdicts[2].reason == 'open tasks = 2: expected fewer'
    desk.cancel('t0')
    assert desk.add(('t2', 0.0, 0.0))[0].accepted


def test_made_up_uavs_do_not_keep_a_real_one_out(monkeypatch):
    monkeypatch.setattr(admission, 'MAX_UAVS', 2)
    desk = Desk()
    desk.uav('a', 0.0, 0.0, 50.0)
    desk.add(('t0', 100.0, 0.0))
    desk.settle()
    desk.uav('ghost', 0.0, 0.0, 50.0)
    assert 'expected one of the 2 UAVs' in desk.uav('b', 0.0, 0.0, 50.0)
    for _ in range(4):  # the ghost falls silent
        desk.now += 2.0
        desk.uav('a', 0.0, 0.0, 50.0)
        desk.settle(report=False)
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


def flood(desk, count, each_second=100, **more):
    """Made-up ids, each told once, while UAV `real` goes on talking; how many were refused."""
    refused = 0
    for k in range(count):
        refused += bool(desk.uav(f'g{k}', 9e4 + k, 0.0, 50.0, **more))
        if (k + 1) % each_second == 0:
            talk(desk, 1.0)
    return refused


def talk(desk, seconds):
    """Time passes in which `real` says that it holds its list."""
    for _ in range(int(seconds)):
        desk.now += 1.0
        desk.uav('real', 0.0, 0.0, 50.0, list_revision=desk.world.lists.get('real').revision)
        desk.core.tick(desk.now, desk.now)
        desk.take()


def flying():
    """An allocator whose UAV `real` holds a list; UAV `home` has flown, and is silent."""
    desk = Desk(uav_timeout=3.0)
    desk.uav('home', 100.0, 0.0, 50.0)
    desk.add(('t0', 100, 0))
    desk.settle()
    desk.event('COMPLETED', 't0', 'home')
    desk.uav('real', 0.0, 0.0, 50.0)
    desk.settle(report=False)
    desk.now += 5.0
    desk.core.tick(desk.now, desk.now)
    desk.add(('t1', 100, 0))
    talk(desk, 1.0)
    desk.settle(report=False)
    talk(desk, 1.0)
    assert desk.route('real') == ('t1',)
    return desk


def written(desk):
    """The ids of the rows of lists that a journal would have."""
    return {row.id for row in desk.core.rows() if row.kind == 'list' and row.body is not None}


def test_finding_24_a_flood_of_made_up_uavs_leaves_no_lists_and_no_rows():
    desk = flying()
    flood(desk, 5000, list_revision=7)
    assert len(desk.world.fleet.records) == admission.MAX_UAVS
    assert len(desk.world.lists.lists) <= admission.MAX_UAVS + 1
    assert len(written(desk)) <= admission.MAX_UAVS + 1
    assert desk.forgotten >= {f'g{k}' for k in range(3000)}
    talk(desk, admission.FORGET_AFTER + admission.CHECK_PERIOD + 5.0)
    assert set(desk.world.fleet.records) == {'real', 'home'}
    assert written(desk) == set(desk.world.lists.lists) == {'real', 'home'}
    assert desk.route('real') == ('t1',)
    world = desk.world
    for by_uav in (world.zone_checks._checked, world.zone_checks.stranded,
                   world._validity.zones_when_built, world._events._resent):
        assert set(by_uav) <= {'real', 'home'}


def test_finding_24_made_up_uavs_do_not_push_out_one_that_has_flown():
    desk = flying()
    assert flood(desk, 5000, each_second=2000) > 0
    assert {'real', 'home'} <= set(desk.world.fleet.records)
    assert desk.uav('home', 0.0, 0.0, 50.0) == ''


def test_finding_24_that_no_uav_is_admitted_is_told_once_until_there_is_room():
    desk = flying()
    flood(desk, 1500, each_second=500)
    full = [note for note in desk.notes if 'UAVs = 1000: expected fewer' in note]
    assert len(full) == 1
    assert any('UAVs = 1000' in warning for warning in health_warnings(desk.world, ''))
    talk(desk, 5.0)
    assert desk.uav('new', 0.0, 0.0, 50.0) == ''
    talk(desk, admission.FORGET_AFTER + admission.CHECK_PERIOD)
    desk.uav('newer', 0.0, 0.0, 50.0)
    assert not any('UAVs = 1000' in warning for warning in health_warnings(desk.world, ''))


def test_finding_24_a_uav_that_comes_back_after_it_was_forgotten_gets_a_higher_revision():
    desk = Desk(uav_timeout=3.0)
    desk.uav('a', 0.0, 0.0, 50.0)  # it never says that it holds its list
    desk.add(('t0', 100, 0))
    desk.settle()
    desk.cancel('t0')
    desk.settle(report=False, wait=5.0)
    before = desk.lists['a'].revision
    talk(desk, admission.FORGET_AFTER + admission.CHECK_PERIOD + 1.0)
    assert 'a' not in desk.world.fleet.records
    assert 'a' not in desk.world.lists.lists
    desk.uav('a', 100.0, 0.0, 50.0)
    desk.add(('t1', 100, 0))
    desk.settle()
    assert desk.lists['a'].revision > before


def test_finding_24_lists_of_a_journal_whose_uavs_never_come_are_forgotten():
    desk = flying()
    flood(desk, 900, list_revision=7)
    after = Desk(restored_state(desk.core.rows()), uav_timeout=3.0)
    assert len(after.world.lists.lists) > 900
    talk(after, admission.FORGET_AFTER + admission.CHECK_PERIOD + 5.0)
    assert set(after.world.lists.lists) == {'real'}


def test_finding_24_an_answer_for_a_uav_that_was_forgotten_meanwhile_is_taken():
    desk = Desk(uav_timeout=3.0)
    desk.uav('a', 0.0, 0.0, 50.0)
    desk.uav('ghost', 0.0, 10.0, 50.0)
    desk.add(('t0', 0, 10), ('t1', 100, 0))
    problem = desk.begin()
    talk(desk, 5.0)
    desk.uav('a', 0.0, 0.0, 50.0)
    desk.world.forget_uav('ghost')
    desk.finish(problem)
    desk.settle()
    assert set(desk.world.lists.owners()) == {'t0', 't1'}
    assert 'ghost' not in desk.world.lists.lists
