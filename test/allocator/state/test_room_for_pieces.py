# SPDX-License-Identifier: Apache-2.0
"""Work that is cut again into more pieces than may be open: none of it is lost."""
from dataclasses import replace

import pytest
from test_works import FIELD, MIDDLE, fleet, fly, pieces, route, status

from uav_task_alloc.allocator.records import AnnouncementAction
from uav_task_alloc.allocator.state import tasks, works


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
