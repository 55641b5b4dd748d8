# SPDX-License-Identifier: Apache-2.0
"""Jumps of positions without a world: which are some, what is logged, and two sources."""
import math
from types import SimpleNamespace

import pytest

from uav_task_alloc.allocator.records import UavReport
from uav_task_alloc.allocator.state.fleet import Fleet
from uav_task_alloc.allocator.state.position_jumps import PositionJumps
from uav_task_alloc.params import AllocatorParams

PARAMS = AllocatorParams(position_jump=200.0, default_cruise_speed=10.0, uav_timeout=5.0)


@pytest.fixture
def reports():
    """`report(x, now)` compares a report of UAV a with the one before; lines and triggers."""
    notes, triggers, fleet = [], [], Fleet()
    jumps = PositionJumps(lambda: PARAMS, lambda text, warning=False: notes.append(
        (text, warning)), lambda trigger, now: triggers.append((trigger, now)))

    def report(x, now, speed=None):
        each = UavReport('a', (x, 0.0, 50.0), cruise_speed=speed)
        jumps.check(fleet.update(each, now), each, now)

    return SimpleNamespace(report=report, jumps=jumps, fleet=fleet, notes=notes,
                           triggers=triggers)


def test_a_jump_is_logged_and_planned_for(reports):
    reports.report(0.0, 10.0)
    reports.report(5000.0, 10.1)
    assert reports.notes == [('a jumped by 5000 m', True)]
    assert reports.triggers == [('a jumped', 10.1)]


def test_one_that_repeats_is_logged_once_and_planned_for_each_time(reports):
    for k in range(4):
        reports.report(5000.0 * (k % 2), 10.0 + k)
    assert (len(reports.notes), len(reports.triggers)) == (1, 3)
    reports.report(0.0, 19.0)  # after `uav_timeout`
    assert len(reports.notes) == 2


@pytest.mark.parametrize(('speed', 'metres', 'jumped'), [
    (None, 299.0, False), (None, 301.0, True), (20.0, 399.0, False), (20.0, 401.0, True)])
def test_what_is_flown_at_ten_times_the_cruise_speed_is_no_jump(reports, speed, metres, jumped):
    reports.report(0.0, 10.0, speed)
    reports.report(metres, 11.0, speed)  # 200 m and 10 s at the cruise speed
    assert bool(reports.triggers) == jumped


def test_a_uav_that_was_silent_may_be_anywhere(reports):
    reports.report(0.0, 10.0)
    reports.fleet.mark_silent(20.0, 5.0)
    reports.report(math.pi * 1e5, 20.0)
    assert reports.triggers == []


def test_several_jumps_shortly_after_one_another_show_two_sources(reports):
    for k in range(5):
        assert not reports.jumps.in_two_places('a')
        reports.report(5000.0 * (k % 2), 10.0 + 2.0 * k)
    assert reports.jumps.in_two_places('a')
    reports.report(0.0, 20.1)
    assert not reports.jumps.in_two_places('a')


def test_a_uav_that_is_forgotten_begins_without_jumps(reports):
    for k in range(5):
        reports.report(5000.0 * (k % 2), 10.0 + k)
    reports.jumps.forget('a')
    assert not reports.jumps.in_two_places('a')
