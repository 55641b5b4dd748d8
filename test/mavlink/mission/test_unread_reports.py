# SPDX-License-Identifier: Apache-2.0
"""A REACHED received before the mission was read: is it of the mission on board?"""
from types import SimpleNamespace

import pytest
from pymavlink.dialects.v20 import ardupilotmega as d
from test_findings_kills import items_at

from uav_task_alloc.mavlink.autopilots import ModeFunction
from uav_task_alloc.mavlink.gcs.unread_reports import UnreadReports
from uav_task_alloc.mavlink.mission.flown_path import PositionSample
from uav_task_alloc.mavlink.mission.position_history import PositionHistory
from uav_task_alloc.mavlink.transport.frame_log import FrameLog


def reports_of(place, repeats):
    """Reports of a vehicle in mission mode that stands at a place."""
    telemetry = SimpleNamespace(has_position=True, position=place, speed=0.0, in_mission=True,
                                mission=SimpleNamespace(state=d.MISSION_STATE_ACTIVE, total=3),
                                mode=ModeFunction.MISSION)
    history = PositionHistory()
    history.add(PositionSample(1.0, place, (0.0, 0.0, 0.0)), True, 1.0, 1)
    return UnreadReports(telemetry, history, repeats)


@pytest.mark.parametrize(('x', 'current', 'known'), [
    (100.0, 1, True),
    (110.0, 1, False),  # not at the item: a repetition of another mission
    (100.0, 0, False)])  # another item was current
def test_a_last_task_reached_just_before_the_mission_is_read_is_known(x, current, known):
    reports = reports_of((x, 0.0, 50.0), repeats=True)
    reports.note_current(current, 1.0, 2, located=False)
    reports.note_reached(1, 2.0, 3)
    taken = reports.take_reached(items_at(0.0, 100.0), None, 2.0)
    assert [each.seq for each in taken] == [1] * known


@pytest.mark.parametrize(('x', 'recorded', 'known'), [
    (100.0, 1, True),
    (130.0, 1, False),  # far from the item
    (100.0, 0, False),  # another item was flown
    (100.0, None, False)])
def test_a_last_task_reached_before_a_reboot_and_a_restart_at_once_is_known(x, recorded, known):
    reports = reports_of((x, 0.0, 50.0), repeats=False)
    reports.note_reached(1, 1.2, 2)  # sent before the reboot
    reports.note_current(0, 1.4, 3, located=False)
    taken = reports.take_reached(items_at(0.0, 100.0), recorded, 2.0)
    assert [each.seq for each in taken] == [1] * known


@pytest.mark.parametrize(('first_at', 'lost', 'current', 'known'), [
    (0.9, False, 2, True),
    (1.1, False, 2, False),  # may repeat a REACHED of a mission before
    (0.9, True, 2, False),  # as well: what was lost may have been its repetition
    (0.9, False, 1, False)])
def test_the_first_reached_of_a_px4_without_a_position_is_known_by_the_current_items(
        first_at, lost, current, known):
    reports = reports_of((0.0, 0.0, 0.0), repeats=True)
    telemetry = reports._telemetry
    telemetry.has_position, telemetry.frames = False, FrameLog()
    for frame in (1, 2, 4, 5) if lost else (1, 2, 3, 4, 5):
        telemetry.frames.note(frame, 0.4 * frame)
    reports.note_current(1, first_at, 1, located=False)
    reports.note_reached(1, 2.0, 4)
    reports.note_current(current, 2.1, 5, located=False)
    telemetry.has_position, telemetry.position = True, (105.0, 0.0, 50.0)
    taken = reports.take_reached(items_at(0.0, 100.0, 200.0), None, 8.0)
    assert [each.seq for each in taken] == [1] * known


@pytest.mark.parametrize(('current', 'known'), [(2, True), (1, False)])
def test_a_task_reached_without_a_position_just_before_a_reboot_is_known_by_the_current_items(
        current, known):
    reports = reports_of((0.0, 0.0, 0.0), repeats=False)
    reports._telemetry.has_position = False
    reports.note_reached(1, 1.0, 2)
    reports.note_current(current, 1.2, 3, located=False)
    reports.restarted(located=False)
    reports._telemetry.has_position = True  # where it has fallen down
    reports.note_current(0, 3.5, 4, located=False)
    taken = reports.take_reached(items_at(0.0, 100.0, 200.0), 1, 4.0)
    assert [each.seq for each in taken] == [1] * known


@pytest.mark.parametrize(('x', 'known'), [(200.0, True), (150.0, False)])
def test_the_last_item_of_a_px4_is_known_though_a_pilot_begins_the_mission_again(x, known):
    reports = reports_of((x, 0.0, 50.0), repeats=True)
    reports.note_current(2, 1.0, 1, located=False)
    reports.note_reached(2, 1.2, 2)
    reports.note_current(0, 9.0, 3, located=False)
    taken = reports.take_reached(items_at(0.0, 100.0, 200.0), 2, 12.0)
    assert [each.seq for each in taken] == [2] * known


@pytest.mark.parametrize(('total', 'repeats', 'known'), [
    (3, True, True),
    (4, True, False),  # its mission was replaced after that
    (4, False, True)])
def test_a_reached_before_the_mission_has_another_number_of_items_is_of_the_one_before(
        total, repeats, known):
    reports = reports_of((100.0, 0.0, 50.0), repeats)
    reports.note_current(1, 0.5, 2, located=False)
    reports.note_reached(1, 1.0, 3)
    reports._telemetry.mission.total = total
    reports.note_current(2, 1.5, 4, located=False)
    taken = reports.take_reached(items_at(0.0, 100.0, 200.0, 300.0), None, 2.0)
    assert [each.seq for each in taken] == [1] * known
