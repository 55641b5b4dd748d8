# SPDX-License-Identifier: Apache-2.0
"""`~/hand_over`: refused in each case with its reason, granted otherwise, and HOLD comes first."""
import pytest
from authority_bench import (
    BOTH,
    LONG,
    MODES,
    AuthorityBench,
    H,
    L,
    N,
    S,
    flown_up_by_pilot,
    flying,
    in_flight,
    lose_command,
    lost,
    on_ground,
    sends_no_command,
    status_is,
    suspended,
)
from mission_bench import drop, task_list
from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.mavlink.gcs.authority import AuthorityEvent, Suspension
from uav_task_alloc.mavlink.gcs.onboard_mission import MissionState


def refused(bench, reason):
    """The hand-over is refused: the state stays, and no command is sent."""
    state, start = bench.authority(), len(bench.sent)
    assert bench.hand_over() == reason
    assert bench.authority() is state
    bench.run(limit=5.0)
    assert bench.commands(start) == []
    return True


@BOTH
@pytest.mark.parametrize('state', [S, L, N])
def test_it_is_refused_while_the_link_is_stale(kind, state):
    bench = in_flight(kind, state)
    bench.line.cut = True
    bench.run(limit=4.0)
    assert refused(bench, 'its link is stale')


@BOTH
@pytest.mark.parametrize('state', [S, L, N])
def test_it_is_refused_while_a_failsafe_is_active(kind, state):
    bench = in_flight(kind, state)
    bench.vehicles[1].failsafe('radio', None)
    bench.run(limit=2.0)
    assert refused(bench, 'a failsafe is active')


@BOTH
@pytest.mark.parametrize('state', [L, N])
def test_it_is_refused_on_a_low_battery(kind, state):
    bench = in_flight(kind, state)
    bench.vehicles[1].flight.body.battery = 0.195
    bench.run(limit=3.0)
    assert refused(bench, 'battery = 19%: expected at least 20%')


@BOTH
def test_it_is_refused_with_a_foreign_mission(kind):
    bench = suspended(kind, Suspension.FOREIGN)
    assert refused(bench, 'the mission on board is foreign')
    bench.vehicles[1].rc_mode(MODES[kind].stick)
    assert bench.reaches(L, 3.0)
    assert refused(bench, 'the mission on board is foreign')


@BOTH
def test_it_is_refused_while_traffic_is_avoided_or_something_else_suspends(kind):
    bench = flying(kind)
    bench.executor().authority.apply(AuthorityEvent.AVOIDING, bench.now, 'avoids')
    assert bench.hand_over() == 'SUSPENDED: avoids'


@BOTH
@pytest.mark.parametrize('state', [L, N])
def test_it_is_refused_on_the_ground_without_takeoff(kind, state):
    bench = on_ground(kind, state)
    bench.set_policy(takeoff=False)
    bench.run(limit=1.0)
    assert refused(bench, 'on the ground, and takeoff is false')


@BOTH
def test_it_is_refused_while_the_autopilot_starts(kind):
    bench = AuthorityBench(kind, configs={1: {'boot_delay': 30.0}}).discover()
    bench.run(limit=3.0)
    assert refused(bench, 'the autopilot is starting: preflight checks fail')


@BOTH
def test_it_is_refused_while_it_is_not_known_whether_it_is_airborne(kind):
    bench = flying(kind)
    bench.line.tampers.append(drop({'EXTENDED_SYS_STATE', 'GLOBAL_POSITION_INT'}, 1 << 30))
    bench.kill_and_restart(1.0, store=False)
    bench.run(limit=2.0)
    assert bench.hand_over() == 'not known whether it is in the air'


@BOTH
def test_a_hand_over_of_a_held_vehicle_succeeds_and_changes_nothing(kind):
    bench = flying(kind)
    start = len(bench.sent)
    assert bench.hand_over() == ''
    bench.run(limit=10.0)
    assert bench.commands(start) == []
    assert status_is(bench, H, 'takeoff is true')


@BOTH
@pytest.mark.parametrize('state', [L, N])
def test_in_flight_it_is_granted_and_holds_before_anything_else(kind, state):
    bench, modes = in_flight(kind, state), MODES[kind]
    start = len(bench.sent)
    assert bench.hand_over() == ''
    assert bench.run(lambda: len(bench.modes(start)) == 2, 20.0)
    assert status_is(bench, H, 'handed over by test')
    assert bench.modes(start) == [modes.hold, modes.mission]
    first = bench.commands(start)[0]
    assert bench.executor().profile.commanded_mode(first) == modes.hold
    assert bench.run(lambda: len(bench.completed()) >= 2, 60.0)


@BOTH
@pytest.mark.parametrize('mode', ['mission', 'rtl', 'land', 'own'])
def test_from_any_mode_it_holds_first_even_if_its_list_is_verified(kind, mode):
    bench, modes = lost(kind), MODES[kind]
    bench.vehicles[1].rc_mode(modes.own)
    bench.run(limit=2.0)
    bench.vehicles[1].rc_mode(getattr(modes, mode))
    bench.run(limit=0.0)
    start = len(bench.sent)
    assert bench.hand_over() == ''
    assert bench.run(lambda: len(bench.modes(start)) >= 2, 20.0)
    assert bench.modes(start)[:2] == [modes.hold, modes.mission]


@BOTH
def test_with_a_new_list_pending_it_holds_before_the_upload(kind):
    bench, modes = lost(kind), MODES[kind]
    bench.assign(task_list('ZYX', 2))
    bench.run(limit=3.0)
    start = len(bench.sent)
    assert bench.hand_over() == ''
    assert bench.run(lambda: bench.completed()[-3:] == ['Z', 'Y', 'X'], 200.0)
    kinds = [(m.get_type(), bench.executor().profile.commanded_mode(m))
             for _, action, m in bench.sent[start:] if action != 'read']
    assert kinds[0] == ('COMMAND_LONG', modes.hold)
    assert kinds[1][0] == 'MISSION_COUNT'


@BOTH
def test_a_hold_that_fails_is_retried_and_nothing_else_is_sent(kind):
    bench, modes = lost(kind), MODES[kind]
    lose_command(bench, d.MAV_CMD_DO_SET_MODE)
    start = len(bench.sent)
    assert bench.hand_over() == ''
    bench.run(limit=40.0)
    assert set(bench.modes(start)) == {modes.hold}
    assert len(bench.modes(start)) >= 10
    bench.line.tampers.clear()
    assert bench.run(lambda: bench.modes(start)[-1] == modes.mission, 30.0)


@BOTH
def test_a_mode_set_by_the_pilot_right_after_a_hand_over_is_a_loss(kind):
    bench, modes = lost(kind), MODES[kind]
    assert bench.hand_over() == ''
    assert bench.run(lambda: bench.vehicles[1].flight.custom_mode == modes.mission, 3.0)
    bench.run(limit=1.0)
    bench.vehicles[1].rc_mode(modes.stick)
    assert bench.reaches(L, 3.0)
    assert sends_no_command(bench)


@BOTH
def test_killed_right_after_a_hand_over_it_still_holds_first(kind):
    bench, modes = lost(kind), MODES[kind]
    lose_command(bench, d.MAV_CMD_DO_SET_MODE)
    assert bench.hand_over() == ''
    bench.run(limit=2.0)
    bench.kill_and_restart(2.0)
    bench.line.tampers.clear()
    bench.run(limit=3.0)
    assert bench.authority() is H
    start = len(bench.sent)
    bench.assign(task_list(LONG, 2))
    assert bench.run(lambda: len(bench.modes(start)) == 2, 20.0)
    assert bench.modes(start) == [modes.hold, modes.mission]


@BOTH
@pytest.mark.parametrize('state', [L, N])
def test_on_the_ground_it_is_granted_and_takes_off(kind, state):
    bench = on_ground(kind, state)
    bench.set_policy(takeoff=True)
    assert bench.hand_over() == ''
    bench.run(limit=0.2)
    assert status_is(bench, H, 'handed over by test')
    bench.assign(task_list('AB', 2))
    assert bench.run(lambda: bench.completed() == ['A', 'B'], 100.0)


@BOTH
def test_with_takeoff_false_a_hand_over_in_flight_lasts_until_the_landing(kind):
    bench = flown_up_by_pilot(kind, 'A')
    assert bench.hand_over() == ''
    assert bench.run(lambda: bench.completed() == ['A'], 60.0)
    bench.assign(task_list('', 2, returns=True))
    assert bench.run(lambda: not bench.vehicles[1].flight.armed, 100.0)
    assert bench.reaches(N, 3.0)
    assert sends_no_command(bench, 20.0)


@BOTH
def test_commands_sent_before_a_hand_over_explain_no_mode_after_it(kind):
    bench, modes = flying(kind), MODES[kind]
    bench.assign(task_list('', 2))
    bench.run(limit=3.0)
    bench.vehicles[1].rc_mode(modes.stick)
    assert bench.reaches(L, 3.0)
    assert bench.hand_over() == ''
    assert bench.run(lambda: bench.vehicles[1].flight.custom_mode == modes.hold, 3.0)
    bench.run(limit=2.0)
    bench.vehicles[1].rc_mode(modes.rtl)
    assert bench.reaches(L, 3.0)
    assert bench.onboard().state is MissionState.VERIFIED
    assert sends_no_command(bench, 20.0)


@BOTH
@pytest.mark.parametrize('acks', [0, 1])
@pytest.mark.parametrize('over', [False, True])
def test_a_failsafe_back_to_the_mode_before_our_hold_that_no_heartbeat_showed_is_a_loss(
        kind, acks, over):
    bench = flying(kind)
    vehicle = bench.vehicles[1]
    vehicle.rc_mode(MODES[kind].rtl)
    assert bench.reaches(L, 3.0)
    bench.assign(task_list('XYZ', 2))  # to be uploaded while it holds
    bench.run(limit=3.0)
    bench.line.tampers += [drop({'COMMAND_ACK'}, acks, 'down'), drop({'MISSION_COUNT'}, 1 << 30),
                           drop({'HEARTBEAT'}, 1 << 30, 'down')]
    before = len(bench.line.sent('COMMAND_ACK', 'down'))
    assert bench.hand_over() == ''
    assert bench.run(lambda: len(bench.line.sent('COMMAND_ACK', 'down')) > before + acks, 2.5)
    assert vehicle.flight.custom_mode == MODES[kind].hold
    bench.run(limit=0.4)
    vehicle.failsafe('radio', MODES[kind].rtl)
    bench.line.tampers.clear()
    bench.run(limit=2.0)
    if over:
        vehicle.failsafe_over()
    assert bench.reaches(L, 6.0)
    vehicle.failsafe_over()
    assert sends_no_command(bench)
