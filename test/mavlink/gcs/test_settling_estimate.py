# SPDX-License-Identifier: Apache-2.0
"""A vehicle whose first position estimates jump up and down while it gets its first list."""
import math

import pytest
from findings_bench import FindingsBench
from mission_bench import task_list
from piece_bench import Track, list_of, strip
from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.mavlink.mission.flown_path import PositionSample
from uav_task_alloc.mavlink.mission.position_history import PositionHistory

SETTLES = {'arming_delay': 3.0, 'boot_delay': 1.0, 'settling_time': 8.0}


def started_while_settling(wait):
    """A PX4 vehicle whose list comes `wait` seconds after its first position, in the air."""
    bench = FindingsBench('px4', configs={1: SETTLES}).discover()
    flight = bench.vehicles[1].flight
    assert bench.run(lambda: flight.positioned, 30.0)
    bench.run(limit=wait)
    bench.assign(task_list('ABC', side=300.0))
    assert bench.run(lambda: bench.executor().telemetry.landed not in (
        d.MAV_LANDED_STATE_ON_GROUND, d.MAV_LANDED_STATE_UNDEFINED), 60.0)
    return bench


@pytest.mark.parametrize('wait', [0.5, 1.0, 1.5, 2.0])
def test_the_next_list_does_not_wait_for_a_take_off_that_its_mission_has_made(wait):
    bench = started_while_settling(wait)
    bench.run(limit=1.0)
    bench.assign(task_list('BCA', revision=2, side=300.0))
    assert bench.run(lambda: bench.state().list_revision == 2, 2.0)
    assert bench.noted('take off') == []


@pytest.mark.parametrize('wait', [0.0, 0.5, 1.2])
def test_a_px4_that_its_mission_takes_off_gets_no_take_off_where_its_landed_state_is_late(wait):
    bench = FindingsBench('px4', configs={1: SETTLES}).discover()
    assert bench.run(lambda: bench.vehicles[1].flight.positioned, 30.0)
    bench.run(limit=wait)
    bench.line.tampers.append(lambda direction, m, now: [(1.5, m)] if (
        m.get_type() == 'EXTENDED_SYS_STATE') else None)
    bench.assign(task_list('ABC', side=300.0))
    assert bench.run(lambda: bench.completed() == ['A', 'B', 'C'], 200.0)
    assert [e.command for e in bench.truth[1] if e.name == 'command'] == ['arm', 'mode']


def test_after_its_landing_it_is_not_armed_by_the_bridge():
    bench = started_while_settling(0.5)
    bench.run(limit=2.0)
    assert not bench.executor().sender.armed_here
    assert bench.run(lambda: bench.completed() == ['A', 'B', 'C'])


@pytest.mark.parametrize('kind', ['ardupilot', 'px4'])
def test_strips_are_flown_once_after_the_first_estimate_has_jumped_on_the_ground(kind):
    bench = FindingsBench(kind, configs={1: SETTLES})
    boot = bench.vehicles[1].flight.boot
    settled = boot.times.position + boot.times.settling
    bench.line.tampers.append(lambda direction, m, now: [] if (
        m.get_type() == 'GLOBAL_POSITION_INT' and boot.elapsed < settled - 0.4) else None)
    track = Track(bench.discover())
    assert bench.run(lambda: bench.executor().telemetry.has_position)
    assert math.dist(bench.executor().telemetry.position, track.points[-1]) > 30.0
    assert bench.run(lambda: boot.elapsed > settled + 1.0)
    bench.assign(list_of(strip(0), strip(1), turned=('F#1',)))
    assert bench.run(lambda: len(bench.completed()) == 2, 200.0)
    assert not bench.noted('not flown')
    for each in (strip(0), strip(1)):
        assert set(track.times_flown(each)) == {1}


@pytest.mark.parametrize('before', [1.8, 2.4, 3.0])  # [s]
def test_strips_are_flown_once_after_an_estimate_that_settled_in_the_climb(before):
    bench = FindingsBench('px4', configs={1: SETTLES})
    boot = bench.vehicles[1].flight.boot
    settled = boot.times.position + boot.times.settling
    # reported as on the ground, at a height below it, until the last jump
    bench.line.tampers.append(lambda direction, m, now: [] if (
        m.get_type() == 'EXTENDED_SYS_STATE' and -before < boot.elapsed - settled < 0.0) else None)
    track = Track(bench.discover())
    assert bench.run(lambda: boot.elapsed > settled - before)
    bench.assign(list_of(strip(0), strip(1), turned=('F#1',)))
    assert bench.run(lambda: len(bench.completed()) == 2, 200.0)
    assert not bench.noted('not flown')
    for each in (strip(0), strip(1)):
        assert set(track.times_flown(each)) == {1}


@pytest.mark.parametrize('speedup', [1.0, 8.0])
def test_positions_are_in_doubt_after_a_jump_for_a_time_of_the_vehicle(speedup):
    def add(x, t):
        history.add(PositionSample(t, (x, 0.0, 50.0), (0.0, 0.0, 0.0)), True, t / speedup)
    history, jump = PositionHistory(), 20.0
    for each in range(400):  # 80 s at 5 Hz
        t = each / 5.0
        add(100.0 if t >= jump else 0.0, t)
        assert history.invalid(t / speedup) == (jump <= t < jump + 60.0)
    history.clear()  # rebooted: its clock begins again, and so does the estimate
    add(100.0, 5.0)
    assert not history.invalid(5.0 / speedup)
