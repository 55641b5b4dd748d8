# SPDX-License-Identifier: Apache-2.0
"""What is still to be judged when the bridge is killed, or another mission is read, is known."""
from types import SimpleNamespace

import pytest
from authority_bench import ARDUPILOT, BOTH, MODES, PX4, flying
from evidence_bench import Flight
from findings_bench import distance, drop_messages, flown_once_each, happened, set_current
from flight_bench import places
from mission_bench import REPORTS_STATE, task_list
from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.mavlink.autopilots import ModeFunction
from uav_task_alloc.mavlink.gcs.unread_reports import UnreadReports
from uav_task_alloc.mavlink.mission.flown_path import FlownPath, PositionSample
from uav_task_alloc.mavlink.mission.item import Item
from uav_task_alloc.mavlink.mission.items import MissionStop, TaskList
from uav_task_alloc.mavlink.mission.position_history import PositionHistory
from uav_task_alloc.mavlink.mission.verified_mission import MissionState
from uav_task_alloc.mavlink.transport.codec import Codec
from uav_task_alloc.model import Task

AT_A, SPEED = (0.0, 100.0, 50.0), 10.0  # [m/s]


@PX4
def test_a_task_of_a_mission_that_was_read_and_is_not_the_uploaded_one_is_flown_once(kind):
    bench, uploads = flying(kind, 'AB'), []

    def tamper(direction, m, now):
        if direction == 'up' and m.get_type() == 'MISSION_COUNT':
            uploads.append(now)
        if direction != 'up' or m.get_type() not in ('MISSION_COUNT', 'MISSION_ITEM_INT'):
            return None
        if len(uploads) > 1:
            return []
        if m.get_type() == 'MISSION_ITEM_INT' and m.seq == 2:
            m.z += 20.0
        return [(0.0, m)]
    bench.line.tampers.append(tamper)
    bench.assign(task_list('ABCD', 2))
    assert bench.run(lambda: places(bench) == ['A', 'B'], 60.0)
    assert bench.onboard().stored is not MissionState.VERIFIED
    assert bench.run(lambda: bench.completed() == ['A', 'B'], 10.0)
    bench.line.tampers.clear()
    flown_once_each(bench, 'ABCD')


@BOTH
@pytest.mark.parametrize('seconds', [0.4, 3.0])
def test_a_task_passed_in_a_cut_in_which_the_mission_was_left_survives_a_kill(kind, seconds):
    bench = flying(kind, 'ABC')
    bench.run(lambda: distance(bench, AT_A) < 45.0)
    bench.line.cut = True
    assert bench.run(lambda: places(bench) == ['A'], 20.0)
    bench.run(limit=0.4)
    bench.vehicles[1].failsafe('ekf', MODES[kind].land)
    drop_messages(bench, 'down', 'MISSION_ITEM_REACHED', lambda m: places(bench) == ['A'])
    bench.run(limit=4.0)
    bench.line.cut = False
    assert bench.run(lambda: bench.onboard().progress.pending, 5.0)
    bench.run(limit=seconds)
    bench.kill_and_restart(0.0)
    bench.assign(task_list('ABC', 2))
    bench.vehicles[1].failsafe_over()
    assert bench.run(lambda: not bench.executor().telemetry.airborne, 30.0)
    bench.run(limit=8.0)
    bench.hand_over()
    flown_once_each(bench, 'ABC')


@BOTH
@pytest.mark.parametrize('failsafe', ['radio', 'ekf'])  # without a position
@pytest.mark.parametrize('flown', [True, False])
def test_a_task_passed_in_a_cut_in_which_the_bridge_was_killed_and_the_mission_left_is_known(
        kind, flown, failsafe):
    bench = flying(kind, 'ABC')
    bench.run(lambda: distance(bench, AT_A) < 20.0)
    bench.line.cut = True
    if flown:
        assert bench.run(lambda: places(bench) == ['A'], 20.0)
    bench.run(limit=0.4)
    bench.vehicles[1].failsafe(failsafe, MODES[kind].land)
    bench.run(limit=4.0)
    bench.line.cut = False
    bench.kill_and_restart(0.0)
    bench.assign(task_list('ABC', 2))
    bench.run(limit=25.0)
    assert bench.onboard().resume.located is (failsafe == 'radio' or not flown)
    bench.vehicles[1].failsafe_over()
    bench.run(limit=8.0)
    assert not bench.executor().telemetry.airborne
    assert bench.completed() == ['A'] * flown
    bench.hand_over()
    flown_once_each(bench, 'ABC')


@BOTH
@pytest.mark.parametrize('place', ['after', 'at'])
def test_tasks_passed_at_once_survive_a_kill_before_they_are_judged(kind, place):
    bench = flying(kind, 'ABC')
    bench.run(lambda: distance(bench, AT_A) < 45.0)
    lost = []
    if place == 'after':
        bench.line.cut = True
    drop_messages(bench, 'down', 'MISSION_ITEM_REACHED', lambda m: True)
    drop_messages(bench, 'down', 'MISSION_CURRENT', lambda m: not lost)
    assert bench.run(lambda: places(bench) == ['A', 'B'], 60.0)
    bench.run(limit=2.0)
    bench.line.cut = False
    lost.append(True)
    assert bench.run(lambda: bench.onboard().progress.pending, 5.0)
    bench.run(limit=2.0)
    bench.kill_and_restart(0.0)
    bench.line.tampers.clear()
    bench.vehicles[1].failsafe('ekf', MODES[kind].land)
    bench.run(limit=4.0)
    bench.vehicles[1].failsafe_over()
    bench.assign(task_list('ABC', 2))
    assert bench.run(lambda: not bench.executor().telemetry.airborne, 30.0)
    bench.run(limit=8.0)
    bench.hand_over()
    flown_once_each(bench, 'ABC')


@PX4
@pytest.mark.parametrize(('state', 'name', 'completed'), [
    (d.MISSION_STATE_COMPLETE, None, ['A', 'B']), (d.MISSION_STATE_ACTIVE, None, ['A']),
    (None, 1, ['A', 'B']), (None, 0, ['A'])])
def test_an_end_reported_just_before_a_reboot_counts_where_it_comes_after_it(
        kind, state, name, completed):
    bench = flying(kind, 'AB')
    assert bench.run(lambda: bench.completed() == ['A'])
    for lost in ('MISSION_ITEM_REACHED', 'MISSION_CURRENT'):
        drop_messages(bench, 'down', lost, lambda m: True)
    assert bench.run(lambda: places(bench) == ['A', 'B'])
    bench.run(limit=0.8)
    bench.vehicles[1].reboot(bench.now)
    bench.run(limit=2.0)
    late = d.MAVLink_mission_current_message(1, 2, state, 2) if name is None else (
        d.MAVLink_mission_item_reached_message(name))
    bench.line.tampers.clear()
    bench.ground_station.receive(1, Codec(1, 1).parse(Codec(1, 1).pack(late))[0], bench.now)
    bench.run(limit=2.0)
    assert bench.completed() == completed


@PX4
@pytest.mark.parametrize('reported', [True, False])
def test_an_end_reported_just_before_a_reboot_counts_where_no_reached_came(kind, reported):
    bench = flying(kind, 'AB', configs=REPORTS_STATE)
    assert bench.run(lambda: bench.completed() == ['A'])
    drop_messages(bench, 'down', 'MISSION_ITEM_REACHED', lambda m: True)
    drop_messages(bench, 'down', 'MISSION_CURRENT', lambda m: not reported and (
        m.mission_state == d.MISSION_STATE_COMPLETE))
    assert bench.run(lambda: places(bench) == ['A', 'B'])
    bench.run(limit=0.8)
    bench.vehicles[1].reboot(bench.now)
    bench.run(limit=4.0)
    assert bench.completed() == ['A', 'B'][:1 + reported]


def test_a_vehicle_without_a_position_has_the_usual_speed():
    assert FlownPath().fastest == 15.0


@pytest.mark.parametrize('back', [False, True])
@pytest.mark.parametrize(('after', 'shown', 'completed'), [
    (0.0, True, ['B']), (0.4, True, []), (0.0, False, [])])
def test_a_mode_and_a_current_item_of_a_restart_do_not_hide_the_place_of_before(
        after, shown, completed, back):
    flight = Flight()
    flight.begin(A=50.0, B=100.0, C=500.0)
    flight.table.note_set_current(1, flight.now)
    flight.table.note_in_mission()
    flight.table.note_current(1, flight.now, True, flight.frame())
    flight.fly_to(100.0)
    if shown:  # else a pilot may have taken it just before
        flight.table.note_in_mission(flight.frame())
    flight.table.note_mission_left(flight.now)
    if after:  # a pilot has taken it
        flight.stay(after)
    if back:
        flight.table.note_current(0, flight.now, False, flight.frame())
    flight.table.invalidate()
    assert list(flight.table.completed) == completed


@pytest.mark.parametrize(('seconds', 'completed'), [(0.6, ['A']), (4.0, [])])
def test_what_stays_current_after_a_place_was_passed_is_not_flown_as_another_station_skips_it(
        seconds, completed):
    flight = Flight(repeats=False)
    flight.begin(A=100.0, B=500.0, C=900.0)
    flight.table.note_in_mission()
    flight.table.note_current(0, flight.now, True, flight.frame())
    flight.fly_to(98.5)
    for _ in range(round(5 * seconds)):
        flight.stay(0.2, SPEED)
        if flight.now < 9.8 + seconds:
            flight.table.note_current(0, flight.now, True, flight.frame())
    flight.table.note_mission_left(flight.now)  # it came late
    flight.table.note_current(2, flight.now, False, flight.frame())
    flight.stay(20.0)
    assert list(flight.table.completed) == completed


@PX4
def test_a_reached_received_while_the_mission_was_read_again_is_no_evidence_after_a_reboot(kind):
    bench = flying(kind, 'AB')
    assert bench.run(lambda: distance(bench, AT_A) < 10.0)
    drop_messages(bench, 'down', 'MISSION_COUNT', lambda m: True)
    bench.onboard().mission.reset()
    assert bench.run(lambda: bench.completed() == ['A'], 10.0)
    bench.run(limit=1.0)
    bench.line.tampers.clear()
    assert bench.run(lambda: bench.onboard().held is not None, 20.0)
    bench.assign(TaskList(2, tuple(MissionStop(Task(name, place)) for name, place in (
        ('X', (3.0, 107.0, 50.0)), ('B', (100.0, 100.0, 50.0))))))
    assert bench.run(lambda: bench.started()[-1] == 'X', 10.0)
    bench.vehicles[1].reboot(bench.now)
    bench.run(limit=12.0)
    assert bench.completed() == ['A']


@ARDUPILOT
def test_a_mission_that_ended_before_its_appended_items_came_is_started_after_a_kill(kind):
    bench = flying(kind, 'AB')
    assert bench.run(lambda: places(bench) == ['A'])
    bench.run(lambda: distance(bench, (100.0, 100.0, 50.0)) < 20.0)
    drop_messages(bench, 'up', 'MISSION_ITEM_INT',
                  lambda m: m.seq > 2 and not happened(bench, 'mission_end'))
    bench.assign(task_list('BCD', 2))
    assert bench.run(lambda: len(bench.vehicles[1].flight.items) == 5, 40.0)
    bench.kill_and_restart(0.0)
    bench.assign(task_list('CD', 3))
    assert bench.run(lambda: bench.completed()[-2:] == ['C', 'D'], 60.0)
    assert places(bench) == list('ABCD')


@ARDUPILOT
@pytest.mark.parametrize('metres', [16.0, 45.0])
def test_a_reached_before_the_first_position_is_of_a_place_from_which_it_can_have_flown_since(
        kind, metres):
    bench, at_b = flying(kind, 'ABCD'), (100.0, 100.0, 50.0)
    assert bench.run(lambda: places(bench) == ['A'])
    bench.run(lambda: distance(bench, at_b) < 10.0)
    bench.kill_and_restart(0.0, store=False)
    drop_messages(bench, 'down', 'GLOBAL_POSITION_INT',
                  lambda m: len(places(bench)) == 1 or distance(bench, at_b) < metres)
    drop_messages(bench, 'down', 'MISSION_COUNT', lambda m: distance(bench, at_b) < 60.0)
    bench.assign(task_list('BCD', 2))
    assert bench.run(lambda: distance(bench, at_b) > 60.0, 30.0)
    bench.run(limit=4.0)
    assert 'B' in bench.completed()


def items_at(*places):
    """A waypoint at each x [m]."""
    return tuple(Item(d.MAV_CMD_NAV_WAYPOINT, d.MAV_FRAME_GLOBAL_INT, 0, 0, 50.0,
                      position=(x, 0.0, 50.0), radius=2.0) for x in places)


@pytest.mark.parametrize(('metres', 'seconds', 'after', 'known'), [
    (45.0, 4.0, 1, True),
    (75.0, 4.0, 1, False),  # too far for its speed
    (45.0, 4.0, 2, False),  # another station has set the current item
    (45.0, 11.0, 1, False),
])
def test_a_position_of_long_after_a_reached_counts_where_the_current_items_agree(
        metres, seconds, after, known):
    telemetry = SimpleNamespace(has_position=False, position=(metres, 0.0, 50.0), speed=10.0,
                                in_mission=True, mode=ModeFunction.MISSION,
                                mission=SimpleNamespace(state=d.MISSION_STATE_ACTIVE, total=3))
    reports = UnreadReports(telemetry, PositionHistory(), repeats=False)
    reports.note_current(0, 0.0, 1, located=False)
    reports.note_reached(0, 1.0, 2)
    reports.note_current(after, 1.5, 3, located=False)
    telemetry.has_position = True
    taken = reports.take_reached(items_at(0.0, 0.0, 0.0), None, 1.0 + seconds)
    assert [each.seq for each in taken] == [0] * known


@BOTH
@pytest.mark.parametrize('read_first', [True, False])
def test_a_task_passed_before_a_reboot_is_known_though_the_mission_was_read_after_it(
        kind, read_first):
    bench, rebooted = flying(kind, 'ABC'), []
    bench.run(lambda: distance(bench, AT_A) < 15.0)
    bench.kill_and_restart(0.0, store=False)

    def noticed():
        return any('was restarted' in note for note in bench.notes)

    def lose(direction, m, now):
        if m.get_type() == 'MISSION_ITEM_INT':
            return None if rebooted and (read_first or noticed()) else []
        late = read_first and rebooted and bench.onboard().held is None
        return [] if m.get_type() == 'MISSION_ITEM_REACHED' or (
            late and hasattr(m, 'time_boot_ms')) else None
    bench.line.tampers.append(lose)
    bench.assign(task_list('ABC', 2))
    assert bench.run(lambda: places(bench) == ['A'], 20.0)
    bench.run(limit=2.0)
    assert bench.onboard().held is None
    assert bench.completed() == []
    bench.vehicles[1].reboot(bench.now)
    rebooted.append(bench.now)
    assert bench.run(lambda: bench.completed() == ['A'], 40.0)
    assert noticed() is not read_first


@ARDUPILOT
@pytest.mark.parametrize('names', ['A', 'AB'])
def test_a_task_reached_without_a_position_while_its_mission_is_not_read_is_known(kind, names):
    bench = flying(kind, names)
    bench.run(lambda: distance(bench, AT_A) < 10.0)
    bench.vehicles[1].failsafe('ekf', None)
    bench.run(limit=0.2)
    bench.kill_and_restart(0.0)
    bench.assign(task_list(names, 2))
    assert bench.run(lambda: places(bench) == ['A'], 20.0)
    bench.run(limit=1.0)
    if names == 'A':  # it was the last one
        bench.vehicles[1].rc_mode(MODES[kind].rtl)
    bench.run(limit=6.0)
    assert bench.completed() == []
    bench.vehicles[1].failsafe_over()
    assert bench.run(lambda: bench.completed() == ['A'], 10.0)


def test_a_mission_taken_before_the_first_position_after_a_reboot_counts_by_its_new_clock():
    flight = Flight()
    flight.table.positions.add_recorded(PositionSample(500.0, (0.0, 0.0, 50.0), (0.0, 0.0, 0.0)))
    flight.begin(since=500.0, A=100.0, B=900.0)  # by the clock of before the reboot
    flight.fly_to(100.0)
    flight.table.note_current(1, flight.now, True, flight.frame())
    flight.stay(0.2)
    flight.begin(C=300.0, B=900.0)
    flight.stay(0.4, SPEED)
    flight.reached(0)  # repeated; the first one was lost
    flight.stay(12.0, SPEED)
    assert list(flight.table.completed) == ['A']


def test_the_clock_of_a_reboot_drops_no_positions_that_came_since_the_bridge_was_restarted():
    flight = Flight()
    flight.table.positions.clear()
    flight.table.positions.add_recorded(PositionSample(20.0, (0.0, 0.0, 50.0), (0.0, 0.0, 0.0)))
    flight.now = 20.0
    flight.begin(A=100.0, B=900.0)
    flight.table.note_current(0, flight.now, True, flight.frame())
    flight.fly_to(101.0)
    flight.table.note_current(1, flight.now, True, flight.frame())
    flight.stay(0.4, SPEED)
    flight.table.add_position(  # the first one of after the reboot, which is not noticed yet
        PositionSample(3.0, (105.0, 0.0, 0.0), (0.0, 0.0, 0.0)), True, flight.now, flight.frame())
    flight.table.invalidate()
    assert list(flight.table.completed) == ['A']


@ARDUPILOT
def test_a_reboot_completes_no_task_of_an_upload_that_was_made_again_after_a_restart(kind):
    bench = flying(kind, 'ABC')
    bench.assign(task_list('ABC', 2, service=4.0))
    assert bench.run(lambda: distance(bench, AT_A) < 1.0)
    bench.run(limit=1.5)
    for message, seconds in (
            ('MISSION_ITEM_REACHED', 5.0), ('MISSION_REQUEST', 5.0), ('MISSION_COUNT', 9.0)):
        drop_messages(bench, 'down', message, lambda m, end=bench.now + seconds: bench.now < end)
    bench.assign(task_list('DEA', 3))
    assert bench.run(lambda: bench.onboard().state is MissionState.UPLOADING, 5.0)
    bench.kill_and_restart(0.0)
    bench.run(limit=2.0)
    set_current(bench, 2)
    bench.run(limit=2.0)
    bench.assign(task_list('DEA', 4))
    assert bench.run(lambda: bench.onboard().verified(), 60.0)
    bench.run(limit=4.0)
    bench.vehicles[1].reboot(bench.now)  # it falls
    bench.run(limit=30.0)
    assert places(bench) == ['A']
    assert set(bench.completed()) <= {'A'}
