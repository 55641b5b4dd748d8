# SPDX-License-Identifier: Apache-2.0
"""Simulated time that is missing, stands still, jumps or goes back: one line each."""
from types import SimpleNamespace

import pytest

from uav_task_alloc.nodes.ros import clock_watch
from uav_task_alloc.nodes.ros.clock_watch import (
    ClockOffsets,
    ClockWatch,
    SteadyTime,
    watch_clock,
)


def lines(*readings):
    """The lines of readings (ROS time, steady time) [s]."""
    watch = ClockWatch()
    return [text for text in (watch.update(*reading) for reading in readings) if text]


@pytest.mark.parametrize('rate', [0.1, 1.0, 20.0, 100.0])
def test_a_clock_that_runs_at_any_rate_is_not_mentioned(rate):
    assert lines(*((1e9 + rate * 0.5 * k, 0.5 * k) for k in range(100))) == []


def test_a_missing_clock_is_logged_once_and_its_start_is_no_jump():
    readings = [(0.0, 0.5 * k) for k in range(40)] + [(1e9 + k, 20.0 + k) for k in range(5)]
    first, second = lines(*readings)
    assert first == 'use_sim_time is true, and nothing publishes /clock: waiting for it'
    assert second == '/clock has begun after 20 s'


def test_a_clock_that_stands_still_is_logged_once_and_again_when_it_runs():
    readings = [(100.0 + k, k) for k in range(5)] + [(104.0, 4.0 + k) for k in range(1, 60)]
    assert lines(*readings, (105.0, 64.0), (106.0, 65.0)) == [
        '/clock has stood still at 104.0 s for 5 s: all times wait for it',
        '/clock runs again after 60 s']


def test_a_watch_says_whether_the_clock_stands_still():
    watch, still = ClockWatch(), []
    for reading in ((9.0, 0.0), (10.0, 1.0), (10.0, 5.0), (10.0, 6.0), (11.0, 7.0)):
        watch.update(*reading)
        still.append(watch.still)
    assert still == [False, False, False, True, False]


@pytest.mark.parametrize(('ros', 'text'), [
    (0.0, 'use_sim_time is true, and nothing publishes /clock: waiting for it'),
    (10.0, '/clock has stood still at 10.0 s for 9 s: all times wait for it')])
def test_a_clock_that_stands_still_is_a_warning_while_it_does(ros, text):
    watch, warnings = ClockWatch(), []
    for at, steady in ((ros, 1.0), (ros, 6.0), (ros, 10.0), (ros + 1.0, 11.0)):
        watch.update(at, steady)
        warnings.append(watch.warning(steady))
    assert warnings[2] == text
    assert [bool(warning) for warning in warnings] == [False, True, True, False]


def test_a_pause_between_two_ticks_is_not_mentioned():
    assert lines((10.0, 0.0), (10.0, 4.5), (11.0, 4.9)) == []


def test_a_clock_that_goes_back_or_jumps_is_logged():
    assert lines((500.0, 0.0), (100.0, 0.5), (101.0, 1.0)) == [
        '/clock went back by 400.0 s, to 100.0 s']
    assert lines((500.0, 0.0), (4100.0, 0.5), (4101.0, 1.0)) == [
        '/clock jumped forward by 3600.0 s, to 4100.0 s']


def test_recorded_time_goes_on_where_the_clock_goes_back():
    time = SteadyTime()
    assert [time.at(ros) for ros in (10.0, 12.0, 5.0, 6.0, 5.5, 7.0)] == [
        10.0, 12.0, 12.0, 13.0, 13.0, 14.5]
    assert time.offset == 7.5


def test_a_sender_with_another_clock_is_named_until_it_agrees_or_is_gone():
    offsets = ClockOffsets('reports')
    for k in range(3):
        assert offsets.warning(k) == ''
        offsets.add('uav_1', 1000.0 + k + 37.0, 1000.0 + k, k)
        offsets.add('uav_2', 1000.0 + k - 4.0, 1000.0 + k, k)
    assert offsets.warning(3.0) == (
        'reports of uav_1 are stamped 37 s after the clock of this node: expected machines whose '
        'clocks agree')
    for k in range(3):
        offsets.add('uav_2', 900.0 + k, 1000.0 + k, k)
    assert offsets.warning(3.0).startswith(
        'reports of uav_2 (and those of 1 more) are stamped 100 s before')
    assert offsets.warning(13.0) == ''
    offsets.add('uav_2', 1003.0, 1003.0, 3.0)
    assert 'uav_2' not in offsets.warning(4.0)


@pytest.mark.parametrize(('stamp', 'clock'), [(0.0, 1e9), (1e9, 0.0)])
def test_what_has_no_time_has_no_offset(stamp, clock):
    offsets = ClockOffsets('reports')
    for k in range(9):
        offsets.add('uav_1', stamp, clock, k)
    assert offsets.warning(9.0) == ''


@pytest.mark.parametrize(('namespaces', 'end'), [
    (('/north',), ''),
    (('/south', '/'), '; it is published by /fleet_sim, /south/fleet_sim: expected one node')])
def test_a_jump_names_the_nodes_that_publish_the_clock_where_they_are_several(
        monkeypatch, namespaces, end):
    monkeypatch.setattr(clock_watch, 'steady_clock', lambda: None)
    times, logged, timers = [900_000_000_000, 100_000_000_000], [], []
    watch_clock(SimpleNamespace(
        get_parameter=lambda _: SimpleNamespace(value=True),
        get_clock=lambda: SimpleNamespace(
            now=lambda: SimpleNamespace(nanoseconds=times.pop(0))),
        get_publishers_info_by_topic=lambda _: [
            SimpleNamespace(node_name='fleet_sim', node_namespace=each) for each in namespaces],
        create_timer=lambda _, callback, clock: timers.append(callback)), logged.append)
    timers[0]()
    timers[0]()
    assert logged == [f'/clock went back by 800.0 s, to 100.0 s{end}']
