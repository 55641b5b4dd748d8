# SPDX-License-Identifier: Apache-2.0
"""What is flown during an upload, a cut or a restart of the bridge is known afterwards."""
import pytest
from authority_bench import ARDUPILOT, BOTH, MODES, PX4, flying
from findings_bench import (
    FindingsBench,
    distance,
    drop_messages,
    flown_once_each,
    set_current,
)
from flight_bench import places
from mission_bench import ORIGIN, OURS, task_list
from pymavlink.dialects.v20 import ardupilotmega as d
from test_findings_evidence import Flight

from uav_task_alloc.mavlink.autopilots import PX4 as PX4_PROFILE, ModeFunction
from uav_task_alloc.mavlink.mission.diff import DiffKind, MissionDiff
from uav_task_alloc.mavlink.mission.items import MissionStop, TaskList, mission_items
from uav_task_alloc.mavlink.mission.reports_during_upload import ReportsDuringUpload
from uav_task_alloc.mavlink.mission.verified_mission import MissionState
from uav_task_alloc.model import Task

AT_A = (0.0, 100.0, 50.0)


def drop_for(bench, seconds, *kinds):
    """The line loses these types on their way to the bridge."""
    end = bench.now + seconds
    for kind in kinds:
        drop_messages(bench, 'down', kind, lambda m: bench.now < end)


@PX4
@pytest.mark.parametrize('lost', [(), ('MISSION_ITEM_REACHED',)])
def test_a_task_reached_while_the_upload_is_not_confirmed_is_flown_once(kind, lost):
    bench = flying(kind, 'AB')
    drop_for(bench, 25.0, 'MISSION_ACK', 'MISSION_COUNT', *lost)
    bench.assign(task_list('ABCD', 2))
    assert bench.run(lambda: places(bench) == ['A'], 30.0)
    flown_once_each(bench, 'ABCD')


@PX4
@pytest.mark.parametrize(('event', 'after'), [('reboot', 1.0), ('kill', 8.0)])
def test_a_task_reached_before_a_mission_that_is_not_confirmed_is_lost_is_known(
        kind, event, after):
    bench = flying(kind, 'ABC')
    drop_for(bench, 60.0, 'MISSION_ACK', 'MISSION_COUNT')
    bench.assign(task_list('BCA', 2))
    assert bench.run(lambda: places(bench) == ['B'], 40.0)
    bench.run(limit=after)
    assert not bench.onboard().latest_upload.taken
    if event == 'kill':
        assert bench.completed() == ['B']
    else:
        bench.vehicles[1].reboot(bench.now)
        assert bench.run(lambda: bench.completed() == ['B'], 10.0)


@PX4
def test_a_task_reached_in_a_cut_while_the_upload_is_not_confirmed_is_flown_once(kind):
    bench = flying(kind, 'AB')
    drop_for(bench, 30.0, 'MISSION_ACK', 'MISSION_COUNT')
    bench.assign(task_list('ABCD', 2))
    bench.run(lambda: distance(bench, AT_A) < 12.0)
    bench.line.cut = True
    bench.run(limit=8.0)
    bench.line.cut = False
    assert places(bench) == ['A']
    flown_once_each(bench, 'ABCD')


@ARDUPILOT
def test_a_task_reached_as_the_vehicle_is_held_for_an_upload_is_flown_once(kind):
    bench = flying(kind, 'ABC', delay=(0.1, 0.1))
    bench.run(lambda: distance(bench, AT_A) < 3.0)
    bench.line.cut = True
    assert bench.run(lambda: places(bench) == ['A'], 5.0)
    bench.line.cut = False
    drop_messages(bench, 'down', 'MISSION_CURRENT',
                  lambda m: bench.onboard().state is not MissionState.UPLOADING)
    bench.assign(task_list('CAB', 2))
    assert bench.run(lambda: bench.onboard().state is MissionState.UPLOADING, 5.0)
    bench.line.tampers.clear()
    flown_once_each(bench, 'ABC')


@ARDUPILOT
def test_the_last_task_reached_as_the_vehicle_is_held_for_an_upload_is_flown_once(kind):
    bench = flying(kind, 'AB')
    assert bench.run(lambda: bench.completed() == ['A'])
    assert bench.run(lambda: distance(bench, AT_A) > 90.0)
    assert places(bench) == ['A']
    # MISSION_CURRENT is complete, and received once the mode is another
    for message in ('MISSION_CURRENT', 'MISSION_ITEM_REACHED'):
        drop_messages(bench, 'down', message,
                      lambda m: bench.executor().telemetry.mode is ModeFunction.MISSION)
    assert bench.run(lambda: places(bench) == ['A', 'B'])
    bench.line.delay = 0.3, 0.3
    bench.assign(task_list('CBD', 2))
    assert bench.run(lambda: bench.onboard().state is MissionState.UPLOADING, 5.0)
    bench.line.tampers.clear()
    flown_once_each(bench, 'ABCD')


@ARDUPILOT
def test_a_task_at_which_an_avoidance_ends_is_flown_once(kind):
    bench = flying(kind, 'AB')
    bench.run(lambda: distance(bench, AT_A) < 6.5)
    bench.vehicles[1].avoid(True)
    bench.run(limit=8.0)
    assert distance(bench, AT_A) < 2.0
    assert places(bench) == []
    bench.vehicles[1].avoid(False)
    # MISSION_CURRENT names the next item before a heartbeat shows the mode
    drop_for(bench, 1.5, 'HEARTBEAT', 'MISSION_ITEM_REACHED')
    flown_once_each(bench, 'AB')


@ARDUPILOT
def test_the_last_task_flown_for_a_pilot_in_a_cut_is_not_flown_again(kind):
    bench = flying(kind, 'ABC')
    bench.vehicles[1].rc_mode(MODES[kind].rtl)
    bench.run(limit=8.0)
    set_current(bench, 2)
    bench.vehicles[1].rc_mode(MODES[kind].mission)
    bench.run(limit=0.3)
    bench.line.cut = True
    assert bench.run(lambda: places(bench) == ['C'], 60.0)
    bench.run(limit=12.0)
    bench.line.cut = False
    bench.run(limit=10.0)
    bench.hand_over()
    flown_once_each(bench, 'ABC')


@ARDUPILOT
def test_a_complete_mission_that_begins_again_by_itself_is_stopped(kind):
    bench = flying(kind, 'AB')
    assert bench.run(lambda: bench.completed() == ['A', 'B'])
    bench.assign(task_list('', 2))
    bench.run(limit=5.0)
    bench.kill_and_restart(0.5)
    bench.assign(task_list('', 3))
    bench.run(limit=10.0)
    bench.vehicles[1].avoid(True)
    bench.run(limit=5.0)
    bench.vehicles[1].avoid(False)
    bench.run(limit=60.0)
    assert places(bench) == ['A', 'B']


@BOTH
@pytest.mark.parametrize(('seconds', 'dead'), [(0.0, 0.0), (0.3, 0.0), (0.6, 12.0)])
def test_an_item_skipped_just_before_the_bridge_is_killed_is_flown_later(kind, seconds, dead):
    bench = flying(kind, 'ABC')
    bench.run(lambda: distance(bench, AT_A) < 60.0)
    set_current(bench, 1)
    bench.run(limit=seconds)
    bench.kill_and_restart(dead)
    bench.assign(task_list('ABC', 2))
    flown_once_each(bench, 'ABC')


@BOTH
def test_items_skipped_while_the_mission_is_read_are_flown_later(kind):
    bench = flying(kind, 'ABCDE')
    bench.run(lambda: distance(bench, AT_A) < 60.0)
    bench.kill_and_restart(0.0)
    drop_for(bench, 6.0, 'MISSION_COUNT')
    bench.assign(task_list('ABCDE', 2))
    bench.run(limit=2.0)
    set_current(bench, 3 if places(bench) == [] else 4)
    flown_once_each(bench, 'ABCDE')


@BOTH
def test_a_task_at_which_it_was_seen_before_the_bridge_was_killed_is_flown_once(kind):
    bench = flying(kind, 'ABC')
    drop_for(bench, 15.0, 'MISSION_ITEM_REACHED')
    assert bench.run(lambda: places(bench) == ['A'])
    bench.kill_and_restart(0.0)
    bench.assign(task_list('ABC', 2))
    flown_once_each(bench, 'ABC')


@BOTH
@pytest.mark.parametrize('lost', [(), ('MISSION_ITEM_REACHED',)])
def test_a_task_reached_between_a_restart_and_a_reboot_is_flown_once(kind, lost):
    bench = flying(kind, 'ABC')
    bench.assign(task_list('ABC', 2, service=2.0))
    bench.run(lambda: distance(bench, AT_A) < 1.0)
    bench.run(limit=0.5)
    bench.kill_and_restart(0.0)
    drop_for(bench, 12.0, 'MISSION_COUNT', *lost)
    drop_for(bench, 2.5, 'EKF_STATUS_REPORT', 'ESTIMATOR_STATUS', 'GPS_RAW_INT')
    bench.assign(task_list('ABC', 3, service=2.0))
    assert bench.run(lambda: places(bench) == ['A'], 8.0)
    bench.run(limit=6.0)
    bench.vehicles[1].reboot(bench.now)
    assert bench.run(lambda: bench.completed() == ['A'], 60.0)


@PX4
def test_a_repetition_of_the_mission_before_the_one_on_board_completes_nothing(kind):
    bench = flying(kind, 'AB')
    assert bench.run(lambda: bench.completed() == ['A'])
    drop_for(bench, 9.0, 'MISSION_ACK', 'MISSION_COUNT')
    shift = task_list('XB', 2, side=100.0)
    bench.assign(TaskList(2, (MissionStop(Task('X', (3.0, 107.0, 50.0))), *shift.stops[1:])))
    bench.run(lambda: bench.vehicles[1].flight.seq == 0, 5.0)
    bench.kill_and_restart(0.0)
    bench.assign(TaskList(3, (MissionStop(Task('X', (3.0, 107.0, 50.0))), *shift.stops[1:])))
    assert bench.run(lambda: 'X' in bench.completed(), 60.0)
    assert any(round(point[1]) == 107 for point in bench.flown())


@PX4
def test_a_repetition_before_the_restart_does_not_complete_the_last_item(kind):
    bench = flying(kind, 'AB')
    assert bench.run(lambda: bench.completed() == ['A'])
    bench.assign(task_list('C', 2))
    assert bench.run(lambda: bench.started()[-1] == 'C', 10.0)
    bench.run(limit=1.0)
    bench.kill_and_restart(0.0)
    bench.assign(task_list('C', 3))
    assert bench.run(lambda: bench.completed() == ['C'], 60.0)
    assert places(bench) == ['A', 'C']


def items_at(**places):
    """Mission items of tasks by name, at x [m]."""
    return mission_items(TaskList(1, tuple(
        MissionStop(Task(name, (x, 0.0, 50.0))) for name, x in places.items())),
        PX4_PROFILE.rules, ORIGIN)


def upload_during(flight, **places):
    """Reports that are kept while another mission may be on board, and that mission."""
    return ReportsDuringUpload(flight.table, ORIGIN, True), MissionDiff(
        DiffKind.REPLACE, items_at(**places), 0)


def confirm(flight, reports, new, begin, plan=0):
    """The upload is confirmed: the vehicle may fly the new mission since `begin` [s]."""
    reports.sent_since = begin
    of_new = reports.begin_new(new)
    flight.table.begin(new.items, 0, flight.now, since=begin)
    reports.replay(of_new, plan)


def test_a_kept_reached_counts_however_far_the_vehicle_has_flown_since():
    flight = Flight()
    flight.begin(A=100.0, X=900.0)
    reports, new = upload_during(flight, B=600.0, C=900.0)
    flight.fly_to(100.0)
    reports.add_reached(0, flight.now, flight.frame())
    flight.fly_to(400.0)
    reports.begin_new(new)
    assert list(flight.table.completed) == ['A']


def test_a_kept_current_item_of_the_new_mission_counts():
    flight = Flight()
    flight.begin(A=900.0)
    begin = flight.now
    reports, new = upload_during(flight, B=100.0, C=300.0)
    reports.add_current(0, flight.now, flight.frame(), True, 7)
    flight.fly_to(100.0)
    flight.stay(0.2, 10.0)
    reports.add_current(1, flight.now, flight.frame(), True, 7)
    flight.fly_to(200.0)
    confirm(flight, reports, new, begin, 7)
    flight.stay(10.0)
    assert list(flight.table.completed) == ['B']


@pytest.mark.parametrize(('current', 'completed'), [(True, ['B']), (False, ['A'])])
def test_a_reached_is_of_the_item_that_was_current_until_then(current, completed):
    flight = Flight()
    flight.begin(A=100.0, X=900.0)
    begin = flight.now
    reports, new = upload_during(flight, B=160.0, C=900.0)
    flight.fly_to(130.0)
    if current:  # both missions are at their first item: A was passed, and not reached
        reports.add_current(0, flight.now, flight.frame(), True, 0)
    flight.fly_to(160.0)
    reports.add_reached(0, flight.now, flight.frame())
    confirm(flight, reports, new, begin)
    flight.fly_to(200.0)
    assert list(flight.table.completed) == completed


def test_a_current_item_of_the_old_mission_releases_the_reached_before_it():
    flight = Flight()
    flight.begin(A=100.0, X=900.0)
    reports, _ = upload_during(flight, B=600.0)
    flight.fly_to(100.0)
    frame = flight.frame()
    reports.add_reached(0, flight.now, frame)
    reports.release(frame - 1)
    assert list(flight.table.completed) == []
    reports.release(frame + 1)
    assert list(flight.table.completed) == ['A']


def test_a_hold_that_was_seen_in_part_is_over_when_the_mission_goes_on():
    flight = Flight()
    flight.begin(A=100.0, B=500.0)
    held = tuple(type(item)(**{**{name: getattr(item, name) for name in (
        'command', 'frame', 'x', 'y', 'z', 'task', 'completes', 'position', 'radius')},
        'params': (2.0, *item.params[1:])}) for item in flight.table.items)
    flight.table.retag(held)
    flight.fly_to(90.0)
    flight.now, flight.x = flight.now + 2.2, 100.0
    flight.stay(1.0)
    flight.table.note_current(1, flight.now, True)
    flight.fly_to(150.0)
    flight.stay(10.0)
    assert list(flight.table.completed) == ['A']


@pytest.mark.parametrize(('x', 'shown', 'completed'), [
    (90.0, True, []), (100.0, True, ['A']), (100.0, False, [])])
def test_a_reboot_at_the_place_of_the_current_item_completes_it(x, shown, completed):
    flight = Flight()
    flight.begin(A=100.0, B=500.0)
    flight.table.note_current(0, flight.now, True)
    flight.fly_to(x)
    if shown:  # mission mode: else a pilot may have taken it just before
        flight.table.note_in_mission(flight.frame())
    flight.table.invalidate()
    assert list(flight.table.completed) == completed


@PX4
def test_a_task_about_to_be_reached_is_flown_before_a_list_that_begins_elsewhere(kind):
    bench = flying(kind, 'ABC')
    assert bench.run(lambda: distance(bench, AT_A) < 12.0)
    bench.assign(task_list('CBA', 2))
    flown_once_each(bench, 'ABC')
    assert places(bench) == ['A', 'C', 'B']


@BOTH
def test_a_task_that_is_served_is_not_left_for_a_list_that_begins_elsewhere(kind):
    bench = FindingsBench(kind).discover()
    bench.assign(task_list('ABC', service=4.0))
    assert bench.run(lambda: distance(bench, AT_A) < 2.0)
    bench.run(limit=1.0)
    bench.assign(task_list('CBA', 2, service=4.0))
    flown_once_each(bench, 'ABC')
    assert places(bench) == ['A', 'C', 'B']


@PX4
def test_the_current_item_counts_in_an_upload_after_one_whose_readback_was_ended(kind):
    bench = flying(kind, 'ABC')
    assert bench.run(lambda: bench.completed() == ['A'])
    ended = d.MAVLink_mission_ack_message(*OURS, d.MAV_MISSION_ERROR)
    bench.line.tampers.append(lambda direction, m, now: [(0.0, m), (0.0, ended)] if (
        m.get_type() == 'MISSION_COUNT' and direction == 'down') else None)
    bench.assign(task_list('BCD', 2))
    assert bench.run(lambda: bench.onboard().verified())
    bench.line.tampers.clear()
    bench.line.tampers.append(lambda direction, m, now: [] if m.get_type() in (
        'MISSION_ITEM_INT', 'MISSION_ITEM_REACHED') else None)
    bench.assign(task_list('DCB', 3))
    assert bench.run(lambda: places(bench) == ['A', 'B'])
    assert bench.run(lambda: bench.completed() == ['A', 'B'], 8.0)
    assert bench.onboard().state is MissionState.UPLOADING
