# SPDX-License-Identifier: Apache-2.0
"""Reports that are kept during a long upload are judged once each."""
from evidence_bench import Flight
from test_findings_uploads import confirm, upload_during

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
