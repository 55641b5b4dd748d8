# SPDX-License-Identifier: Apache-2.0
"""The mission service of the simulated ArduCopter, quirk by quirk."""
import pytest
from pymavlink.dialects.v20 import ardupilotmega as d
from vehicle_bench import NAN, Bench, content, item, of, waypoint

from uav_task_alloc.mavlink.transport.codec import plan_id

A, B, C, D = (100.0, 0.0, 30.0), (100.0, 100.0, 30.0), (0.0, 100.0, 30.0), (50.0, 50.0, 30.0)
HOME = waypoint((777.0, 777.0, 777.0))


@pytest.fixture
def bench():
    return Bench('ardupilot')


def sent_back(bench, sent):
    """The item as it reads back after an upload that is accepted."""
    bench.load(sent)
    return bench.download()[1]


def refusal(bench, sent):
    return bench.upload([HOME, sent]).type


def test_seq_0_is_replaced_by_the_real_home(bench):
    bench.load(waypoint(A))
    home = bench.download()[0]
    assert (home.x, home.y) == (round(47.397742e7), round(8.545594e7))
    assert home.z == pytest.approx(488.0)


def test_total_excludes_home(bench):
    bench.load(waypoint(A), waypoint(B))
    bench.command(d.MAV_CMD_REQUEST_MESSAGE, d.MAVLINK_MSG_ID_MISSION_CURRENT)
    assert of(bench.received, 'MISSION_CURRENT')[-1].total == 2


def test_it_always_asks_with_mission_request(bench):
    for _ in range(2):
        bench.load(waypoint(A))
    assert not of(bench.received, 'MISSION_REQUEST_INT')
    assert len(of(bench.received, 'MISSION_REQUEST')) == 4


def test_count_truncates_the_old_mission_at_once(bench):
    bench.load(waypoint(A), waypoint(B), waypoint(C))
    bench.count(2)
    assert len(bench.vehicle.mission.items) == 2


def test_each_item_overwrites_the_old_one_at_once(bench):
    bench.load(waypoint(A), waypoint(B))
    bench.count(3)
    bench.send(HOME)
    new = waypoint(C)
    new.seq = 1
    bench.send(new)
    bench.pass_time(10.0)  # it gives up
    assert [i.x for i in bench.download()[1:]] == [waypoint(C).x, waypoint(B).x]


def test_a_refused_item_leaves_a_mixed_mission(bench):
    bench.load(waypoint(A), waypoint(B))
    assert bench.upload([HOME, waypoint(C), item(d.MAV_CMD_DO_PARACHUTE)]).type == 3
    assert [i.x for i in bench.download()[1:]] == [waypoint(C).x, waypoint(B).x]


@pytest.mark.parametrize(('sent', 'read'), [(0, 0), (2, 0), (3, 3), (5, 0), (6, 3), (10, 10),
                                            (11, 10)])
def test_frames_read_back_as_their_plain_form(bench, sent, read):
    assert sent_back(bench, waypoint(A, frame=sent)).frame == read


@pytest.mark.parametrize('frame', [1, 4, 7, 8, 20])
def test_other_frames_are_refused(bench, frame):
    assert refusal(bench, waypoint(A, frame=frame)) == d.MAV_MISSION_UNSUPPORTED_FRAME


def test_frame_2_on_a_waypoint_is_an_absolute_altitude(bench):
    bench.load(waypoint(A, frame=2))
    x, y, z = bench.flight.point(bench.vehicle.mission.items[1])
    assert (x, y, z) == pytest.approx(A, abs=0.02)


def test_hold_is_cut_to_whole_seconds_and_yaw_and_radius_are_lost(bench):
    read = sent_back(bench, waypoint(A, p1=2.5, p2=7.0, p4=90.0))
    assert (read.param1, read.param2, read.param4) == (2.0, 0.0, 0.0)


def test_loiter_time_is_cut_to_whole_seconds(bench):
    assert sent_back(bench, item(d.MAV_CMD_NAV_LOITER_TIME, A, p1=3.7)).param1 == 3.0


@pytest.mark.parametrize(('command', 'sent', 'read'), [
    (d.MAV_CMD_NAV_LAND, {'p1': 2.5, 'p4': 0.0}, (2.0, 0.0, 0.0, 1.0)),
    (d.MAV_CMD_NAV_LAND, {'p4': -0.5}, (0.0, 0.0, 0.0, -1.0)),
    (d.MAV_CMD_NAV_LOITER_TIME, {'p1': 3.0}, (3.0, 0.0, 1.0, 0.0)),
    (d.MAV_CMD_NAV_LOITER_TIME, {'p3': -9.0, 'p4': 0.5}, (0.0, 0.0, -1.0, 1.0)),
    (d.MAV_CMD_NAV_LOITER_UNLIM, {'p1': 7.0, 'p3': -9.5}, (0.0, 0.0, -9.0, 0.0)),
])
def test_a_direction_is_kept_as_1_or_its_opposite(bench, command, sent, read):
    held = sent_back(bench, item(command, A, **sent))
    assert (held.param1, held.param2, held.param3, held.param4) == read


def test_a_direction_of_turning_and_the_time_of_a_delay_keep_their_sign(bench):
    turned = sent_back(bench, item(d.MAV_CMD_CONDITION_YAW, p1=90.0, p3=-1.0))
    assert (turned.param1, turned.param3) == (90.0, -1.0)
    delayed = sent_back(bench, item(d.MAV_CMD_NAV_DELAY, p1=0.5, p2=-1.0, p3=2.5, p4=30.0))
    assert (delayed.param1, delayed.param2, delayed.param3, delayed.param4) == (
        0.5, -1.0, 2.0, 30.0)


def test_altitude_is_kept_to_a_centimetre(bench):
    sent = waypoint(A, frame=3)
    sent.z = 30.127
    assert sent_back(bench, sent).z == pytest.approx(30.12, abs=1e-5)


def test_latitude_and_longitude_are_exact(bench):
    read, sent = sent_back(bench, waypoint(A)), waypoint(A)
    assert (read.x, read.y) == (sent.x, sent.y)


@pytest.mark.parametrize('command', [d.MAV_CMD_NAV_WAYPOINT, d.MAV_CMD_NAV_LAND,
                                     d.MAV_CMD_NAV_TAKEOFF])
def test_nan_is_taken_as_yaw(bench, command):
    assert refusal(bench, item(command, A, p4=NAN)) == d.MAV_MISSION_ACCEPTED


@pytest.mark.parametrize(('sent', 'result'), [
    (waypoint(A, p1=NAN), d.MAV_MISSION_INVALID_PARAM1),
    (waypoint(A, p2=NAN), d.MAV_MISSION_INVALID_PARAM2),
    (waypoint(A, p3=NAN), d.MAV_MISSION_INVALID_PARAM3),
    (item(d.MAV_CMD_NAV_LOITER_TIME, A, p4=NAN), d.MAV_MISSION_INVALID_PARAM4),
])
def test_nan_elsewhere_is_an_invalid_parameter(bench, sent, result):
    assert refusal(bench, sent) == result


def test_a_cancel_is_ignored(bench):
    bench.count(2)
    bench.send(d.MAVLink_mission_ack_message(1, 1, d.MAV_MISSION_OPERATION_CANCELLED, 0))
    assert of(bench.pass_time(1.5), 'MISSION_REQUEST')


def test_a_second_station_is_denied_during_an_upload(bench):
    bench.count(2)
    denied, = of(bench.count(2, station=(7, 7)), 'MISSION_ACK')
    assert (denied.type, denied.target_system) == (d.MAV_MISSION_DENIED, 7)


def test_a_readback_is_denied_during_an_upload(bench):
    bench.count(2)
    denied, = bench.send(d.MAVLink_mission_request_list_message(1, 1, 0), station=(7, 7))
    assert denied.type == d.MAV_MISSION_DENIED


def test_a_second_count_of_the_same_station_restarts_the_upload(bench):
    bench.count(3)
    bench.send(HOME)
    assert of(bench.count(2), 'MISSION_REQUEST')[-1].seq == 0


def test_it_repeats_the_request_every_second_and_cancels_after_eight(bench):
    bench.count(2)
    report = bench.pass_time(9.0)
    assert len(of(report, 'MISSION_REQUEST')) in (7, 8)
    ack, = of(report, 'MISSION_ACK')
    assert ack.type == d.MAV_MISSION_OPERATION_CANCELLED
    assert not of(bench.pass_time(5.0), 'MISSION_REQUEST', 'MISSION_ACK')


def test_an_item_out_of_turn_is_an_invalid_sequence_and_not_the_end(bench):
    bench.count(3)
    late = waypoint(A)
    late.seq = 2
    ack, = of(bench.send(late), 'MISSION_ACK')
    assert ack.type == d.MAV_MISSION_INVALID_SEQUENCE
    assert of(bench.send(HOME), 'MISSION_REQUEST')[0].seq == 1


def test_an_item_without_a_transfer_is_an_error(bench):
    ack, = bench.send(HOME)
    assert ack.type == d.MAV_MISSION_ERROR


def test_the_capacity_is_650_items(bench):
    assert bench.count(651)[0].type == d.MAV_MISSION_NO_SPACE
    assert of(bench.count(650), 'MISSION_REQUEST')


def test_there_is_no_mission_id(bench):
    bench.load(waypoint(A))
    assert plan_id(of(bench.received, 'MISSION_ACK')[-1]) == 0


def test_messages_for_another_system_are_ignored(bench):
    assert not bench.send(d.MAVLink_mission_count_message(2, 1, 3, 0))


def test_a_reboot_keeps_the_mission_and_forgets_the_transfer(bench):
    bench.load(waypoint(A), waypoint(B))
    before = [content(i) for i in bench.download()]
    bench.count(3)
    bench.vehicle.reboot(bench.now)
    assert not of(bench.pass_time(9.0), 'MISSION_REQUEST')
    assert [content(i) for i in bench.download()] == before
