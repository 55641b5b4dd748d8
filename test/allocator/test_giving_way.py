# SPDX-License-Identifier: Apache-2.0
"""An idle UAV in the way of one that holds for it flies elsewhere, and stays in doubt."""
import math
from dataclasses import replace

import pytest
from allocation import AllocatorDriver

from uav_task_alloc.geometry.zones import zones_around
from uav_task_alloc.model import Shape, Task, ThreatZone

RULE = {'separation__horizontal': 20.0, 'separation__vertical': 10.0}
SPOT = (0.0, 0.0, 50.0)  # of the idle one, u2, and of the task of u1
STILL = {'velocity': (0.0, 0.0, 0.0)}


class Spot(AllocatorDriver):
    """u1 comes from the west to a task where u2 hovers, and holds."""

    def __init__(self, more=None, others=(), **params):
        super().__init__(**{**RULE, **params})
        self.more, self.others = more or {}, dict(others)
        self.places = {'u1': (-90.0, 0.0, 50.0), 'u2': SPOT}
        self.report(u1={'velocity': (10.0, 0.0, 0.0)})
        self.add(Task('t1', SPOT, allowed_uavs=frozenset({'u1'})))
        self.settle(report=False)
        self.report(u1={'velocity': (10.0, 0.0, 0.0)})
        self.steps = [self.core.separate(self.now, self.now)]

    def report(self, **more):
        for uav_id, place in {**self.places, **self.others}.items():
            self.uav(uav_id, *place, **{
                'mode': 'HOLD' if uav_id == 'u2' else 'ON_MISSION', 'authority': 'HELD',
                'home': (-500.0, -500.0, 0.0), **STILL, **more.get(uav_id, {}),
                **(self.more if uav_id == 'u2' else {})})

    def wait(self, seconds=10.0):
        for _ in range(int(2.0 * seconds)):
            self.now += 0.5
            self.report()
            self.settle(report=False)
            self.steps.append(self.core.separate(self.now, self.now))
            self.take()

    @property
    def place(self):
        return self.world.list_of('u2').waiting_place

    @property
    def held(self):
        return 'u1' in self.core.separation.monitor.holding


def test_it_leaves_and_the_other_one_goes_on():
    spot = Spot()
    assert spot.held
    spot.wait()
    assert spot.lists['u2'].stops == ()
    assert not spot.lists['u2'].returns
    assert math.dist(spot.place, SPOT) > 2.0 * RULE['separation__horizontal'] - 1e-6
    assert spot.place[2] == 50.0
    assert spot.core.waiting.texts()['u2'] == (
        'waits at ({:.0f}, {:.0f}, 50) m to give way to u1'.format(*spot.place))
    assert any('to give way to u1' in note for note in spot.notes)
    place = spot.places['u2'] = spot.place
    spot.wait(3.0)
    assert not spot.held
    spot.wait(60.0)
    assert spot.place == place  # there it stays


def test_a_hold_that_is_soon_over_moves_nobody():
    spot = Spot()
    spot.wait(2.0)
    assert spot.place is None
    spot.cancel('t1')
    spot.wait(30.0)
    assert spot.place is None


def test_the_alert_says_what_it_does():
    spot = Spot()
    assert spot.core.separation.texts()['u1'].endswith(
        'u1 holds for u2, which has no tasks: it gives way where that is safe, else a task or '
        'its return ends that')


@pytest.mark.parametrize('more', [
    {'authority': 'SUSPENDED'}, {'authority': 'LOST'}, {'available': False}, {'foreign': True},
    {'velocity': (3.0, 0.0, 0.0)}, {'mode': 'FAULT'}])
def test_one_that_is_not_ours_or_moves_stays(more):
    spot = Spot(more)
    spot.wait(30.0)
    assert spot.place is None


def test_one_that_an_operator_holds_stays():
    spot = Spot()
    spot.order('PAUSE', 'u2')
    spot.wait(30.0)
    assert spot.place is None


def test_one_whose_plans_an_operator_approves_stays_and_the_alert_says_so():
    spot = Spot(approval='all')
    spot.core.decide(True, 'ann', spot.now, spot.now)
    spot.wait(30.0)
    assert spot.held
    assert spot.place is None
    assert spot.core.separation.texts()['u1'].endswith(
        'u1 holds for u2, which has no tasks and stays: a task for it, or its return, ends that')


def test_its_place_is_in_the_way_of_nobody():
    """u3 stands in the east, and u4 flies along a line in the north-east and south-east."""
    spot = Spot(others={'u3': (40.0, 0.0, 50.0), 'u4': (60.0, 200.0, 50.0)})
    spot.add(Task('t4', (60.0, -200.0, 50.0), allowed_uavs=frozenset({'u4'})))
    spot.wait()
    assert math.dist(spot.place[:2], (40.0, 0.0)) > 20.0
    assert spot.place[0] < 40.0  # 20 m from the line of u4


def rectangle(zone_id, west, south, east, north):
    return ThreatZone(zone_id, Shape.POLYGON, vertices=(
        (west, south), (east, south), (east, north), (west, north)))


def test_a_place_inside_a_zone_is_none():
    zone = rectangle('z', 10.0, -400.0, 400.0, 400.0)  # in the east
    spot = Spot()
    spot.world.set_zones((zone,), (), spot.now)
    spot.wait()
    assert spot.place is not None
    assert not zones_around(spot.place, (zone,))


def test_without_a_free_place_it_stays_and_says_so():
    walls = (rectangle('n', -900.0, 25.0, 25.0, 400.0), rectangle('e', 25.0, -400.0, 400.0, 400.0),
             rectangle('s', -900.0, -400.0, 25.0, -25.0))  # open in the west, where u1 is
    spot = Spot()
    spot.world.set_zones(walls, (), spot.now)
    spot.wait(15.0)
    assert spot.place is None
    assert 'u2 stays in the way of u1: all places near it are in the way' in spot.notes


def test_a_battery_that_does_not_allow_it_is_the_reason():
    spot = Spot({'battery': 0.25, 'range': 720.0, 'full_range': 3000.0}, battery_reserve=0.0)
    spot.wait()
    assert spot.place is None
    assert 'u2 stays in the way of u1: battery' in spot.notes


def test_it_leaves_for_one_that_may_not_hold():
    """u1 is low on battery and flies home over u2."""
    spot = Spot()
    spot.cancel('t1')
    spot.wait(5.0)
    low = {'battery': 0.1, 'range': 900.0, 'mode': 'RETURNING', 'velocity': (10.0, 0.0, 0.0),
           'home': (300.0, 0.0, 0.0)}
    spot.places['u1'] = (-200.0, 0.0, 50.0)
    for _ in range(12):
        spot.now += 0.5
        spot.places['u1'] = (spot.places['u1'][0] + 5.0, 0.0, 50.0)
        spot.report(u1=low)
        spot.settle(report=False)
        spot.steps.append(spot.core.separate(spot.now, spot.now))
        spot.take()
    assert spot.place is not None
    assert abs(spot.place[1]) > 20.0  # beside its way


def test_one_that_holds_for_one_that_waits_for_it_by_its_list_goes_on():
    """u2 waits 20.5 m beside the way of u1: by plans that is enough, by the monitor it is not."""
    driver = AllocatorDriver(**RULE)
    places = {'u1': (-90.0, 0.0, 50.0), 'u2': (0.0, 20.5, 50.0)}

    def report(speed=0.0):
        for uav_id, place in places.items():
            driver.uav(uav_id, *place, mode='ON_MISSION', authority='HELD', cruise_speed=10.0,
                       velocity=(speed if uav_id == 'u1' else 0.0, 0.0, 0.0))

    report(10.0)
    driver.add(Task('t0', places['u2'], allowed_uavs=frozenset({'u2'})),
               Task('t1', (200.0, 0.0, 50.0), allowed_uavs=frozenset({'u1'})),
               Task('t2', (0.0, -300.0, 50.0), allowed_uavs=frozenset({'u2'})))
    driver.settle(report=False)
    lists = driver.world.lists.lists
    first, later = lists['u2'].stops
    lists['u2'] = replace(lists['u2'], stops=(first, replace(
        later, begin_after=driver.now + 100.0)))
    driver.event('COMPLETED', 't0', 'u2')
    holds = []
    for _ in range(60):
        driver.now += 0.5
        report(0.0 if holds else 10.0)
        driver.settle(report=False)
        holds += driver.core.separate(driver.now, driver.now).holds
        if holds and not holds[-1].hold:
            break
    assert [(hold.uav, hold.hold) for hold in holds][:1] == [('u1', True)]
    assert 'u1, u2 wait for each other' in ' '.join(driver.solves)
    assert not holds[-1].hold  # it flies past below or above
    assert all(abs(z - 50.0) > 9.5 for _, _, z in driver.world.list_of('u1').stops[0].leg.via[-1:])
