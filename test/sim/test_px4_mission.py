# SPDX-License-Identifier: Apache-2.0
"""The mission service of the simulated PX4, quirk by quirk."""
import struct
import zlib

import pytest
from pymavlink.dialects.v20 import ardupilotmega as d
from vehicle_bench import NAN, Bench, content, item, of, waypoint

from uav_task_alloc.mavlink.transport.codec import plan_id

A, B, C = (100.0, 0.0, 30.0), (100.0, 100.0, 30.0), (0.0, 100.0, 30.0)
RTL = d.MAV_CMD_NAV_RETURN_TO_LAUNCH
REQUESTS = ('MISSION_REQUEST', 'MISSION_REQUEST_INT')


@pytest.fixture
def bench():
    return Bench('px4')


def test_seq_0_is_the_first_real_item(bench):
    bench.load(waypoint(A))
    assert bench.download()[0].x == waypoint(A).x


def test_total_is_65535_when_empty(bench):
    assert of(bench.pass_time(2.0), 'MISSION_CURRENT')[-1].total == 65535
    bench.load(waypoint(A), waypoint(B))
    assert of(bench.received, 'MISSION_CURRENT')[-1].total == 2


def test_only_the_first_request_of_the_first_upload_is_a_float_one(bench):
    bench.load(waypoint(A), waypoint(B))
    bench.load(waypoint(A), waypoint(B))
    assert [(m.get_type(), m.seq) for m in of(bench.received, *REQUESTS)] == [
        ('MISSION_REQUEST', 0), ('MISSION_REQUEST_INT', 1), ('MISSION_REQUEST_INT', 0),
        ('MISSION_REQUEST_INT', 1)]


def test_a_failed_upload_leaves_the_old_mission(bench):
    bench.load(waypoint(A), waypoint(B))
    bench.count(2)
    bench.send(waypoint(C))
    bench.pass_time(6.0)
    assert [i.x for i in bench.download()] == [waypoint(A).x, waypoint(B).x]


def test_a_refused_item_leaves_the_old_mission(bench):
    bench.load(waypoint(A))
    assert bench.upload([waypoint(B), waypoint(C, frame=10)]).type == 2
    assert [i.x for i in bench.download()] == [waypoint(A).x]


@pytest.mark.parametrize('frame', [0, 3, 5, 6])
def test_items_read_back_exactly_as_sent(bench, frame):
    sent = waypoint(A, frame=frame, p1=2.5, p2=3.25, p4=90.5)
    sent.z = 30.127
    bench.load(sent)
    read, = bench.download()
    assert content(read)[:8] == content(sent)[:8]
    assert read.z == struct.unpack('f', struct.pack('f', 30.127))[0]


def test_nan_is_kept(bench):
    bench.load(waypoint(A, p4=NAN), item(d.MAV_CMD_NAV_LOITER_TIME, B, p1=1.0, p4=NAN))
    assert all(i.param4 != i.param4 for i in bench.download())


@pytest.mark.parametrize('frame', [10, 11])
def test_terrain_frames_are_refused(bench, frame):
    ack = bench.upload([waypoint(A, frame=frame)])
    assert ack.type == d.MAV_MISSION_UNSUPPORTED_FRAME


def test_items_without_a_position_need_frame_2(bench):
    assert bench.upload([item(RTL, frame=3)]).type == d.MAV_MISSION_UNSUPPORTED
    assert bench.upload([item(RTL, frame=2)]).type == d.MAV_MISSION_ACCEPTED


def test_items_with_a_position_are_refused_in_frame_2(bench):
    assert bench.upload([waypoint(A, frame=2)]).type == d.MAV_MISSION_UNSUPPORTED


def test_a_cancel_ends_the_transfer(bench):
    bench.count(2)
    bench.send(d.MAVLink_mission_ack_message(1, 1, d.MAV_MISSION_OPERATION_CANCELLED, 0))
    assert not of(bench.pass_time(6.0), *REQUESTS)


def test_a_second_station_gets_no_answer_during_an_upload(bench):
    bench.count(2)
    bench.send(waypoint(A))
    answers = bench.count(2, station=(7, 7))
    assert not [m for m in answers if getattr(m, 'target_system', 7) == 7]


def test_a_second_count_in_mid_transfer_is_an_error_and_the_transfer_goes_on(bench):
    bench.count(2)
    bench.send(waypoint(A))
    ack, = of(bench.count(2), 'MISSION_ACK')
    assert ack.type == d.MAV_MISSION_ERROR
    last = waypoint(B)
    last.seq = 1
    assert of(bench.send(last), 'MISSION_ACK')[0].type == d.MAV_MISSION_ACCEPTED


def test_a_second_count_before_the_first_item_only_repeats_the_request(bench):
    bench.count(2)
    assert [m.seq for m in of(bench.count(2), *REQUESTS, 'MISSION_ACK')] == [0]


def test_it_repeats_the_request_four_times_a_second_and_gives_up_silently_after_five(bench):
    bench.count(2)
    report = bench.pass_time(4.9, step=0.02)
    assert 16 <= len(of(report, *REQUESTS)) <= 20
    bench.pass_time(0.3)
    assert not of(bench.pass_time(5.0), *REQUESTS, 'MISSION_ACK', 'STATUSTEXT')


def test_a_repeated_last_item_is_accepted_again(bench):
    bench.load(waypoint(A))
    ack, = bench.send(waypoint(A))
    assert ack.type == d.MAV_MISSION_ACCEPTED


def test_the_crc_of_the_items_is_sent_in_ack_count_and_current(bench):
    bench.load(waypoint(A), waypoint(B))
    crc = 0
    for sent in (waypoint(A), waypoint(B)):
        raw = struct.pack('<BHB4fiif', 0, 16, 1, 0, 0, 0, 0, sent.x, sent.y, sent.z)
        crc = zlib.crc32(raw, crc ^ 0xFFFFFFFF) ^ 0xFFFFFFFF
    bench.download()
    bench.pass_time(2.0)
    for kind in ('MISSION_ACK', 'MISSION_COUNT', 'MISSION_CURRENT'):
        assert plan_id(of(bench.received, kind)[-1]) == crc


def test_the_crc_differs_between_missions(bench):
    bench.load(waypoint(A))
    first = bench.vehicle.mission.mission_id
    bench.load(waypoint(B))
    assert bench.vehicle.mission.mission_id != first


def test_the_capacity_is_500_items(bench):
    assert bench.count(501)[0].type == d.MAV_MISSION_NO_SPACE
    assert of(bench.count(500), *REQUESTS)


def test_a_request_out_of_turn_ends_the_readback_with_an_error(bench):
    bench.load(waypoint(A), waypoint(B), waypoint(C))
    bench.send(d.MAVLink_mission_request_list_message(1, 1, 0))
    ack, = of(bench.send(d.MAVLink_mission_request_int_message(1, 1, 2, 0)), 'MISSION_ACK')
    assert ack.type == d.MAV_MISSION_ERROR


def test_a_count_while_it_is_read_back_is_an_error(bench):
    bench.load(waypoint(A), waypoint(B))
    bench.send(d.MAVLink_mission_request_list_message(1, 1, 0))
    assert of(bench.count(1), 'MISSION_ACK')[0].type == d.MAV_MISSION_ERROR
    bench.pass_time(6.0)
    assert of(bench.count(1), *REQUESTS)


def test_a_reboot_keeps_the_mission_and_its_id(bench):
    bench.load(waypoint(A))
    before = bench.vehicle.mission.mission_id
    bench.vehicle.reboot(bench.now)
    assert bench.download()[0].x == waypoint(A).x
    assert bench.vehicle.mission.mission_id == before
