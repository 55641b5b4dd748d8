# SPDX-License-Identifier: Apache-2.0
"""What comes into force when an operator accepts a plan: the lists of the proposal, or nothing."""
from dataclasses import replace

import pytest
from allocation import AllocatorDriver

from uav_task_alloc import plan
from uav_task_alloc.allocator.records import AnnouncementAction
from uav_task_alloc.geometry.zones import path_is_clear
from uav_task_alloc.model import Task, ThreatZone
from uav_task_alloc.work.pieces import Work
from uav_task_alloc.work.values import Kind


def make(**more):
    return AllocatorDriver(None, plan, uav_timeout=3600.0,
                           **{'approval': 'all', 'approval_timeout': 1e4, **more})


@pytest.fixture
def driver():
    """One UAV with tasks, and a proposal that another flies one of them."""
    driver = make()
    driver.uav('a', 0.0, 0.0, 50.0)
    driver.add(('t1', 100, 0), ('t2', 1000, 100))
    driver.settle()
    assert approve(driver).success
    driver.uav('b', 1000.0, 0.0, 50.0)
    driver.settle()
    assert {each.uav: each.task_ids for each in driver.world.proposal.lists} == {
        'a': ('t1',), 'b': ('t2',)}
    return driver


def approve(driver, dry_run=False):
    answer = driver.desk().approve(driver.world.proposal.revision, True, 'ann', dry_run,
                                   driver.now, driver.now)
    driver.take()
    return answer


def flown(each):
    """What a list has a UAV fly."""
    return [(stop.task, stop.leg.via, stop.begin_after, stop.reversed)
            for stop in each.stops], each.returns, each.end_via


def test_a_path_is_flown_in_the_direction_that_was_approved():
    driver = make()
    driver.uav('a', 0.0, 0.0, 50.0, range=1200.0)
    ends = (1000.0, 0.0, 50.0), (100.0, 0.0, 50.0)
    driver.add(Work(Task('line', ends[0]), Kind.LINE, ends))
    driver.settle()
    proposed, = driver.world.proposal.lists
    assert (proposed.stops[0].reversed, proposed.distance) == (True, pytest.approx(1000.0))
    assert approve(driver).success
    assert flown(driver.lists['a']) == flown(proposed)
    assert driver.lists['a'].distance == pytest.approx(1000.0)


def test_heights_that_keep_uavs_apart_are_those_that_were_approved():
    driver = make(separation__horizontal=10.0)
    driver.uav('a', 0.0, 200.0, 50.0, mode='HOLD', authority='HELD')
    driver.uav('b', 200.0, 0.0, 50.0, mode='HOLD', authority='HELD')
    driver.add(Task('ta', (400.0, 200.0, 50.0), allowed_uavs=frozenset({'a'})),
               Task('tb', (200.0, 400.0, 50.0), allowed_uavs=frozenset({'b'})))
    driver.settle()
    proposed = {each.uav: flown(each) for each in driver.world.proposal.lists}
    assert any(via for stops, *_ in proposed.values() for _, via, *_ in stops)
    assert approve(driver).success
    assert {uav_id: flown(each) for uav_id, each in driver.lists.items()} == proposed


def test_uavs_are_kept_apart_from_lists_that_were_not_proposed():
    driver = make(separation__horizontal=10.0, approval='replan')
    driver.uav('a', 0.0, 200.0, 50.0, mode='HOLD', authority='HELD')
    driver.add(Task('t0', (0.0, 210.0, 50.0)))
    driver.settle()
    driver.add(Task('ta', (400.0, 200.0, 50.0), allowed_uavs=frozenset({'a'})))
    driver.settle()
    assert [each.uav for each in driver.world.proposal.lists] == ['a']
    driver.uav('b', 200.0, 0.0, 50.0, mode='HOLD', authority='HELD')
    driver.add(Task('tb', (200.0, 400.0, 50.0), allowed_uavs=frozenset({'b'})))
    driver.settle()
    assert driver.route('b') == ('tb',)
    assert approve(driver).success
    assert any(stop.leg.via or stop.begin_after
               for each in driver.lists.values() for stop in each.stops)


def test_a_zone_that_came_since_is_flown_around(driver):
    dome = ThreatZone.cylinder('dome', (1000.0, 50.0), 20.0)
    driver.world.set_zones([dome], (), driver.now)
    driver.settle()
    assert approve(driver).success
    way = (1000.0, 0.0, 50.0), *driver.lists['b'].stops[0].line
    assert driver.route('b') == ('t2',)
    assert path_is_clear(way, [dome])


def test_a_plan_is_refused_once_its_uav_may_have_no_tasks(driver):
    driver.world.set_available('b', False, driver.now)
    assert approve(driver).message == (
        'refused: plan 4 cannot be put in force now: b is not available')
    assert driver.route('a') == ('t1', 't2')


def test_a_plan_is_refused_once_a_task_of_it_was_changed(driver):
    before = driver.world.proposal.revision
    driver.add(Task('t2', (1000.0, 300.0, 50.0)), action=AnnouncementAction.UPDATE)
    for dry_run in (True, False):
        answer = approve(driver, dry_run)
        assert (answer.success, answer.message) == (
            False, f'refused: plan {before} cannot be put in force now: t2 was changed')
    assert driver.world.proposal is None
    assert driver.route('a') == ('t1', 't2')
    driver.settle()
    assert driver.world.proposal.revision > before
    assert approve(driver).success
    assert driver.lists['b'].stops[0].task.position == (1000.0, 300.0, 50.0)


def test_a_plan_with_a_task_that_was_changed_since_is_proposed_again(driver):
    before = driver.world.proposal.revision
    driver.add(Task('t2', (1000.0, 300.0, 50.0)), action=AnnouncementAction.UPDATE)
    driver.settle()
    assert driver.world.proposal.revision > before
    assert driver.world.proposal.lists[1].stops[0].task.position == (1000.0, 300.0, 50.0)


def test_a_plan_is_refused_once_another_uav_flies_to_a_task_of_it(driver):
    driver.event('STARTED', 't1', 'a')
    driver.event('COMPLETED', 't1', 'a')
    driver.event('STARTED', 't2', 'a')
    answer = approve(driver)
    assert answer.message.endswith('cannot be put in force now: a has to fly t2 first')
    driver.settle()
    assert driver.route('a') == ('t2',)
    assert 'b' not in driver.lists


def test_an_outdated_plan_is_withdrawn_when_its_time_is_over(driver):
    driver.world.params = replace(driver.world.params, approval_on_timeout='accept')
    driver.world.proposal = replace(driver.world.proposal, deadline=driver.now + 1.0,
                                    accepted_on_timeout=True)
    revision = driver.world.proposal.revision
    driver.world.set_available('b', False, driver.now + 1.0)
    driver.settle(wait=1.5)
    assert driver.route('a') == ('t1', 't2')
    assert (f'plan {revision}: withdrawn: it cannot be put in force any more: b is not available'
            in driver.notes)
