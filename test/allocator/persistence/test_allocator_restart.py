# SPDX-License-Identifier: Apache-2.0
"""Restart: the state is restored, revisions increase, no task changes its UAV too early."""
import numpy as np
import pytest
from allocation import AllocatorDriver

from uav_task_alloc import plan
from uav_task_alloc.allocator.persistence.restore import restored_state
from uav_task_alloc.allocator.records import AnnouncementAction
from uav_task_alloc.allocator.replanning.learned_state import learned_row, learned_state
from uav_task_alloc.journal import JournalRow
from uav_task_alloc.model import Leg, Task, ThreatZone
from uav_task_alloc.solver.tables import Learnt, Tables
from uav_task_alloc.solver.warm import WarmState

ZONES = (ThreatZone.hemisphere('z1', (500.0, 5.0, 0.0), 100.0),
         ThreatZone.cylinder('z2', (0.0, 900.0), 10.0, 0.0),
         ThreatZone.polygon('z3', ((0.0, 800.0), (9.0, 800.0), (9.0, 820.0)), -5.0, 70.0, 2.0))


@pytest.fixture
def rows():
    driver = AllocatorDriver()
    driver.uav('a', 0.0, 0.0, 50.0)
    driver.uav('b', 0.0, 500.0, 50.0)
    driver.world.set_zones(ZONES, (), driver.now)
    driver.add(('t1', 100, 0), ('t2', 1000, 0), ('t3', 100, 500), ('t5', 300, 500),
             Task('t4', (0.0, 1.0, 2.0), 2.0, 3.0, frozenset({'camera'}), frozenset({'b'}), 4.0))
    driver.settle()
    driver.event('COMPLETED', 't1', 'a')
    driver.event('FAILED', 't5', driver.world.tasks.records['t5'].uav, reason='no')
    driver.cancel('t3')
    driver.world.set_available('b', False, driver.now)
    driver.settle(wait=1.0)
    return driver.core.rows()


def test_the_world_is_the_same_after_a_restart(rows):
    before, after = restored_state(rows), AllocatorDriver(restored_state(rows))
    assert list(after.world.tasks.records.values()) == before.tasks
    assert {t.task.id: t.state.name for t in before.tasks} == {
        't1': 'COMPLETED', 't2': 'ASSIGNED', 't3': 'CANCELLED', 't4': 'UNASSIGNED',
        't5': 'ASSIGNED'}
    assert tuple(after.world.airspace.zones.values()) == ZONES
    assert after.world.fleet.switched_off == {'b'}
    assert after.core.rows() == []


def test_lists_are_resent_under_a_higher_revision(rows):
    revisions = {each.uav: each.revision for each in restored_state(rows).lists}
    driver = AllocatorDriver(restored_state(rows))
    driver.core.tick(driver.now, driver.now)
    driver.take()
    assert {u: each.revision for u, each in driver.lists.items()} == {
        u: revision + 1 for u, revision in revisions.items()}
    assert set(driver.route('a')) == {'t2', 't5'}
    assert driver.lists['a'].stops[0].leg.via == next(
        each for each in restored_state(rows).lists if each.uav == 'a').stops[0].leg.via


def test_nothing_is_withdrawn_before_the_uavs_had_time_to_report(rows):
    driver = AllocatorDriver(restored_state(rows), uav_timeout=5.0)
    driver.add(('t9', 1, 1))
    driver.settle()
    assert driver.solves == []
    driver.uav('a', 50.0, 0.0, 50.0, active_task='t2', list_revision=3)
    driver.settle()
    assert driver.route('a')[0] == 't2'
    assert 't9' in driver.route('a')
    assert [each.revision for each in driver.allocations] == [
        restored_state(rows).revision + 1, restored_state(rows).revision + 2]


def test_a_uav_without_a_report_after_a_restart_loses_its_tasks(rows):
    driver = AllocatorDriver(restored_state(rows), uav_timeout=5.0)
    driver.uav('c', 0.0, 0.0, 50.0)
    driver.settle()
    assert driver.solves == []
    driver.settle(wait=5.0)
    assert driver.route('a') == ()
    assert set(driver.route('c')) == {'t2', 't5'}


def test_an_event_of_the_time_the_allocator_was_down_counts_when_it_is_repeated(rows):
    driver = AllocatorDriver(restored_state(rows))
    assert driver.event('COMPLETED', 't2', 'a', revision=1) == ''
    assert driver.state('t2') == 'COMPLETED'
    driver.core.tick(driver.now, driver.now)


def test_a_uav_that_has_passed_a_task_flew_it_while_the_allocator_was_down(rows):
    before, = (each for each in restored_state(rows).lists if each.uav == 'a')
    first, second = before.task_ids
    for step, state in ((-1, 'ASSIGNED'), (1, 'ASSIGNED'), (0, 'COMPLETED')):
        driver = AllocatorDriver(restored_state(rows))
        driver.uav('a', 0.0, 0.0, 50.0, active_task=second, list_revision=before.revision + step)
        driver.settle()
        assert driver.state(first) == 'ASSIGNED'  # the bridge may say how it ended
        driver.settle(wait=4.0)
        assert driver.state(first) == state
    assert driver.reason(first) == 'passed while the allocator was down'
    assert driver.route('a') == (second,)


@pytest.mark.parametrize('what', ['failed', 'changed', 'flown now'])
def test_a_task_that_a_uav_has_passed_without_flying_it_stays_open(rows, what):
    before, = (each for each in restored_state(rows).lists if each.uav == 'a')
    first, second = before.task_ids
    driver = AllocatorDriver(restored_state(rows))
    driver.uav('c', 0.0, 0.0, 50.0)
    driver.uav('a', 0.0, 0.0, 50.0, active_task=second, list_revision=before.revision)
    if what == 'failed':
        assert driver.event('FAILED', first, 'a', before.revision, 'terrain') == ''
    elif what == 'changed':
        assert driver.add((first, 70, 70), action=AnnouncementAction.UPDATE)[0].accepted
    else:
        driver.uav('a', 0.0, 0.0, 50.0, active_task=first, list_revision=before.revision)
    driver.settle(wait=4.0)
    driver.settle()
    assert driver.state(first) in ('ASSIGNED', 'ACTIVE')
    assert (first in driver.world.list_of('c').task_ids) == (what == 'failed')


def test_a_uav_that_reports_after_the_hold_is_not_compared(rows):
    before, = (each for each in restored_state(rows).lists if each.uav == 'a')
    first, second = before.task_ids
    driver = AllocatorDriver(restored_state(rows))
    driver.settle()
    driver.settle(wait=30.0)
    driver.uav('a', 0.0, 0.0, 50.0, active_task=second, list_revision=before.revision)
    driver.settle(wait=4.0)
    assert driver.state(first) == 'ASSIGNED'


def test_the_hold_after_a_restart_counts_from_when_the_lists_are_published(rows):
    driver = AllocatorDriver(restored_state(rows))
    for uav_id in ('a', 'b'):
        driver.uav(uav_id, 0.0, 0.0, 50.0)
    driver.core.tick(driver.now, driver.now)
    driver.take()
    published = driver.now + 8.0  # many lists: the next tick comes when all are
    for wait, holds in ((0.0, True), (2.9, True), (3.1, False)):
        driver.core.tick(published + wait, published + wait)
        assert driver.world.restart_hold is holds


def test_an_unreadable_row_is_left_out_and_named(rows):
    found = restored_state([
        *rows, JournalRow('task', 't9', {'id': 't9'}), JournalRow('mood', '', 'good'),
        JournalRow('learner', '', {'uavs': ['a'], 'tasks': [], 'near': '!', 'task': '',
                                   'start': ''})])
    assert found.tasks == restored_state(rows).tasks
    assert len(found.unreadable) == 2
    assert AllocatorDriver(found).core._best.state == WarmState()
    assert found.unreadable[0].startswith("journal row task 't9' cannot be read: KeyError")
    assert "unknown kind 'mood'" in found.unreadable[1]


def test_a_task_whose_row_is_missing_is_removed_from_its_list(rows):
    found = restored_state([row for row in rows if row.id != 't2'])
    assert all('t2' not in each.task_ids for each in found.lists)


def test_the_plan_of_the_previous_run_is_published_before_any_other(rows):
    before = restored_state(rows)
    driver = AllocatorDriver(restored_state(rows))
    driver.core.tick(driver.now, driver.now)
    driver.take()
    allocation, = driver.allocations
    assert (allocation.trigger, allocation.revision) == ('restart', before.revision + 1)
    assert allocation.plan.routes == {each.uav: each.task_ids for each in before.lists}
    assert allocation.plan.distance == pytest.approx(
        sum(each.distance for each in allocation.lists))


def test_the_task_under_way_is_known_before_the_first_report():
    driver = AllocatorDriver()
    driver.uav('a', 0.0, 0.0, 50.0)
    driver.add(('t1', 100, 0), ('t2', 200, 0))
    driver.settle()
    driver.event('STARTED', 't2', 'a')
    after = AllocatorDriver(restored_state(driver.core.rows()))
    assert after.state('t2') == 'ACTIVE'
    assert after.event('STARTED', 't1', 'a', revision=1) == ''
    after.event('STARTED', 't2', 'a', revision=1)
    after.uav('a', 0.0, 0.0, 50.0)
    assert after.begin().locked == {'a': ('t2', 't1')}
    assert after.route('a') == ('t1', 't2')


@pytest.mark.parametrize('first_report', [0.0, 4.0])  # [s] after the restart
@pytest.mark.parametrize('seconds', [0.5, 3.5])
def test_shortly_after_a_restart_no_task_changes_hands(seconds, first_report):
    driver = AllocatorDriver()
    driver.uav('a', 0.0, 0.0, 50.0)
    driver.add(('t1', 100, 0), ('t2', 200, 0))
    driver.settle()
    after = AllocatorDriver(restored_state(driver.core.rows()))
    after.settle(wait=first_report)
    after.uav('a', 0.0, 0.0, 50.0)
    after.uav('b', 150.0, 0.0, 50.0)
    after.settle(wait=seconds)
    after.world.set_available('a', False, after.now)  # it may have flown t1 meanwhile
    after.settle()
    later = seconds > 3.0
    assert after.route('a') == (() if later else ('t1', 't2'))
    assert ('b' in after.lists) == later
    after.event('COMPLETED', 't1', 'a', revision=1)
    after.settle(wait=3.0)
    assert after.route('b') == ('t2',)


def test_a_uav_with_the_list_that_was_resent_reports_itself_what_it_has_flown():
    driver = AllocatorDriver()
    driver.uav('a', 0.0, 0.0, 50.0)
    driver.add(('t1', 100, 0), ('t2', 200, 0))
    driver.settle()
    after = AllocatorDriver(restored_state(driver.core.rows()))
    after.core.tick(after.now, after.now)
    after.take()
    assert after.lists['a'].revision == 2
    after.uav('a', 150.0, 0.0, 50.0, active_task='t2', list_revision=2)
    after.settle(wait=2.0)
    assert set(after.route('a')) == {'t1', 't2'}
    assert after.event('COMPLETED', 't1', 'a', revision=2) == ''
    after.settle(wait=2.0)
    assert (after.state('t1'), after.reason('t1'), after.route('a')) == ('COMPLETED', '', ('t2',))


def out_of_turn(task_id):
    """A driver in which a, with the list t1 t2 t3, has completed one that is not the first."""
    driver = AllocatorDriver()
    driver.uav('a', 0.0, 0.0, 50.0)
    driver.add(('t1', 100, 0), ('t2', 200, 80), ('t3', 300, 0))
    driver.settle()
    driver.event('COMPLETED', task_id, 'a')
    return driver


def test_no_list_is_resent_with_a_task_completed_out_of_turn():
    driver = out_of_turn('t2')
    after = AllocatorDriver(restored_state(driver.core.rows()))
    after.core.tick(after.now, after.now)
    after.take()
    assert [each.task_ids for each in after.history] == [('t1', 't3')]
    assert after.lists['a'].stops[1].leg.via == ((200.0, 80.0, 50.0),)  # that way is clear
    after.uav('a', 0.0, 0.0, 50.0)
    after.settle()
    assert after.route('a') == ('t1', 't3')
    assert after.lists['a'].stops[1].leg == Leg((), 200.0)


def test_a_uav_that_is_switched_off_reports_what_it_has_flown_before_its_tasks_move():
    driver = out_of_turn('t3')
    driver.world.set_available('a', False, driver.now)
    after = AllocatorDriver(restored_state(driver.core.rows()))
    for uav_id in ('a', 'b'):
        after.uav(uav_id, 0.0, 0.0, 50.0)
    after.settle(wait=2.9)  # the node waits for subscribers so long
    assert after.route('a') == ('t1', 't2')
    after.settle(wait=2.0)  # after which the bridge repeats
    assert after.event('COMPLETED', 't1', 'a') == ''
    assert after.event('COMPLETED', 't2', 'a') == ''
    after.settle(wait=4.0)
    assert {each.task_ids for each in after.history if each.uav == 'b'} <= {()}
    assert (after.state('t1'), after.state('t2')) == ('COMPLETED', 'COMPLETED')


def fixed_rounds(*world, max_iterations, **more):
    """`plan` with the same number of iterations on any machine."""
    rounds = 3000 if max_iterations is None else max_iterations
    return plan(*world, **{**more, 'budget': 60.0, 'max_iterations': rounds})


def test_the_learned_state_survives():
    driver = AllocatorDriver(plan=fixed_rounds)
    driver.uav('a', 0.0, 0.0, 50.0)
    driver.uav('b', 900.0, 0.0, 50.0)
    for k in range(3):
        driver.add(*((f't{k}_{i}', 37 * i % 400, 91 * i % 300) for i in range(10)))
        driver.settle(wait=6.0)
    before = driver.core._best.state.learnt
    after = AllocatorDriver(restored_state(driver.core.rows()), plan=fixed_rounds)
    kept = after.core._best.state.learnt
    assert (kept.uavs, kept.tasks) == (before.uavs, before.tasks)
    assert np.allclose(kept.tables.task, before.tables.task)
    assert np.allclose(kept.tables.start, before.tables.start)
    assert (kept.near == before.near).all()
    for uav_id in 'ab':
        after.uav(uav_id, 0.0, 0.0, 50.0)
    after.settle()
    assert sum(len(each.stops) for each in after.lists.values()) == 30


def test_the_row_of_the_learned_state_is_bounded(monkeypatch):
    tables = Tables(np.full((40, 4), 0.25), np.full((3, 40), 0.75))
    near = np.tile(np.arange(3, 7), (40, 1))
    learnt = Learnt(tables, near, {'a': 0, 'b': 1, 'c': 2}, {f't{k}': k for k in range(40)})
    assert learned_state(learned_row(WarmState(learnt=learnt)).body).learnt.uavs == learnt.uavs
    monkeypatch.setattr('uav_task_alloc.allocator.replanning.learned_state._MAX_ENTRIES', 119)
    assert learned_row(WarmState(learnt=learnt)).body is None
    monkeypatch.setattr('uav_task_alloc.allocator.replanning.learned_state._MAX_ENTRIES', 160)
    wide = learnt._replace(tables=tables._replace(start=np.full((5, 40), 0.5)), near=near + 2,
                           uavs={f'u{k}': k for k in range(5)})
    # the table of UAVs has 200 entries, and is left out
    kept = learned_state(learned_row(WarmState(learnt=wide)).body).learnt
    assert (kept.uavs, kept.tables.start.shape) == ({}, (0, 40))
    assert (kept.near == np.arange(4)).all()
    assert (kept.tables.task == 0.25).all()
