# SPDX-License-Identifier: Apache-2.0
"""Finding 19: no UAV is sent home into a zone, and none takes off inside one."""
import pytest
from allocation import AllocatorDriver

from uav_task_alloc import plan
from uav_task_alloc.allocator.persistence.restore import restored_state
from uav_task_alloc.allocator.status import health_values, health_warnings
from uav_task_alloc.geometry.zones import path_is_clear
from uav_task_alloc.model import ThreatZone

HOME = (0.0, 0.0, 0.0)
OVER = ThreatZone.cylinder('base', (0.0, 0.0), 100.0, 0.0, 80.0)
AWAY = ThreatZone.cylinder('away', (5000.0, 5000.0), 10.0)
NO_PATH = 'a has no safe path home (its home is inside zone base): its list ends with HOLD'


@pytest.fixture
def driver():
    """One UAV in the air that comes home."""
    driver = AllocatorDriver(route_end='home', list_interval=0.0)
    driver.uav('a', 500.0, 0.0, 50.0, home=HOME)
    driver.add(('t1', 600, 0), ('t2', 700, 0))
    driver.settle()
    assert driver.lists['a'].returns
    return driver


def put(driver, *zones):
    driver.world.set_zones(zones, (), driver.now)
    driver.settle(wait=1.0)


def test_finding_19_a_zone_over_the_home_ends_the_list_with_hold(driver):
    put(driver, OVER)
    published = driver.lists['a']
    assert (published.returns, published.end_via, published.task_ids) == (False, (), ('t1', 't2'))


def test_finding_19_an_empty_list_ends_with_hold_too(driver):
    driver.event('COMPLETED', 't1', 'a')
    driver.event('COMPLETED', 't2', 'a')
    driver.settle()
    assert (driver.route('a'), driver.lists['a'].returns) == ((), True)
    put(driver, OVER)
    assert (driver.route('a'), driver.lists['a'].returns) == ((), False)


def test_finding_19_a_low_battery_sends_no_uav_into_a_zone(driver):
    put(driver, OVER)
    driver.uav('a', 500.0, 0.0, 50.0, home=HOME, battery=0.1)
    driver.settle()
    assert (driver.route('a'), driver.lists['a'].returns) == ((), False)
    assert NO_PATH in driver.notes


def test_finding_19_a_uav_that_was_sent_home_on_a_low_battery_is_stopped(driver):
    driver.uav('a', 500.0, 0.0, 50.0, home=HOME, battery=0.1)
    driver.settle()
    assert (driver.route('a'), driver.lists['a'].returns) == ((), True)
    put(driver, OVER)
    assert not driver.lists['a'].returns


def test_finding_19_a_uav_that_gets_no_tasks_is_not_sent_into_a_zone_either(driver):
    driver.world.set_available('a', False, driver.now)
    driver.settle()
    assert (driver.route('a'), driver.lists['a'].returns) == ((), True)
    put(driver, OVER)
    assert not driver.lists['a'].returns
    published = len(driver.history)
    put(driver)
    assert len(driver.history) == published  # its list stays as it was


def test_finding_19_it_is_logged_once_until_it_changes(driver):
    for k in range(4):
        put(driver, OVER, *[AWAY] * (k % 2))
    assert driver.notes.count(NO_PATH) == 1
    assert ('a has no safe path home: its home is inside zone base'
            in health_warnings(driver.world, ''))
    put(driver)
    assert driver.lists['a'].returns
    assert driver.notes.count('a has a safe path home again') == 1
    assert health_warnings(driver.world, '') == []


def test_finding_19_zones_that_close_a_home_off_end_the_list_with_hold():
    driver = AllocatorDriver(route_end='home', altitude_max=60.0)
    driver.uav('a', 500.0, 0.0, 50.0, home=HOME)
    driver.add(('t1', 600, 0))
    ring = ThreatZone.polygon('ring', ((-90.0, -90.0), (90.0, -90.0), (90.0, 90.0), (-90.0, 90.0),
                                       (-90.0, -89.0), (-60.0, -60.0), (-60.0, 60.0),
                                       (60.0, 60.0), (60.0, -60.0), (-89.0, -89.5)))
    put(driver, ring)
    assert not driver.lists['a'].returns
    assert any('a has no safe path home (zones close it off)' in note for note in driver.notes)


def test_finding_19_a_list_that_ends_with_hold_does_not_flap():
    driver = AllocatorDriver(route_end='home', list_interval=10.0)
    driver.uav('a', 500.0, 0.0, 50.0, home=HOME)
    driver.world.set_zones([OVER], (), driver.now)
    driver.add(('t1', 600, 0))
    driver.settle()
    assert not driver.lists['a'].returns
    assert not driver.world.must_change('a')
    for k in range(5):
        driver.add((f'n{k}', 700 + k, 0))  # waits for the interval, as nothing is urgent
        driver.settle(wait=0.5)
    assert len(driver.history) == 1
    driver.world.set_zones([OVER, AWAY], (), driver.now)
    driver.settle(wait=10.0)
    assert len(driver.history) == 2


def test_finding_19_a_zone_that_comes_over_the_home_is_urgent():
    driver = AllocatorDriver(route_end='home', list_interval=10.0)
    driver.uav('a', 500.0, 0.0, 50.0, home=HOME)
    driver.add(('t1', 600, 0))
    driver.settle()
    for zones, returns in (([OVER], False), ([], True)):
        driver.world.set_zones(zones, (), driver.now)
        driver.settle(wait=0.2)
        assert driver.lists['a'].returns is returns


def test_finding_19_a_home_that_is_reported_late_is_checked():
    driver = AllocatorDriver(route_end='home')
    driver.world.set_zones([OVER], (), driver.now)
    driver.uav('a', 500.0, 0.0, 50.0)
    driver.add(('t1', 600, 0))
    driver.settle()
    assert driver.lists['a'].returns
    driver.now += 1.0
    driver.uav('a', 500.0, 0.0, 50.0, home=HOME)
    driver.settle()
    assert not driver.lists['a'].returns


def test_finding_19_a_restarted_allocator_sends_no_uav_into_a_zone(driver):
    put(driver, OVER)
    rows = driver.core.rows()
    again = AllocatorDriver(restored_state(rows), route_end='home')
    again.uav('a', 500.0, 0.0, 50.0, home=HOME, list_revision=driver.lists['a'].revision)
    again.settle(wait=4.0)
    again.settle(wait=4.0)
    assert [each.returns for each in again.history] == [False] * len(again.history)
    assert again.route('a') == ('t1', 't2')


def test_finding_19_a_restored_list_that_returns_into_a_zone_is_corrected(driver):
    put(driver, OVER)
    rows = [row if row.kind != 'list' else row._replace(body={**row.body, 'returns': True})
            for row in driver.core.rows()]
    again = AllocatorDriver(restored_state(rows), route_end='home')
    again.uav('a', 500.0, 0.0, 50.0, home=HOME)
    again.settle(wait=4.0)
    assert not again.lists['a'].returns


@pytest.mark.parametrize('where', [
    {'position': (0.0, 10.0, 0.0), 'home': (0.0, 10.0, 0.0)},
    {'position': (0.0, 10.0, -0.4), 'home': None},  # a height is not known better
    {'position': (900.0, 0.0, 0.0), 'home': HOME}])
@pytest.mark.parametrize('route_end', ['home', 'hold'])
def test_finding_19_a_uav_on_the_ground_inside_a_zone_gets_no_tasks(where, route_end):
    driver = AllocatorDriver(route_end=route_end)
    driver.world.set_zones([OVER], (), driver.now)
    driver.uav('a', *where['position'], home=where['home'], standby=True)
    driver.uav('b', 2000.0, 0.0, 0.0, home=(2000.0, 0.0, 0.0), standby=True)
    driver.add(('t1', 600, 0), ('t2', 700, 0))
    driver.settle()
    assert driver.route('b') == ('t2', 't1') or driver.route('b') == ('t1', 't2')
    assert 'a' not in driver.lists
    text = ('a is on the ground inside zone base' if where['position'][0] == 0.0 else
            'the home of a is inside zone base')
    assert f'{text}: it gets no tasks' in driver.notes
    assert health_warnings(driver.world, '')[0] == f'{text}: no tasks'
    shown = text.removeprefix('a is ')
    assert health_values(driver.world, False)['warning of a'] == f'{shown}: no tasks'
    assert 'warning of b' not in health_values(driver.world, False)
    driver.world.set_zones([], (), driver.now)
    driver.settle()
    assert 'warning of a' not in health_values(driver.world, False)


def test_finding_19_tasks_of_a_uav_on_the_ground_inside_a_zone_have_that_reason():
    driver = AllocatorDriver()
    driver.uav('a', 0.0, 0.0, 0.0, standby=True)
    driver.add(('t1', 600, 0))
    driver.settle()
    assert driver.state('t1') == 'ASSIGNED'
    put(driver, OVER)
    assert driver.route('a') == ()
    assert (driver.state('t1'), driver.reason('t1')) == (
        'UNASSIGNED', 'a is on the ground inside zone base')
    put(driver)
    assert driver.route('a') == ('t1',)


def test_finding_19_the_reason_names_uavs_blocked_on_the_ground():
    driver = AllocatorDriver(plan=plan, route_end='home', solve_budget=0.1)
    driver.world.set_zones([OVER], (), driver.now)
    driver.uav('a', 0.0, 0.0, 0.0, standby=True)
    driver.uav('b', 9000.0, 0.0, 50.0, range=10.0)
    driver.add(('t1', 600, 0))
    driver.settle()
    assert driver.reason('t1').startswith('beyond the range of every UAV: b')
    assert driver.reason('t1').endswith('; a is on the ground inside zone base')


def test_finding_19_a_position_that_drifts_at_the_rim_changes_nothing():
    driver = AllocatorDriver(clearance=10.0)
    driver.world.set_zones([OVER], (), driver.now)
    solves = []
    for k in range(12):
        driver.uav('a', 100.0 + (-1.0) ** (k + 1) * 1.5, 0.0, 0.0, home=(900.0, 0.0, 0.0),
                 standby=True)
        driver.settle(wait=1.0, report=False)
        solves.append(len(driver.solves))
    assert driver.notes.count('a is on the ground inside zone base: it gets no tasks') == 1
    assert solves[1:] == solves[1:2] * 11


def test_in_flight_above_a_zone_a_uav_keeps_its_tasks():
    driver = AllocatorDriver(route_end='hold')
    driver.uav('a', 0.0, 0.0, 200.0, home=HOME)
    driver.add(('t1', 600, 0))
    put(driver, OVER)
    assert driver.route('a') == ('t1',)


def test_finding_19_a_uav_without_a_path_home_gets_only_the_task_under_way():
    driver = AllocatorDriver(plan=plan, route_end='home', solve_budget=0.01)
    driver.uav('a', 500.0, 0.0, 50.0, home=HOME)
    driver.uav('b', 5000.0, 0.0, 50.0, home=(5000.0, 0.0, 0.0))
    driver.add(('t1', 600, 0), ('t2', 700, 0))
    driver.settle()
    driver.event('STARTED', 't1', 'a')
    put(driver, OVER)
    assert (driver.route('a'), driver.lists['a'].returns) == (('t1',), False)
    assert (driver.route('b'), driver.lists['b'].returns) == (('t2',), True)
    driver.event('COMPLETED', 't1', 'a')
    driver.settle()
    assert (driver.route('a'), driver.lists['a'].returns) == ((), False)


def test_a_zone_across_a_detour_changes_the_list_though_the_straight_way_is_clear():
    driver = AllocatorDriver()
    driver.world.set_zones([ThreatZone.cylinder('a', (500.0, -250.0), 400.0, 0.0, 1000.0)], (),
                           driver.now)
    driver.uav('u0', 0.0, 0.0, 50.0)
    driver.add(('t1', 1000.0, 0.0, 50.0))
    driver.settle()
    x, y, _ = driver.lists['u0'].stops[0].leg.via[0]
    moved = ThreatZone.cylinder('a', (x / 2.0, y / 2.0), 20.0, 0.0, 1000.0)
    driver.world.set_zones([moved], (), driver.now)
    driver.settle(1.0)
    way = (0.0, 0.0, 50.0), *driver.lists['u0'].stops[0].leg.via, (1000.0, 0.0, 50.0)
    assert path_is_clear(way, [moved])


WALL = ThreatZone.polygon('wall', ((250.0, -300.0), (270.0, -300.0), (270.0, 300.0),
                                   (250.0, 300.0)), -100.0, 1000.0)


def switched_off(driver, place, available):
    """What is left of the list of a UAV at a place that may have no tasks any more."""
    if available:
        driver.world.set_available('a', False, driver.now)
    driver.uav('a', *place, home=HOME, available=available)
    driver.settle()
    each = driver.lists['a']
    assert each.stops == ()
    return each


def way_home(each, place):
    return [place, *each.end_via, HOME]


@pytest.mark.parametrize('available', [True, False])
@pytest.mark.parametrize('place', [(150.0, 200.0, 50.0), (350.0, 0.0, 50.0)])
@pytest.mark.parametrize('last', [100, 400])
def test_a_uav_switched_off_in_flight_returns_from_where_it_is(available, place, last):
    driver = AllocatorDriver(route_end='home')
    driver.world.set_zones([WALL], (), driver.now)
    driver.uav('a', 380.0, 0.0, 50.0, home=HOME)
    driver.add(('t', last, 0))
    driver.settle()
    each = switched_off(driver, place, available)
    assert each.returns
    assert path_is_clear(way_home(each, place), [WALL])
    put(driver)  # a way home that is flown stays where nothing cuts it
    assert driver.lists['a'] == each


def test_a_uav_switched_off_in_flight_returns_around_a_zone_that_appears():
    driver = AllocatorDriver(route_end='home')
    driver.uav('a', 380.0, 0.0, 50.0, home=HOME)
    driver.add(('t', 400, 0))
    driver.settle()
    place = (350.0, 0.0, 50.0)
    assert not path_is_clear(way_home(switched_off(driver, place, True), place), [WALL])
    put(driver, WALL)
    each = driver.lists['a']
    assert each.returns
    assert path_is_clear(way_home(each, place), [WALL])


def test_a_uav_that_is_not_known_has_no_way_home():
    driver = AllocatorDriver(route_end='home')
    driver.uav('a', 380.0, 0.0, 50.0, home=HOME)
    driver.add(('t', 400, 0))
    driver.settle()
    assert driver.lists['a'].returns
    driver.world.fleet.forget('a')
    driver.world.request_replan('test', driver.now)
    driver.settle()
    each = driver.lists['a']
    assert (each.stops, each.returns, each.end_via) == ((), False, ())
    driver.uav('a', 380.0, 0.0, 50.0, home=HOME)
    driver.settle()
    assert driver.lists['a'].returns
