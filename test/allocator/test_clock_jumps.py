# SPDX-License-Identifier: Apache-2.0
"""A published clock that jumps, or begins late, shifts what is in force and breaks none of it."""
from dataclasses import replace

import pytest
from allocation import AllocatorDriver

from uav_task_alloc.allocator.core import FASTEST_CLOCK, REAL_CLOCK
from uav_task_alloc.allocator.persistence.restore import restored_state
from uav_task_alloc.allocator.records import UavReport

JUMPS = [-900.0, -7.0, 60.0, 3600.0]


def jump(driver, by):
    """Let the published clock jump between two ticks; returns the stamp after it."""
    driver.core.tick(driver.now, driver.now)
    driver.now += 0.01
    driver.core.tick(driver.now, driver.now + by)
    driver.take()
    return driver.now + by


@pytest.mark.parametrize('by', JUMPS)
def test_a_wait_for_the_separation_lasts_as_long_and_is_sent_again(by):
    driver = AllocatorDriver()
    driver.uav('a', 0.0, 0.0, 50.0)
    driver.add(('t1', 100, 0))
    driver.settle()
    each = driver.lists['a']
    stop = replace(each.stops[0], begin_after=driver.now + 90.0)
    driver.world.publish({'a': replace(each, stops=(stop,))}, driver.now)
    revision = driver.world.list_of('a').revision
    stamp = jump(driver, by)
    sent = driver.lists['a']
    assert sent.revision == revision + 1
    assert sent.stamp + sent.stops[0].start == pytest.approx(stamp + 90.0, abs=0.1)


def test_a_list_whose_wait_was_over_before_the_clock_went_back_survives_a_restart():
    driver = AllocatorDriver()
    driver.uav('a', 0.0, 0.0, 50.0)
    driver.add(('t1', 100, 0))
    driver.settle()
    each = driver.lists['a']
    stop = replace(each.stops[0], begin_after=driver.now + 5.0)
    driver.world.publish({'a': replace(each, stops=(stop,))}, driver.now)
    driver.now += 60.0
    driver.uav('a', 50.0, 0.0, 50.0)
    jump(driver, -driver.now)
    driver.core.nothing_written()
    state = restored_state(driver.core.rows())
    assert state.unreadable == []
    assert [each.task_ids for each in state.lists] == [('t1',)]


@pytest.mark.parametrize('by', JUMPS)
@pytest.mark.parametrize('begun', [True, False])
def test_the_deadline_of_a_plan_that_waits_for_approval_is_as_far_away(by, begun):
    driver = AllocatorDriver(approval='all', approval_timeout=30.0, approval_on_timeout='accept')
    driver.uav('a', 0.0, 0.0, 50.0)
    driver.add(('t1', 100, 0))
    driver.settle()
    if not begun:
        by = jump(driver, -driver.now) + by
    jump(driver, by)
    for seconds, waits in ((29.0, True), (2.0, False)):
        driver.now += seconds
        driver.uav('a', 0.0, 0.0, 50.0)
        driver.core.tick(driver.now, driver.now + by)
        assert (driver.world.proposal is not None) == waits
    driver.take()
    assert driver.route('a') == ('t1',)


@pytest.mark.parametrize('by', JUMPS)
def test_a_uav_stands_at_home_and_serves_for_as_long(by):
    driver = AllocatorDriver()
    driver.uav('a', 0.0, 0.0, 0.0, home=(0.0, 0.0, 0.0), standby=True)
    driver.uav('b', 100.0, 0.0, 50.0)
    driver.add(('t1', 100, 0))
    driver.settle()
    driver.uav('b', 100.0, 0.0, 50.0)
    driver.now += 3.0
    flights, landed = driver.world.flights, driver.world.flights.at_home_since('a')
    served = flights.of('b', driver.now).served
    assert served >= 3.0
    stamp = jump(driver, by)
    assert stamp - flights.at_home_since('a') == pytest.approx(driver.now - landed, abs=0.1)
    assert flights.of('b', stamp).served == pytest.approx(served, abs=0.1)


@pytest.mark.parametrize('by', JUMPS)
def test_a_silent_uav_in_the_air_is_kept_apart_from_the_others(by):
    driver = AllocatorDriver(separation__horizontal=20.0, uav_timeout=5.0)
    flying = {'mode': 'ON_MISSION', 'authority': 'HELD'}
    driver.uav('b', 100.0, 0.0, 50.0, velocity=(0.0, 0.0, 0.0), **flying)
    for _ in range(12):
        driver.now += 0.5
        driver.uav('a', 0.0, 0.0, 50.0, velocity=(5.0, 0.0, 0.0), **flying)
        driver.core.tick(driver.now, driver.now)
        driver.core.separate(driver.now, driver.now)
    assert driver.world.uav_records()['b'].silent
    assert driver.core.separation.texts().keys() == {'a', 'b'}
    stamp = jump(driver, by)
    assert not driver.world.flights.is_forgotten('b', stamp)
    driver.core.separate(driver.now + 1.0, stamp + 1.0)
    assert driver.core.separation.texts().keys() == {'a', 'b'}


def test_a_list_of_a_previous_run_with_a_later_clock_waits_no_longer():
    driver = AllocatorDriver()
    driver.world.update_uav(UavReport('a', (0.0, 0.0, 50.0)), driver.now, 10.0)
    driver.world.lists.lists['a'] = replace(
        driver.world.list_of('a'), revision=4, stamp=5000.0)
    driver.core.tick(driver.now, 10.0)
    assert driver.world.list_of('a').stamp == 10.0


@pytest.mark.parametrize(('rate', 'shifted'), [(REAL_CLOCK, True), (FASTEST_CLOCK, False)])
def test_twenty_seconds_at_once_are_a_jump_of_a_computer_not_of_a_fast_simulation(rate, shifted):
    driver = AllocatorDriver()
    driver.core.clock_rate = rate
    driver.uav('a', 0.0, 0.0, 50.0)
    driver.add(('t1', 100, 0))
    driver.settle()
    stop = replace(driver.lists['a'].stops[0], begin_after=driver.now + 90.0)
    driver.world.publish({'a': replace(driver.lists['a'], stops=(stop,))}, driver.now)
    begin = stop.begin_after
    driver.core.tick(driver.now, driver.now)
    driver.now += 0.1
    driver.core.tick(driver.now, driver.now + 20.0)
    after = driver.world.list_of('a').stops[0].begin_after
    assert after == pytest.approx(begin + 19.9 * shifted, abs=0.2)
