# SPDX-License-Identifier: Apache-2.0
"""Areas that an UPDATE changes in flight: what is covered is not flown again."""
import random
from dataclasses import replace

import pytest
from allocation import AllocatorDriver
from test_works import FIELD, fleet, fly, pieces, shares, status

from uav_task_alloc.allocator.persistence.restore import restored_state
from uav_task_alloc.allocator.records import AnnouncementAction
from uav_task_alloc.model import ThreatZone


def until(y, **more):
    """The field from the south to y [m]."""
    return replace(FIELD, path=tuple((x, min(y, north * y), z) for x, north, z in FIELD.path),
                   **more)


def updated(driver, work):
    assert driver.add(work, action=AnnouncementAction.UPDATE)[0].accepted
    driver.settle()


def half_flown():
    """Four of six strips of 20 m are flown, two in the south and two in the north."""
    driver = fleet()
    driver.add(FIELD)
    driver.settle()
    fly(driver, 'a', 2)
    fly(driver, 'b', 2)
    return driver


def left(driver):
    return [record.task for each in pieces(driver)
            if (record := driver.world.tasks.records[each]).open]


def gaps(driver, top, width):
    """Spots of the field that no way of a piece has within half a width."""
    rng, ways = random.Random(1), [driver.world.tasks.records[each].task.path
                                   for each in pieces(driver)]
    spots = [(rng.uniform(101.0, 299.0), rng.uniform(0.0, top)) for _ in range(2000)]
    return [spot for spot in spots if not any(
        min(a[0], b[0]) - 1e-6 <= spot[0] <= max(a[0], b[0]) + 1e-6
        and abs(spot[1] - a[1]) <= width / 2 + 1e-6 for a, b in ways)]


@pytest.mark.parametrize('top', [130.0, 110.0])
def test_a_moved_edge_has_no_covered_strip_flown_again(top):
    driver = half_flown()
    done = sorted(driver.world.tasks.records[each].task.path[0][1] for each in pieces(driver)
                  if not driver.world.tasks.records[each].open)
    updated(driver, until(top))
    assert status(driver).pieces_done == 4
    assert gaps(driver, top, 20.0) == []
    assert sum(task.path_length for task in left(driver)) <= 200.0 * 4 + 1.0
    assert sum(task.value for task in left(driver)) == pytest.approx(
        6.0 * len(left(driver)) / -(-top // 20.0), rel=0.01)
    for zones in ([ThreatZone.cylinder('z', (900.0, 0.0), 15.0)], []):
        before = pieces(driver)
        driver.world.set_zones(zones, (), driver.now)
        driver.settle()
        assert set(pieces(driver)) == set(before)
    assert len(done) == 4


def test_strips_that_an_update_makes_wider_count_as_wide_as_they_were_flown():
    driver = half_flown()
    wide = until(120.0, strip_width=60.0)  # along y = 30 m and y = 90 m, as two of those flown
    updated(driver, wide)
    assert sorted(round(task.path[0][1]) for task in left(driver)) == [30, 90]
    again = AllocatorDriver(restored_state(driver.core.rows()), shares)
    assert again.world.works.records['field'] == driver.world.works.records['field']
    fly(driver, 'a', len(driver.world.list_of('a').stops))
    driver.world.set_zones([ThreatZone.cylinder('z', (200.0, 90.0), 15.0)], (), driver.now)
    driver.settle()
    assert all(task.path[0][1] > 60.0 for task in left(driver))  # the southern one was flown wide
    fly(driver, 'b', len(driver.world.list_of('b').stops))
    assert status(driver).state.name == 'COMPLETED'


def test_a_strip_that_is_flown_while_an_update_makes_it_wider_is_flown_again():
    driver = half_flown()
    stop, revision = driver.world.list_of('b').stops[0], driver.world.list_of('b').revision
    updated(driver, until(120.0, strip_width=60.0))
    assert driver.event('COMPLETED', stop.task.id, 'b', revision) == ''
    driver.settle()
    assert sorted(round(task.path[0][1]) for task in left(driver)) == [30, 90]


def test_an_area_that_shrinks_to_what_is_covered_is_completed():
    driver = AllocatorDriver(None, shares)
    driver.uav('a', 0.0, 0.0, 50.0)
    driver.add(FIELD)
    driver.settle()
    fly(driver, 'a', 3)
    updated(driver, until(55.0))
    assert (status(driver).state.name, left(driver)) == ('COMPLETED', [])
