# SPDX-License-Identifier: Apache-2.0
"""Gaps that are no evidence, and ends that begin again; found by flights at random."""
import pytest
from authority_bench import BOTH, flying
from evidence_bench import SPEED, Flight

from uav_task_alloc.mavlink.mission.flown_path import FlownPath, PositionSample, Visit


def on_first_leg(x, repeats=True, **tasks):
    """A flight in mission mode that has come to x [m], towards the first of the tasks."""
    flight = Flight(repeats=repeats)
    flight.begin(**tasks)
    flight.table.note_in_mission(flight.frame())
    flight.table.note_current(0, flight.now, True, flight.frame())
    flight.fly_to(x)
    return flight


@pytest.mark.parametrize(('left_at', 'known'), [(97.0, False), (99.0, True)])
def test_a_gap_after_the_mission_was_left_is_no_evidence(left_at, known):
    flight = on_first_leg(30.0, A=100.0, B=500.0)
    flight.lost = True
    flight.stay(3.0, SPEED)
    flight.lost = False
    flight.fly_to(left_at)
    flight.table.note_other_mode(flight.now)
    flight.stay(0.2, 5.0 * (100.0 - left_at))
    flight.lost = True
    flight.stay(14.0)
    flight.lost = False
    flight.stay(1.0)
    flight.table.note_current(1, flight.now, False, flight.frame())
    flight.stay(8.0)
    assert ('A' in flight.table.completed) is known


@pytest.mark.parametrize('gap_first', [True, False])
def test_a_position_at_the_end_of_a_gap_shows_where_it_was(gap_first):
    path, still = FlownPath(), (0.0, 0.0, 0.0)
    path.add(PositionSample(10.0, (0.0, 0.0, 50.0), still))
    path.add(PositionSample(20.0, (60.0, 0.0, 50.0), still))
    there, elsewhere = ((0.0, 60.0) if gap_first else (60.0, 0.0))
    since, until = (5.0, 15.0) if gap_first else (15.0, 25.0)
    assert path.visited((there, 1.0, 50.0), 2.0, 0.0, since, until) is Visit.YES
    assert path.visited((elsewhere, 1.0, 50.0), 2.0, 0.0, since, until) is Visit.UNOBSERVED
    assert path.visited((30.0, 0.0, 50.0), 2.0, 0.0, since, until) is Visit.UNOBSERVED


@pytest.mark.parametrize(('reports', 'current'), [(1, 2), (2, 0)])
def test_a_mission_that_begins_again_after_its_end_is_known_by_the_second_report(reports, current):
    flight = Flight()
    flight.begin(A=100.0, B=200.0)
    flight.table.note_in_mission(flight.frame())
    for seq, x in enumerate((100.0, 200.0)):
        flight.table.note_current(seq, flight.now, True, flight.frame())
        flight.fly_to(x)
        flight.reached(seq)
    assert flight.table.finished
    for _ in range(reports):
        flight.stay(1.0)
        flight.table.note_current(0, flight.now, True, flight.frame())
    assert flight.table.current == current


@pytest.mark.parametrize(('flew', 'completed'), [(True, ['A']), (False, [])])
def test_a_report_sent_before_the_mission_was_left_shows_that_it_was_flown_until_then(
        flew, completed):
    flight = Flight(repeats=False)
    flight.begin(A=101.0, B=200.0)
    flight.fly_to(96.0)
    flight.table.note_current(0, flight.now, True, flight.frame())
    flight.fly_to(98.0)
    report = flight.frame()
    flight.table.note_other_mode(flight.now)  # its ACK has overtaken the report
    flight.fly_to(100.0)
    flight.table.note_current(1, flight.now, False, report, flew=flew)
    flight.stay(8.0)
    assert list(flight.table.completed) == completed


@pytest.mark.parametrize(('left', 'late', 'completed'), [
    (97.0, 0.0, ['A']),  # the place by the positions on both sides of the change of mode
    (97.0, 2.0, []),  # another station may have set the current item since
    (90.0, 0.0, [])])
def test_an_item_reached_just_as_the_bridge_holds_the_vehicle_is_known(left, late, completed):
    flight = Flight(repeats=False)
    flight.begin(A=100.0, B=500.0)
    flight.fly_to(left)
    flight.table.note_current(0, flight.now, True, flight.frame())
    flight.table.note_other_mode(flight.now)  # by its ACK
    flight.stay(0.2, SPEED)
    flight.stay(0.2, 0.5 * SPEED)
    if late:
        flight.stay(late)
    flight.table.note_current(1, flight.now, False, flight.frame())
    flight.lost = True
    flight.stay(10.0)
    assert list(flight.table.completed) == completed


@pytest.mark.parametrize(('seconds', 'completed'), [(10.0, ['A']), (60.0, [])])
def test_an_item_passed_without_a_position_since_waits_for_the_next_one(seconds, completed):
    """An ArduPilot in an EKF failsafe goes on with its mission; it has no valid position."""
    flight = on_first_leg(85.0, repeats=False, A=100.0, B=150.0)
    flight.lost = True
    flight.stay(1.8, SPEED)  # less than a gap
    flight.table.note_current(1, flight.now, True, flight.frame())
    flight.stay(min(seconds, 8.0), 5.0)
    assert not flight.table.skipped
    flight.stay(max(seconds - 8.0, 0.0))
    flight.lost = False
    flight.stay(1.0)
    assert list(flight.table.completed) == completed
    assert list(flight.table.skipped) == ([] if completed else ['A'])


@pytest.mark.parametrize('repeats', [True, False])
@pytest.mark.parametrize(('x', 'seq', 'completed'), [
    (94.0, 0, ['A']), (94.0, 1, []), (60.0, 0, [])])
def test_a_reached_that_a_reboot_overtakes_counts_where_the_vehicle_came_there(
        repeats, x, seq, completed):
    flight = on_first_leg(x, repeats=repeats, A=100.0, B=200.0)
    flight.table.invalidate()
    flight.now += 0.2
    flight.reached(seq)
    assert list(flight.table.completed) == completed


def test_a_place_passed_in_another_mode_is_no_evidence_for_what_a_station_skips_later():
    flight = on_first_leg(60.0, A=100.0, B=500.0)
    flight.table.note_other_mode(flight.now)
    flight.fly_to(110.0)
    flight.fly_to(60.0)
    flight.table.note_current(0, flight.now, False, flight.frame())
    flight.table.note_in_mission(flight.frame())
    flight.stay(0.4, SPEED)
    flight.table.note_current(1, flight.now, True, flight.frame())
    flight.stay(8.0)
    assert not flight.table.completed


def test_a_position_of_a_restart_that_is_not_noticed_yet_hides_no_task_passed_before():
    flight = on_first_leg(102.0, A=100.0, B=500.0)
    flight.table.note_current(1, flight.now, True, flight.frame())
    flight.now += 0.2
    flight.table.add_position(PositionSample(0.1, (102.0, 0.0, 0.0), (0.0, 0.0, 0.0)), True,
                              flight.now, flight.frames.note(round(20 * flight.now), flight.now))
    flight.table.invalidate()
    assert list(flight.table.completed) == ['A']


@BOTH
def test_a_position_of_before_a_reboot_that_comes_after_it_is_dropped(kind):
    bench = flying(kind, 'AB')
    bench.run(limit=10.0)
    late = bench.line.sent('GLOBAL_POSITION_INT', 'down')[-1]
    bench.vehicles[1].reboot(bench.now)
    assert bench.run(lambda: bench.onboard().progress.path.newest < 5.0, 5.0)
    bench.run(limit=1.0)
    bench.from_vehicle(late)
    bench.run(limit=1.0)
    assert bench.onboard().progress.path.newest < 10.0


def test_a_position_that_comes_after_the_mode_of_a_restart_hides_no_place_of_before():
    flight = on_first_leg(100.0, A=100.0, B=500.0)
    flight.table.note_in_mission(flight.frame())
    late = PositionSample(flight.now + 0.2, (100.0, 0.0, 50.0), (0.0, 0.0, 0.0))
    flight.now += 1.0
    flight.table.note_mission_left(flight.now)  # by a heartbeat of after the restart
    flight.table.add_position(late, True, flight.now, flight.frame())
    flight.table.invalidate()
    assert list(flight.table.completed) == ['A']
