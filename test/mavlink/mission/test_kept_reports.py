# SPDX-License-Identifier: Apache-2.0
"""Reports that are kept during a long upload are judged once each."""
from evidence_bench import Flight
from test_findings_uploads import upload_during

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
