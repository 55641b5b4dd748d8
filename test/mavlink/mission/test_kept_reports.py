# SPDX-License-Identifier: Apache-2.0
"""Reports that are kept during an upload are judged once each, by the items that were on board."""
import pytest
from authority_bench import MODES, PX4, flying
from evidence_bench import Flight
from findings_bench import distance, drop_messages, flown_once_each
from flight_bench import places
from mission_bench import task_list
from test_findings_uploads import AT_A, confirm, upload_during

from uav_task_alloc.mavlink.gcs.authority_state import AuthorityState
from uav_task_alloc.mavlink.mission.reports_during_upload import ReportsDuringUpload


def test_each_kept_reached_is_judged_once_while_an_upload_takes_long(monkeypatch):
    flight, judged = Flight(), []
    credit = ReportsDuringUpload._credit_old
    monkeypatch.setattr(ReportsDuringUpload, '_credit_old', lambda self, reached, *rest: (
        judged.append(reached.seq), credit(self, reached, *rest))[1])
    flight.begin(A=100.0, B=200.0, X=900.0)
    reports, new = upload_during(flight, C=600.0, D=900.0)
    for seq in range(2):
        flight.fly_to(100.0 * (seq + 1))
        reports.add_reached(seq, flight.now, flight.frame())
        for _ in range(100):
            flight.stay(0.2)
            reports.step(new, flight.now)
    assert judged == [0, 1]


def test_a_repetition_that_began_before_an_upload_is_not_of_its_mission():
    flight = Flight()
    flight.begin(A=50.0, X=900.0)
    flight.fly_to(50.0)
    flight.reached(0)
    flight.begin(C=157.0, X=900.0)  # taken at A, whose REACHED is repeated until it is at C
    for _ in range(10):
        flight.stay(1.0, 10.0)
        flight.reached(0)
    flight.fly_to(157.0)
    flight.reached(0)
    flight.table.note_current(1, flight.now, True, flight.frame())
    flight.stay(0.4)
    begin = flight.now
    reports, new = upload_during(flight, E=44.0, X=-900.0)
    flight.stay(1.0)
    reports.add_reached(0, flight.now, flight.frame())
    confirm(flight, reports, new, begin)
    flight.stay(10.0)
    assert list(flight.table.completed) == ['A', 'C']


def repeating_after_a(seconds):
    """A flight that has reached A, and repeats that while it flies on."""
    flight = Flight()
    flight.begin(A=50.0, X=900.0)
    flight.fly_to(50.0)
    flight.reached(0)
    flight.table.note_current(1, flight.now, True, flight.frame())
    for _ in range(seconds):
        flight.stay(1.0, 10.0)
        flight.reached(0)
    return flight


@pytest.mark.parametrize('early', [True, False])
def test_a_place_passed_before_a_mission_was_sent_is_not_flown_by_a_repetition(early):
    flight = repeating_after_a(9)
    reports, new = upload_during(flight, C=100.0, D=-900.0)
    reports.note_sent(flight.frame())
    flight.stay(1.0, 10.0)
    reports.add_reached(0, flight.now, flight.frame())
    if early:
        reports.step(new, flight.now)
    confirm(flight, reports, new, reports.sent_since)
    flight.stay(10.0)
    assert list(flight.table.completed) == ['A']


@pytest.mark.parametrize(('current', 'completed'), [(0, ['A']), (1, ['A', 'C'])])
def test_a_repetition_at_the_first_place_of_a_new_mission_counts_once_that_has_moved_on(
        current, completed):
    flight = repeating_after_a(8)
    reports, new = upload_during(flight, C=138.0, D=-900.0)
    reports.note_sent(flight.frame())
    flight.stay(1.0, 10.0)
    reports.add_reached(0, flight.now, flight.frame())
    flight.stay(0.2, 10.0)
    reports.add_current(current, flight.now, flight.frame(), True, 7)
    reports.step(new, flight.now)
    assert list(flight.table.completed) == completed


@pytest.mark.parametrize(('place', 'completed'), [(99.0, ['A']), (90.0, [])])
def test_a_reached_just_before_a_reboot_counts_where_the_vehicle_was_at_its_item(place, completed):
    flight = Flight()
    flight.begin(X=900.0, Y=950.0)
    flight.stay(1.0)
    flight.begin(A=100.0, B=500.0)
    flight.table.note_current(0, flight.now, True, flight.frame())
    flight.fly_to(place)
    flight.reached(0)  # no report of the next current item has come
    flight.table.invalidate()
    assert list(flight.table.completed) == completed


@PX4
@pytest.mark.parametrize('lost', [(), ('MISSION_ITEM_REACHED',)])
@pytest.mark.parametrize('then', ['', 'newer list', 'pilot'])
def test_a_task_whose_item_of_an_earlier_upload_came_late_and_was_stored_is_flown_once(
        kind, lost, then):
    bench, reread = flying(kind, 'AB'), []
    late = next(m for m in bench.line.sent('MISSION_ITEM_INT') if m.seq == 0)  # of A

    def tamper(direction, m, now):
        if m.get_type() != 'MISSION_ITEM_INT':
            return None
        if direction == 'up' and m.seq == 0 and not reread:
            return [(0.0, late)]
        if direction == 'down' and m.seq == 1:
            reread.append(now)
            return None if places(bench) else []
        return None
    bench.line.tampers.append(tamper)
    for kind_lost in lost:
        drop_messages(bench, 'down', kind_lost, lambda m: len(places(bench)) == 1)
    bench.run(lambda: distance(bench, AT_A) < 25.0)
    bench.assign(task_list('CBA', 2))
    assert bench.run(lambda: reread, 10.0)
    if then == 'newer list':
        bench.assign(task_list('CDBA', 3))
    elif then == 'pilot':
        drop_messages(bench, 'down', 'MISSION_ITEM_INT',
                      lambda m: m.seq == 2 and bench.authority() is AuthorityState.HELD)
        assert bench.run(lambda: places(bench) == ['A'], 10.0)
        bench.run(limit=0.6)
        bench.vehicles[1].rc_mode(MODES[kind].stick)
    assert bench.run(lambda: bench.completed() == ['A'], 20.0)
    if then == 'pilot':
        assert bench.hand_over() == ''
    flown_once_each(bench, 'ABCD' if then == 'newer list' else 'ABC')


@pytest.mark.parametrize(('shown', 'completed'), [(False, []), (True, ['A'])])
def test_a_reboot_while_another_mission_may_be_on_board_completes_no_item_by_its_place(
        shown, completed):
    flight = Flight()
    flight.begin(A=100.0, X=900.0)
    flight.table.note_current(0, flight.now, True, flight.frame())
    reports, new = upload_during(flight, B=600.0)
    flight.fly_to(93.0)
    reports.note_sent(flight.frame())
    flight.fly_to(100.0)
    frame = flight.frame()
    flight.table.note_in_mission(frame)
    if shown:  # by PX4's id of the old mission
        reports.release(frame)
    flight.table.invalidate(reports.end(new))
    assert list(flight.table.completed) == completed
