# SPDX-License-Identifier: Apache-2.0
"""Work that is cut again in flight: what was withdrawn or flown stays so, and nothing is lost."""
from test_works import FIELD, fleet, route, status

from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.model import ThreatZone


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
