# SPDX-License-Identifier: Apache-2.0
"""Work that is cut again into more pieces than may be open: none of it is lost."""
from dataclasses import replace

import pytest
from test_works import FIELD, MIDDLE, fleet, fly, pieces, route, status

from uav_task_alloc.allocator.records import AnnouncementAction
from uav_task_alloc.allocator.state import tasks, works
from uav_task_alloc.allocator.state.task_state_machine import TaskTransition
from uav_task_alloc.model import ThreatZone

EDGE = ThreatZone.cylinder('mast', (200.0, 112.0), 5.0)


@pytest.fixture
def limited(monkeypatch):
    """A fleet with a field of six strips, where at most so many tasks and pieces are open."""
    def limit(most):
        for module in (tasks, works):
            monkeypatch.setattr(module, 'MAX_OPEN', most)
        driver = fleet()
        driver.add(FIELD)
        driver.settle()
        assert len(pieces(driver)) == 6
        return driver
    return limit


def update(driver, **changes):
    return driver.add(replace(FIELD, **changes), action=AnnouncementAction.UPDATE)[0]


def fly_all(driver):
    for uav_id in 'ab':
        fly(driver, uav_id, len(route(driver, uav_id)))


def test_an_update_to_more_pieces_than_there_is_room_for_is_refused(limited):
    driver = limited(11)
    before = pieces(driver)
    verdict = update(driver, strip_width=10.0)
    assert not verdict.accepted
    assert verdict.reason == 'open tasks and pieces: expected at most 11'
    assert pieces(driver) == before
    driver.settle()
    fly_all(driver)
    assert (status(driver).state.name, status(driver).pieces_done) == ('COMPLETED', 6)


def test_pieces_that_are_replaced_make_room_for_new_ones(limited):
    driver = limited(12)
    assert update(driver, strip_width=10.0).accepted
    driver.settle()
    assert all(each in driver.world.tasks.records for each in pieces(driver))
    fly_all(driver)
    assert (status(driver).state.name, status(driver).pieces_done) == ('COMPLETED', 12)


def test_with_zones_that_cut_it_into_too_many_pieces_work_stays_as_it_is(limited):
    driver = limited(6)
    before = pieces(driver)
    driver.world.set_zones([MIDDLE], (), driver.now)
    driver.settle()
    assert pieces(driver) == before
    assert all(each in driver.world.tasks.records for each in before)
    fly_all(driver)
    assert status(driver).state.name == 'UNASSIGNED'  # the strips through the zone are left


def test_a_piece_flown_while_it_was_cut_again_counts_where_no_more_may_be_open(limited):
    driver = limited(20)
    hit, revision = route(driver, 'a')[-1], driver.world.list_of('a').revision
    assert update(driver, strip_width=15.0).accepted
    driver.settle()
    assert driver.state(hit) == 'CANCELLED'
    while len(driver.world.tasks.open()) < 20:
        driver.add((f't{len(driver.world.tasks.records)}', -100.0, 0.0))
    assert driver.event('COMPLETED', hit, 'a', revision) == ''
    assert status(driver).pieces_done == 1
    assert all(each in driver.world.tasks.records for each in pieces(driver))


def fail(driver, task_id, uav_id='a'):
    """Fail a task for good."""
    record = driver.world.tasks.records[task_id]
    driver.world.tasks.step(task_id, TaskTransition.FAIL_LAST, driver.now, uav_id, 'no camera')
    assert driver.state(task_id) == 'FAILED' != record.state.name


def fill_up(driver):
    while len(driver.world.tasks.open()) < tasks.MAX_OPEN:
        driver.add((f't{len(driver.world.tasks.records)}', -100.0, 0.0))


def test_an_update_that_opens_failed_pieces_has_to_have_room_for_them(limited):
    driver = limited(8)
    failed = pieces(driver)[:3]
    for each in failed:
        fail(driver, each)
    fill_up(driver)
    verdict = update(driver, task=replace(FIELD.task, value=9.0))
    assert not verdict.accepted
    assert verdict.reason == 'open tasks and pieces: expected at most 8'
    assert [driver.state(each) for each in failed] == 3 * ['FAILED']
    for each in range(6, 9):
        driver.cancel(f't{each}')
    assert update(driver, task=replace(FIELD.task, value=9.0)).accepted
    assert len(driver.world.tasks.open()) == 8 - 3 + 3


def test_failed_pieces_that_stay_so_need_no_room(limited):
    driver = limited(10)
    for each in pieces(driver)[3:]:
        fail(driver, each)
    fill_up(driver)
    for name in ('t6', 't7', 't8'):
        driver.cancel(name)
    driver.world.set_zones([EDGE], (), driver.now)  # four pieces for the first one
    driver.settle()
    assert len(pieces(driver)) == 9
    assert all(each in driver.world.tasks.records for each in pieces(driver))
    assert len(driver.world.tasks.open()) == 10


def test_a_cut_into_fewer_pieces_is_accepted_where_too_many_are_open(limited, monkeypatch):
    driver = limited(20)
    fill_up(driver)
    for module in (tasks, works):
        monkeypatch.setattr(module, 'MAX_OPEN', 10)
    assert not update(driver, strip_width=10.0).accepted
    assert update(driver, strip_width=40.0).accepted
    assert len(driver.world.tasks.open()) < 20
    assert all(each in driver.world.tasks.records for each in pieces(driver))


def test_an_update_that_opens_a_failed_task_has_to_have_room_for_it(limited):
    driver = limited(8)
    driver.add(('failed', 50.0, 0.0))
    fail(driver, 'failed')
    fill_up(driver)
    verdict = driver.add(('failed', 60.0, 0.0), action=AnnouncementAction.UPDATE)[0]
    assert (verdict.accepted, verdict.reason) == (False, 'open tasks = 8: expected fewer')
    assert driver.state('failed') == 'FAILED'
    driver.cancel(driver.world.tasks.open()[-1].task.id)
    assert driver.add(('failed', 60.0, 0.0), action=AnnouncementAction.UPDATE)[0].accepted
    assert driver.state('failed') == 'PENDING'
