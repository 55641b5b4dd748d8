# SPDX-License-Identifier: Apache-2.0
"""Wind, speeds and stops are measured; arrivals follow from them and from windows."""
import math
import random
from dataclasses import replace

import pytest
from allocation import AllocatorDriver

from uav_task_alloc.allocator.list_records import ListStop
from uav_task_alloc.allocator.state.flight_pace import (
    FlightPace,
    UavFlight,
    measured_stop,
    stopping,
)
from uav_task_alloc.allocator.state.stop_times import timed_stops
from uav_task_alloc.allocator.state.wind import WindEstimate
from uav_task_alloc.geometry.flight_time import flight_time
from uav_task_alloc.model import Leg, Task, Uav

NORTH = math.pi / 2.0


def ground(pace, heading):
    speed = pace.ground_speed(math.cos(heading), math.sin(heading))
    return speed * math.cos(heading), speed * math.sin(heading)


def flown(wind, headings, seconds=30, seed=1, speed=14.0):
    """An estimate after some seconds in which UAVs flew in these directions."""
    rng, estimate = random.Random(seed), WindEstimate()
    pace = FlightPace(speed, wind=wind)
    for t in range(seconds):
        for uav_id, heading in headings.items():
            x, y = ground(pace, heading(t))
            estimate.add(uav_id, 15.0, (x + rng.gauss(0.0, 0.2), y + rng.gauss(0.0, 0.2)), t)
    return estimate


@pytest.mark.parametrize('wind', [(5.0, 0.0), (3.0, -4.0), (0.0, 0.0), (-2.0, 4.5)])
def test_wind_and_air_speed_follow_from_ground_velocities_in_several_directions(wind):
    estimate = flown(wind, {'a': lambda t: 0.3, 'b': lambda t: 2.0, 'c': lambda t: 4.5 + 0.3 * t})
    assert estimate.wind == pytest.approx(wind, abs=0.3)
    for uav_id in 'abc':
        assert estimate.of(uav_id, 15.0)[0] == pytest.approx(14.0, abs=0.3)


def test_the_wind_of_a_fleet_counts_for_a_uav_that_has_not_flown_yet():
    estimate = flown((5.0, 0.0), {'a': lambda t: 0.1 * t, 'b': lambda t: 2.0})
    speed, wind = estimate.of('new', 15.0)
    assert (speed, wind) == (15.0, estimate.wind)


def test_one_direction_alone_predicts_itself():
    estimate = flown((-5.0, 0.0), {'a': lambda t: 0.0})
    speed, wind = estimate.of('a', 15.0)
    assert FlightPace(speed, wind=wind).ground_speed(1.0, 0.0) == pytest.approx(9.0, abs=0.4)


def test_an_autopilot_that_holds_its_ground_speed_is_predicted_without_wind():
    estimate = flown((5.0, 0.0), {'a': lambda t: 0.3 * t, 'b': lambda t: 2.0})
    for t in range(30):
        estimate.add('steady', 15.0, ground(FlightPace(15.0), 0.3 * t), t)
    speed, wind = estimate.of('steady', 15.0)
    assert (speed, wind) == (pytest.approx(15.0, abs=0.2), (0.0, 0.0))
    assert estimate.of('a', 15.0)[1] == pytest.approx((5.0, 0.0), abs=0.4)


def test_a_pace_without_wind_is_the_flight_time_of_the_solver():
    uav = Uav('u', (0.0, 0.0, 0.0), cruise_speed=15.0, climb_speed=2.5, descent_speed=1.5)
    points = [(0.0, 0.0, 0.0), (10.0, 0.0, 40.0), (500.0, 100.0, 20.0), (501.0, 100.0, 0.0)]
    assert FlightPace.of(uav).seconds(points) == pytest.approx(flight_time(uav, points))


def stops(*tasks):
    return tuple(ListStop(task, Leg((), 0.0), 0.0) for task in tasks)


def at(x, name='t', **more):
    return Task(f'{name}{x:g}', (float(x), 0.0, 50.0), **more)


def times(*tasks, **flight):
    made = {'pace': FlightPace(10.0), 'stamp': 1000.0, **flight}
    return [(stop.eta, stop.wait, stop.finish)
            for stop in timed_stops(stops(*tasks), UavFlight((0.0, 0.0, 50.0), **made))]


def test_a_uav_that_is_early_waits_and_the_rest_follows():
    assert times(at(100, earliest=1030.0, service_time=5.0), at(200)) == [
        (10.0, 20.0, 35.0), (45.0, 0.0, 45.0)]


def test_a_release_postpones_the_leg():
    assert times(at(100), at(200, release=1040.0)) == [(10.0, 0.0, 10.0), (50.0, 0.0, 50.0)]


def test_every_stop_costs_its_time_and_half_of_it_on_the_leg_under_way():
    pace = FlightPace(10.0, stop_time=4.0)
    assert times(at(100), at(200), pace=pace) == [(12.0, 0.0, 12.0), (26.0, 0.0, 26.0)]


def test_a_uav_on_the_ground_climbs_first():
    pace = FlightPace(10.0, climb=2.5)
    made = timed_stops(stops(at(100)), UavFlight((0.0, 0.0, 0.0), pace, on_ground=True))
    assert made[0].eta == pytest.approx(20.0 + 10.0)


def test_a_short_leg_is_flown_without_reaching_the_cruise_speed():
    pace = FlightPace(10.0, stop_time=4.0)  # accelerates with 2.5 m/s2
    assert pace.from_stop([(0.0, 0.0, 0.0), (40.0, 0.0, 0.0)]) == pytest.approx(8.0)
    assert pace.from_stop([(0.0, 0.0, 0.0), (10.0, 0.0, 0.0)]) == pytest.approx(4.0)
    assert pace.from_stop([(0.0, 0.0, 0.0), (90.0, 0.0, 0.0)]) == pytest.approx(13.0)


def test_the_leg_under_way_is_timed_by_the_present_velocity():
    pace = FlightPace(10.0, stop_time=4.0)
    for velocity, eta in [(None, 12.0), ((10.0, 0.0, 0.0), 12.0), ((0.0, 0.0, 0.0), 14.0),
                          ((0.0, 7.0, 0.0), 14.0), ((5.0, 0.0, 0.0), 12.5)]:
        made = timed_stops(stops(at(100)), UavFlight((0.0, 0.0, 50.0), pace, velocity=velocity))
        assert made[0].eta == pytest.approx(eta)
    braking = timed_stops(stops(at(5)), UavFlight((0.0, 0.0, 50.0), pace,
                                                  velocity=(5.0, 0.0, 0.0)))
    assert braking[0].eta == pytest.approx(2.0)


def test_detour_points_cost_time_as_sharp_as_they_are():
    pace = FlightPace(10.0, stop_time=4.0)
    straight, slight, back = ([(0.0, 0.0, 0.0), (100.0, 0.0, 0.0), end] for end in (
        (200.0, 0.0, 0.0), (200.0, 60.0, 0.0), (0.0, 1.0, 0.0)))
    assert pace.corners(straight) == 0.0
    assert 0.0 < pace.corners(slight) < pace.corners(back) < 1.0


def test_a_take_off_takes_its_time():
    pace = FlightPace(10.0, climb=2.5, takeoff=4.0)
    made = timed_stops(stops(at(100)), UavFlight((0.0, 0.0, 0.0), pace, on_ground=True))
    assert made[0].eta == pytest.approx(4.0 + 20.0 + 10.0)


def test_before_any_stop_was_measured_it_costs_what_it_costs_a_usual_copter():
    driver = AllocatorDriver()
    driver.uav('a', 0.0, 0.0, 50.0, cruise_speed=10.0)
    assert driver.world.flights.pace('a').stop_time == 4.0
    assert driver.world.flights.stop_time == 4.0


def test_the_measured_stop_is_the_inverse_of_the_time_of_a_leg():
    for stop_time in (1.0, 4.0, 9.0):
        for seconds in (2.0, 6.0, 30.0):
            flown = stopping(seconds, stop_time)
            assert measured_stop(seconds, flown, 0.0) == pytest.approx(stop_time)


def test_a_service_under_way_counts_from_its_begin():
    served = {'serving': 't0', 'served': 3.0}
    assert times(at(0, service_time=8.0), at(100), **served) == [
        (0.0, 0.0, 5.0), (15.0, 0.0, 15.0)]
    waits = timed_stops(stops(at(0, service_time=8.0, earliest=1010.0)), UavFlight(
        (0.0, 0.0, 50.0), FlightPace(10.0), 1000.0, **served))
    assert (waits[0].start, waits[0].finish) == (10.0, 18.0)
    begun = timed_stops(stops(at(0, service_time=8.0, earliest=999.0)), UavFlight(
        (0.0, 0.0, 50.0), FlightPace(10.0), 1000.0, **served))
    assert (begun[0].start, begun[0].finish) == (-1.0, 7.0)


def test_the_time_lost_at_stops_is_measured_from_completions():
    driver = AllocatorDriver()
    driver.uav('a', 0.0, 0.0, 50.0, cruise_speed=10.0)
    driver.add(*(at(100 * k, service_time=2.0) for k in range(1, 6)))
    driver.settle()
    for k in range(1, 4):
        driver.now += 10.0 + 2.0 + 6.0
        driver.uav('a', 100.0 * k, 0.0, 50.0, cruise_speed=10.0)
        assert driver.event('COMPLETED', f't{100 * k}', 'a') == ''
        driver.core.tick(driver.now, driver.now)
    assert driver.world.flights.pace('a').stop_time == pytest.approx(6.0, abs=0.1)


@pytest.mark.parametrize(('late', 'share'), [(0.0, 0.0), (3.0, 0.4)])
def test_how_late_a_uav_was_is_the_error_of_its_times(late, share):
    driver = AllocatorDriver()
    driver.uav('a', 0.0, 0.0, 50.0, cruise_speed=10.0)
    driver.add(*(at(100 * k, service_time=2.0) for k in range(1, 8)))
    driver.settle()
    flight = driver.world.flights.of('a', driver.now)
    assert (flight.late, flight.time_error) == (0.0, math.inf)
    for k in range(1, 6):  # 14 s are predicted: full speed and a stop; every second one is late
        driver.now += 10.0 + 2.0 + 4.0 + (late if k % 2 else -late)
        driver.uav('a', 100.0 * k, 0.0, 50.0, cruise_speed=10.0)
        assert driver.event('COMPLETED', f't{100 * k}', 'a') == ''
        driver.core.tick(driver.now, driver.now)
    flight = driver.world.flights.of('a', driver.now)
    assert flight.late == pytest.approx(late, abs=1.5)
    assert flight.time_error == pytest.approx(share, abs=0.25)


def test_a_take_off_ends_at_the_height_that_the_uav_reports():
    driver = AllocatorDriver()
    driver.uav('a', 0.0, 0.0, 3.0, home=(0.0, 0.0, 3.0), standby=True, takeoff_height=40.0)
    flight = driver.world.flights.of('a', driver.now)
    assert flight.takeoff_top == 43.0
    pace = FlightPace(10.0, climb=2.5)
    low = timed_stops(stops(at(100)), UavFlight((0.0, 0.0, 0.0), pace, on_ground=True,
                                                takeoff_top=75.0))
    assert low[0].eta == pytest.approx(30.0 + 10.0)
    driver.uav('a', 0.0, 0.0, 13.0, home=(0.0, 0.0, 3.0), mode='TAKEOFF', takeoff_height=40.0)
    assert driver.world.flights.of('a', driver.now).climbing
    climbs = timed_stops(stops(at(100)), UavFlight((0.0, 0.0, 25.0), pace, climbing=True,
                                                   takeoff_top=75.0))
    assert climbs[0].eta == pytest.approx(20.0 + 10.0)


def test_ground_velocities_of_reports_are_measured_in_steady_flight_only():
    driver = AllocatorDriver()
    for t in range(20):
        driver.now += 1.0
        fast = 10.0 if t < 15 else 3.0 + 2.0 * (t - 15)
        driver.uav('a', 10.0 * t, 0.0, 50.0, cruise_speed=15.0, active_task='t1',
                   velocity=(fast, 0.0, 0.0))
    assert driver.world.flights.pace('a').ground_speed(1.0, 0.0) == pytest.approx(10.0, abs=0.3)
    driver.uav('b', 0.0, 0.0, 50.0, velocity=(1e6, 0.0, 0.0), active_task='t2')
    assert driver.world.flights.pace('b').speed == 15.0


def test_a_uav_that_was_without_a_list_on_a_leg_measures_no_stop():
    driver = AllocatorDriver()
    driver.uav('a', 0.0, 0.0, 50.0, cruise_speed=10.0)
    driver.add(*(at(100 * k) for k in range(1, 4)))
    driver.settle()
    driver.now += 10.0
    driver.event('COMPLETED', 't100', 'a')
    driver.core.tick(driver.now, driver.now)
    driver.cancel('t200', 't300')
    driver.settle(wait=1.0)
    driver.uav('a', 100.0, 0.0, 50.0, cruise_speed=10.0)
    driver.add(at(200, 'u'))
    driver.settle(wait=1.0)
    driver.now += 15.0
    driver.event('COMPLETED', 'u200', 'a')
    assert driver.world.flights.pace('a').stop_time == 10.0 / 2.5


def waiting(before=20.0, **hold):
    """A UAV that has completed t100 and waits there, then on the way, for that time [s]."""
    driver = AllocatorDriver()
    driver.uav('a', 100.0, 0.0, 50.0, cruise_speed=10.0)
    driver.add(*(at(100 * k) for k in range(1, 4)))
    driver.settle()
    lists, flights = driver.world.lists.lists, driver.world.flights
    first, later, last = lists['a'].stops
    lists['a'] = replace(lists['a'], stops=(first, replace(
        later, begin_after=driver.now + before + 14.0), last))
    driver.event('COMPLETED', 't100', 'a')
    driver.uav('a', 100.0, 0.0, 50.0, cruise_speed=10.0)
    driver.core.tick(driver.now, driver.now)
    driver.now += before
    driver.uav('a', 101.0, 0.0, 50.0, cruise_speed=10.0, **hold)
    return driver, flights


def test_a_uav_waits_at_the_stop_before_until_it_sets_out():
    driver, flights = waiting()
    assert flights.of('a', driver.now).waiting == 't200'
    driver.uav('a', 120.0, 0.0, 50.0, cruise_speed=10.0)
    assert flights.of('a', driver.now).waiting == ''
    driver.uav('a', 100.0, 0.0, 50.0, cruise_speed=10.0)
    assert flights.of('a', driver.now).waiting == ''


def test_a_uav_whose_task_is_taken_away_waits_no_more():
    driver, flights = waiting()
    driver.cancel('t200')
    driver.settle(wait=1.0, report=False)
    driver.uav('a', 100.0, 0.0, 50.0, cruise_speed=10.0)
    assert driver.route('a') == ('t300',)
    assert flights.of('a', driver.now).waiting == ''


def test_a_wait_before_a_leg_is_no_time_lost_at_a_stop():
    driver, flights = waiting(before=6.0)
    driver.now += 14.0
    driver.event('COMPLETED', 't200', 'a')
    assert flights.pace('a').stop_time == 10.0 / 2.5
    assert flights.of('a', driver.now).late == 0.0


def test_a_leg_in_which_a_uav_was_held_measures_no_stop():
    driver, flights = waiting(before=0.0, mode='HOLD')
    driver.now += 14.0 + 8.0
    driver.event('COMPLETED', 't200', 'a')
    assert flights.pace('a').stop_time == 10.0 / 2.5
    assert flights.of('a', driver.now).late == 0.0
