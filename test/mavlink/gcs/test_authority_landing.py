# SPDX-License-Identifier: Apache-2.0
"""Landing, `relaunch`, and arming by others."""
import math
from dataclasses import replace

import pytest
from authority_bench import (
    BOTH,
    MODES,
    PX4,
    AuthorityBench,
    H,
    L,
    N,
    S,
    armed_by_us,
    flying,
    is_command,
    lose_command,
    lost,
    on_ground,
    sends_no_command,
    status_is,
)
from flight_bench import places
from mission_bench import task_list
from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.sim.config import FlightMode

BY_HAND = '; given back by ~/hand_over'


# landing, relaunch

@BOTH
@pytest.mark.parametrize('end', ['item', 'mode'])
@pytest.mark.parametrize('relaunch', ['operator', 'automatic'])
def test_after_our_landing_it_starts_again_as_relaunch_says(kind, relaunch, end):
    bench = AuthorityBench(kind, relaunch=relaunch).discover()
    bench.assign(task_list('A', returns=end == 'item'))
    assert bench.run(lambda: bench.completed() == ['A'], 60.0)
    bench.assign(task_list('', 2, returns=True))
    assert bench.run(lambda: not bench.vehicles[1].flight.armed, 100.0)
    bench.run(limit=5.0)
    if relaunch == 'operator':
        assert status_is(bench, N, 'landed')
        assert bench.state().reason.endswith(BY_HAND)
        assert sends_no_command(bench)
        for takeoff in (False, True):
            bench.set_policy(takeoff=takeoff)
            bench.run(limit=2.0)
        assert status_is(bench, N)
        assert 'waits for ~/hand_over: it has landed' in bench.notes
        assert bench.hand_over() == ''
    assert bench.authority() is H
    bench.assign(task_list('B', 9))
    assert bench.run(lambda: bench.completed() == ['A', 'B'], 100.0)


@BOTH
def test_after_a_landing_a_restarted_bridge_waits_for_the_hand_over_too(kind):
    bench = flying(kind, 'A')
    bench.assign(task_list('', 2, returns=True))
    assert bench.run(lambda: not bench.vehicles[1].flight.armed, 100.0)
    bench.run(limit=3.0)
    bench.kill_and_restart(3.0)
    assert sends_no_command(bench)
    assert bench.state().reason.endswith(BY_HAND)


@BOTH
def test_a_landing_by_our_return_while_suspended_is_a_loss(kind):
    bench = flying(kind, 'A')
    bench.assign(task_list('', 2, returns=True))
    assert bench.run(lambda: bench.vehicles[1].flight.custom_mode == MODES[kind].rtl, 60.0)
    bench.run(limit=2.0)
    bench.vehicles[1].failsafe('radio', None)
    assert bench.reaches(S)
    assert bench.reaches(L, 60.0)
    assert sends_no_command(bench, 20.0)


@PX4
@pytest.mark.parametrize('late', [0.0, 0.6, 2.0])
def test_a_return_of_the_mission_that_an_upload_has_just_replaced_is_ours(kind, late):
    """Before a heartbeat shows its mode, and perhaps before the last REACHED is received."""
    bench = AuthorityBench(kind).discover()
    bench.assign(task_list('A', 1, returns=True))
    flight = bench.vehicles[1].flight
    bench.line.tampers.append(lambda direction, m, now: {
        'HEARTBEAT': [(0.9, m)], 'MISSION_ITEM_REACHED': [(late, m)]}.get(m.get_type()))
    assert bench.run(lambda: math.dist(flight.body.position, (0.0, 100.0, 50.0)) < 5.0, 60.0)
    bench.assign(task_list('AB', 2, returns=True))  # its upload waits until A is served
    assert bench.run(lambda: flight.custom_mode == MODES[kind].rtl, 60.0)
    assert bench.run(lambda: 'B' in bench.completed(), 60.0)
    assert places(bench) == ['A', 'B']
    assert bench.authority() is H


@PX4
def test_a_return_just_after_an_upload_that_replaced_no_return_is_a_loss(kind):
    bench = AuthorityBench(kind).discover()
    bench.assign(task_list('AC', 1, returns=True))
    assert bench.run(lambda: bench.completed() == ['A'], 60.0)
    bench.assign(task_list('B', 2, returns=True))
    assert bench.run(lambda: bench.onboard().revision == 2, 5.0)
    bench.vehicles[1].rc_mode(MODES[kind].rtl)
    assert bench.reaches(L, 10.0)
    assert sends_no_command(bench, 20.0)


@BOTH
@pytest.mark.parametrize('relaunch', ['operator', 'automatic'])
def test_a_landing_by_the_pilot_grants_nothing(kind, relaunch):
    bench = lost(kind, relaunch=relaunch)
    bench.vehicles[1].rc_mode(MODES[kind].land)
    assert bench.run(lambda: not bench.vehicles[1].flight.armed, 100.0)
    assert sends_no_command(bench)
    assert bench.authority() is L


def nearly_landed(kind):
    """A vehicle that returns by our command and is 3 m above the ground."""
    bench = flying(kind, 'A', relaunch='automatic')
    bench.assign(task_list('', 2, returns=True))
    assert bench.run(lambda: bench.vehicles[1].flight.custom_mode == MODES[kind].rtl, 60.0)
    assert bench.run(lambda: bench.vehicles[1].flight.body.position[2] < 3.0, 100.0)
    return bench


@BOTH
def test_a_landing_by_our_return_before_our_next_mode_arrives_is_ours(kind):
    bench = nearly_landed(kind)
    flight = bench.vehicles[1].flight

    def landed():
        return any(e.name == 'disarmed' for e in bench.truth[1])
    bench.line.tampers.append(lambda direction, m, now: [] if (
        direction == 'up' and is_command(m, d.MAV_CMD_DO_SET_MODE)
        and flight.armed and not landed()) else None)
    bench.assign(task_list('B', 3))
    assert bench.run(landed, 30.0)
    bench.run(limit=3.0)
    assert bench.authority() is H
    assert bench.run(lambda: bench.completed()[-1:] == ['B'], 120.0)


@BOTH
def test_armed_again_it_takes_off_where_the_report_of_its_landing_was_lost(kind):
    bench = nearly_landed(kind)
    flight, landed_at = bench.vehicles[1].flight, []
    bench.line.tampers.append(lambda direction, m, now: [] if (
        m.get_type() == 'EXTENDED_SYS_STATE' and not landed_at) else None)
    assert bench.run(lambda: not flight.armed, 30.0)
    bench.assign(task_list('B', 3))
    assert bench.run(lambda: flight.armed, 60.0)
    bench.run(limit=1.0)
    landed_at.append(bench.now)
    assert not [note for note in bench.notes if 'mode mission' in note]
    assert bench.run(lambda: bench.completed()[-1:] == ['B'], 120.0)
    assert bench.authority() is H


@PX4
@pytest.mark.parametrize('relaunch', ['operator', 'automatic'])
def test_a_px4_is_not_armed_in_mission_mode_after_a_return(kind, relaunch):
    bench = AuthorityBench(kind, relaunch=relaunch).discover()
    vehicle = bench.vehicles[1]
    bench.assign(task_list('A', returns=True))
    assert bench.run(lambda: bench.completed() == ['A'], 120.0)
    bench.assign(replace(task_list('', 2), returns=True))
    assert bench.run(lambda: not vehicle.flight.armed, 120.0)
    assert vehicle.flight.mode is FlightMode.MISSION  # of before the return
    bench.run(limit=3.0)
    bench.assign(task_list('B', 3))
    if relaunch == 'operator':
        assert bench.hand_over() == ''
    assert bench.run(lambda: bench.completed()[-1:] == ['B'], 120.0)
    events = bench.truth[1]
    armed = max(n for n, event in enumerate(events) if event.name == 'armed')
    assert [event.mode for event in events[:armed] if event.name == 'mode'][-1] == MODES[kind].hold


@PX4
@pytest.mark.parametrize('mode', ['rtl', 'land'])
def test_a_px4_that_was_set_to_a_mode_without_arming_on_the_ground_is_set_to_hold_first(
        kind, mode):
    bench = AuthorityBench(kind).discover()
    vehicle = bench.vehicles[1]
    vehicle.rc_mode(getattr(MODES[kind], mode))
    assert not vehicle.rc_arm(True)
    bench.run(limit=10.0)
    bench.assign(task_list('A'))
    assert bench.hand_over() == ''
    assert bench.run(lambda: bench.completed() == ['A'], 120.0)
    assert not [note for note in bench.notes if note.startswith('arm')]


# arming by others

@PX4
def test_a_px4_that_a_pilot_arms_after_a_return_stays_with_the_pilot(kind):
    bench = flying(kind, 'ABC')
    vehicle = bench.vehicles[1]
    vehicle.rc_mode(MODES[kind].rtl)
    assert bench.run(lambda: not vehicle.flight.armed, 120.0)
    assert vehicle.flight.mode is FlightMode.MISSION  # of before the return
    bench.run(limit=3.0)
    assert status_is(bench, L)
    assert vehicle.rc_arm(True)
    assert bench.run(lambda: bench.executor().telemetry.airborne, 20.0)
    assert sends_no_command(bench)
    assert status_is(bench, L)


@BOTH
@pytest.mark.parametrize('state', [H, S])
def test_an_arming_by_somebody_else_is_a_loss(kind, state):
    bench = on_ground(kind, state)
    bench.vehicles[1].rc_arm(True)
    assert bench.reaches(L, 3.0)
    assert status_is(bench, L, 'armed, not by the bridge')
    assert sends_no_command(bench)


@BOTH
@pytest.mark.parametrize('state', [L, N])
def test_arming_and_disarming_by_somebody_else_changes_nothing_while_not_held(kind, state):
    bench = on_ground(kind, state)
    for armed in (True, False):
        bench.vehicles[1].rc_arm(armed)
        bench.run(limit=3.0)
        assert bench.authority() is state
    assert sends_no_command(bench, 20.0)


@BOTH
def test_a_disarming_by_somebody_else_after_our_arming_is_a_loss(kind):
    bench = armed_by_us(on_ground(kind, H))
    bench.vehicles[1].rc_arm(False)
    assert bench.run(lambda: bench.authority() is L, 3.0)
    assert sends_no_command(bench)
    assert status_is(bench, L, 'disarmed, not by the bridge')


@BOTH
def test_a_vehicle_that_disarms_itself_before_its_take_off_is_a_loss(kind):
    bench = armed_by_us(on_ground(kind, H))
    lose_command(bench, d.MAV_CMD_COMPONENT_ARM_DISARM)
    assert bench.run(lambda: bench.authority() is L, 20.0)
    assert sends_no_command(bench)
    assert status_is(bench, L, 'disarmed, not by the bridge')


@BOTH
def test_our_own_delayed_arming_grants_nothing(kind):
    bench = on_ground(kind, H)
    bench.line.tampers.append(lambda direction, m, now: [(5.0, m)] if (
        direction == 'up' and is_command(m, d.MAV_CMD_COMPONENT_ARM_DISARM)) else None)
    bench.assign(task_list('AB', 2))
    bench.run(limit=1.5)
    bench.set_policy(takeoff=False)
    bench.run(limit=0.2)
    assert bench.authority() is N
    assert sends_no_command(bench)
