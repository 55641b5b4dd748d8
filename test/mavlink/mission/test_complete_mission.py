# SPDX-License-Identifier: Apache-2.0
"""Missions that begin again: ArduPilot where mission mode is entered, PX4 after a disarming."""
import pytest
from authority_bench import ARDUPILOT, MODES, PX4, flying
from findings_bench import commanded, flown_once_each
from flight_bench import places
from mission_bench import task_list
from pymavlink.dialects.v20 import ardupilotmega as d


def completed(kind, *tampers):
    """A vehicle that has flown A and B, and whose list is empty."""
    bench = flying(kind, 'AB')
    assert bench.run(lambda: bench.completed() == ['A', 'B'], 100.0)
    bench.line.tampers += tampers
    bench.assign(task_list('', 2))
    return bench


@ARDUPILOT
@pytest.mark.parametrize('link', [True, False])
def test_a_complete_mission_does_not_begin_again_when_an_avoidance_ends(kind, link):
    bench = completed(kind)
    bench.run(limit=3.0)
    vehicle = bench.vehicles[1]
    for _ in range(1 + link):
        vehicle.avoid(True)
        bench.run(limit=4.0)
        bench.line.cut = not link
        vehicle.avoid(False)
        assert vehicle.flight.custom_mode == MODES[kind].mission
        bench.run(limit=40.0)
        bench.line.cut = False
        bench.run(limit=5.0)
    assert places(bench)[:2] == ['A', 'B']
    assert set(places(bench)[2:]) <= {'B'}
    assert link or bench.hand_over() == ''
    bench.assign(task_list('CD', 3))
    assert bench.run(lambda: bench.completed()[2:] == ['C', 'D'], 120.0)


@ARDUPILOT
def test_the_last_item_is_set_once_while_the_vehicle_still_reports_the_end(kind):
    bench = flying(kind, 'AB')

    def complete(direction, m, now):
        if m.get_type() == 'MISSION_CURRENT' and m.mission_state == d.MISSION_STATE_NOT_STARTED:
            m.mission_state = d.MISSION_STATE_COMPLETE
    bench.line.tampers.append(complete)
    assert bench.run(lambda: bench.completed() == ['A', 'B'], 100.0)
    before = commanded(bench)
    bench.assign(task_list('', 2))
    bench.run(limit=60.0)
    assert commanded(bench)[len(before):] == ['set current']


@ARDUPILOT
@pytest.mark.parametrize('delay', [0.0, 2.5, 4.5])
def test_a_list_waits_for_the_end_of_a_set_current_that_a_link_delays(kind, delay):
    def late(direction, m, now):
        is_end = m.get_type() == 'COMMAND_LONG' and (
            m.command == d.MAV_CMD_DO_SET_MISSION_CURRENT and m.param1 == 2)
        return [(delay, m)] if is_end else None
    bench = completed(kind, late)
    bench.run(limit=1.5)
    bench.assign(task_list('CDEF', 3))
    flown_once_each(bench, 'ABCDEF')
    assert places(bench) == list('ABCDEF')


@ARDUPILOT
def test_a_mission_reported_once_as_not_started_flies_on(kind):
    bench = flying(kind, 'ABC')
    changed = []

    def once(direction, m, now):
        if m.get_type() == 'MISSION_CURRENT' and not changed:
            changed.append(m)
            m.mission_state = d.MISSION_STATE_NOT_STARTED
    bench.line.tampers.append(once)
    before = commanded(bench)
    flown_once_each(bench, 'ABC')
    assert changed
    assert commanded(bench) == before


@PX4
@pytest.mark.parametrize('armed_by', ['bridge', 'pilot'])
def test_a_px4_disarmed_at_its_last_item_does_not_begin_again_where_it_stands(kind, armed_by):
    bench = flying(kind, 'AB')
    vehicle = bench.vehicles[1]
    assert bench.run(lambda: bench.completed() == ['A'], 100.0)
    bench.assign(task_list('B', 2))
    bench.run(limit=0.3)
    vehicle.kill_switch()  # it falls to the ground below A
    bench.run(limit=6.0)
    vehicle.kill_switch_off()
    bench.run(limit=3.0)
    if armed_by == 'pilot':
        vehicle.rc_mode(MODES[kind].stick)
        vehicle.rc_arm(True)
        vehicle.rc_stick((0.0, 0.0, 3.0))
        bench.run(limit=10.0)
        vehicle.rc_stick(None)
        bench.run(limit=3.0)
        assert not vehicle.flight.landed
    error = bench.hand_over()
    if armed_by == 'pilot':  # killed before: on the ground only
        assert error
        vehicle.rc_mode(MODES[kind].land)
        assert bench.run(lambda: not vehicle.flight.armed, 60.0)
        bench.run(limit=3.0)
        error = bench.hand_over()
    assert error == ''
    flown_once_each(bench, 'AB')
