# SPDX-License-Identifier: Apache-2.0
"""The custom modes of the simulated vehicles, entered by stations and by the pilot's switch."""
import pytest
from pymavlink.dialects.v20 import ardupilotmega as d
from vehicle_bench import Bench, of, waypoint

from uav_task_alloc.sim.config import FlightMode
from uav_task_alloc.sim.dynamics import metres_between
from uav_task_alloc.sim.modes import COPTER_MODES, PX4_MODES, px4_mode

FAR = (400.0, 0.0, 30.0)
NUMBERS = [('ardupilot', n) for n in COPTER_MODES] + [('px4', n) for n in PX4_MODES]
COPTER_STICK = [0, 1, 2, 5, 11, 13, 14, 15, 16, 18, 22, 24, 25, 26, 28, 29]
STICK = [('ardupilot', n) for n in COPTER_STICK] + [
    ('px4', px4_mode(main)) for main in (1, 2, 3, 5, 7, 8)]
STOPS = [('ardupilot', n) for n in (7, 17, 19, 20, 23)] + [
    ('px4', px4_mode(*n)) for n in ((4, 1), (4, 3), (4, 8), (4, 10), (6,), (10,))]
RETURNS = [('ardupilot', n) for n in (6, 21, 27)] + [('px4', px4_mode(4, 5))]
LANDS = [('ardupilot', 9), ('px4', px4_mode(4, 6)), ('px4', px4_mode(4, 9))]


def flying(kind):
    bench = Bench(kind)
    bench.fly(waypoint(FAR))
    bench.pass_time(5.0)
    return bench


def reported_mode(bench):
    return of(bench.pass_time(1.1), 'HEARTBEAT')[-1].custom_mode


def ground_distance(a, b):
    return metres_between((a[0], a[1], 0.0), (b[0], b[1], 0.0))


@pytest.mark.parametrize(('kind', 'number'), NUMBERS)
def test_every_mode_is_entered_by_a_station_and_reported_in_the_heartbeat(kind, number):
    bench = flying(kind)
    assert bench.set_mode(number) == d.MAV_RESULT_ACCEPTED
    assert reported_mode(bench) == number


@pytest.mark.parametrize(('kind', 'number'), NUMBERS)
def test_every_mode_is_entered_by_the_pilot_too(kind, number):
    bench = flying(kind)
    assert bench.vehicle.rc_mode(number)
    assert reported_mode(bench) == number


@pytest.mark.parametrize(('kind', 'number'), [('ardupilot', 16), ('px4', px4_mode(6))])
def test_set_mode_enters_a_mode_too(kind, number):
    bench = flying(kind)
    bench.send(d.MAVLink_set_mode_message(1, 1, number), station=(7, 7))
    assert reported_mode(bench) == number


@pytest.mark.parametrize(('kind', 'number'), [('ardupilot', 8), ('px4', px4_mode(9))])
def test_a_mode_that_does_not_exist_is_refused(kind, number):
    bench = flying(kind)
    assert bench.set_mode(number) != 0
    assert not bench.vehicle.rc_mode(number)
    assert bench.flight.mode is FlightMode.MISSION


@pytest.mark.parametrize(('kind', 'number'), STICK + STOPS)
def test_in_stick_modes_and_its_own_it_stops_and_stays(kind, number):
    bench = flying(kind)
    bench.vehicle.rc_stick(None)
    bench.set_mode(number)
    bench.pass_time(8.0)
    where = bench.flight.body.position
    bench.pass_time(20.0)
    assert metres_between(bench.flight.body.position, where) < 0.1
    assert bench.flight.armed


@pytest.mark.parametrize('number', COPTER_STICK)
def test_an_arducopter_without_a_radio_control_sinks_in_a_stick_mode_and_disarms(number):
    bench = flying('ardupilot')
    bench.set_mode(number)
    bench.pass_time(6.0)
    assert bench.flight.body.velocity == pytest.approx((0.0, 0.0, -2.5), abs=0.01)
    bench.until(lambda: not bench.flight.armed, 30.0)
    assert bench.flight.landed


def overriding(throttle):
    return d.MAVLink_rc_channels_override_message(1, 1, 1500, 1500, throttle, 1500, *[0xffff] * 4)


def test_a_throttle_of_a_station_that_is_not_centred_keeps_no_arducopter_up():
    bench = flying('ardupilot')
    bench.set_mode(d.COPTER_MODE_LOITER)
    for _ in range(6):
        bench.send(overriding(1000))
        bench.pass_time(1.0)
    assert bench.flight.body.velocity[2] == pytest.approx(-2.5, abs=0.01)


def test_centred_sticks_of_a_station_keep_an_arducopter_up_until_they_end():
    bench = flying('ardupilot')
    bench.set_mode(d.COPTER_MODE_LOITER)
    sticks = overriding(1500)
    for _ in range(20):
        bench.send(sticks)
        bench.pass_time(1.0)
    height = bench.flight.body.position[2]
    bench.send(sticks)
    bench.pass_time(2.9)
    assert bench.flight.body.position[2] == pytest.approx(height, abs=0.01)
    bench.pass_time(3.0)
    assert bench.flight.body.position[2] < height - 3.0


@pytest.mark.parametrize(('kind', 'number'), STICK)
def test_the_stick_flies_it_in_stick_modes(kind, number):
    bench = flying(kind)
    bench.set_mode(number)
    bench.pass_time(8.0)
    y = bench.flight.body.position[1]
    bench.vehicle.rc_stick((0.0, 5.0, 1.0))
    bench.pass_time(10.0)
    assert bench.flight.body.velocity == pytest.approx((0.0, 5.0, 1.0), abs=1e-6)
    assert bench.flight.body.position[1] > y + 40.0
    bench.vehicle.rc_stick(None)
    bench.pass_time(5.0)
    assert bench.flight.body.velocity == (0.0, 0.0, 0.0)


@pytest.mark.parametrize(('kind', 'number'), STOPS + [('ardupilot', 4)])
def test_the_stick_does_not_matter_in_other_modes(kind, number):
    bench = flying(kind)
    bench.vehicle.rc_stick((0.0, 5.0, 0.0))
    bench.set_mode(number)
    bench.pass_time(8.0)
    assert bench.flight.body.velocity == (0.0, 0.0, 0.0)


@pytest.mark.parametrize('kind', ['ardupilot', 'px4'])
def test_the_pilot_takes_off_and_lands_by_stick(kind):
    bench = Bench(kind)
    bench.vehicle.rc_mode(16 if bench.own else px4_mode(3))
    assert bench.vehicle.rc_arm(True)
    bench.vehicle.rc_stick((0.0, 0.0, 2.0))
    bench.pass_time(10.0)
    assert bench.flight.body.position[2] > 15.0
    bench.vehicle.rc_stick((0.0, 0.0, -2.0))
    bench.until(lambda: bench.flight.landed)
    assert bench.flight.body.position[2] == 0.0
    bench.pass_time(11.0)
    assert not bench.flight.armed


@pytest.mark.parametrize(('kind', 'number'), RETURNS)
def test_the_modes_that_return_end_on_the_ground_at_home(kind, number):
    bench = flying(kind)
    bench.set_mode(number)
    bench.until(lambda: not bench.flight.armed)
    assert bench.flight.landed
    assert metres_between(bench.flight.body.position, (0.0, 0.0, 0.0)) < 1.0


@pytest.mark.parametrize(('kind', 'number'), LANDS)
def test_the_modes_that_land_end_on_the_ground_below(kind, number):
    bench = flying(kind)
    bench.set_mode(number)
    where = bench.flight.body.position
    bench.until(lambda: not bench.flight.armed)
    assert bench.flight.body.position[2] == 0.0
    assert ground_distance(bench.flight.body.position, where) < 40.0


@pytest.mark.parametrize(('kind', 'number'), RETURNS + LANDS)
def test_after_the_landing_px4_enters_the_mode_before_and_the_copter_stays_in_its_mode(
        kind, number):
    bench = flying(kind)
    bench.set_mode(number)
    bench.until(lambda: not bench.flight.armed)
    assert reported_mode(bench) == (number if bench.own else px4_mode(4, 4))


@pytest.mark.parametrize('by', ['station', 'failsafe'])
def test_after_a_landing_from_hold_px4_holds(by):
    bench = flying('px4')
    bench.set_mode(px4_mode(4, 3))
    if by == 'failsafe':
        bench.vehicle.failsafe('battery', px4_mode(4, 6))
    else:
        bench.set_mode(px4_mode(4, 6))
    bench.until(lambda: not bench.flight.armed)
    assert reported_mode(bench) == px4_mode(4, 3)


def test_px4_stays_in_the_land_mode_that_it_is_given_on_the_ground():
    bench = Bench('px4')
    bench.set_mode(FlightMode.LAND)
    assert reported_mode(bench) == px4_mode(4, 6)


@pytest.mark.parametrize('kind', ['ardupilot', 'px4'])
def test_the_landing_of_a_return_item_ends_the_same_way(kind):
    bench = Bench(kind)
    home = d.MAVLink_mission_item_int_message(
        1, 1, 0, 2, d.MAV_CMD_NAV_RETURN_TO_LAUNCH, 0, 1, 0, 0, 0, 0, 0, 0, 0, 0)
    bench.fly(waypoint((50.0, 0.0, 30.0)), home)
    bench.until(lambda: not bench.flight.armed)
    assert reported_mode(bench) == (3 if bench.own else px4_mode(4, 4))


def test_a_change_between_two_stick_modes_is_a_change():
    bench = flying('ardupilot')
    bench.vehicle.rc_mode(5)
    bench.vehicle.rc_mode(16)
    assert [e.mode for e in bench.vehicle.take_events() if e.name == 'mode'][-2:] == [5, 16]


def test_the_takeoff_mode_of_px4_climbs_and_ends_in_hold():
    bench = Bench('px4')
    bench.arm()
    assert bench.set_mode(FlightMode.TAKEOFF) == 0
    bench.until(lambda: bench.flight.mode is FlightMode.HOLD)
    assert bench.flight.body.position[2] == pytest.approx(2.5, abs=0.5)
