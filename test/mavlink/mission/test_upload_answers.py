# SPDX-License-Identifier: Apache-2.0
"""What the upload machine makes of requests and answers that it did not hope for."""
import pytest
from mission_bench import UploadBench, ack, drop, request, verified
from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.mavlink.mission.upload_states import UploadState

BOTH = pytest.mark.parametrize('kind', ['ardupilot', 'px4'])


@BOTH
def test_fault_09_a_request_beyond_the_end_is_cancelled_and_started_again(kind):
    bench = UploadBench(kind)
    bench.line.tampers.append(drop({'MISSION_COUNT'}, 1, 'up'))
    mission = bench.replace(bench.mission())
    bench.from_vehicle(request(77))
    assert bench.upload.state is UploadState.DRAINING
    assert bench.line.sent('MISSION_ACK')[0].type == 15
    verified(bench, mission)
    assert bench.now >= (5.0 if kind == 'px4' else 8.0)


@BOTH
@pytest.mark.parametrize(('message', 'source'), [
    (request(0, system=99), (1, 1)), (request(0, component=7), (1, 1)),
    (request(0, mission_type=1), (1, 1)), (request(0), (2, 1)), (request(0), (1, 2)),
    (ack(4, mission_type=2), (1, 1)), (ack(4), (3, 1))])
def test_fault_10_what_is_not_for_us_is_ignored(kind, message, source):
    bench = UploadBench(kind)
    bench.line.tampers.append(drop({'MISSION_COUNT'}, 99, 'up'))
    bench.replace(bench.mission())
    bench.from_vehicle(message, *source)
    assert bench.upload.state is UploadState.COUNTING
    assert bench.line.sent('MISSION_ITEM_INT') == []


@BOTH
def test_fault_12_an_old_request_is_answered_with_an_int_item(kind):
    bench = UploadBench(kind)
    mission = bench.replace(bench.mission())
    bench.from_vehicle(d.MAVLink_mission_request_message(245, 190, 0, 0))
    verified(bench, mission)
    assert bench.line.sent('MISSION_REQUEST', 'down')
    assert bench.line.sent('MISSION_ITEM') == []


@BOTH
def test_fault_13_invalid_sequence_midway_is_not_final(kind):
    bench = UploadBench(kind)
    bench.line.tampers.append(drop({'MISSION_ITEM_INT'}, 1, 'up'))
    mission = bench.replace(bench.mission())
    bench.from_vehicle(ack(13))
    verified(bench, mission)
    assert len(bench.line.sent('MISSION_COUNT')) == 1


NAKS = [*range(1, 13), 14, 15]


@BOTH
@pytest.mark.parametrize('when', ['start', 'middle', 'end'])
@pytest.mark.parametrize('result', NAKS)
def test_fault_14_each_nak_has_the_effect_of_the_table(kind, result, when):
    bench = UploadBench(kind)
    bench.line.tampers.append(drop({'MISSION_COUNT', 'MISSION_ITEM_INT'}, 9999, 'up'))
    mission = bench.replace(bench.mission('ABCDE'))
    requested = {'start': 0, 'middle': 3, 'end': len(mission.items)}[when]
    for seq in range(requested):
        bench.from_vehicle(request(seq))
    bench.from_vehicle(ack(result))
    bench.run(limit=0.1)
    expected = {1: UploadState.GRACE, 14: UploadState.BACKOFF, 15: UploadState.COUNTING}.get(
        result, UploadState.IDLE
    )
    assert bench.upload.state is expected
    if expected is UploadState.IDLE:
        failed = bench.events[-1]
        assert failed.result == result
        assert failed.seq == (requested - 1 if requested else None)
        assert len(bench.line.sent('MISSION_COUNT')) == 1
    else:
        bench.line.tampers.clear()
        verified(bench, mission)


@pytest.mark.parametrize(('kind', 'counts'), [('ardupilot', 1), ('px4', 2)])
def test_after_all_items_an_error_of_ardupilot_is_read_back_not_sent_again(kind, counts):
    bench = UploadBench(kind)
    bench.line.tampers.append(drop({'MISSION_ACK'}, 1, 'down'))
    mission = bench.replace(bench.mission())
    assert bench.run(lambda: bench.upload.sent_all, 5.0)
    bench.from_vehicle(ack(1))  # ArduPilot: to a late copy of an item, with no transfer open
    verified(bench, mission)
    assert len(bench.line.sent('MISSION_COUNT')) == counts


@BOTH
def test_fault_15_denied_backs_off_eight_seconds_or_more_with_jitter(kind):
    waits = set()
    for seed in range(3):
        bench = UploadBench(kind, seed=seed)
        bench.line.tampers.append(drop({'MISSION_COUNT'}, 1, 'up'))
        mission = bench.replace(bench.mission())
        bench.from_vehicle(ack(14))
        verified(bench, mission)
        waits.add(bench.now)
        assert bench.now >= 8.0
    assert len(waits) == 3


@BOTH
def test_fault_16_an_early_accepted_is_no_success(kind):
    bench = UploadBench(kind)
    bench.line.tampers.append(drop({'MISSION_COUNT', 'MISSION_ITEM_INT'}, 3, 'up'))
    mission = bench.replace(bench.mission('ABCDE'))
    bench.from_vehicle(request(0))
    bench.from_vehicle(ack(0))
    assert bench.events == []
    verified(bench, mission)
    assert bench.line.sent('MISSION_REQUEST_LIST')
