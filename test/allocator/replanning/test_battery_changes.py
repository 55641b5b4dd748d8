# SPDX-License-Identifier: Apache-2.0
"""An idle UAV whose battery allows few of the tasks expected goes home for another one."""
import json
import math

import numpy as np
import pytest
from allocation import AllocatorDriver

from uav_task_alloc.allocator.persistence.restore import restored_state
from uav_task_alloc.journal import JournalRow
from uav_task_alloc.model import Task, ThreatZone
from uav_task_alloc.params import AllocatorParams

FULL, SPEED = 20_000.0, 10.0  # [m] with a full battery, [m/s]
HOT = (3000.0, 0.0)  # [m]
AREA = (-4000.0, -4000.0, 4000.0, 4000.0)
PLACE = (2000.0, 0.0, 50.0)


class Service:
    """UAVs between a hot spot and their homes at the origin, and tasks that were withdrawn."""

    def __init__(self, *batteries, more=None, **params):
        self.params = {'anticipate': 'learnt', 'anticipate_area': AREA, 'battery_reserve': 0.2,
                       **params}
        self.driver = AllocatorDriver(**self.params)
        self.batteries = {f'u{k}': battery for k, battery in enumerate(batteries)}
        self.more = dict.fromkeys(self.batteries, more or {})
        self.report()
        for uav_id in self.batteries:  # each has had a list
            self.driver.add(Task(f'first {uav_id}', PLACE, allowed_uavs=frozenset({uav_id})))
        self.driver.settle(report=False)
        for uav_id in self.batteries:
            self.driver.cancel(f'first {uav_id}')
        rng = np.random.default_rng(7)
        for k in range(40):
            self.driver.add((f's{k}', *rng.normal(HOT, 300.0)))
            self.driver.cancel(f's{k}')
        self.wait(20.0)

    def report(self):
        for uav_id, battery in self.batteries.items():
            self.driver.uav(uav_id, *self.more[uav_id].get('position', PLACE), **{
                'home': (0.0, 0.0, 0.0), 'authority': 'HELD', 'mode': 'HOLD', 'battery': battery,
                'range': FULL * battery, 'full_range': FULL, 'cruise_speed': SPEED,
                'turnaround': 60.0,
                **{k: v for k, v in self.more[uav_id].items() if k != 'position'}})

    def wait(self, seconds):
        for _ in range(math.ceil(seconds / 2.0)):
            self.driver.now += 2.0
            self.report()
            self.driver.settle(report=False)

    def land(self, uav_id='u0', battery=0.3, **more):
        self.batteries[uav_id] = battery
        self.more[uav_id] = {'position': (0.0, 0.0, 0.0), 'standby': True, 'mode': 'STANDBY',
                             **more}
        self.wait(10.0)

    def restart(self):
        """Start the allocator again from its journal."""
        before, rows = self.driver, self.driver.core.rows()
        stored = [row._replace(body=json.loads(json.dumps(row.body))) for row in rows]
        self.driver = AllocatorDriver(restored_state(stored), **self.params)
        self.driver.now = before.now + 2.0
        self.wait(20.0)

    def goes_home(self, uav_id='u0'):
        each, world = self.driver.world.list_of(uav_id), self.driver.world
        return each.returns and not each.stops and not world.usable(uav_id)


@pytest.mark.parametrize(('battery', 'home'), [(0.6, False), (0.45, False), (0.37, True)])
def test_it_goes_home_once_its_battery_allows_few_of_the_tasks_expected(battery, home):
    service = Service(battery)  # a task takes 4 km of 20 km, 4 km are the reserve
    assert service.goes_home() is home
    assert any('goes home for another battery' in note
               for note in service.driver.notes) is home
    assert (service.driver.core.waiting.texts().get('u0') == 'gets another battery at its home') \
        is home


@pytest.mark.parametrize('more', [
    {'turnaround': None}, {'full_range': None}, {'authority': 'LOST'}, {'mode': 'MANUAL'},
    {'position': (0.0, 0.0, 0.0), 'standby': True, 'mode': 'STANDBY'}])
def test_one_that_is_not_idle_in_flight_or_that_nobody_gives_another_battery_stays(more):
    assert not Service(0.37, more=more).goes_home()


@pytest.mark.parametrize('params', [{'anticipate': 'off'}, {'approval': 'all'}])
def test_without_waiting_places_it_stays(params):
    assert not Service(0.37, **params).goes_home()


def test_one_with_a_task_stays():
    service = Service(0.6)
    service.driver.add(('t', *HOT))
    service.wait(4.0)
    service.batteries['u0'] = 0.37
    service.wait(20.0)
    assert service.driver.route('u0') == ('t',)


def test_two_are_away_at_most():
    service = Service(0.37, 0.36, 0.35, 0.6)
    assert [uav_id for uav_id in service.batteries if service.goes_home(uav_id)] == ['u1', 'u2']


def test_one_whose_battery_nobody_changes_does_not_keep_others_from_it():
    service = Service(0.37, 0.36, 0.6)
    for uav_id in ('u0', 'u1'):
        service.land(uav_id, battery=0.1)  # below the reserve
    service.batteries['u2'] = 0.37
    service.wait(20.0)
    assert not service.goes_home('u2')
    service.wait(180.0)
    assert service.goes_home('u2')


def test_it_gets_tasks_again_with_another_battery():
    service = Service(0.37)
    service.driver.add(('t', 500.0, 0.0))
    service.wait(4.0)
    service.land()
    assert service.driver.route('u0') == ()  # hands are at the propellers
    service.batteries['u0'] = 1.0
    service.wait(4.0)
    assert service.driver.route('u0') == ('t',)
    assert any('u0 has another battery' in trigger for trigger in service.driver.solves)


@pytest.mark.parametrize('landed', [False, True])
def test_it_waits_for_its_battery_over_a_restart_of_the_allocator(landed):
    service = Service(0.37)
    if landed:
        service.land()
    service.restart()
    service.driver.add(('t', 500.0, 0.0))
    service.wait(4.0)
    if not landed:
        assert service.goes_home()
        service.land()
    assert service.driver.route('u0') == ()
    service.batteries['u0'] = 1.0
    service.wait(4.0)
    assert service.driver.route('u0') == ('t',)
    assert [row.body for row in service.driver.core.rows() if row.kind == 'change'] == [None]


@pytest.mark.parametrize('body', [None, 'x', -0.1, 1.5, [0.5]])
def test_a_damaged_row_is_left_out(body):
    state = restored_state([JournalRow('change', 'u0', body)])
    assert not state.change_from
    assert len(state.unreadable) == 1


def test_a_uav_that_is_forgotten_leaves_no_row():
    service = Service(0.37)
    assert [row.id for row in service.driver.core.rows() if row.kind == 'change'] == ['u0']
    service.driver.world.forget_uav('u0')
    assert [row for row in service.driver.core.rows() if row.kind == 'change'] == [
        JournalRow('change', 'u0', None)]


@pytest.mark.parametrize('place', [(0.0, 0.0, 0.0), (900.0, 0.0, 0.0)])
def test_where_nobody_changes_it_the_uav_is_used_as_it_is(place):
    service = Service(0.37)
    service.land(position=place)
    service.wait(180.0)
    service.driver.add(('t', 300.0, 0.0))
    service.wait(4.0)
    assert service.driver.route('u0') == ('t',)


@pytest.mark.parametrize('order', ['PAUSE', 'RETURN'])
def test_orders_go_before(order):
    service = Service(0.37)
    assert service.goes_home()
    service.driver.order(order, 'u0')
    service.wait(10.0)
    hold = service.driver.world.orders.holds.get('u0')
    assert (hold is not None and hold.hold) is (order == 'PAUSE')
    assert not service.driver.world.uav_record('u0').awaits_battery


def test_the_parameter_switched_off_lets_it_stay():
    service = Service(0.37)
    params = AllocatorParams(**{**vars(service.driver.world.params), 'anticipate': 'off'})
    service.driver.world.set_params(params, service.driver.now)
    service.wait(6.0)
    assert not service.driver.world.uav_record('u0').awaits_battery
    assert service.driver.world.usable('u0')


def test_without_a_safe_way_home_it_is_not_sent():
    service = Service(0.37, more={'turnaround': None})
    service.driver.world.set_zones(
        [ThreatZone.cylinder('z', (0.0, 0.0), 500.0)], (), service.driver.now)
    service.more['u0'] = {}
    service.wait(20.0)
    assert not service.driver.world.uav_record('u0').awaits_battery
