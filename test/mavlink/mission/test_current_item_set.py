# SPDX-License-Identifier: Apache-2.0
"""A current item that we set: when it is sent again, and which reports are of before it."""
import pytest
from authority_bench import PX4
from findings_bench import flown_once_each, flying
from flight_bench import places
from mission_bench import OURS, task_list
from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.mavlink.mission.current_item_reports import CurrentItemReports


@pytest.mark.parametrize(('before', 'reported', 'plan', 'sent_again'), [
    (0, 2, 7, False), (0, 1, 7, False), (0, 0, 7, True), (1, 2, 7, False), (2, 2, 7, True),
    (2, 2, 8, False), (2, 0, 8, True)])  # the item before was one of another mission
def test_a_set_current_is_not_sent_again_once_a_later_item_is_reported(
        before, reported, plan, sent_again):
    executor, done = flying('px4', 'ABCD').executor(), []
    mission, sender = executor.telemetry.mission, executor.sender
    mission.current, mission.plan_id = before, 7
    assert sender.set_current(1, 100.0, done.append)
    mission.current, mission.current_at, mission.plan_id = reported, 100.5, plan
    assert bool(sender.finish(101.5)) is sent_again
    assert bool(done) is not sent_again


@pytest.mark.parametrize(('before', 'shows'), [(1, False), (0, True)])
def test_an_item_that_was_current_before_needs_the_ack_of_its_set_current(before, shows):
    executor, done = flying('ardupilot', 'ABCD').executor(), []
    mission, sender = executor.telemetry.mission, executor.sender
    mission.current = before
    assert sender.set_current(1, 100.0, done.append)
    mission.current, mission.current_at = 1, 100.5
    assert bool(sender.finish(101.5)) is not shows
    if not shows:
        ack = d.MAVLink_command_ack_message(d.MAV_CMD_DO_SET_MISSION_CURRENT, 0)
        ack.get_srcSystem, ack.get_srcComponent = (lambda: 1), (lambda: 1)
        sender.receive(ack)
        assert sender.finish(101.6) is None
    assert done


def test_a_command_is_repeated_only_after_all_messages_of_a_stall():
    executor, done = flying('px4', 'ABCD').executor(), []
    mission, sender = executor.telemetry.mission, executor.sender
    mission.current = 0
    assert sender.set_current(2, 100.0, done.append)
    sender.receive(d.MAVLink_system_time_message(0, 0))  # one that came before the answer
    assert sender.finish(101.5) == []
    assert sender.finish(101.52)
    mission.current, mission.current_at = 2, 101.6
    assert sender.finish(101.6) is None
    assert done == [101.6]


@pytest.mark.parametrize(('seq', 'frame', 'old'), [
    (3, 41, False), (3, 40, True), (3, None, True), (2, 40, False), (1, 41, True)])
def test_a_report_that_came_after_the_item_was_set_is_of_after_it(seq, frame, old):
    reports = CurrentItemReports()
    reports.begin(0, 100.0)
    reports.note_set(2, 100.0, 40)
    assert reports.is_old(seq, 101.0, frame) is old


@pytest.mark.parametrize(('id_at', 'old'), [(100.2, True), (100.6, False)])
def test_a_report_with_the_id_of_the_mission_taken_is_of_it(id_at, old):
    reports = CurrentItemReports()
    reports.begin(0, 100.0)
    reports.note_id(50, id_at)
    assert reports.is_old(3, id_at, 50) is old


@PX4
def test_what_was_flown_of_an_upload_that_is_sent_again_is_not_flown_twice(kind):
    bench = flying(kind, 'ABC')
    ended = d.MAVLink_mission_ack_message(*OURS, d.MAV_MISSION_ERROR)
    bench.line.tampers.append(lambda direction, m, now: [(0.0, ended)] if (
        m.get_type() == 'MISSION_ACK' and direction == 'down') else None)
    bench.assign(task_list('BCA', 2))
    assert bench.run(lambda: bench.onboard().upload.sent_all)
    bench.run(limit=2.0)  # its acceptance is lost, and an error of another transfer comes
    bench.line.tampers[:] = [lambda direction, m, now: [] if (
        m.get_type() == 'MISSION_COUNT' and direction == 'up') else None]
    assert bench.run(lambda: places(bench) == ['B'])
    bench.line.tampers.clear()
    flown_once_each(bench, 'ABC')
