# SPDX-License-Identifier: Apache-2.0
"""The download machine: repeated requests, and transfers that the vehicle ends."""
from mission_bench import OURS
from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.mavlink.mission.download import Download, DownloadState
from uav_task_alloc.mavlink.mission.peer import Peer


def stored_item(seq):
    return d.MAVLink_mission_item_int_message(
        *OURS, seq, 3, d.MAV_CMD_NAV_WAYPOINT, 0, 1, 0.0, 0.0, 0.0, 0.0, seq, 0, 30.0, 0)


def test_a_request_is_repeated_after_twice_the_time_of_an_answer():
    download = Download(Peer(1, 1, *OURS), 0.0)
    download.receive(d.MAVLink_mission_count_message(*OURS, 2), 0.2)
    assert download.step(0.5) == []
    assert [m.seq for m in download.step(0.61)] == [0]
    assert [m.seq for m in download.step(1.02)] == [0]


def test_a_readback_that_the_vehicle_has_ended_begins_again_at_once():
    download = Download(Peer(1, 1, *OURS), 0.0)
    ended = d.MAVLink_mission_ack_message(*OURS, d.MAV_MISSION_ERROR)
    assert download.receive(ended, 0.1) == []  # of an earlier transfer: the list is on its way
    again = []
    for n in range(20):
        download.receive(d.MAVLink_mission_count_message(*OURS, 3), 0.2 + n)
        again += download.receive(ended, 0.5 + n)
    assert {m.get_type() for m in again} == {'MISSION_REQUEST_LIST'}
    assert 1 < len(again) < 20


def test_a_readback_that_the_vehicle_has_ended_many_times_is_read_to_its_end():
    download, now = Download(Peer(1, 1, *OURS), 0.0), 0.0
    ended = d.MAVLink_mission_ack_message(*OURS, d.MAV_MISSION_ERROR)
    for _ in range(10):  # a request of two items before has come late
        download.receive(d.MAVLink_mission_count_message(*OURS, 3), now + 0.2)
        download.receive(stored_item(0), now + 0.4)
        assert [m.get_type() for m in download.receive(ended, now + 0.6)] == [
            'MISSION_REQUEST_LIST']
        now += 0.6
    download.receive(d.MAVLink_mission_count_message(*OURS, 3), now + 0.2)
    for seq in range(3):
        download.receive(stored_item(seq), now + 0.4)
    assert download.state is DownloadState.DONE
    assert [item.x for item in download.items] == [0, 1, 2]
