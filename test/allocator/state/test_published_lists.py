# SPDX-License-Identifier: Apache-2.0
"""Lists: published only if changed, with legs that stay as published while they are safe."""
import pytest
from allocation import AllocatorDriver, task

from uav_task_alloc.allocator.list_records import ListStop, UavList
from uav_task_alloc.allocator.records import AnnouncementAction
from uav_task_alloc.allocator.replanning.list_rate_limiter import ListRateLimiter
from uav_task_alloc.geometry.zones import path_is_clear
from uav_task_alloc.model import Leg, ThreatZone

DOME = ThreatZone.hemisphere('dome', (500.0, 5.0, 0.0), 100.0)


def points(driver, uav_id, start):
    return [start, *(p for stop in driver.lists[uav_id].stops
                     for p in (*stop.leg.via, stop.task.position))]


@pytest.fixture
def driver():
    driver = AllocatorDriver(clearance=10.0, replan_margin=0.001)
    driver.uav('a', 0.0, 0.0, 50.0)
    driver.uav('b', 0.0, 5000.0, 50.0)
    driver.world.set_zones([DOME], (), driver.now)
    driver.add(('t1', 1000, 0), ('t2', 1200, 0), ('t3', 100, 5000))
    driver.settle()
    return driver


def test_only_changed_lists_are_published(driver):
    assert [(each.uav, each.revision) for each in driver.history] == [('a', 1), ('b', 1)]
    driver.add(('t4', 200, 5000))
    driver.settle()
    assert [(each.uav, each.revision) for each in driver.history[2:]] == [('b', 2)]
    assert driver.allocations[-1].revision == 2


def test_a_list_leads_around_a_zone(driver):
    assert driver.lists['a'].stops[0].leg.via
    assert path_is_clear(points(driver, 'a', (0.0, 0.0, 50.0)), [DOME])


def test_the_leg_stays_as_published_while_the_uav_flies_it(driver):
    published = driver.lists['a'].stops[0].leg.via
    for x, y, z in (published[0], published[-1]):
        driver.uav('a', x + 1.0, y, z)
        driver.add((f'n{x}', 1300 + x, 0))
        driver.settle()
        assert driver.lists['a'].stops[0].leg.via == published
    assert driver.lists['a'].stops[0].leg.length < 700.0  # what is still to fly


def test_a_new_zone_that_cuts_a_leg_changes_it(driver):
    wall = ThreatZone.cylinder('wall', (1100.0, 0.0), 30.0)
    driver.world.set_zones([DOME, wall], (), driver.now)
    driver.settle()
    assert driver.lists['a'].revision == 2
    assert path_is_clear(points(driver, 'a', (0.0, 0.0, 50.0)), [DOME, wall])
    assert 'b' not in [each.uav for each in driver.history[2:]]
    assert 'zones wall' in driver.solves[-1]


def test_without_the_zone_the_leg_is_straight_again(driver):
    driver.world.set_zones([], (), driver.now)
    driver.settle()
    assert driver.lists['a'].stops[0].leg.via == ()


def test_the_same_zones_again_change_nothing(driver):
    solves = len(driver.solves)
    driver.world.set_zones([DOME], (), driver.now)
    driver.settle()
    assert len(driver.solves) == solves


def test_a_zone_whose_new_form_is_bad_stays_as_it_was(driver):
    driver.world.set_zones([], {'dome': 'radius = -1'}, driver.now)
    assert driver.world.airspace.zones == {'dome': DOME}


def test_a_zone_over_a_task_leaves_it_out_with_the_reason(driver):
    driver.world.set_zones([DOME, ThreatZone.hemisphere('z', (1200.0, 0.0, 0.0), 90.0)], (),
                         driver.now)
    driver.settle()
    assert driver.route('a') == ('t1',)
    assert driver.state('t2') == 'UNASSIGNED'
    assert driver.reason('t2')


def test_the_leg_of_a_uav_inside_a_zone_leaves_it_first(driver):
    trap = ThreatZone.hemisphere('trap', (30.0, 0.0, 0.0), 80.0)
    driver.world.set_zones([DOME, trap], (), driver.now)
    driver.settle(wait=1.0)
    assert any('a is inside a zone' in note for note in driver.notes)
    path = points(driver, 'a', (0.0, 0.0, 50.0))
    assert path_is_clear(path[1:], [DOME, trap])
    solves = len(driver.solves)
    driver.settle(wait=1.0)
    assert len(driver.solves) == solves  # it knows already


def test_a_uav_whose_leg_is_cut_after_a_drift_is_planned_again(driver):
    driver.now += 1.0
    driver.uav('a', 480.0, -170.0, 0.0)
    driver.settle()
    published = driver.lists['a'].stops[0].leg.via
    driver.now += 1.0
    driver.uav('a', 385.0, 5.0, 0.0)
    driver.settle()
    assert 'leg of a cut' in driver.solves[-1] or driver.lists['a'].stops[0].leg.via == published


def test_a_route_home_ends_the_list():
    driver = AllocatorDriver(route_end='home')
    driver.uav('a', 0.0, 0.0, 50.0)
    driver.add(('t1', 300, 0))
    driver.settle()
    assert driver.lists['a'].returns
    assert driver.lists['a'].distance == 600.0


@pytest.fixture
def returning():
    driver = AllocatorDriver(route_end='home', clearance=10.0)
    driver.uav('a', 0.0, 0.0, 50.0)
    driver.world.set_zones([DOME], (), driver.now)
    driver.add(('t1', 1000, 0))
    driver.settle()
    return driver


def home_bound(driver):
    """The path home from the last task."""
    return [(1000.0, 0.0, 50.0), *driver.lists['a'].end_via, (0.0, 0.0, 50.0)]


def test_the_path_home_leads_around_a_zone_too(returning):
    published = returning.lists['a']
    assert published.returns
    assert published.end_via
    assert path_is_clear(home_bound(returning), [DOME])


def test_the_path_home_stays_as_published_once_all_is_flown(returning):
    published = returning.lists['a'].end_via
    returning.event('COMPLETED', 't1', 'a')
    returning.settle()
    assert (returning.lists['a'].stops, returning.lists['a'].end_via) == ((), published)
    returning.uav('a', *published[0])
    returning.world.request_replan('test', returning.now)
    returning.settle()
    assert returning.lists['a'].end_via == published


def test_a_new_zone_on_the_path_home_changes_it(returning):
    returning.event('COMPLETED', 't1', 'a')
    returning.settle()
    returning.uav('a', 1000.0, 0.0, 50.0)
    wall = ThreatZone.cylinder('wall', (750.0, 0.0), 100.0)
    returning.world.set_zones([DOME, wall], (), returning.now)
    returning.settle()
    assert path_is_clear(home_bound(returning), [DOME, wall])


def stops(*ids):
    return tuple(ListStop(task((task_id, 1, 1)), Leg((), 1.0), 0.0) for task_id in ids)


@pytest.fixture
def limited():
    driver = AllocatorDriver(list_interval=1.0)
    driver.uav('a', 0.0, 0.0, 50.0)
    driver.uav('b', 0.0, 9000.0, 50.0)
    driver.add(('t1', 100, 0))
    driver.settle()
    return driver


def test_a_uav_gets_no_second_list_within_the_interval(limited):
    limited.add(('t2', 200, 0))
    limited.settle()
    assert limited.route('a') == ('t1',)
    assert (limited.state('t2'), limited.reason('t2')) == ('PENDING', 'waits for the next plan')
    limited.add(('t3', 300, 0))
    limited.settle(wait=1.0)
    limited.settle()
    assert limited.route('a') == ('t1', 't2', 't3')
    assert limited.lists['a'].revision == 2


def test_a_deferred_list_is_published_after_the_interval(limited):
    limited.add(('t2', 200, 0))
    limited.settle()
    limited.settle(wait=1.0)
    assert limited.route('a') == ('t1', 't2')
    assert limited.solves[-1] == 'deferred lists'


@pytest.mark.parametrize('what', ['withdrawn', 'moved', 'not available', 'zone', 'idle'])
def test_what_cannot_be_flown_any_more_is_replaced_at_once(limited, what):
    if what == 'withdrawn':
        limited.cancel('t1')
    elif what == 'moved':
        limited.add(('t1', 150, 0), action=AnnouncementAction.UPDATE)
    elif what == 'not available':
        limited.uav('a', 0.0, 0.0, 50.0, available=False)
    elif what == 'zone':
        limited.world.set_zones([ThreatZone.cylinder('z', (50.0, 0.0), 20.0)], (), limited.now)
    else:
        limited.add(('t9', 0, 9100))
    limited.settle()
    assert len(limited.history) > 1


def test_lists_that_exchange_a_task_are_published_together_or_deferred():
    held = {'a': UavList('a', 1, stops('t1', 't2')), 'b': UavList('b', 1, stops('t3'))}
    new = {'a': UavList('a', 1, stops('t1')), 'b': UavList('b', 1, stops('t3', 't2'))}
    limiter = ListRateLimiter()
    limiter.published(['b'], 10.0)
    never = set().__contains__
    assert limiter.permitted(held, new, never, 10.4, 1.0) == {}
    assert not limiter.due(10.9)
    assert limiter.due(11.0)
    assert not limiter.due(12.0)
    assert limiter.permitted(held, new, never, 11.0, 1.0) == new
    assert limiter.permitted(held, new, {'a'}.__contains__, 10.4, 1.0) == new


def test_times_of_a_list_are_computed_once_for_a_flight_and_again_when_the_uav_has_moved(driver):
    driver.settle()
    lists, flights = driver.world.lists, driver.world.flights

    def timed():
        return lists.restamped('a', driver.now, flights.of('a', driver.now))

    before = timed()
    assert timed() is before
    driver.uav('a', 50.0, 0.0, 50.0)
    assert timed().stops[0].eta < before.stops[0].eta
    driver.now += 1.0
    assert timed().stamp == before.stamp + 1.0
