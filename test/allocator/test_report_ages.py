# SPDX-License-Identifier: Apache-2.0
"""How old a position is: a stale link repeats the last one, and a silent UAV sends none."""
from dataclasses import replace

import pytest
from allocation import AllocatorDriver

from uav_task_alloc.allocator.report_ages import ReportAges


class Reports(AllocatorDriver):
    """One UAV in flight, whose reports come or not."""

    def __init__(self):
        super().__init__()
        self.ages = ReportAges(self.world)

    def age(self, east=None, wait=0.0, silent=False):
        self.now += wait
        if east is not None:
            self.uav('u1', east, 0.0, 50.0, mode='ON_MISSION')
        return self.ages.age('u1', self.record(silent), self.now)

    def silent_for(self, silent, wait=0.0):
        self.now += wait
        return self.ages.silent_for('u1', self.record(silent), self.now)

    def record(self, silent):
        return replace(self.world.uav_record('u1'), silent=silent)


def test_a_position_that_is_repeated_grows_old_to_twice_the_timeout():
    reports = Reports()
    assert reports.age(0.0) == 0.0
    assert reports.age(0.0, wait=1.5) == pytest.approx(1.5)
    assert reports.age(5.0, wait=1.0) == 0.0
    most = 2.0 * reports.world.params.uav_timeout
    assert reports.age(5.0, wait=10.0 * most) == pytest.approx(most)


def test_a_silent_uav_is_silent_from_when_that_is_known_on():
    reports = Reports()
    reports.age(0.0)
    assert reports.silent_for(False) == 0.0
    assert reports.silent_for(True) == 0.0
    assert reports.silent_for(True, wait=4.0) == pytest.approx(4.0)
    assert reports.age(silent=True) == pytest.approx(4.0)
    reports.ages.clock_jumped(100.0)
    assert reports.silent_for(True, wait=100.0) == pytest.approx(4.0)
    assert reports.age(silent=True) == pytest.approx(4.0)
    assert reports.silent_for(False) == 0.0
    assert reports.silent_for(True) == 0.0


def test_nothing_is_kept_of_a_uav_that_is_forgotten():
    reports = Reports()
    reports.age(0.0)
    reports.silent_for(True)
    record = reports.record(True)
    reports.world.forget_uav('u1')
    reports.ages.forget_removed()
    assert reports.ages.silent_for('u1', record, reports.now + 9.0) == 0.0
