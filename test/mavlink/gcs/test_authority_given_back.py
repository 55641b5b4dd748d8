# SPDX-License-Identifier: Apache-2.0
"""Hand-over to the bridge by a mode change, and PX4's own mode change at the end of a mission."""
import pytest
from authority_bench import (
    ARDUPILOT,
    BOTH,
    MODES,
    PX4,
    H,
    L,
    N,
    S,
    flown_up_by_pilot,
    flying,
    in_flight,
    lost,
    on_ground,
    sends_no_command,
    set_mode,
    status_is,
    suspended,
    upload_by_another,
)
from mission_bench import drop, task_list
from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.mavlink.gcs.authority import Suspension
from uav_task_alloc.mavlink.gcs.onboard_mission import MissionState

# STICK -> HOLD

@BOTH
@pytest.mark.parametrize('state', [L, N])
def test_stick_mode_to_hold_at_rest_for_six_seconds_is_a_hand_over(kind, state):
    bench, modes = in_flight(kind, state), MODES[kind]
    start = len(bench.sent)
    bench.vehicles[1].rc_mode(modes.hold)
    bench.run(limit=5.5)
    assert bench.authority() is state
    assert bench.reaches(H, 3.0)
    assert status_is(bench, H, 'at rest for 6 s')
    assert bench.run(lambda: modes.mission in bench.modes(start), 10.0)
    assert bench.modes(start)[0] == modes.mission  # it is in HOLD already


@BOTH
@pytest.mark.parametrize('state', [L, N])
@pytest.mark.parametrize('disturbance', ['moved', 'moving', 'critical', 'changed', 'text'])
def test_a_hold_that_is_not_at_rest_is_no_hand_over(kind, state, disturbance):
    bench, modes = in_flight(kind, state), MODES[kind]
    vehicle = bench.vehicles[1]
    if disturbance == 'moving':
        vehicle.rc_stick((12.0, 0.0, 0.0))
        bench.run(limit=5.0)
    vehicle.rc_mode(modes.hold)
    if disturbance != 'moving':
        bench.run(limit=3.0)
    if disturbance == 'moved':
        vehicle.estimate.glitch((4.0, 0.0, 0.0), 60.0)
    elif disturbance == 'critical':
        vehicle.failsafe('radio', None)
    elif disturbance == 'changed':
        vehicle.rc_mode(modes.own)
        bench.run(limit=1.5)
        vehicle.rc_mode(modes.hold)
    elif disturbance == 'text':
        vehicle.flight.texts.append((2, 'Failsafe activated'))
    bench.run(limit=10.0)
    assert bench.authority() in (L, N)
    assert sends_no_command(bench)


@ARDUPILOT
def test_on_the_ground_a_change_from_a_stick_mode_to_hold_changes_nothing(kind):
    bench = on_ground(kind, H)
    assert bench.vehicles[1].flight.custom_mode == d.COPTER_MODE_STABILIZE
    bench.from_station(set_mode(MODES[kind].hold, kind))
    bench.run(limit=10.0)
    assert status_is(bench, H, 'takeoff is true')


# -> MISSION

@BOTH
@pytest.mark.parametrize('state', [L, N])
def test_mission_set_in_flight_is_a_hand_over_and_a_verified_list_is_continued(kind, state):
    bench = in_flight(kind, state)
    assert bench.onboard().state is MissionState.VERIFIED
    start = len(bench.sent)
    bench.vehicles[1].rc_mode(MODES[kind].mission)
    assert bench.reaches(H, 3.0)
    assert status_is(bench, H, '-> ', 'in flight')
    assert bench.run(lambda: len(bench.completed()) >= 2, 60.0)
    assert bench.modes(start) == []


@BOTH
def test_mission_set_in_flight_with_a_new_list_pending_holds_first(kind):
    bench, modes = lost(kind), MODES[kind]
    bench.assign(task_list('XYZ', 2))
    bench.run(limit=5.0)
    start = len(bench.sent)
    bench.vehicles[1].rc_mode(modes.mission)
    assert bench.reaches(H, 3.0)
    assert bench.run(lambda: len(bench.modes(start)) == 2, 30.0)
    assert bench.modes(start) == [modes.hold, modes.mission]
    assert bench.run(lambda: bench.completed() == ['X', 'Y', 'Z'], 200.0)


@BOTH
def test_mission_set_by_a_pilot_while_held_keeps_authority_and_holds_first(kind):
    bench, modes = flying(kind), MODES[kind]
    bench.assign(task_list('', 2))
    bench.run(limit=14.0)
    start = len(bench.sent)
    bench.vehicles[1].rc_mode(modes.mission)
    bench.run(limit=4.0)
    assert status_is(bench, H)
    assert set(bench.modes(start)) <= {modes.hold}


@BOTH
def test_mission_soon_after_our_own_mission_command_is_no_hand_over(kind):
    bench = flying(kind)
    assert bench.now - max(t for t, action, _ in bench.sent if action == 'command') < 5.0
    bench.vehicles[1].rc_mode(MODES[kind].stick)
    assert bench.reaches(L, 3.0)
    bench.vehicles[1].rc_mode(MODES[kind].mission)
    bench.run(limit=20.0)
    assert status_is(bench, L)
    assert sends_no_command(bench, 20.0)


@PX4
@pytest.mark.parametrize('names', ['AB', 'XY'])
def test_a_take_off_in_the_mission_mode_is_a_hand_over_where_our_list_is_verified(kind, names):
    bench = on_ground(kind, N)
    bench.assign(task_list('AB'))
    assert bench.run(lambda: bench.onboard().state is MissionState.VERIFIED, 20.0)
    bench.from_station(set_mode(MODES[kind].mission, kind))
    bench.run(limit=2.0)
    assert bench.authority() is N
    bench.vehicles[1].rc_arm(True)
    if names == 'XY':
        bench.line.tampers.append(lambda direction, m, now: [] if direction == 'up' and (
            m.get_type() == 'MISSION_COUNT') else None)
        bench.assign(task_list('XY', 2))
    assert bench.run(lambda: bench.executor().telemetry.airborne, 10.0)
    bench.run(limit=1.0)
    if names == 'XY':
        assert sends_no_command(bench, 12.0)
        assert status_is(bench, N)
    else:
        assert status_is(bench, H, 'took off with our mission')
        assert bench.run(lambda: bench.completed() == ['A', 'B'], 60.0)


@BOTH
def test_with_a_foreign_mission_the_mission_mode_changes_nothing(kind):
    bench = suspended(kind, Suspension.FOREIGN)
    bench.vehicles[1].rc_mode(MODES[kind].mission)
    bench.run(limit=5.0)
    assert status_is(bench, S, 'somebody else changed the mission')
    assert sends_no_command(bench, 10.0)


@BOTH
def test_mission_set_during_a_failsafe_is_no_hand_over(kind):
    bench = lost(kind)
    bench.vehicles[1].failsafe('radio', None)
    bench.run(limit=2.0)
    bench.vehicles[1].rc_mode(MODES[kind].mission)
    bench.run(limit=3.0)
    assert status_is(bench, L)
    assert sends_no_command(bench, 20.0)


# the end of a mission, PX4

@PX4
def test_px4_goes_to_hold_at_the_end_of_its_mission_and_stays_held(kind):
    bench = flying(kind, 'AB')
    assert bench.run(lambda: bench.vehicles[1].mode.name == 'HOLD', 60.0)
    bench.run(limit=20.0)
    assert status_is(bench, H)
    bench.assign(task_list('C', 2))
    assert bench.run(lambda: bench.completed() == ['A', 'B', 'C'], 60.0)


@PX4
def test_the_last_reached_may_arrive_after_the_hold(kind):
    bench = flying(kind, 'AB')

    def late(direction, m, now):
        return [(3.0, m)] if m.get_type() == 'MISSION_ITEM_REACHED' else None
    bench.line.tampers.append(late)
    bench.line.tampers.insert(0, drop({'STATUSTEXT'}, 1 << 30))
    assert bench.reaches(S, 60.0)
    assert status_is(bench, S, 'Mission -> Hold')
    assert bench.reaches(H, 5.0)
    assert status_is(bench, H)


@PX4
def test_without_the_last_reached_the_end_is_a_loss(kind):
    bench = flying(kind, 'AB')
    bench.line.tampers.append(lambda direction, m, now: [] if m.get_type() in (
        'MISSION_ITEM_REACHED', 'STATUSTEXT') else None)
    assert bench.reaches(S, 60.0)
    assert bench.reaches(L, 6.0)
    assert sends_no_command(bench)


@PX4
def test_the_end_of_the_mission_before_explains_no_hold_once_it_flies_the_next(kind):
    bench = flying(kind, 'AB')
    assert bench.run(lambda: bench.vehicles[1].mode.name == 'HOLD', 60.0)
    bench.run(limit=0.4)
    bench.assign(task_list('Y', 2))
    assert bench.run(lambda: bench.vehicles[1].mode.name == 'MISSION', 4.0)
    bench.run(limit=1.2)  # a heartbeat has shown it
    start = len(bench.sent)
    bench.from_station(set_mode(MODES[kind].hold, kind))
    assert bench.reaches(L, 8.0)
    assert bench.commands(start) == []
    assert sends_no_command(bench)


@PX4
def test_a_hold_before_the_end_of_the_mission_is_a_loss(kind):
    bench = flying(kind, 'ABC')
    assert bench.run(lambda: bench.completed() == ['A'])
    bench.vehicles[1].rc_mode(MODES[kind].hold)
    assert bench.reaches(L, 2.0)
    assert sends_no_command(bench)


@PX4
def test_while_suspended_the_end_of_the_mission_is_a_loss(kind):
    bench = flying(kind, 'AB')
    bench.vehicles[1].failsafe('battery', None)
    assert bench.reaches(S)
    assert bench.reaches(L, 60.0)
    assert sends_no_command(bench)


@PX4
def test_the_end_of_another_stations_mission_grants_nothing(kind):
    bench = flown_up_by_pilot(kind, 'AB', when_foreign='yield')
    upload_by_another(bench)
    bench.run(limit=5.0)
    bench.from_station(set_mode(MODES[kind].mission, kind))
    bench.run(limit=90.0)
    assert bench.vehicles[1].mode.name == 'HOLD'
    assert bench.authority() is not H
    assert bench.modes() == []


@PX4
def test_a_list_that_px4_calls_infeasible_is_no_loss(kind):
    bench = flying(kind, 'ABC')
    far = task_list('ABC', 2)
    stop = far.stops[0].__class__(far.stops[0].task.__class__('far', (30000.0, 0.0, 60.0)))
    bench.assign(far.__class__(2, (stop,)))
    assert bench.run(lambda: bench.vehicles[1].mode.name == 'HOLD', 20.0)
    bench.run(limit=10.0)
    assert status_is(bench, H)
    bench.assign(task_list('B', 3))
    assert bench.run(lambda: 'B' in bench.completed(), 60.0)
