# SPDX-License-Identifier: Apache-2.0
"""Restart: the world comes back from the journal, revisions rise, nothing is taken too early."""
import pytest
from allocation import Desk

from uav_task_alloc.allocator.keeper import Keeper
from uav_task_alloc.allocator.restore import saved
from uav_task_alloc.errors import JournalError
from uav_task_alloc.journal import FILE_NAME, Row
from uav_task_alloc.model import Task, ThreatZone

ZONES = (ThreatZone.hemisphere('z1', (500.0, 5.0, 0.0), 100.0),
         ThreatZone.cylinder('z2', (0.0, 900.0), 10.0, 0.0),
         ThreatZone.polygon('z3', ((0.0, 800.0), (9.0, 800.0), (9.0, 820.0)), -5.0, 70.0, 2.0))


@pytest.fixture
def rows():
    desk = Desk()
    desk.uav('a', 0.0, 0.0, 50.0)
    desk.uav('b', 0.0, 500.0, 50.0)
    desk.world.set_zones(ZONES, (), desk.now)
    desk.add(('t1', 100, 0), ('t2', 1000, 0), ('t3', 100, 500), ('t5', 300, 500),
             Task('t4', (0.0, 1.0, 2.0), 2.0, 3.0, frozenset({'camera'}), frozenset({'b'}), 4.0))
    desk.settle()
    desk.event('COMPLETED', 't1', 'a')
    desk.event('FAILED', 't5', desk.world.tasks.records['t5'].uav, reason='no')
    desk.cancel('t3')
    desk.world.set_available('b', False, desk.now)
    desk.settle(wait=1.0)
    return desk.core.rows()


def test_the_world_is_the_same_after_a_restart(rows):
    before, after = saved(rows), Desk(saved(rows))
    assert list(after.world.tasks.records.values()) == before.tasks
    assert {t.task.id: t.state.name for t in before.tasks} == {
        't1': 'COMPLETED', 't2': 'ASSIGNED', 't3': 'CANCELLED', 't4': 'UNASSIGNED',
        't5': 'ASSIGNED'}
    assert tuple(after.world.zones.values()) == ZONES
    assert after.world.fleet.off == {'b'}
    assert after.core.rows() == []


def test_lists_are_told_again_under_a_higher_revision(rows):
    revisions = {each.uav: each.revision for each in saved(rows).lists}
    desk = Desk(saved(rows))
    desk.core.tick(desk.now, desk.now)
    desk.take()
    assert {u: each.revision for u, each in desk.lists.items()} == {
        u: revision + 1 for u, revision in revisions.items()}
    assert set(desk.route('a')) == {'t2', 't5'}
    assert desk.lists['a'].stops[0].leg.via == next(
        each for each in saved(rows).lists if each.uav == 'a').stops[0].leg.via


def test_nothing_is_withdrawn_before_the_uavs_had_time_to_be_heard(rows):
    desk = Desk(saved(rows), uav_timeout=5.0)
    desk.add(('t9', 1, 1))
    desk.settle()
    assert desk.solves == []
    desk.uav('a', 50.0, 0.0, 50.0, active_task='t2', list_revision=3)
    desk.settle()
    assert desk.route('a')[0] == 't2'
    assert 't9' in desk.route('a')
    assert desk.allocations[-1].revision == saved(rows).revision + 1


def test_a_uav_that_is_not_heard_after_a_restart_loses_its_tasks(rows):
    desk = Desk(saved(rows), uav_timeout=5.0)
    desk.uav('c', 0.0, 0.0, 50.0)
    desk.settle()
    assert desk.solves == []
    desk.settle(wait=5.0)
    assert desk.route('a') == ()
    assert set(desk.route('c')) == {'t2', 't5'}


def test_what_was_flown_while_nobody_listened_counts_when_it_is_told(rows):
    desk = Desk(saved(rows))
    assert desk.event('COMPLETED', 't2', 'a', revision=1) == ''
    assert desk.state('t2') == 'COMPLETED'
    desk.core.tick(desk.now, desk.now)


def test_a_uav_that_is_past_a_task_flew_it_while_nobody_listened(rows):
    before, = (each for each in saved(rows).lists if each.uav == 'a')
    first, second = before.task_ids
    for revision, state in ((before.revision - 1, 'ASSIGNED'), (before.revision, 'COMPLETED')):
        desk = Desk(saved(rows))
        desk.uav('a', 0.0, 0.0, 50.0, active_task=second, list_revision=revision)
        assert desk.state(first) == state
    desk.settle()
    assert desk.route('a') == (second,)


def test_a_row_that_nobody_wrote_is_refused():
    with pytest.raises(JournalError, match="journal row task 't1' cannot be read: KeyError"):
        saved([Row('task', 't1', {'id': 't1'})])
    with pytest.raises(JournalError, match="unknown kind 'mood'"):
        saved([Row('mood', '', 'good')])


def test_a_keeper_brings_back_what_it_saved(tmp_path):
    desk, keeper = Desk(), Keeper(str(tmp_path), print)
    desk.add(('t1', 100, 0))
    keeper.save(desk.core, desk.now)
    assert desk.core.rows() == []
    keeper.close()
    assert saved([]) != Keeper(str(tmp_path), print).saved
    assert Keeper('', print).saved == saved([])


def test_a_full_disk_is_told_once_and_made_up_for_when_there_is_room(tmp_path):
    said = []
    desk, keeper = Desk(), Keeper(str(tmp_path), said.append)
    database = keeper._journal._db
    database.execute('PRAGMA max_page_count = 3')
    for k in range(300):
        desk.add((f't{k}', 100, 0))
        keeper.save(desk.core, desk.now + k)
    assert len(said) == 1
    assert keeper.trouble.endswith('database or disk is full; tried again every 1 s')
    database.execute('PRAGMA max_page_count = 1000000')
    keeper.save(desk.core, desk.now + 1000.0)
    assert keeper.trouble == ''
    keeper.close()
    assert len(Keeper(str(tmp_path), print).saved.tasks) == 300


def test_without_a_good_journal_the_allocator_runs_on_and_says_so(tmp_path):
    said = []
    (tmp_path / FILE_NAME).write_bytes(b'no database at all ' * 50)
    keeper = Keeper(str(tmp_path), said.append)
    desk = Desk(keeper.saved)
    desk.add(('t1', 100, 0))
    keeper.save(desk.core, desk.now)
    assert said == [keeper.trouble]
    assert 'file is not a database; nothing is kept' in keeper.trouble
