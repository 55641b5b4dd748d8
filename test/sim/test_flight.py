# SPDX-License-Identifier: Apache-2.0
"""How the simulated vehicles fly: kinematics, arming, and what both do with a mission."""
import math
from itertools import pairwise

import pytest
from pymavlink.dialects.v20 import ardupilotmega as d
from vehicle_bench import ORIGIN, Bench, item, of, reached, waypoint

from uav_task_alloc.sim.config import FlightMode
from uav_task_alloc.sim.dynamics import metres_between

A, B, C = (100.0, 0.0, 30.0), (100.0, 100.0, 30.0), (0.0, 100.0, 30.0)
KINDS = ['ardupilot', 'px4']


@pytest.fixture(params=KINDS)
def bench(request):
    return Bench(request.param)


def trace(bench, limit):
    """Position and velocity at each 0.1 s."""
    path = []
    for _ in range(round(limit * 10)):
        bench.pass_time(0.1)
        path.append((bench.flight.body.position, bench.flight.body.velocity))
    return path


def test_it_flies_what_is_in_its_storage_in_order(bench):
    bench.fly(waypoint(A), waypoint(B), waypoint(C))
    bench.reach(2)
    events = [e for e in bench.vehicle.take_events() if e.name == 'item_reached']
    assert [e.seq for e in events] == [0 + bench.own, 1 + bench.own, 2 + bench.own]
    for event, point in zip(events, (A, B, C), strict=True):
        assert event.point == pytest.approx(point, abs=0.02)


def test_speed_acceleration_and_climb_stay_within_limits(bench):
    bench.fly(waypoint((300.0, 0.0, 90.0)), waypoint((0.0, 0.0, 20.0)))
    path = trace(bench, 80.0)
    for (_, before), (_, after) in pairwise(path):
        assert math.hypot(*after) <= 15.0 + 1e-6
        assert abs(after[2]) <= 4.0 + 0.5
        assert metres_between(before, after) <= 3.0 * 0.1 + 1e-6


def test_a_corner_is_neither_cut_nor_overshot_by_more_than_its_radius(bench):
    bench.fly(waypoint(A), waypoint(B))
    path = [p for p, _ in trace(bench, 40.0)]
    assert max(p[0] for p in path) < 102.5
    assert min(metres_between(p, A) for p in path) < 2.0


def test_a_corner_in_two_points_near_each_other_is_not_overshot_either(bench):
    bench.fly(waypoint(A), waypoint((101.0, 0.0, 30.0)), waypoint((0.0, 50.0, 30.0)))
    assert max(p[0] for p, _ in trace(bench, 40.0)) < 105.0


def test_a_fast_vehicle_does_not_fly_past_its_waypoint():
    bench = Bench('ardupilot', cruise_speed=30.0)
    bench.fly(waypoint((400.0, 0.0, 30.0)), waypoint((800.0, 0.0, 30.0)))
    bench.reach(1)
    assert max(p[0] for p, _ in trace(bench, 10.0)) < 803.0


def test_big_steps_of_time_fly_the_same_path(bench):
    bench.fly(waypoint(A), waypoint(B))
    report = bench.pass_time(60.0, step=60.0)
    assert 1 + bench.own in reached(report)


def test_a_hold_keeps_it_at_the_waypoint(bench):
    bench.fly(waypoint(A, p1=5.0), waypoint(B))
    bench.until(lambda: metres_between(bench.flight.body.position, A) < 1.9)
    assert bench.own not in reached(bench.pass_time(4.5))
    assert bench.own in reached(bench.pass_time(1.0))


def test_loiter_time_holds_too(bench):
    bench.fly(item(d.MAV_CMD_NAV_LOITER_TIME, A, p1=5.0), waypoint(B))
    bench.until(lambda: metres_between(bench.flight.body.position, A) < 1.9)
    assert bench.own not in reached(bench.pass_time(4.5))
    assert bench.own in reached(bench.pass_time(1.0))


def test_change_speed_holds_for_the_legs_after_it(bench):
    frame = 2
    bench.fly(item(d.MAV_CMD_DO_CHANGE_SPEED, frame=frame, p1=1.0, p2=5.0),
              waypoint((400.0, 0.0, 30.0)))
    assert max(math.hypot(*v) for _, v in trace(bench, 20.0)) == pytest.approx(5.0, abs=0.1)


def test_return_ends_on_the_ground_at_home(bench):
    bench.fly(waypoint(A))
    bench.set_mode(FlightMode.RETURN)
    bench.until(lambda: not bench.flight.armed)
    assert bench.flight.landed
    assert metres_between(bench.flight.body.position, (0.0, 0.0, 0.0)) < 1.0


def landed_state(bench):
    return bench.request('EXTENDED_SYS_STATE')[0].landed_state


def test_the_landed_state_is_that_of_a_takeoff_until_its_height_is_reached(bench):
    assert landed_state(bench) == d.MAV_LANDED_STATE_ON_GROUND
    bench.set_mode(FlightMode.GUIDED if bench.own else FlightMode.HOLD)
    bench.arm()
    bench.command(d.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, 0, 0, 0,
                  30.0 + (0.0 if bench.own else ORIGIN.altitude_amsl))
    bench.until(lambda: bench.flight.body.position[2] > 25.0)
    assert landed_state(bench) == d.MAV_LANDED_STATE_TAKEOFF
    bench.pass_time(10.0)
    assert landed_state(bench) == d.MAV_LANDED_STATE_IN_AIR


def test_the_landed_state_of_a_return_is_a_landing_once_it_goes_down_over_home(bench):
    bench.fly(waypoint(A))
    bench.until(lambda: bench.flight.body.position[0] > 90.0)
    bench.set_mode(FlightMode.RETURN)
    bench.until(lambda: bench.flight.body.position[0] < 50.0)
    assert landed_state(bench) == d.MAV_LANDED_STATE_IN_AIR
    bench.until(lambda: bench.flight.body.position[2] < 10.0)
    assert landed_state(bench) == d.MAV_LANDED_STATE_LANDING
    bench.until(lambda: bench.flight.landed)
    assert landed_state(bench) == d.MAV_LANDED_STATE_ON_GROUND


def test_landing_ends_on_the_ground_where_it_is(bench):
    bench.rise()
    bench.set_mode(FlightMode.LAND)
    bench.until(lambda: bench.flight.landed)
    assert bench.flight.body.position[2] == 0.0
    assert not bench.flight.armed


@pytest.mark.parametrize(('kind', 'delay'), [('ardupilot', 41.0), ('px4', 20.0)])
def test_it_does_not_arm_without_a_position_estimate(kind, delay):
    bench = Bench(kind)
    bench.vehicle.reboot(bench.now)
    bench.set_mode(FlightMode.GUIDED if bench.own else FlightMode.HOLD)
    bench.pass_time(delay - 1.0)
    bench.received.clear()
    assert bench.command(d.MAV_CMD_COMPONENT_ARM_DISARM, 1) != 0
    texts = [m.text for m in of(bench.received, 'STATUSTEXT')]
    assert texts == (['Arm: Need Position Estimate'] if bench.own else [])
    bench.pass_time(1.5)
    assert bench.command(d.MAV_CMD_COMPONENT_ARM_DISARM, 1) == 0


def test_the_arming_delay_can_be_set():
    bench = Bench('px4', arming_delay=100.0)
    assert bench.command(d.MAV_CMD_COMPONENT_ARM_DISARM, 1) == d.MAV_RESULT_TEMPORARILY_REJECTED


def test_it_disarms_itself_when_nothing_happens(bench):
    bench.set_mode(FlightMode.GUIDED if bench.own else FlightMode.HOLD)
    bench.command(d.MAV_CMD_COMPONENT_ARM_DISARM, 1)
    bench.pass_time(11.0)
    assert not bench.flight.armed


def test_it_does_not_disarm_in_the_air(bench):
    bench.rise()
    assert bench.command(d.MAV_CMD_COMPONENT_ARM_DISARM, 0) != 0
    assert bench.flight.armed


def test_the_battery_drains_with_the_distance_flown():
    bench = Bench('px4', range=2000.0)
    bench.fly(waypoint((500.0, 0.0, 30.0)))
    before = bench.flight.body.battery
    bench.reach(0)
    assert before - bench.flight.body.battery == pytest.approx(500.0 / 2000.0, abs=0.03)


def test_an_empty_battery_brings_it_down():
    bench = Bench('ardupilot', range=300.0)
    bench.fly(waypoint((2000.0, 0.0, 30.0)))
    bench.until(lambda: bench.flight.landed)
    assert bench.flight.mode is FlightMode.LAND
    assert bench.flight.body.position[0] < 400.0


def test_a_dead_vehicle_neither_speaks_nor_moves(bench):
    bench.fly(waypoint(A))
    bench.pass_time(3.0)
    where = bench.flight.body.position
    bench.vehicle.kill()
    assert not bench.pass_time(10.0)
    assert not bench.send(d.MAVLink_mission_request_list_message(1, 1, 0))
    assert bench.flight.body.position == where


def test_a_reboot_sets_the_boot_time_to_zero(bench):
    bench.vehicle.reboot(bench.now)
    bench.command(d.MAV_CMD_REQUEST_MESSAGE, d.MAVLINK_MSG_ID_ATTITUDE)
    assert of(bench.received, 'ATTITUDE')[-1].time_boot_ms == 0


def test_the_position_sent_is_the_position_flown(bench):
    bench.rise()
    bench.command(d.MAV_CMD_REQUEST_MESSAGE, d.MAVLINK_MSG_ID_GLOBAL_POSITION_INT)
    report = of(bench.received, 'GLOBAL_POSITION_INT')[-1]
    assert report.lat == pytest.approx(47.397742e7, abs=1)
    assert report.relative_alt / 1000.0 == pytest.approx(bench.flight.body.position[2], abs=0.02)
    assert report.alt / 1000.0 == pytest.approx(488.0 + bench.flight.body.position[2], abs=0.02)
