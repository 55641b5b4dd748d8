# SPDX-License-Identifier: Apache-2.0
"""The height of a task takes endurance from the UAVs that may get it, and from no others."""
from dataclasses import replace

import pytest
from allocation import AllocatorDriver

from uav_task_alloc import plan
from uav_task_alloc.allocator.records import AnnouncementAction
from uav_task_alloc.geometry.flight_time import flight_time
from uav_task_alloc.model import Task

ROW = [Task(f't{k}', (100.0 * k, 60.0, 50.0)) for k in range(7)]
LISTS = {'a': ('t0', 't1', 't2', 't3'), 'b': ('t6', 't5', 't4')}
ENDURANCE = 450.0


def fleet(endurance=ENDURANCE, **more):
    driver = AllocatorDriver(None, plan, uav_timeout=3600.0, objective='balanced',
                             route_end='home', **more)
    for uav_id, x in (('a', 0.0), ('b', 600.0)):
        driver.uav(uav_id, x, 0.0, 50.0, home=(x, 0.0, 0.0), range=8000.0, endurance=endurance,
                   battery=0.9, climb_speed=2.5, descent_speed=1.5, mode='ON_MISSION',
                   authority='HELD')
    return driver


@pytest.fixture
def driver():
    driver = fleet()
    driver.add(*ROW)
    driver.settle()
    assert routes(driver) == LISTS
    return driver


def routes(driver):
    return {uav_id: each.task_ids for uav_id, each in driver.lists.items()}


def high(z, **more):
    return Task('high', (300.0, 30.0, z), **more)


@pytest.mark.parametrize(('z', 'reason'), [
    (538.0, 'no UAV can serve it: a needs 563 s in the air and has 306 s'),
    (250.0, 'too high: a needs 253 s in the air and has 183 s')])
@pytest.mark.parametrize('allowed', [None, frozenset({'zz'}), frozenset({'a'})])
def test_a_task_too_high_for_all_takes_nothing_from_their_lists(driver, z, reason, allowed):
    driver.add(high(z, allowed_uavs=allowed))
    driver.settle()
    assert routes(driver) == LISTS
    assert driver.state('high') == 'UNASSIGNED'
    assert driver.reason('high').startswith(
        'allowed for zz only' if allowed == {'zz'} else reason)


def test_a_task_that_is_moved_up_leaves_the_rest_of_its_list(driver):
    driver.add(Task('t2', (200.0, 60.0, 538.0)), action=AnnouncementAction.UPDATE)
    driver.settle()
    listed = {task_id for each in driver.lists.values() for task_id in each.task_ids}
    assert listed == {task.id for task in ROW} - {'t2'}


def test_a_task_too_high_for_the_list_in_force_waits():
    driver = fleet(endurance=370.0)
    driver.add(*(replace(task, service_time=30.0) for task in ROW))
    driver.settle()
    before = routes(driver)
    driver.add(high(140.0, allowed_uavs=frozenset({'a'})))
    driver.settle()
    assert routes(driver) == before
    assert driver.reason('high').startswith('too high: the list of a needs ')


def test_a_high_task_reduces_only_the_uavs_that_may_get_it(driver):
    driver.add(high(200.0, allowed_uavs=frozenset({'a'})))
    problem = driver.begin()
    for uav, top in zip(problem.uavs, (200.0, 50.0), strict=True):
        whole = driver.world.uav(uav.id)
        assert whole.endurance > uav.endurance
        assert uav.endurance == driver.world.flights.spendable(whole, top).endurance


def test_a_uav_that_gets_a_high_task_can_come_down_from_it(driver):
    driver.add(high(200.0))
    driver.settle()
    uav_id, = (uav_id for uav_id, row in routes(driver).items() if 'high' in row)
    uav, each = driver.world.uav(uav_id), driver.lists[uav_id]
    line = [uav.position, *(stop.task.position for stop in each.stops)]
    level = (*uav.base[:2], line[-1][2])
    assert flight_time(uav, [*line, level, (*level[:2], 200.0), uav.base]) < uav.endurance
    assert {task for row in routes(driver).values() for task in row} == {
        'high', *(task.id for task in ROW)}
