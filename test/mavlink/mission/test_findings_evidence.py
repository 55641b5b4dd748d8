# SPDX-License-Identifier: Apache-2.0
"""What is evidence that a task was flown, and what is not; found by flights at random."""
import pytest
from authority_bench import BOTH, MODES, PX4, H, L, S, flying, sends_no_command, status_is
from evidence_bench import SPEED, Flight
from findings_bench import distance, drop_messages, flown_once_each, set_current
from flight_bench import Store, places
from mission_bench import ORIGIN, REPORTS_STATE, task_list
from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.mavlink.autopilots import PX4 as PX4_PROFILE
from uav_task_alloc.mavlink.mission.flown_path import FlownPath, PositionSample
from uav_task_alloc.mavlink.mission.items import (
    MissionStop,
    TaskList,
    mission_items,
    with_position,
)
from uav_task_alloc.mavlink.mission.position_history import PositionHistory
from uav_task_alloc.model import Task


def repeated_over_two_uploads():
    """PX4 repeats REACHED of A while two more missions come; 8 m from B it turns to C."""
    flight = Flight()
    flight.begin(A=100.0, X=900.0)
    flight.fly_to(100.0)
    flight.reached(0)
    flight.begin(B=128.0, X=900.0)
    for _ in range(2):
        flight.stay(1.0, SPEED)
        flight.reached(0)
    flight.begin(C=500.0, X=900.0)
    flight.stay(1.0)
    flight.reached(0)
    return flight


def test_a_repetition_over_two_uploads_completes_nothing_of_the_second():
    assert list(repeated_over_two_uploads().table.completed) == ['A']


def test_lost_positions_do_not_make_a_repetition_a_new_reached():
    flight = Flight()
    flight.begin(A=100.0, X=900.0)
    flight.fly_to(100.0)
    flight.reached(0)
    flight.begin(B=128.0, X=900.0)
    for _ in range(2):
        flight.stay(1.0, SPEED)
        flight.reached(0)
    flight.stay(0.2)
    flight.begin(C=500.0, X=900.0)
    flight.lost = True
    flight.stay(0.8)
    flight.reached(0)
    flight.lost = False
    flight.stay(10.0)
    assert list(flight.table.completed) == ['A']


def test_the_first_repetition_may_come_at_once():
    flight = Flight()
    flight.begin(A=100.0, X=900.0)
    flight.fly_to(100.0)
    flight.reached(0)
    flight.stay(0.2)
    flight.begin(B=109.0, X=900.0)
    flight.stay(0.2)
    flight.reached(0)
    flight.table.note_current(1, flight.now, True)  # set by another station
    flight.stay(10.0)
    assert list(flight.table.completed) == ['A']


def test_a_repetition_at_the_place_of_an_item_that_stays_current_completes_nothing():
    flight = Flight()
    flight.begin(A=100.0, X=900.0)
    flight.fly_to(100.0)
    flight.reached(0)
    flight.begin(X=500.0, Y=900.0)
    flight.stay(1.0, SPEED)
    flight.reached(0)
    flight.stay(0.8, SPEED)
    flight.begin(B=120.0, Y=900.0)
    flight.table.note_current(0, flight.now, True, flight.frame())
    flight.stay(0.2, SPEED)
    flight.reached(0)
    flight.stay(10.0, SPEED)
    assert list(flight.table.completed) == ['A']


def test_a_reached_after_the_end_of_the_repetitions_counts():
    flight = repeated_over_two_uploads()
    flight.fly_to(500.0)
    flight.reached(0)
    flight.table.note_current(1, flight.now, True)
    flight.stay(1.0)
    assert list(flight.table.completed) == ['A', 'C']


@pytest.mark.parametrize('flying', [True, False])
def test_a_place_passed_before_its_item_can_have_been_current_was_not_reached(flying):
    flight = Flight()
    flight.begin(A=200.0, B=100.0, C=900.0)
    flight.table.note_in_mission()
    flight.fly_to(150.0)
    flight.table.note_current(0, flight.now, True, flight.frame())
    flight.fly_to(190.0)
    if not flying:
        flight.table.note_mission_left(flight.now)
    flight.table.note_current(2, flight.now, flying, flight.frame())
    flight.stay(20.0)
    assert list(flight.table.completed) == []


def test_a_reboot_does_not_lose_what_the_positions_have_shown():
    flight = Flight()
    flight.begin(A=100.0, B=500.0)
    flight.fly_to(100.0)
    flight.table.note_current(1, flight.now, True)
    flight.fly_to(110.0)
    flight.table.invalidate()
    assert list(flight.table.completed) == ['A']


@pytest.mark.parametrize(('place', 'completed'), [(93.0, ['A']), (60.0, [])])
def test_a_reboot_just_after_a_task_was_passed_between_two_positions_keeps_it(place, completed):
    flight = Flight()
    flight.begin(A=100.0, B=500.0)
    flight.table.note_current(0, flight.now, True, flight.frame())
    flight.fly_to(place)
    flight.lost = True
    flight.stay(0.6, SPEED)
    flight.table.note_current(1, flight.now, True)
    flight.stay(0.2, SPEED)
    flight.table.invalidate()
    assert list(flight.table.completed) == completed


def test_a_task_passed_without_positions_counts_where_the_vehicle_is_seen_again():
    flight = Flight(repeats=False)
    flight.begin(A=100.0, B=500.0)
    flight.fly_to(60.0)
    flight.lost = True  # the estimate is invalid for a while
    flight.fly_to(110.0)
    flight.table.note_current(1, flight.now, True, flight.frame())
    flight.fly_to(250.0)
    assert list(flight.table.completed) == []
    flight.lost = False
    flight.stay(1.0, SPEED)
    assert list(flight.table.completed) == ['A']


def test_a_place_passed_after_its_mission_was_replaced_was_not_reached_by_that_mission():
    flight = Flight()
    flight.begin(A=108.0, X=900.0)
    flight.fly_to(50.0)
    flight.begin(B=200.0, X=900.0)
    flight.fly_to(100.0)
    flight.lost = True  # the estimate is invalid
    flight.stay(1.0)
    flight.reached(0)
    flight.lost = False
    flight.stay(0.2)
    assert list(flight.table.completed) == []


def test_where_it_flies_after_it_has_left_the_mission_is_no_evidence():
    flight = Flight()
    flight.begin(A=100.0, B=500.0, C=900.0)
    flight.fly_to(50.0)
    flight.table.note_mission_left(flight.now)
    flight.fly_to(150.0)  # over A, on its way home
    flight.table.note_current(2, flight.now, False)
    flight.stay(10.0)
    assert list(flight.table.completed) == []


@pytest.mark.parametrize('current_first', [True, False])
@pytest.mark.parametrize(('silence', 'completed'), [(8.0, ['A']), (3.0, [])])
def test_a_task_passed_in_silence_in_which_the_mission_was_left_was_flown_if_it_can_have_been(
        silence, completed, current_first):
    flight = Flight()
    flight.begin(A=100.0, B=500.0, C=900.0)
    flight.table.note_in_mission()
    flight.table.note_current(0, flight.now, True, flight.frame())
    flight.fly_to(50.0)
    flight.lost = True
    flight.stay(silence)
    flight.x, flight.lost = 20.0, False  # it returns
    if current_first:
        flight.table.note_current(1, flight.now, True, flight.frame())
        flight.stay(0.4, -SPEED)
        flight.table.note_mission_left(flight.now)
    else:
        flight.table.note_mission_left(flight.now)
        flight.stay(0.4, -SPEED)
        flight.table.note_current(1, flight.now, False, flight.frame())
    flight.stay(10.0)
    assert list(flight.table.completed) == completed


@pytest.mark.parametrize(('seconds', 'shown', 'completed'), [
    (1.6, True, []), (2.2, True, ['A']), (2.2, False, [])])
def test_a_reboot_before_a_service_is_over_completes_nothing(seconds, shown, completed):
    flight = Flight()
    flight.begin(A=100.0, B=500.0, service=1.85)
    flight.table.note_in_mission()
    flight.table.note_current(0, flight.now, True, flight.frame())
    flight.fly_to(100.0)
    flight.stay(seconds)
    if shown:  # mission mode: else a pilot may have taken it meanwhile
        flight.table.note_in_mission(flight.frame())
    flight.table.invalidate()
    assert list(flight.table.completed) == completed


def test_the_end_of_a_mission_in_silence_is_known_when_the_link_is_back():
    bench = flying('px4', 'AB', configs=REPORTS_STATE)
    assert bench.run(lambda: len(bench.completed()) == 1)
    assert bench.run(lambda: distance(bench, (100.0, 100.0, 50.0)) < 15.0)
    bench.line.cut = True
    assert bench.run(lambda: len(places(bench)) == 2)
    bench.run(limit=15.0)  # it repeats REACHED for 10 s
    bench.line.cut = False
    assert bench.run(lambda: bench.completed() == ['A', 'B'], 20.0)


def test_where_it_comes_to_rest_when_it_is_held_for_an_upload_is_no_evidence():
    place = (0.0, 100.0, 50.0)
    bench = flying('ardupilot', 'ABC')
    assert bench.run(lambda: distance(bench, place) < 6.0)
    drop_messages(bench, 'up', 'MISSION_COUNT', lambda m: True)
    bench.assign(task_list('CBA', 2))
    bench.run(limit=8.0)
    assert distance(bench, place) < 1.0
    assert places(bench) == []
    bench.vehicles[1].reboot(bench.now)
    assert bench.run(lambda: 'was restarted' in bench.notes)
    bench.run(limit=3.0)
    assert bench.completed() == []


@pytest.mark.parametrize(('frame', 'place', 'plane', 'completed'), [
    (0, 50.0, False, []), (1, 50.0, False, ['B']), (1, 200.0, False, []),
    (1, 200.0, True, ['B']), (1, 600.0, True, [])])
def test_a_reached_sent_after_the_mission_was_taken_has_to_be_possible(
        frame, place, plane, completed):
    """A plane may pass a corner 300 m wide of it."""
    flight = Flight(repeats=False, plane=plane)
    flight.begin(A=100.0)
    taken = flight.frames.note(9, flight.now)
    flight.begin(B=place)
    flight.table.note_reached(0, flight.now, frame=taken + frame)
    flight.stay(10.0)
    assert list(flight.table.completed) == completed


def test_frames_that_are_missing_are_not_sent_at_once():
    positions = PositionHistory()
    for n in range(50):
        positions.add(PositionSample(0.2 * n, (0.0, 0.0, 50.0), (0.0, 0.0, 0.0)), True, 0.2 * n,
                      4 * n)
    assert positions.at_once(196, 200)
    assert not positions.at_once(196, 500)


def test_an_item_that_was_read_has_the_position_that_it_was_sent_with():
    sent, = mission_items(TaskList(1, (MissionStop(Task('A', (300.0, 400.0, 50.0))),)),
                          PX4_PROFILE.rules, ORIGIN)
    read = type(sent)(sent.command, sent.frame, sent.x, sent.y, sent.z, sent.params)
    assert with_position(read, ORIGIN).position == pytest.approx((300.0, 400.0, 50.0), abs=0.05)


@BOTH
def test_a_current_item_set_on_the_ground_while_no_bridge_ran_completes_nothing(kind):
    bench = flying(kind, 'ABCD')
    flown_once_each(bench, 'ABCD')
    bench.vehicles[1].rc_mode(MODES[kind].rtl)
    assert bench.run(lambda: bench.vehicles[1].flight.landed
                     and not bench.vehicles[1].flight.armed, 200.0)
    assert bench.hand_over() == ''
    bench.policy = bench.executor().policy = type(bench.policy)(takeoff=False)
    bench.assign(task_list('EFGH', 2))
    bench.run(limit=10.0)
    set_current(bench, 3)
    bench.kill_and_restart(2.0)
    bench.assign(task_list('EFGH', 3))
    bench.run(limit=20.0)
    assert bench.completed() == []


@BOTH
def test_an_item_skipped_before_the_mission_is_read_is_flown_later(kind):
    bench = flying(kind, 'ABCDE')
    bench.kill_and_restart(0.5)
    begin = bench.now
    drop_messages(bench, 'down', 'MISSION_COUNT', lambda m: bench.now < begin + 4.0)
    bench.assign(task_list('ABCDE', 2))
    bench.run(limit=2.0)
    assert places(bench) == []
    set_current(bench, 3)
    flown_once_each(bench, 'ABCDE')


@BOTH
def test_a_reached_before_the_mission_is_read_counts_when_the_vehicle_reboots_then(kind):
    bench = flying(kind, 'ABC')
    bench.run(lambda: distance(bench, (0.0, 100.0, 50.0)) < 25.0)
    bench.kill_and_restart(0.0)
    begin = bench.now
    drop_messages(bench, 'down', 'MISSION_COUNT', lambda m: bench.now < begin + 12.0)
    bench.assign(task_list('ABC', 2))
    assert bench.run(lambda: places(bench) == ['A'], 11.0)
    bench.run(limit=0.5)
    bench.vehicles[1].reboot(bench.now)
    assert bench.run(lambda: bench.completed() == ['A'], 60.0)


@PX4
@pytest.mark.parametrize('seconds', [0.0, 2.0])
def test_a_mode_that_nothing_has_explained_is_not_accepted_by_a_restarted_bridge(kind, seconds):
    bench = flying(kind, 'A')
    bench.vehicles[1].rc_mode(MODES[kind].rtl)
    assert bench.run(lambda: bench.authority() is not H, 3.0)
    assert bench.authority() is S
    bench.kill_and_restart(seconds)
    bench.run(limit=1.0)
    assert status_is(bench, L)
    assert sends_no_command(bench, names='ABC')


@PX4
def test_a_task_of_a_mission_that_a_restarted_bridge_has_read_needs_no_reached(kind):
    bench = flying(kind, 'ABC')
    drop_messages(bench, 'down', 'MISSION_ITEM_REACHED', lambda m: len(places(bench)) < 2)
    bench.kill_and_restart(0.0, store=False)
    bench.assign(task_list('ABC', 2))
    assert bench.run(lambda: bench.executor().onboard.resume.located, 10.0)
    drop_messages(bench, 'up', 'MISSION_COUNT', lambda m: not places(bench))
    bench.assign(task_list('CAB', 3))
    assert bench.run(lambda: places(bench), 60.0)
    flown_once_each(bench, 'ABC')


@PX4
def test_a_current_item_set_during_an_upload_and_a_restart_completes_nothing(kind):
    bench = flying(kind, 'ABC')
    drop_messages(bench, 'down', 'MISSION_COUNT', lambda m: bench.now < end)
    end = bench.now + 8.0
    bench.assign(task_list('DEFG', 2))
    assert bench.run(lambda: len(bench.vehicles[1].flight.items) == 4, 8.0)
    bench.run(limit=0.5)
    bench.kill_and_restart(0.0)
    set_current(bench, 2)
    bench.assign(task_list('DEFG', 3))
    flown_once_each(bench, 'DEFG')


@BOTH
def test_an_item_skipped_before_the_first_heartbeat_completes_nothing(kind):
    bench = flying(kind, 'ABCD')
    own = bench.onboard().own
    bench.store = Store()
    bench.start()
    drop_messages(bench, 'down', 'HEARTBEAT', lambda m: bench.now < begin + 3.0)
    begin = bench.now
    bench.run(limit=1.5)
    bench.from_station(d.MAVLink_mission_set_current_message(1, 1, own + 2))
    bench.discover()
    bench.assign(task_list('ABCD', 2))
    flown_once_each(bench, 'ABCD')


@pytest.mark.parametrize(('speed', 'later', 'flown'), [
    (8.0, -2.0, False),  # it turns around: that takes longer
    (15.0, -15.0, True)])
def test_a_place_near_a_turn_was_not_reached_in_a_gap_too_short_to_fly_there(speed, later, flown):
    path = FlownPath()
    path.add(PositionSample(0.0, (0.0, 0.0, 50.0), (speed, 0.0, 0.0)))
    path.add(PositionSample(2.6, (8.0, 0.0, 50.0), (later, 0.0, 0.0)))
    assert path.could_have_flown(
        [(26.0, 0.0, 50.0)], (-300.0, 0.0, 50.0), 0.0, 0.0) is flown


@pytest.mark.parametrize(('y', 'flown'), [
    (0.0, False), (6.0, False), (11.5, True), (17.0, True)])  # it turns at y = 15
def test_beside_a_leg_on_the_inner_side_of_the_turn_it_may_have_flown_straight(y, flown):
    path = FlownPath()
    path.add(PositionSample(0.0, (-150.0, 0.0, 50.0), (15.0, 0.0, 0.0)))
    path.add(PositionSample(12.0, (30.0, y, 50.0), (15.0, 0.0, 0.0)))
    assert path.could_have_flown(
        [(0.0, 15.0, 50.0)], (150.0, 0.0, 50.0), 0.0, 0.0) is flown
