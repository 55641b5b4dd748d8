# SPDX-License-Identifier: Apache-2.0
"""Events of pieces that another allocator cut, or that a journal has lost."""
from allocation import AllocatorDriver
from test_works import FIELD, fleet, fly, pieces, route, shares, status

from uav_task_alloc.allocator.persistence.restore import restored_state


def listed(revision):
    """A UAV that holds a list of another allocator, and a field that it gets."""
    driver = AllocatorDriver(None, shares)
    driver.uav('a', 0.0, 0.0, 50.0, list_revision=revision)
    driver.add(FIELD)
    driver.settle()
    return driver


def test_an_event_of_a_piece_that_was_never_cut_is_refused():
    driver = listed(7)
    assert driver.event('COMPLETED', 'field#14', 'a', revision=7).endswith(': unknown task')
    assert driver.event('COMPLETED', 'other#1', 'a', revision=7).endswith(': unknown task')
    assert status(driver).pieces_done == 0


def test_a_piece_of_another_allocator_counts_once_the_bridge_has_compared_its_way():
    driver = listed(7)
    assert 'revision 7' in driver.event('COMPLETED', 'field#3', 'a', revision=7)
    assert driver.state('field#3') == 'ASSIGNED'
    driver.settle()
    driver.uav('a', 0.0, 0.0, 50.0, list_revision=driver.world.list_of('a').revision)
    assert driver.event('COMPLETED', 'field#3', 'a', revision=7) == ''
    assert driver.state('field#3') == 'COMPLETED'
    driver.world.forget_uav('a')
    assert 'unknown UAV' in driver.event('COMPLETED', 'field#2', 'a', revision=7)


def test_a_piece_whose_work_the_journal_lost_is_another_one_when_it_is_announced_again():
    driver = fleet()
    driver.add(FIELD)
    driver.settle()
    revision = driver.world.list_of('a').revision
    rows = [row for row in driver.core.rows() if row.kind != 'work']
    again = fleet(restored_state(rows))
    again.add(FIELD)
    task_id = pieces(again)[0]
    assert f'revision {revision}' in again.event('COMPLETED', task_id, 'a', revision=revision)
    assert again.state(task_id) == 'PENDING'


def test_work_is_cancelled_before_its_lost_pieces_are_cut_again():
    driver = fleet()
    driver.add(FIELD)
    driver.settle()
    fly(driver, 'a')
    rows = [row for row in driver.core.rows() if row.id != 'field#5']
    again = fleet(restored_state(rows))
    assert again.cancel('field')[0].accepted
    again.settle(wait=5.0)
    assert route(again, 'a') == route(again, 'b') == ()
    assert status(again).state.name == 'CANCELLED'
    assert status(again).reason == '1 of 6 strips; cancelled'
