# SPDX-License-Identifier: Apache-2.0
"""Work that is cut again in flight: what was withdrawn or flown stays so, and nothing is lost."""
from dataclasses import replace

import pytest
from test_works import FIELD, fleet, fly, route, status

from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.model import ThreatZone
from uav_task_alloc.work.recut import main_direction


def test_work_that_was_cancelled_stays_so_when_a_piece_of_an_earlier_cut_is_flown():
    driver = fleet()
    driver.add(FIELD)
    driver.settle()
    hit, revision = route(driver, 'a')[0], driver.world.list_of('a').revision
    across = driver.world.tasks.records[hit].task.path[0][1]
    driver.world.set_zones([ThreatZone.cylinder('z', (200.0, across), 15.0)], (), driver.now)
    driver.settle()
    assert driver.cancel('field')[0].accepted
    assert driver.event('COMPLETED', hit, 'a', revision) == ''
    driver.settle()
    assert (status(driver).state.name, status(driver).pieces_done) == ('CANCELLED', 1)
    assert route(driver, 'a') == route(driver, 'b') == ()


def test_a_piece_flown_while_it_was_cut_again_counts_where_no_new_cut_is_possible(monkeypatch):
    driver = fleet()
    driver.add(FIELD)
    driver.settle()
    hit, revision = route(driver, 'a')[0], driver.world.list_of('a').revision
    across = driver.world.tasks.records[hit].task.path[0][1]
    driver.world.set_zones([ThreatZone.cylinder('z', (200.0, across), 15.0)], (), driver.now)
    driver.settle()

    def too_many(_):
        raise InvalidValue('strip_width', 20.0, 'wider strips')
    monkeypatch.setattr(driver.world.works, '_cut', too_many)
    assert driver.event('COMPLETED', hit, 'a', revision) == ''
    assert status(driver).pieces_done == 1


def test_strips_keep_their_direction_after_a_part_across_them_is_flown():
    driver = fleet()
    driver.add(replace(FIELD, direction=None))
    driver.settle()
    hit, revision = route(driver, 'a')[0], driver.world.list_of('a').revision
    across = driver.world.tasks.records[hit].task.path[0][1]
    tower, other = (ThreatZone.cylinder('z', (200.0, y), 15.0) for y in (across, 110.0))
    driver.world.set_zones([tower], (), driver.now)
    driver.settle()
    assert driver.event('COMPLETED', hit, 'a', revision) == ''
    driver.settle()
    # from the flown strip along the tower: it begins across the strips
    beside = next(each for each in route(driver, 'a')
                  if len(driver.world.tasks.records[each].task.path) == 3)
    while beside in route(driver, 'a'):
        fly(driver, 'a')
    for zones in ((), (other,)):
        driver.world.set_zones(zones, (), driver.now)
        driver.settle()
        assert driver.state(beside) == 'COMPLETED'
        for each in (*route(driver, 'a'), *route(driver, 'b')):
            a, b = driver.world.tasks.records[each].task.path[:2]
            assert a[1] == pytest.approx(b[1])


def test_the_direction_of_ways_is_that_of_most_of_their_length():
    way = ((0.0, 0.0, 50.0), (0.0, 30.0, 50.0), (-20.0, 30.0, 50.0), (-60.0, 30.0, 50.0))
    assert main_direction([way[:3]]) == pytest.approx(1.5707963)
    assert main_direction([way]) == pytest.approx(0.0)
    assert main_direction([way[::-1], ((0.0, 0.0, 50.0), (0.0, 40.0, 50.0))]) == pytest.approx(
        1.5707963)
