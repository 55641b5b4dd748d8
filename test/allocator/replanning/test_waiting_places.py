# SPDX-License-Identifier: Apache-2.0
"""Idle UAVs are sent to places where tasks are expected, and stay where that is in doubt."""
import json
import math

import numpy as np
import pytest
from allocation import AllocatorDriver

from uav_task_alloc.allocator.monitored_uavs import MonitoredUavs
from uav_task_alloc.allocator.persistence.restore import restored_state
from uav_task_alloc.geometry.zones import path_is_clear, zones_around
from uav_task_alloc.model import ThreatZone
from uav_task_alloc.params import AllocatorParams

HOT = (3000.0, 3000.0)  # [m]
AREA = (-4000.0, -4000.0, 4000.0, 4000.0)


class IdleFleet:
    """UAVs in flight without tasks, and tasks that were announced and withdrawn."""

    def __init__(self, *places, seen=40, saved=None, **params):
        self.driver = AllocatorDriver(saved, **{
            'anticipate': 'learnt', 'default_range': 60_000.0, **params})
        self.places = {f'u{k}': place for k, place in enumerate(places)}
        self.more = {}
        self.report()
        self.see(seen)
        self.driver.settle()

    def report(self):
        for uav_id, place in self.places.items():
            self.driver.uav(uav_id, *place, **{
                'home': (0.0, 0.0, 0.0), 'authority': 'HELD', 'mode': 'HOLD',
                **self.more.get(uav_id, {})})

    def see(self, count, at=HOT):
        """Tasks around a place that are announced and withdrawn."""
        rng = np.random.default_rng(7)
        for k in range(count):
            x, y = rng.normal(at, 300.0)
            self.driver.add((f's{k}_{at[0]:.0f}', x, y))
            self.driver.cancel(f's{k}_{at[0]:.0f}')

    def wait(self, seconds=40.0):
        """Let time pass, so that places are chosen."""
        for _ in range(int(seconds / 2.0)):
            self.driver.now += 2.0
            self.report()
            self.driver.settle(report=False)

    def place(self, uav_id='u0'):
        return self.driver.world.list_of(uav_id).waiting_place

    def text(self, uav_id='u0'):
        return self.driver.core.waiting.texts().get(uav_id, '')


def near(place, at=HOT):
    return math.dist(place[:2], at) < 1500.0


def test_an_idle_uav_is_sent_to_where_tasks_came_from():
    fleet = IdleFleet((0.0, 0.0, 50.0))
    fleet.wait()
    assert near(fleet.place())
    assert fleet.driver.lists['u0'].stops == ()
    assert fleet.text() == 'waits at ({:.0f}, {:.0f}, 50) m for demand'.format(*fleet.place())
    assert 'u0 waits at' in '\n'.join(fleet.driver.notes)
    assert fleet.driver.allocations[-1].trigger == 'waiting places'


def test_without_the_parameter_it_stays():
    fleet = IdleFleet((0.0, 0.0, 50.0), anticipate='off')
    fleet.wait()
    assert fleet.place() is None
    assert 'u0' not in fleet.driver.lists
    assert fleet.driver.world.announced.seen.seen == []


def test_even_waits_apart_whatever_was_announced():
    fleet = IdleFleet((0.0, 0.0, 50.0), (50.0, 0.0, 50.0), anticipate='even',
                      anticipate_area=AREA)
    fleet.wait()
    places = [fleet.place(u) or fleet.places[u] for u in fleet.places]
    assert math.dist(*places) > 1000.0


def test_it_leaves_at_once_for_a_task():
    fleet = IdleFleet((0.0, 0.0, 50.0))
    fleet.wait()
    assert fleet.place()
    before = fleet.driver.now
    fleet.driver.add(('t1', 100.0, 100.0))
    fleet.driver.settle(report=False)
    assert fleet.driver.route('u0') == ('t1',)
    assert fleet.driver.lists['u0'].end_via == ()
    assert fleet.driver.now - before < 1.0


def test_a_place_is_kept_while_nothing_changes():
    fleet = IdleFleet((0.0, 0.0, 50.0))
    fleet.wait()
    sent = len(fleet.driver.history)
    fleet.wait(300.0)
    assert len(fleet.driver.history) == sent


@pytest.mark.parametrize('background', [0.0, 0.02])
def test_a_place_is_kept_while_plans_follow_for_others(background):
    fleet = IdleFleet((0.0, 0.0, 50.0), (-3000.0, -3000.0, 50.0), background_budget=background,
                      anticipate_area=AREA)
    fleet.wait()
    assert near(fleet.place())
    sent = len(fleet.driver.history)
    fleet.driver.add(('t1', -9000.0, -9100.0))
    for _ in range(30):
        fleet.driver.now += 1.0
        fleet.report()
        fleet.driver.world.request_replan('test', fleet.driver.now)
        fleet.driver.settle(report=False)
        assert near(fleet.place())
    assert fleet.driver.route('u1') == ('t1',)
    assert sum(each.uav == 'u0' for each in fleet.driver.history[sent:]) <= 1


@pytest.mark.parametrize('more', [
    {'authority': 'SUSPENDED'}, {'authority': 'LOST'}, {'authority': 'NONE'}, {'authority': ''},
    {'mode': 'STANDBY', 'standby': True}, {'mode': 'RETURNING'}, {'mode': 'TAKEOFF'},
    {'mode': 'FAULT'}, {'available': False}, {'foreign': True},
    {'battery': 0.1, 'range': 5000.0}])
def test_a_uav_that_is_not_ours_or_not_idle_is_left_alone(more):
    fleet = IdleFleet((0.0, 0.0, 50.0))
    fleet.more['u0'] = more
    fleet.wait()
    assert fleet.place() is None


@pytest.mark.parametrize('more', [{'authority': 'SUSPENDED'}, {'mode': 'STANDBY', 'standby': True},
                                  {'available': False}])
def test_on_its_way_it_is_released_when_it_is_not_ours_any_more(more):
    fleet = IdleFleet((0.0, 0.0, 50.0))
    fleet.wait()
    assert fleet.place()
    fleet.more['u0'] = more
    fleet.wait(4.0)
    assert fleet.place() is None


def test_orders_go_before():
    fleet = IdleFleet((0.0, 0.0, 50.0), (100.0, 0.0, 50.0))
    fleet.wait()
    sent = [u for u in fleet.places if fleet.place(u)]
    assert sent
    assert fleet.driver.order('PAUSE', sent[0]).success
    fleet.wait()
    assert fleet.place(sent[0]) is None
    assert fleet.driver.order('RETURN', sent[0]).success
    fleet.wait(4.0)
    assert fleet.driver.world.list_of(sent[0]).returns
    assert fleet.place(sent[0]) is None


def test_the_parameter_switched_off_releases_all():
    fleet = IdleFleet((0.0, 0.0, 50.0))
    fleet.wait()
    params = AllocatorParams(**{**vars(fleet.driver.world.params), 'anticipate': 'off'})
    fleet.driver.world.set_params(params, fleet.driver.now)
    fleet.wait(4.0)
    assert fleet.place() is None


def test_plans_that_operators_approve_leave_idle_uavs_where_they_are():
    fleet = IdleFleet((0.0, 0.0, 50.0), approval='replan')
    fleet.wait()
    assert fleet.place() is None


@pytest.mark.parametrize(('limits', 'goes'), [
    ({'range': 12_000.0, 'battery': 1.0}, False), ({'range': 40_000.0, 'battery': 1.0}, True),
    ({'range': 40_000.0, 'battery': 1.0, 'endurance': 600.0}, False)])
def test_a_battery_that_does_not_last_for_the_way_there_and_home_keeps_it_where_it_is(
        limits, goes):
    fleet = IdleFleet((0.0, 0.0, 50.0), seen=0)
    fleet.more['u0'] = limits
    fleet.report()
    fleet.see(40)
    fleet.wait()
    assert (fleet.place() is not None and near(fleet.place())) is goes


def test_its_way_leads_around_zones_and_its_place_is_outside():
    zones = [ThreatZone.cylinder('wall', (1500.0, 1500.0), 500.0, 0.0, 1000.0),
             ThreatZone.cylinder('spot', HOT, 400.0, 0.0, 1000.0)]
    fleet = IdleFleet((0.0, 0.0, 50.0), seen=0)
    fleet.see(40)
    fleet.driver.world.set_zones(zones, (), fleet.driver.now)
    fleet.wait()
    way = ((0.0, 0.0, 50.0), *fleet.driver.lists['u0'].end_via)
    assert len(way) > 2
    assert path_is_clear(way, zones)
    assert not zones_around(fleet.place(), zones)


def test_a_zone_across_its_way_makes_it_hold_and_choose_again():
    fleet = IdleFleet((0.0, 0.0, 50.0))
    fleet.wait()
    x, y, _ = fleet.place()
    wall = ThreatZone.cylinder('wall', (x / 2.0, y / 2.0), 400.0, 0.0, 1000.0)
    fleet.driver.world.set_zones([wall], (), fleet.driver.now)
    sent = len(fleet.driver.history)
    fleet.wait(2.0)
    assert fleet.driver.history[sent].end_via == ()
    fleet.wait()
    way = ((0.0, 0.0, 50.0), *fleet.driver.world.list_of('u0').end_via)
    assert path_is_clear(way, [wall])
    assert len(way) > 2


@pytest.mark.parametrize(('height', 'limits', 'at'), [
    (5.0, {}, 50.0), (80.0, {}, 80.0), (80.0, {'altitude_max': 60.0}, 60.0)])
def test_it_climbs_to_the_height_of_its_take_offs_within_the_limits(height, limits, at):
    fleet = IdleFleet((0.0, 0.0, height), **limits)
    fleet.wait()
    way = fleet.driver.lists['u0'].end_via
    assert way[-1][2] == at
    assert (way[0] == (0.0, 0.0, at)) is (height != at)


def test_in_conflict_with_another_uav_it_stays():
    fleet = IdleFleet((0.0, 0.0, 50.0), separation__horizontal=30.0)
    fleet.wait()
    goal = fleet.place()
    between = tuple(0.5 * c for c in goal[:2])
    other = IdleFleet((0.0, 0.0, 50.0), (*between, 52.0), separation__horizontal=30.0, seen=0)
    other.more['u1'] = {'authority': 'SUSPENDED', 'mode': 'HOLD'}
    other.report()
    other.see(40)
    other.wait()
    assert other.place() is None or other.place()[:2] != goal[:2]
    assert other.text() == 'stays where it is: separation from u1' or other.place()


def test_others_keep_apart_from_its_way():
    fleet = IdleFleet((0.0, 0.0, 50.0), separation__horizontal=30.0)
    fleet.wait()
    assert fleet.place()
    monitored = MonitoredUavs(fleet.driver.world).at(fleet.driver.now)
    assert monitored['u0'].way.points[-1][1] == fleet.place()


def test_what_was_announced_survives_a_restart():
    fleet = IdleFleet((0.0, 0.0, 50.0))
    fleet.wait()
    rows = fleet.driver.core.rows()
    seen = fleet.driver.world.announced.seen.seen
    stored = [row._replace(body=json.loads(json.dumps(row.body))) for row in rows]
    again = IdleFleet(saved=restored_state(stored), seen=0)
    assert again.driver.world.announced.seen.seen == seen
    assert again.place() == fleet.place()
    again.places = fleet.places
    again.wait(60.0)
    assert again.place() == fleet.place()
    assert fleet.driver.core.written(rows)
    fleet.driver.add(('t1', 0.0, 0.0))
    assert [row.id for row in fleet.driver.core.rows() if row.kind == 'demand'] == ['0']


def test_damaged_rows_of_the_demand_are_left_out():
    fleet = IdleFleet((0.0, 0.0, 50.0), seen=3)
    rows = [row for row in fleet.driver.core.rows() if row.kind == 'demand']
    for body in (7, [[1.0, 2.0, 3.0]], [[1.0, 2.0, math.inf, 1.0]], [[1.0, 2.0, 3.0, -1.0]]):
        state = restored_state([rows[0]._replace(body=body)])
        assert state.seen_tasks == {}
        assert len(state.unreadable) == 1


class RandomService(IdleFleet):
    """UAVs that fly their lists while orders, zones and losses of authority come at random."""

    def __init__(self, seed):
        super().__init__((0.0, 0.0, 50.0), (200.0, 0.0, 50.0), (400.0, 0.0, 50.0), seen=0,
                         locked_tasks=0, separation__horizontal=20.0)
        self.rng, self.number, self.sent = np.random.default_rng(seed), 0, 0

    def step(self):
        """An event and two seconds of flight."""
        uav_id, driver = str(self.rng.choice(list(self.places))), self.driver
        event = self.rng.integers(8)
        if event < 2:
            self.number += 1
            driver.add((f't{self.number}', *self.rng.uniform(-900.0, 900.0, 2)))
        elif event < 5:
            driver.order(('PAUSE', 'RESUME', 'RETURN')[event - 2], uav_id)
        elif event == 5:
            held = self.rng.random() < 0.7
            self.more[uav_id] = {} if held else {'authority': 'LOST', 'available': False}
        elif event == 6:
            zones = [ThreatZone.cylinder('z', tuple(self.rng.uniform(-900.0, 900.0, 2)), 80.0)]
            driver.world.set_zones(zones if self.rng.random() < 0.5 else [], (), driver.now)
        self.fly()
        self.wait(2.0)
        self.check()

    def fly(self):
        """Each UAV that may be flown is at the end of its waiting way, or has done a task."""
        for uav_id in self.places:
            each = self.driver.world.list_of(uav_id)
            if 'authority' in self.more.get(uav_id, {}):
                continue
            if each.stops:
                self.places[uav_id] = each.stops[0].exit
                self.driver.event('COMPLETED', each.stops[0].task.id, uav_id)
            elif each.waiting_place is not None:
                self.places[uav_id], self.sent = each.waiting_place, self.sent + 1

    def check(self):
        world = self.driver.world
        ids = [t for each in world.lists_in_force().values() for t in each.task_ids]
        assert len(ids) == len(set(ids))
        for uav_id in self.places:
            each = world.list_of(uav_id)
            assert each.returns or not (each.stops and each.end_via)
            if each.waiting_place is not None:
                assert world.orders.of_uav(uav_id) is None
                assert world.uav_record(uav_id).report.authority == 'HELD'


@pytest.mark.parametrize('seed', [1, 2])
def test_with_waiting_places_no_task_is_lost_and_no_order_is_broken(seed):
    service = RandomService(seed)
    for _ in range(120):
        service.step()
    service.more.clear()
    service.driver.world.set_zones((), (), service.driver.now)
    for uav_id in service.places:
        service.driver.order('RESUME', uav_id)
    for _ in range(40):
        service.fly()
        service.wait(2.0)
        service.check()
    states = {record.state.name for record in service.driver.world.task_records().values()}
    assert states == {'COMPLETED'}
    assert service.sent > 5
