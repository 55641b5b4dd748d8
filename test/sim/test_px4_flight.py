# SPDX-License-Identifier: Apache-2.0
"""The simulated PX4 in flight and its commands, quirk by quirk."""
import pytest
from pymavlink.dialects.v20 import ardupilotmega as d
from vehicle_bench import Bench, item, of, reached, waypoint

from uav_task_alloc.sim.config import FlightMode
from uav_task_alloc.sim.dynamics import metres_between

A, B, C = (100.0, 0.0, 30.0), (100.0, 100.0, 30.0), (0.0, 100.0, 30.0)
FAR = (400.0, 0.0, 30.0)


@pytest.fixture
def bench():
    return Bench('px4')


@pytest.fixture
def newer():
    """A PX4 that reports its mission_state."""
    return Bench('px4', reports_mission_state=True)


def current(bench):
    return of(bench.pass_time(1.1), 'MISSION_CURRENT')[-1]


def test_it_streams_without_a_request():
    bench = Bench('px4', floods=True)
    assert len(of(bench.pass_time(2.0), 'ATTITUDE')) in range(195, 206)


def test_the_flood_can_be_stopped_and_comes_back_with_a_reboot():
    bench = Bench('px4', floods=True)
    assert bench.command(d.MAV_CMD_SET_MESSAGE_INTERVAL, d.MAVLINK_MSG_ID_ATTITUDE, -1) == 0
    assert not of(bench.pass_time(2.0), 'ATTITUDE')
    bench.vehicle.reboot(bench.now)
    assert of(bench.pass_time(2.0), 'ATTITUDE')


def test_mission_current_is_sent_without_a_request_and_has_no_rate(bench):
    assert len(of(bench.pass_time(10.0), 'MISSION_CURRENT')) in (9, 10, 11)
    assert bench.command(d.MAV_CMD_SET_MESSAGE_INTERVAL, d.MAVLINK_MSG_ID_MISSION_CURRENT,
                         500_000) == d.MAV_RESULT_FAILED


def test_224_is_unsupported(bench):
    bench.load(waypoint(A), waypoint(B))
    assert bench.command(d.MAV_CMD_DO_SET_MISSION_CURRENT, 1) == d.MAV_RESULT_UNSUPPORTED
    assert current(bench).seq == 0


def test_mission_set_current_is_confirmed_by_mission_current(bench):
    bench.load(waypoint(A), waypoint(B))
    assert of(bench.set_current(1), 'MISSION_CURRENT')[0].seq == 1


def test_clearing_the_mission_it_flies_drops_to_hold(bench):
    bench.fly(waypoint(FAR))
    bench.pass_time(2.0)
    ack, = of(bench.send(d.MAVLink_mission_clear_all_message(1, 1, 0)), 'MISSION_ACK')
    assert ack.type == d.MAV_MISSION_ACCEPTED
    assert bench.flight.mode is FlightMode.HOLD


def test_an_upload_in_flight_jumps_to_the_flagged_item(bench):
    bench.fly(waypoint(A), waypoint(B), waypoint(FAR))
    bench.pass_time(2.0)
    bench.load(waypoint(A), waypoint(B), waypoint(C, current=1))
    assert current(bench).seq == 2
    bench.reach(2)
    assert reached(bench.received)[0] == 2


def test_an_identical_upload_jumps_to_the_flagged_item_too(bench):
    bench.fly(waypoint(A), waypoint(B))
    bench.load(waypoint(A), waypoint(B, current=1))
    assert current(bench).seq == 1


def test_without_a_flag_the_old_index_stays(bench):
    bench.fly(waypoint(A), waypoint(FAR))
    bench.reach(0)
    bench.load(waypoint(A), waypoint(C), waypoint(B))
    assert current(bench).seq == 1
    bench.reach(1)
    assert metres_between(bench.flight.body.position, C) < 2.5


def test_without_a_flag_the_old_index_is_clamped(bench):
    bench.fly(waypoint(A), waypoint(B), waypoint(FAR))
    bench.reach(1)
    bench.load(waypoint(C), waypoint(A))
    assert current(bench).seq == 1


def test_reached_is_repeated_ten_times_at_1_hz(bench):
    bench.fly(waypoint(A))
    bench.reach(0)
    bench.pass_time(20.0)
    assert reached(bench.received) == [0] * 11


def test_the_repetition_goes_on_across_a_new_upload(bench):
    bench.fly(waypoint(A))
    bench.reach(0)
    bench.pass_time(2.5)
    bench.load(waypoint(B), waypoint(C))
    bench.pass_time(20.0)
    assert reached(bench.received) == [0] * 11


def test_the_next_item_reached_ends_the_repetition_of_the_one_before(bench):
    near = (105.0, 0.0, 30.0)
    bench.fly(waypoint(A), waypoint(near))
    bench.reach(1)
    bench.received.clear()
    assert set(reached(bench.pass_time(20.0))) == {1}


def test_reached_is_not_sent_for_a_return_item(bench):
    bench.fly(waypoint(A), item(d.MAV_CMD_NAV_RETURN_TO_LAUNCH, frame=2))
    bench.until(lambda: not bench.flight.armed)
    assert set(reached(bench.received)) == {0}


def test_at_the_end_it_goes_to_hold_with_mission_state_5(newer):
    newer.fly(waypoint(A))
    assert current(newer).mission_state == d.MISSION_STATE_ACTIVE
    newer.reach(0)
    assert newer.flight.mode is FlightMode.HOLD
    assert current(newer).mission_state == d.MISSION_STATE_COMPLETE


def test_px4_1_15_reports_no_mission_state(bench):
    bench.fly(waypoint(A))
    assert (current(bench).mission_state, current(bench).mission_mode) == (0, 0)
    bench.reach(0)
    assert bench.flight.mode is FlightMode.HOLD
    assert (current(bench).mission_state, current(bench).mission_mode) == (0, 0)


def test_a_mission_that_has_ended_is_not_begun_again_in_the_air(newer):
    newer.fly(waypoint(A), waypoint(B))
    newer.reach(1)
    newer.received.clear()
    assert newer.set_mode(FlightMode.MISSION) == d.MAV_RESULT_ACCEPTED
    assert newer.texts() == ['No valid mission available, loitering']
    assert newer.flight.mode is FlightMode.HOLD
    assert current(newer).mission_state == d.MISSION_STATE_COMPLETE
    newer.set_current(0)
    newer.set_mode(FlightMode.MISSION)
    newer.reach(0)


@pytest.mark.parametrize('flown', [1, 2])
def test_disarmed_at_its_last_item_the_mission_begins_again(bench, flown):
    bench.fly(waypoint(A), waypoint(B))
    bench.reach(flown - 1)
    bench.set_mode(FlightMode.RETURN)
    bench.until(lambda: not bench.flight.armed)
    assert current(bench).seq == 1
    bench.set_mode(FlightMode.MISSION)
    assert bench.arm() == 0
    assert current(bench).seq == 0


@pytest.mark.parametrize('mode', [FlightMode.RETURN, FlightMode.LAND])
def test_it_does_not_arm_in_a_mode_that_only_comes_down(bench, mode):
    bench.set_mode(mode)
    assert bench.arm() == d.MAV_RESULT_TEMPORARILY_REJECTED
    assert not bench.flight.armed
    bench.received.clear()
    bench.pass_time(1.5)
    status = of(bench.received, 'SYS_STATUS')[-1]
    assert not status.onboard_control_sensors_health & d.MAV_SYS_STATUS_PREARM_CHECK
    bench.set_mode(FlightMode.HOLD)
    assert bench.arm() == d.MAV_RESULT_ACCEPTED


def test_a_mission_that_ends_on_the_ground_ends_once_and_stays_in_mission_mode(bench):
    bench.load(item(d.MAV_CMD_DO_CHANGE_SPEED, frame=2, p1=1.0, p2=5.0))
    bench.set_mode(FlightMode.MISSION)
    assert bench.arm() == 0
    bench.pass_time(3.0)
    assert bench.flight.mode is FlightMode.MISSION
    ends = [event for event in bench.vehicle.take_events() if event.name == 'mission_end']
    assert len(ends) == 1


def test_disarmed_before_its_last_item_the_mission_goes_on(bench):
    bench.fly(waypoint(A), waypoint(B), waypoint(C))
    bench.reach(0)
    bench.set_mode(FlightMode.RETURN)
    bench.until(lambda: not bench.flight.armed)
    assert bench.arm() == 0
    bench.set_mode(FlightMode.MISSION)
    assert current(bench).seq == 1


def test_a_mission_loaded_on_the_ground_begins_at_its_last_item_where_that_is_current(bench):
    bench.fly(waypoint(A))
    bench.set_mode(FlightMode.RETURN)
    bench.until(lambda: not bench.flight.armed)
    bench.load(waypoint(A), waypoint(B, current=1))
    bench.set_mode(FlightMode.MISSION)
    assert bench.arm() == 0
    assert current(bench).seq == 1


def test_after_a_take_off_it_reports_that_its_mission_is_complete(newer):
    newer.load(waypoint(A), waypoint(B))
    assert current(newer).mission_state == d.MISSION_STATE_NOT_STARTED
    newer.rise()
    newer.until(lambda: newer.flight.mode is FlightMode.HOLD)
    assert current(newer).mission_state == d.MISSION_STATE_COMPLETE
    newer.set_mode(FlightMode.MISSION)
    assert current(newer).mission_state == d.MISSION_STATE_ACTIVE


def test_without_param2_a_waypoint_is_reached_10_m_before_it():
    bench = Bench('px4', acceptance_radius=None)
    bench.fly(waypoint(A), waypoint(FAR))
    bench.reach(0)
    assert 5.0 < metres_between(bench.flight.body.position, A) < 10.0


def test_param2_is_the_acceptance_radius(bench):
    bench.fly(waypoint(A, p2=20.0), waypoint(FAR))
    bench.reach(0)
    assert 15.0 < metres_between(bench.flight.body.position, A) < 20.0


def test_mission_start_arms_and_takes_off_straight_up(bench):
    bench.load(waypoint(A), waypoint(B))
    assert bench.command(d.MAV_CMD_MISSION_START) == 0
    bench.until(lambda: bench.flight.body.position[2] > 25.0)
    assert metres_between(bench.flight.body.position, (0.0, 0.0, 30.0)) < 6.0
    bench.reach(1)


def test_without_a_mission_the_mission_mode_is_refused(bench):
    assert bench.set_mode(FlightMode.MISSION) == d.MAV_RESULT_TEMPORARILY_REJECTED
    assert bench.flight.mode is FlightMode.HOLD


def test_an_infeasible_mission_is_accepted_and_not_flown(bench):
    bench.rise()
    bench.load(waypoint((12_000.0, 0.0, 30.0)))
    assert 'First waypoint too far' in of(bench.received, 'STATUSTEXT')[-1].text
    assert bench.set_mode(FlightMode.MISSION) == d.MAV_RESULT_TEMPORARILY_REJECTED


def test_takeoff_height_is_above_mean_sea_level(bench):
    bench.rise(20.0)
    assert bench.flight.body.position[2] == pytest.approx(20.0, abs=0.5)
    assert bench.flight.mode is FlightMode.HOLD
