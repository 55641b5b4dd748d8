# SPDX-License-Identifier: Apache-2.0
"""The upload machine against both simulated mission services, one fault of the list at a time."""
import pytest
from mission_bench import UploadBench, ack, drop, request, verified
from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.errors import MissionError
from uav_task_alloc.mavlink.mission import upload as machine
from uav_task_alloc.mavlink.mission.outcomes import Failed, Mission, Verified
from uav_task_alloc.mavlink.mission.upload_states import UploadState

BOTH = pytest.mark.parametrize('kind', ['ardupilot', 'px4'])


@BOTH
def test_a_clean_line_takes_one_round_trip_for_each_item(kind):
    bench = UploadBench(kind)
    mission = bench.replace(bench.mission('ABCDE'))
    verified(bench, mission)
    assert bench.now == 0.0
    assert len(bench.line.sent('MISSION_ITEM_INT')) == len(mission.items)


@BOTH
def test_fault_01_a_count_dropped_twice_is_sent_again(kind):
    bench = UploadBench(kind)
    bench.line.tampers.append(drop({'MISSION_COUNT'}, 2, 'up'))
    verified(bench, bench.replace(bench.mission()))
    assert len(bench.line.sent('MISSION_COUNT')) == 3


@BOTH
@pytest.mark.parametrize('lost', ['MISSION_REQUEST', 'MISSION_REQUEST_INT', 'MISSION_ITEM_INT'])
def test_fault_02_a_lost_request_or_item_is_requested_again_by_the_vehicle(kind, lost):
    bench = UploadBench(kind)
    bench.line.tampers.append(drop({lost}, 2))
    verified(bench, bench.replace(bench.mission()))
    items = bench.line.sent('MISSION_ITEM_INT')
    requested = (bench.line.sent('MISSION_REQUEST', 'down')
             + bench.line.sent('MISSION_REQUEST_INT', 'down'))
    assert len(items) <= len(requested)


@BOTH
def test_fault_03_a_lost_final_ack_is_replaced_by_the_readback(kind):
    bench = UploadBench(kind)
    bench.line.tampers.append(drop({'MISSION_ACK'}, 99, 'down'))
    verified(bench, bench.replace(bench.mission()))
    assert len(bench.line.sent('MISSION_COUNT')) == 1


def test_the_end_of_a_readback_is_sent_again_before_the_next_upload():
    bench = UploadBench('px4')
    bench.line.tampers.append(drop({'MISSION_ACK'}, 1, 'up'))
    verified(bench, bench.replace(bench.mission('AB')))
    bench.run(limit=0.5)
    verified(bench, bench.replace(bench.mission('CD')))
    assert {m.type for m in bench.line.sent('MISSION_ACK', 'down')} == {d.MAV_MISSION_ACCEPTED}


@BOTH
def test_fault_04_a_request_twice_gets_the_same_item_and_an_ack_twice_nothing(kind):
    bench = UploadBench(kind)

    def twice(direction, message, now):
        if direction == 'down' and message.get_type() in ('MISSION_REQUEST', 'MISSION_REQUEST_INT',
                                                    'MISSION_ACK'):
            return [(0.0, message), (0.0, message)]
        return None
    bench.line.tampers.append(twice)
    verified(bench, bench.replace(bench.mission()))
    assert sum(isinstance(e, Verified) for e in bench.events) == 1
    before = len(bench.line.log)
    bench.from_vehicle(ack(0))
    assert not bench.upload.busy
    assert len(bench.line.log) == before


@BOTH
def test_fault_05_a_late_request_of_an_earlier_item_is_answered(kind):
    bench = UploadBench(kind)
    bench.line.tampers.append(drop({'MISSION_ITEM_INT'}, 99, 'up'))
    bench.replace(bench.mission('ABCDE'))
    for seq in (0, 1, 2, 1):
        bench.from_vehicle(request(seq))
    assert [m.seq for m in bench.line.sent('MISSION_ITEM_INT')] == [0, 1, 2, 1]


@BOTH
@pytest.mark.parametrize('seed', range(50))
def test_fault_06_a_bad_line_ends_verified_or_in_an_honest_state(kind, seed):
    bench = UploadBench(kind, seed=seed, loss=0.2, delay=(0.0, 1.0))
    mission = bench.replace(bench.mission('ABCDEFGH'))
    last = bench.settle(600.0)
    assert isinstance(last, (Verified, Failed))
    if isinstance(last, Verified):
        assert bench.holds(mission)


@BOTH
def test_fault_07_a_request_back_to_zero_gets_the_whole_list_again(kind):
    bench = UploadBench(kind)
    bench.line.tampers.append(drop({'MISSION_ITEM_INT'}, 99, 'up'))
    mission = bench.replace(bench.mission('ABC'))
    n = len(mission.items)
    for seq in [*range(n - 1), *range(n)]:
        bench.from_vehicle(request(seq))
    assert [m.seq for m in bench.line.sent('MISSION_ITEM_INT')] == [*range(n - 1), *range(n)]


@BOTH
def test_fault_08_gaps_of_three_seconds_do_not_abort(kind):
    bench = UploadBench(kind)
    gaps = {0.0: 3.0}

    def pause(direction, message, now):
        cut_until = gaps.get('until', -1.0)
        if message.get_type() == 'MISSION_ITEM_INT' and message.seq == 2 and 'until' not in gaps:
            gaps['until'] = now + 3.0
            return []
        return [] if now < cut_until else None
    bench.line.tampers.append(pause)
    verified(bench, bench.replace(bench.mission('ABCDE')))
    assert len(bench.line.sent('MISSION_COUNT')) == 1


@BOTH
def test_fault_19_of_five_lists_during_an_upload_only_the_last_follows(kind):
    bench = UploadBench(kind, delay=(0.05, 0.05))
    bench.replace(bench.mission('ABC'))
    bench.run(limit=0.2)
    for names in ('A', 'AB', 'BC', 'CB'):
        bench.replace(bench.mission(names))
    last = bench.replace(bench.mission('CAB'))
    verified(bench, last)
    assert bench.upload.uploads == 2


@BOTH
def test_fault_26_no_nan_is_sent_but_as_the_yaw_of_a_waypoint_on_px4(kind):
    bench = UploadBench(kind)
    bench.replace(bench.mission('ABC', service=2.5))
    bench.settle()
    for m in bench.line.sent('MISSION_ITEM_INT'):
        values = [m.param1, m.param2, m.param3, m.z] + [m.param4] * (kind == 'ardupilot')
        assert all(v == v for v in values)


@BOTH
def test_fault_27_an_item_altered_on_board_is_detected_and_sent_again(kind):
    bench = UploadBench(kind)

    def alter(direction, message, now):
        if direction == 'down' and message.get_type() == 'MISSION_COUNT' and not altered:
            altered.append(1)
            items = bench.vehicle.mission.items
            items[-1] = items[-1]._replace(x=items[-1].x + 50)
        return None
    altered = []
    bench.line.tampers.append(alter)
    verified(bench, bench.replace(bench.mission(service=2.5)))
    assert bench.upload.uploads == 2


@BOTH
def test_a_late_answer_that_nothing_is_on_board_is_requested_again(kind):
    """It answers a request from before the upload."""
    bench = UploadBench(kind)
    mission = bench.mission()
    late = [True]

    def empty(direction, message, now):
        if direction == 'down' and message.get_type() == 'MISSION_COUNT' and late:
            late.clear()
            message.count = mission.own
        return None
    bench.line.tampers.append(empty)
    verified(bench, bench.replace(mission))
    assert bench.upload.uploads == 1


@BOTH
def test_an_upload_that_never_matches_ends_after_three_tries(kind):
    bench = UploadBench(kind)

    def alter(direction, message, now):
        if direction == 'down' and message.get_type() == 'MISSION_ITEM_INT':
            message.z += 1.0
        return None
    bench.line.tampers.append(alter)
    bench.replace(bench.mission())
    last = bench.settle()
    assert isinstance(last, Failed)
    assert 'given up after 3 tries; last event: readback differs' in last.reason
    assert bench.upload.uploads == 3


@BOTH
def test_a_dead_line_ends_after_five_counts(kind):
    bench = UploadBench(kind)
    bench.line.cut = True
    bench.replace(bench.mission())
    assert bench.settle().reason == 'no answer to 5 MISSION_COUNT'
    assert [round(t) for t, direction, _ in bench.line.log if direction == 'up'] == [0, 1, 2, 3, 4]


def test_an_empty_mission_is_refused_as_a_uav_would_lose_what_it_flies():
    with pytest.raises(MissionError, match='expected at least one'):
        Mission(())


def test_every_state_can_be_left():
    for state, row in machine.TRANSITIONS.items():
        assert row, state
        assert set(row.values()) - {state} or state is UploadState.IDLE
