# SPDX-License-Identifier: Apache-2.0
"""The simulated ArduCopter in flight and its commands, quirk by quirk."""
import pytest
from pymavlink.dialects.v20 import ardupilotmega as d
from vehicle_bench import Bench, item, of, reached, waypoint

from uav_task_alloc.sim.config import FlightMode
from uav_task_alloc.sim.dynamics import metres_between

A, B, C = (100.0, 0.0, 30.0), (100.0, 100.0, 30.0), (0.0, 100.0, 30.0)
FAR = (400.0, 0.0, 30.0)
HOME = waypoint((0.0, 0.0, 0.0))


@pytest.fixture
def bench():
    return Bench('ardupilot')


def mission_current(bench):
    bench.command(d.MAV_CMD_REQUEST_MESSAGE, d.MAVLINK_MSG_ID_MISSION_CURRENT)
    return of(bench.received, 'MISSION_CURRENT')[-1]


def texts(messages):
    return [m.text for m in of(messages, 'STATUSTEXT')]


def test_after_start_it_sends_nothing_but_heartbeats(bench):
    assert {m.get_type() for m in bench.pass_time(10.0)} == {'HEARTBEAT'}


def test_rates_are_as_asked_and_forgotten_by_a_reboot(bench):
    number = d.MAVLINK_MSG_ID_GLOBAL_POSITION_INT
    bench.command(d.MAV_CMD_SET_MESSAGE_INTERVAL, number, 200_000)
    assert len(of(bench.pass_time(10.0), 'GLOBAL_POSITION_INT')) in (50, 51)
    bench.vehicle.reboot(bench.now)
    assert not of(bench.pass_time(10.0), 'GLOBAL_POSITION_INT')


def test_224_sets_the_current_item(bench):
    bench.load(waypoint(A), waypoint(B))
    assert bench.command(d.MAV_CMD_DO_SET_MISSION_CURRENT, 2) == 0
    assert mission_current(bench).seq == 2
    assert bench.command(d.MAV_CMD_DO_SET_MISSION_CURRENT, 7) == d.MAV_RESULT_DENIED


def test_mission_set_current_sets_it_too(bench):
    bench.load(waypoint(A), waypoint(B))
    current, = bench.set_current(2)
    assert current.seq == 2


def test_clearing_the_mission_it_flies_is_an_error(bench):
    bench.fly(waypoint(FAR))
    bench.pass_time(2.0)
    ack, = bench.send(d.MAVLink_mission_clear_all_message(1, 1, 0))
    assert ack.type == d.MAV_MISSION_ERROR
    assert len(bench.vehicle.mission.items) == 2


def test_clearing_on_the_ground_is_accepted(bench):
    bench.load(waypoint(A))
    ack, = bench.send(d.MAVLink_mission_clear_all_message(1, 1, 0))
    assert ack.type == d.MAV_MISSION_ACCEPTED
    assert not bench.vehicle.mission.items


def test_an_upload_in_flight_keeps_the_seq_and_flies_the_new_item(bench):
    bench.fly(waypoint(A), waypoint(FAR))
    bench.reach(0)
    bench.load(waypoint(A), waypoint(C))
    assert mission_current(bench).seq == 2
    bench.reach(1)
    assert metres_between(bench.flight.body.position, C) < 2.5


def test_an_upload_in_flight_restarts_the_command_after_each_item(bench):
    bench.fly(waypoint(A, p1=10.0))
    bench.until(lambda: metres_between(bench.flight.body.position, A) < 1.0)
    bench.pass_time(8.0)
    bench.received.clear()
    bench.load(waypoint(A, p1=10.0), waypoint(B))
    assert texts(bench.received) == ['Auto mission changed, restarted command'] * 3
    assert not reached(bench.pass_time(9.0))  # the hold was restarted
    assert reached(bench.pass_time(2.0)) == [1]


def test_a_shorter_list_in_flight_leaves_current_beyond_its_end(bench):
    bench.fly(waypoint(A), waypoint(B), waypoint(FAR))
    bench.reach(1)
    bench.received.clear()
    bench.load(waypoint(C))
    assert 'Auto mission changed but failed to restart command' in texts(bench.received)
    current = mission_current(bench)
    assert current.seq > current.total
    bench.until(lambda: metres_between(bench.flight.body.position, FAR) < 2.5)  # the old item


def test_reached_is_sent_once_for_each_item(bench):
    bench.fly(waypoint(A), waypoint(B))
    bench.pass_time(60.0)
    assert reached(bench.received) == [1, 2]


def test_reached_is_sent_for_a_return_item(bench):
    bench.fly(waypoint(A), item(d.MAV_CMD_NAV_RETURN_TO_LAUNCH))
    bench.until(lambda: not bench.flight.armed)
    assert reached(bench.received) == [1, 2]


def test_reached_is_not_sent_for_a_landing(bench):
    bench.fly(waypoint(A), item(d.MAV_CMD_NAV_LAND, (100.0, 0.0, 0.0)))
    bench.until(lambda: not bench.flight.armed)
    bench.pass_time(5.0)
    assert reached(bench.received) == [1]


def test_at_the_end_it_stays_in_auto_with_mission_state_5(bench):
    bench.fly(waypoint(A))
    assert mission_current(bench).mission_state == d.MISSION_STATE_ACTIVE
    bench.reach(0)
    bench.pass_time(2.0)
    assert bench.flight.mode is FlightMode.MISSION
    assert mission_current(bench).mission_state == 5


def test_after_the_end_a_new_upload_alone_does_not_fly(bench):
    bench.fly(waypoint(A))
    bench.reach(0)
    bench.load(waypoint(B), waypoint(C))
    bench.pass_time(10.0)
    assert metres_between(bench.flight.body.position, A) < 2.5
    assert bench.command(d.MAV_CMD_MISSION_START) == 0
    bench.reach(1)


def test_a_resumed_mission_goes_on_at_the_item_it_flew(bench):
    bench.fly(waypoint(A), waypoint(FAR))
    bench.reach(0)
    bench.set_mode(FlightMode.GUIDED)
    bench.pass_time(10.0)
    bench.set_mode(FlightMode.MISSION)
    bench.reach(1)
    assert reached(bench.received) == [1, 2]


def test_a_stopped_mission_is_reported_as_not_started(bench):
    bench.fly(waypoint(A), waypoint(FAR))
    bench.reach(0)
    bench.set_mode(FlightMode.GUIDED)
    current = mission_current(bench)
    assert (current.seq, current.mission_state) == (2, d.MISSION_STATE_NOT_STARTED)
    assert current.mission_mode == 0


def test_a_current_item_set_after_the_end_stops_the_mission_in_auto(bench):
    bench.fly(waypoint(A))
    bench.reach(0)
    bench.set_current(1)
    bench.pass_time(5.0)
    current = mission_current(bench)
    assert (current.mission_state, current.mission_mode) == (d.MISSION_STATE_NOT_STARTED, 1)
    assert bench.set_mode(FlightMode.MISSION) == 0  # it is in AUTO already
    bench.pass_time(5.0)
    assert mission_current(bench).mission_state == d.MISSION_STATE_NOT_STARTED


def test_a_mission_cut_off_before_the_item_it_flew_begins_again(bench):
    bench.fly(waypoint(A), waypoint(B), waypoint(FAR))
    bench.reach(1)
    bench.set_mode(FlightMode.GUIDED)
    bench.load(waypoint(C), waypoint(A))
    bench.received.clear()
    bench.set_mode(FlightMode.MISSION)
    bench.until(lambda: mission_current(bench).mission_state == d.MISSION_STATE_COMPLETE)
    assert reached(bench.received) == [1, 2]


@pytest.mark.parametrize(('end', 'seq', 'state'), [
    (item(d.MAV_CMD_NAV_RETURN_TO_LAUNCH), 0, d.MISSION_STATE_COMPLETE),
    (item(d.MAV_CMD_NAV_LAND, A), 1, d.MISSION_STATE_ACTIVE),
])
def test_a_disarming_resets_the_mission(bench, end, seq, state):
    bench.fly(waypoint(A), end)
    bench.until(lambda: not bench.flight.armed)
    bench.pass_time(5.0)
    current = mission_current(bench)
    assert (current.seq, current.mission_state, current.mission_mode) == (seq, state, 1)
    bench.set_mode(FlightMode.GUIDED)
    assert mission_current(bench).seq == seq


def test_a_landing_in_mid_mission_resets_it(bench):
    bench.fly(waypoint(A), waypoint(FAR))
    bench.reach(0)
    bench.set_mode(FlightMode.LAND)
    assert mission_current(bench).seq == 2
    bench.until(lambda: not bench.flight.armed)
    assert mission_current(bench).seq == 0


def test_set_current_while_held_chooses_where_auto_goes_on(bench):
    bench.fly(waypoint(A), waypoint(B), waypoint(C))
    bench.set_mode(FlightMode.GUIDED)
    bench.set_current(3)
    bench.set_mode(FlightMode.MISSION)
    bench.reach(2)
    assert reached(bench.received) == [3]


def test_auto_on_the_ground_needs_a_takeoff_item(bench):
    bench.load(waypoint(A))
    bench.set_mode(FlightMode.GUIDED)
    bench.command(d.MAV_CMD_COMPONENT_ARM_DISARM, 1)
    assert bench.set_mode(FlightMode.MISSION) == d.MAV_RESULT_FAILED
    assert 'Auto: Missing Takeoff Cmd' in texts(bench.received)


def test_auto_on_the_ground_needs_a_takeoff_at_the_current_item(bench):
    bench.load(item(d.MAV_CMD_NAV_TAKEOFF, (0.0, 0.0, 30.0)), waypoint(A))
    bench.set_mode(FlightMode.GUIDED)
    bench.arm()
    bench.set_current(2)
    assert bench.set_mode(FlightMode.MISSION) == d.MAV_RESULT_FAILED
    bench.set_current(1)
    assert bench.set_mode(FlightMode.MISSION) == 0


def test_auto_needs_a_mission(bench):
    bench.rise()
    assert bench.set_mode(FlightMode.MISSION) == d.MAV_RESULT_FAILED


def test_auto_is_not_armable(bench):
    bench.load(item(d.MAV_CMD_NAV_TAKEOFF, (0.0, 0.0, 30.0)), waypoint(A))
    bench.set_mode(FlightMode.MISSION)
    assert bench.command(d.MAV_CMD_COMPONENT_ARM_DISARM, 1) == d.MAV_RESULT_FAILED


def test_takeoff_needs_guided_and_armed(bench):
    assert bench.command(d.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, 0, 0, 0, 20) == d.MAV_RESULT_FAILED
    bench.rise(20.0)
    assert bench.flight.body.position[2] == pytest.approx(20.0, abs=0.5)


def test_param2_is_no_acceptance_radius(bench):
    bench.fly(waypoint(A, p2=50.0))
    bench.reach(0)
    assert metres_between(bench.flight.body.position, A) < 2.5


def test_home_is_where_it_was_armed_last_and_the_local_frame_stays(bench):
    bench.fly(waypoint(A))
    bench.pass_time(6.0)
    bench.set_mode(FlightMode.LAND)
    bench.until(lambda: not bench.flight.armed)
    place = bench.flight.body.position
    assert place[0] > 20.0
    before, = bench.request('HOME_POSITION')
    local, = bench.request('LOCAL_POSITION_NED')
    bench.set_mode(FlightMode.GUIDED)
    assert bench.arm() == 0
    after, = bench.request('HOME_POSITION')
    assert after.longitude > before.longitude
    assert bench.flight.home == pytest.approx((place[0], place[1], 0.0))
    assert bench.request('LOCAL_POSITION_NED')[0].y == pytest.approx(local.y, abs=0.1)
