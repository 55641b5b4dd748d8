# SPDX-License-Identifier: Apache-2.0
"""A pilot hands the aircraft over by a mode; PX4 leaves its mission at the end by itself."""
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
    flying,
    in_flight,
    keeps_quiet,
    lost,
    on_ground,
    risen_by_pilot,
    set_mode,
    shows,
    suspended,
    upload_by_another,
)
from mission_bench import task_list

from uav_task_alloc.mavlink.gcs.authority import Suspension
from uav_task_alloc.mavlink.gcs.onboard_mission import MissionState

# STICK -> HOLD

@BOTH
@pytest.mark.parametrize('state', [L, N])
def test_from_the_sticks_to_hold_at_rest_for_six_seconds_hands_it_over(kind, state):
    bench, modes = in_flight(kind, state), MODES[kind]
    start = len(bench.sent)
    bench.vehicles[1].rc_mode(modes.hold)
    bench.run(limit=5.5)
    assert bench.authority() is state
    assert bench.becomes(H, 3.0)
    assert shows(bench, H, 'at rest for 6 s')
    assert bench.run(lambda: modes.mission in bench.modes(start), 10.0)
    assert bench.modes(start)[0] == modes.mission  # it held already


@BOTH
@pytest.mark.parametrize('state', [L, N])
@pytest.mark.parametrize('spoilt', ['moved', 'moving', 'critical', 'changed', 'text'])
def test_a_hold_that_is_not_at_rest_hands_nothing_over(kind, state, spoilt):
    bench, modes = in_flight(kind, state), MODES[kind]
    vehicle = bench.vehicles[1]
    if spoilt == 'moving':
        vehicle.rc_stick((12.0, 0.0, 0.0))
        bench.run(limit=5.0)
    vehicle.rc_mode(modes.hold)
    if spoilt != 'moving':
        bench.run(limit=3.0)
    if spoilt == 'moved':
        vehicle.estimate.glitch((4.0, 0.0, 0.0), 60.0)
    elif spoilt == 'critical':
        vehicle.failsafe('radio', None)
    elif spoilt == 'changed':
        vehicle.rc_mode(modes.own)
        bench.run(limit=1.5)
        vehicle.rc_mode(modes.hold)
    elif spoilt == 'text':
        vehicle.flight.texts.append((2, 'Failsafe activated'))
    bench.run(limit=10.0)
    assert bench.authority() in (L, N)
    assert keeps_quiet(bench)


@ARDUPILOT
def test_on_the_ground_a_change_from_sticks_to_hold_changes_nothing(kind):
    bench = on_ground(kind, H)
    assert bench.vehicles[1].flight.custom_mode == 0
    bench.from_station(set_mode(MODES[kind].hold, kind))
    bench.run(limit=10.0)
    assert shows(bench, H, 'takeoff is true')


# -> MISSION

@BOTH
@pytest.mark.parametrize('state', [L, N])
def test_the_mission_mode_set_in_flight_hands_it_over_and_a_verified_list_is_flown_on(kind,
                                                                                     state):
    bench = in_flight(kind, state)
    assert bench.onboard().state is MissionState.VERIFIED
    start = len(bench.sent)
    bench.vehicles[1].rc_mode(MODES[kind].mission)
    assert bench.becomes(H, 3.0)
    assert shows(bench, H, '-> ', 'in flight')
    assert bench.run(lambda: len(bench.completed()) >= 2, 60.0)
    assert bench.modes(start) == []


@BOTH
def test_the_mission_mode_set_with_another_list_waiting_holds_first(kind):
    bench, modes = lost(kind), MODES[kind]
    bench.assign(task_list('XYZ', 2))
    bench.run(limit=5.0)
    start = len(bench.sent)
    bench.vehicles[1].rc_mode(modes.mission)
    assert bench.becomes(H, 3.0)
    assert bench.run(lambda: len(bench.modes(start)) == 2, 30.0)
    assert bench.modes(start) == [modes.hold, modes.mission]
    assert bench.run(lambda: bench.completed() == ['X', 'Y', 'Z'], 200.0)


@BOTH
def test_held_by_us_the_mission_mode_set_by_a_pilot_changes_nothing_but_holds_first(kind):
    bench, modes = flying(kind), MODES[kind]
    bench.assign(task_list('', 2))
    bench.run(limit=14.0)
    start = len(bench.sent)
    bench.vehicles[1].rc_mode(modes.mission)
    bench.run(limit=4.0)
    assert shows(bench, H)
    assert set(bench.modes(start)) <= {modes.hold}


@BOTH
def test_the_mission_mode_soon_after_our_own_command_may_be_that_command_and_gives_nothing(kind):
    bench = flying(kind)
    assert bench.now - max(t for t, what, _ in bench.sent if what == 'command') < 5.0
    bench.vehicles[1].rc_mode(MODES[kind].stick)
    assert bench.becomes(L, 3.0)
    bench.vehicles[1].rc_mode(MODES[kind].mission)
    bench.run(limit=20.0)
    assert shows(bench, L)
    assert keeps_quiet(bench, 20.0)


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
        bench.line.tampers.append(lambda way, m, now: [] if way == 'up' and (
            m.get_type() == 'MISSION_COUNT') else None)
        bench.assign(task_list('XY', 2))
    assert bench.run(lambda: bench.executor().telemetry.airborne, 10.0)
    bench.run(limit=1.0)
    if names == 'XY':
        assert keeps_quiet(bench, 12.0)
        assert shows(bench, N)
    else:
        assert shows(bench, H, 'took off with our mission')
        assert bench.run(lambda: bench.completed() == ['A', 'B'], 60.0)


@BOTH
def test_beside_a_foreign_mission_the_mission_mode_changes_nothing(kind):
    bench = suspended(kind, Suspension.FOREIGN)
    bench.vehicles[1].rc_mode(MODES[kind].mission)
    bench.run(limit=5.0)
    assert shows(bench, S, 'somebody else changed the mission')
    assert keeps_quiet(bench, 10.0)


@BOTH
def test_the_mission_mode_during_a_failsafe_hands_nothing_over(kind):
    bench = lost(kind)
    bench.vehicles[1].failsafe('radio', None)
    bench.run(limit=2.0)
    bench.vehicles[1].rc_mode(MODES[kind].mission)
    bench.run(limit=3.0)
    assert shows(bench, L)
    assert keeps_quiet(bench, 20.0)


# the end of a mission, PX4

@PX4
def test_held_px4_goes_to_hold_at_the_end_of_its_mission_and_stays_ours(kind):
    bench = flying(kind, 'AB')
    assert bench.run(lambda: bench.vehicles[1].mode.name == 'HOLD', 60.0)
    bench.run(limit=20.0)
    assert shows(bench, H)
    bench.assign(task_list('C', 2))
    assert bench.run(lambda: bench.completed() == ['A', 'B', 'C'], 60.0)


@PX4
def test_the_last_reached_may_come_after_the_hold(kind):
    bench = flying(kind, 'AB')

    def late(way, m, now):
        return [(3.0, m)] if m.get_type() == 'MISSION_ITEM_REACHED' else None
    bench.line.tampers.append(late)
    bench.line.tampers.insert(0, lambda way, m, now: [] if m.get_type() == 'STATUSTEXT' else None)
    assert bench.becomes(S, 60.0)
    assert shows(bench, S, 'Mission -> Hold')
    assert bench.becomes(H, 5.0)
    assert shows(bench, H)


@PX4
def test_without_the_last_reached_the_end_is_a_loss(kind):
    bench = flying(kind, 'AB')
    bench.line.tampers.append(lambda way, m, now: [] if m.get_type() in (
        'MISSION_ITEM_REACHED', 'STATUSTEXT') else None)
    assert bench.becomes(S, 60.0)
    assert bench.becomes(L, 6.0)
    assert keeps_quiet(bench)


@PX4
def test_a_hold_before_the_end_is_a_pilots(kind):
    bench = flying(kind, 'ABC')
    assert bench.run(lambda: bench.completed() == ['A'])
    bench.vehicles[1].rc_mode(MODES[kind].hold)
    assert bench.becomes(L, 2.0)
    assert keeps_quiet(bench)


@PX4
def test_suspended_the_end_of_the_mission_is_a_loss(kind):
    bench = flying(kind, 'AB')
    bench.vehicles[1].failsafe('battery', None)
    assert bench.becomes(S)
    assert bench.becomes(L, 60.0)
    assert keeps_quiet(bench)


@PX4
def test_lost_or_never_granted_the_end_of_a_mission_gives_nothing(kind):
    bench = risen_by_pilot(kind, 'AB', when_foreign='yield')
    upload_by_another(bench)
    bench.run(limit=5.0)
    bench.from_station(set_mode(MODES[kind].mission, kind))
    bench.run(limit=90.0)
    assert bench.vehicles[1].mode.name == 'HOLD'
    assert bench.authority() is not H
    assert bench.modes() == []


@PX4
def test_an_upload_of_ours_that_px4_calls_infeasible_does_not_take_it(kind):
    bench = flying(kind, 'ABC')
    far = task_list('ABC', 2)
    stop = far.stops[0].__class__(far.stops[0].task.__class__('far', (30000.0, 0.0, 60.0)))
    bench.assign(far.__class__(2, (stop,)))
    assert bench.run(lambda: bench.vehicles[1].mode.name == 'HOLD', 20.0)
    bench.run(limit=10.0)
    assert shows(bench, H)
    bench.assign(task_list('B', 3))
    assert bench.run(lambda: 'B' in bench.completed(), 60.0)
