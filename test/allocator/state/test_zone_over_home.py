# SPDX-License-Identifier: Apache-2.0
"""Finding 19: no UAV is sent home into a zone, and none starts inside one."""

import pytest
from allocation import Desk

from uav_task_alloc import plan
from uav_task_alloc.allocator.persistence.restore import restored_state
from uav_task_alloc.allocator.status import health_warnings
from uav_task_alloc.model import ThreatZone

HOME = (0.0, 0.0, 0.0)
OVER = ThreatZone.cylinder('base', (0.0, 0.0), 100.0, 0.0, 80.0)
AWAY = ThreatZone.cylinder('away', (5000.0, 5000.0), 10.0)
NO_WAY = 'a has no safe path home (its home is inside zone base): its list ends with HOLD'


@pytest.fixture
def desk():
    """One UAV in the air that comes home."""
    desk = Desk(route_end='home', list_interval=0.0)
    desk.uav('a', 500.0, 0.0, 50.0, home=HOME)
    desk.add(('t1', 600, 0), ('t2', 700, 0))
    desk.settle()
    assert desk.lists['a'].returns
    return desk


def put(desk, *zones):
    desk.world.set_zones(zones, (), desk.now)
    desk.settle(wait=1.0)


def test_finding_19_a_zone_over_the_home_ends_the_list_with_hold(desk):
    put(desk, OVER)
    told = desk.lists['a']
    assert (told.returns, told.end_via, told.task_ids) == (False, (), ('t1', 't2'))


def test_finding_19_an_empty_list_ends_with_hold_too(desk):
    desk.event('COMPLETED', 't1', 'a')
    desk.event('COMPLETED', 't2', 'a')
    desk.settle()
    assert (desk.route('a'), desk.lists['a'].returns) == ((), True)
    put(desk, OVER)
    assert (desk.route('a'), desk.lists['a'].returns) == ((), False)


def test_finding_19_a_low_battery_sends_nobody_into_a_zone(desk):
    put(desk, OVER)
    desk.uav('a', 500.0, 0.0, 50.0, home=HOME, battery=0.1)
    desk.settle()
    assert (desk.route('a'), desk.lists['a'].returns) == ((), False)
    assert NO_WAY in desk.notes


def test_finding_19_a_uav_that_was_sent_home_on_a_low_battery_is_stopped(desk):
    desk.uav('a', 500.0, 0.0, 50.0, home=HOME, battery=0.1)
    desk.settle()
    assert (desk.route('a'), desk.lists['a'].returns) == ((), True)
    put(desk, OVER)
    assert not desk.lists['a'].returns


def test_finding_19_a_uav_that_gets_no_tasks_is_not_sent_into_a_zone_either(desk):
    desk.world.set_available('a', False, desk.now)
    desk.settle()
    assert (desk.route('a'), desk.lists['a'].returns) == ((), True)
    put(desk, OVER)
    assert not desk.lists['a'].returns
    told = len(desk.history)
    put(desk)
    assert len(desk.history) == told  # its list stays as it was


def test_finding_19_the_operator_reads_it_once_until_it_changes(desk):
    for k in range(4):
        put(desk, OVER, *[AWAY] * (k % 2))
    assert desk.notes.count(NO_WAY) == 1
    assert ('a has no safe path home: its home is inside zone base'
            in health_warnings(desk.world, ''))
    put(desk)
    assert desk.lists['a'].returns
    assert desk.notes.count('a has a safe path home again') == 1
    assert health_warnings(desk.world, '') == []


def test_finding_19_zones_that_close_a_home_off_end_the_list_with_hold():
    desk = Desk(route_end='home', altitude_max=60.0)
    desk.uav('a', 500.0, 0.0, 50.0, home=HOME)
    desk.add(('t1', 600, 0))
    ring = ThreatZone.polygon('ring', ((-90.0, -90.0), (90.0, -90.0), (90.0, 90.0), (-90.0, 90.0),
                                       (-90.0, -89.0), (-60.0, -60.0), (-60.0, 60.0),
                                       (60.0, 60.0), (60.0, -60.0), (-89.0, -89.5)))
    put(desk, ring)
    assert not desk.lists['a'].returns
    assert any('a has no safe path home (zones close it off)' in note for note in desk.notes)


def test_finding_19_a_list_that_ends_with_hold_does_not_flap():
    desk = Desk(route_end='home', list_interval=10.0)
    desk.uav('a', 500.0, 0.0, 50.0, home=HOME)
    desk.world.set_zones([OVER], (), desk.now)
    desk.add(('t1', 600, 0))
    desk.settle()
    assert not desk.lists['a'].returns
    assert not desk.world.must_change('a')
    for k in range(5):
        desk.add((f'n{k}', 700 + k, 0))  # waits for the interval, as nothing is urgent
        desk.settle(wait=0.5)
    assert len(desk.history) == 1
    desk.world.set_zones([OVER, AWAY], (), desk.now)
    desk.settle(wait=10.0)
    assert len(desk.history) == 2


def test_finding_19_a_zone_that_comes_over_the_home_is_urgent():
    desk = Desk(route_end='home', list_interval=10.0)
    desk.uav('a', 500.0, 0.0, 50.0, home=HOME)
    desk.add(('t1', 600, 0))
    desk.settle()
    for zones, returns in (([OVER], False), ([], True)):
        desk.world.set_zones(zones, (), desk.now)
        desk.settle(wait=0.2)
        assert desk.lists['a'].returns is returns


def test_finding_19_a_home_that_is_told_late_is_looked_at():
    desk = Desk(route_end='home')
    desk.world.set_zones([OVER], (), desk.now)
    desk.uav('a', 500.0, 0.0, 50.0)
    desk.add(('t1', 600, 0))
    desk.settle()
    assert desk.lists['a'].returns
    desk.now += 1.0
    desk.uav('a', 500.0, 0.0, 50.0, home=HOME)
    desk.settle()
    assert not desk.lists['a'].returns


def test_finding_19_a_restarted_allocator_sends_nobody_into_a_zone(desk):
    put(desk, OVER)
    rows = desk.core.rows()
    again = Desk(restored_state(rows), route_end='home')
    again.uav('a', 500.0, 0.0, 50.0, home=HOME, list_revision=desk.lists['a'].revision)
    again.settle(wait=4.0)
    again.settle(wait=4.0)
    assert [each.returns for each in again.history] == [False] * len(again.history)
    assert again.route('a') == ('t1', 't2')


def test_finding_19_a_journal_with_a_way_home_into_a_zone_is_put_right(desk):
    put(desk, OVER)
    rows = [row if row.kind != 'list' else row._replace(body={**row.body, 'returns': True})
            for row in desk.core.rows()]
    again = Desk(restored_state(rows), route_end='home')
    again.uav('a', 500.0, 0.0, 50.0, home=HOME)
    again.settle(wait=4.0)
    assert not again.lists['a'].returns


@pytest.mark.parametrize('where', [
    {'position': (0.0, 10.0, 0.0), 'home': (0.0, 10.0, 0.0)},
    {'position': (0.0, 10.0, -0.4), 'home': None},  # a height is not known better
    {'position': (900.0, 0.0, 0.0), 'home': HOME}])
@pytest.mark.parametrize('route_end', ['home', 'hold'])
def test_finding_19_who_stands_inside_a_zone_gets_no_tasks(where, route_end):
    desk = Desk(route_end=route_end)
    desk.world.set_zones([OVER], (), desk.now)
    desk.uav('a', *where['position'], home=where['home'], standby=True)
    desk.uav('b', 2000.0, 0.0, 0.0, home=(2000.0, 0.0, 0.0), standby=True)
    desk.add(('t1', 600, 0), ('t2', 700, 0))
    desk.settle()
    assert desk.route('b') == ('t2', 't1') or desk.route('b') == ('t1', 't2')
    assert 'a' not in desk.lists
    text = ('a is on the ground inside zone base' if where['position'][0] == 0.0 else
            'the home of a is inside zone base')
    assert f'{text}: it gets no tasks' in desk.notes
    assert health_warnings(desk.world, '')[0] == f'{text}: no tasks'


def test_finding_19_tasks_of_who_stands_inside_a_zone_say_so():
    desk = Desk()
    desk.uav('a', 0.0, 0.0, 0.0, standby=True)
    desk.add(('t1', 600, 0))
    desk.settle()
    assert desk.state('t1') == 'ASSIGNED'
    put(desk, OVER)
    assert desk.route('a') == ()
    assert (desk.state('t1'), desk.reason('t1')) == (
        'UNASSIGNED', 'a is on the ground inside zone base')
    put(desk)
    assert desk.route('a') == ('t1',)


def test_finding_19_who_else_could_fly_it_is_said_with_the_reason():
    desk = Desk(plan=plan, route_end='home', solve_budget=0.01)
    desk.world.set_zones([OVER], (), desk.now)
    desk.uav('a', 0.0, 0.0, 0.0, standby=True)
    desk.uav('b', 9000.0, 0.0, 50.0, range=10.0)
    desk.add(('t1', 600, 0))
    desk.settle()
    assert desk.reason('t1').startswith('beyond the range of every UAV: b')
    assert desk.reason('t1').endswith('; a is on the ground inside zone base')


def test_finding_19_a_position_that_wanders_at_the_rim_changes_nothing():
    desk = Desk(clearance=10.0)
    desk.world.set_zones([OVER], (), desk.now)
    solves = []
    for k in range(12):
        desk.uav('a', 100.0 + (-1.0) ** (k + 1) * 1.5, 0.0, 0.0, home=(900.0, 0.0, 0.0),
                 standby=True)
        desk.settle(wait=1.0, report=False)
        solves.append(len(desk.solves))
    assert desk.notes.count('a is on the ground inside zone base: it gets no tasks') == 1
    assert solves[1:] == solves[1:2] * 11


def test_in_flight_above_a_zone_a_uav_keeps_its_tasks():
    desk = Desk(route_end='hold')
    desk.uav('a', 0.0, 0.0, 200.0, home=HOME)
    desk.add(('t1', 600, 0))
    put(desk, OVER)
    assert desk.route('a') == ('t1',)


def test_finding_19_the_solver_gives_who_has_no_way_home_only_what_it_flies():
    desk = Desk(plan=plan, route_end='home', solve_budget=0.01)
    desk.uav('a', 500.0, 0.0, 50.0, home=HOME)
    desk.uav('b', 5000.0, 0.0, 50.0, home=(5000.0, 0.0, 0.0))
    desk.add(('t1', 600, 0), ('t2', 700, 0))
    desk.settle()
    desk.event('STARTED', 't1', 'a')
    put(desk, OVER)
    assert (desk.route('a'), desk.lists['a'].returns) == (('t1',), False)
    assert (desk.route('b'), desk.lists['b'].returns) == (('t2',), True)
    desk.event('COMPLETED', 't1', 'a')
    desk.settle()
    assert (desk.route('a'), desk.lists['a'].returns) == ((), False)


