# SPDX-License-Identifier: Apache-2.0
"""Plans end above the reserve, and a UAV turns home while its battery lasts for that."""
import pytest
from allocation import AllocatorDriver

from uav_task_alloc import ThreatZone, plan
from uav_task_alloc.allocator.records import UavReport
from uav_task_alloc.allocator.state.fleet import above_reserve
from uav_task_alloc.allocator.status import health_values
from uav_task_alloc.model import Task

SPEED, FULL = 10.0, 3000.0  # [m/s], [m]
HOME = (0.0, 0.0, 50.0)


def driver(**params):
    return AllocatorDriver(plan=plan, **{
        'solve_budget': 0.02, 'route_end': 'home', 'battery_reserve': 0.2, **params})


def uav(made, x, battery, metres=None, **more):
    """A report of a UAV in flight, `metres` what its battery carries it."""
    made.uav('a', float(x), 0.0, 50.0, home=HOME, cruise_speed=SPEED, battery=battery,
             range=FULL * battery if metres is None else metres, full_range=FULL, **more)


def later(made, seconds=1.1):
    made.now += seconds
    made.core.tick(made.now, made.now)
    made.settle(report=False)


def at(name, x):
    return Task(name, (float(x), 0.0, 50.0))


@pytest.mark.parametrize(('metres', 'state'), [(1190.0, 'ASSIGNED'), (1210.0, 'UNASSIGNED')])
def test_no_plan_uses_the_reserve(metres, state):
    made = driver()
    uav(made, 0, 1.0, standby=True)
    made.add(at('t', metres))
    made.settle()
    assert made.state('t') == state  # 2400 of 3000 m are above the reserve of 20 %


def test_what_is_above_the_reserve():
    def left(battery=0.5, **more):
        return above_reserve(UavReport('a', HOME, **more), battery, 0.2)
    assert left(range=1500.0) == (pytest.approx(900.0), None)
    assert left(range=1200.0, full_range=3000.0) == (pytest.approx(600.0), None)
    assert left(range=1000.0, endurance=100.0, full_range=2500.0) == (
        pytest.approx(500.0), pytest.approx(50.0))
    assert left(endurance=100.0) == (None, pytest.approx(60.0))
    assert left(0.1, range=300.0, endurance=20.0) == (0.0, 1.0)
    assert left(None, range=300.0, endurance=20.0) == (300.0, 20.0)  # unknown: as reported
    assert left() == (None, None)


def test_the_last_moment_to_turn_is_published_and_kept():
    made = driver()
    uav(made, 0, 1.0)
    made.add(at('t1', 600), at('t2', 1100))
    made.settle()
    assert made.route('a') == ('t1', 't2')
    uav(made, 500, 0.8)
    later(made)  # 1800 m above the reserve, 500 m to home
    assert made.core.batteries.turns['a'] - made.now == pytest.approx(130.0, abs=2.0)
    shown = health_values(made.world, False, turns=made.core.batteries.texts(made.now))
    assert shown['turn home a'].endswith('in 130 s')
    assert not made.world.fleet.records['a'].low
    uav(made, 600, 0.39)
    later(made)  # 570 m above the reserve, 600 m to home
    assert made.world.fleet.records['a'].low
    assert made.lists['a'].stops == ()
    assert made.lists['a'].returns
    assert any('the last moment' in note for note in made.notes)


@pytest.mark.parametrize('rate', [1, 20, 100])
def test_a_uav_turns_in_time_however_fast_the_simulated_clock_is(rate):
    made, stamp, charge = driver(battery_reserve=0.0), 100.0, 1.0
    uav(made, 0, charge)
    made.add(at('t1', 1000), at('t2', 1400))
    made.settle()
    x, step = 0.0, 0.05 * rate
    while not made.world.fleet.records['a'].low:
        x += SPEED * step
        assert x < FULL
        charge -= SPEED * step / FULL
        made.now, stamp = made.now + 0.05, stamp + step
        uav(made, x, charge)
        made.core.tick(made.now, stamp)
    left = FULL * charge - x  # beyond the way home; a check may be a second or a step later
    assert -2.0 * SPEED * max(step, 1.0) - 2.0 <= left <= 2.0 * SPEED * step


def test_a_uav_that_has_turned_returns_until_it_is_on_the_ground():
    made = driver()
    uav(made, 600, 0.39)
    made.add(at('t1', 700))
    made.settle()
    later(made)
    assert made.world.fleet.records['a'].low
    uav(made, 300, 0.39)  # now there is enough for the way home and more
    later(made)
    assert made.world.fleet.records['a'].low
    uav(made, 0, 0.25, standby=True)
    later(made)
    assert made.world.fleet.records['a'].low  # until it is recharged
    uav(made, 0, 1.0, standby=True)
    later(made)
    assert not made.world.fleet.records['a'].low
    assert made.route('a') == ('t1',)


def test_the_way_home_is_that_around_the_zones():
    made = driver()
    made.world.set_zones([ThreatZone.polygon('wall', [
        (280, -400), (320, -400), (320, 400), (280, 400)], margin=10.0)], (), made.now)
    uav(made, 600, 0.5)  # 900 m above the reserve, straight 600 m, around 1020 m
    later(made)
    assert made.world.fleet.records['a'].low


def test_a_list_that_the_battery_no_longer_carries_loses_tasks():
    made = driver()
    uav(made, 0, 1.0)
    made.add(at('t1', 300), at('t2', 1100))
    made.settle()
    assert made.route('a') == ('t1', 't2')
    uav(made, 100, 0.9, metres=1900.0)  # 1300 m above the reserve: the list needs 2100 m
    later(made)
    assert made.route('a') == ('t1',)
    assert made.state('t2') == 'UNASSIGNED'
    assert any('does not last' in trigger for trigger in made.solves)


def test_a_uav_with_endurance_turns_by_its_time_too():
    made = driver()
    uav(made, 500, 1.0, metres=FULL, endurance=60.0)  # 48 s above the reserve, 50 s to home
    later(made)
    assert made.world.fleet.records['a'].low


def test_a_wind_that_is_far_off_turns_no_uav_home():
    made = driver()
    for k in range(60):  # a slow and a fast sample in turn, all towards the east
        made.now += 3.0
        uav(made, 300, 0.8, endurance=200.0, active_task='t',
            velocity=(7.0 if k // 6 % 2 else SPEED, 0.0, 0.0))
    assert made.world.flights.pace('a').mean_speed > 0.9 * SPEED
    made.world.flights.wind.of = lambda uav_id, cruise: (cruise, (-0.8 * cruise, 0.0))  # far off
    assert made.world.flights.pace('a').mean_speed < 0.7 * SPEED
    later(made)
    assert not made.world.fleet.records['a'].low  # 150 s are above the reserve, home is 63 s away
