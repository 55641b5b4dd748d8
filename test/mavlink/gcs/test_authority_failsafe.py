# SPDX-License-Identifier: Apache-2.0
"""Authority and the messages sent during failsafes, traffic avoidance, kills, FOREIGN missions."""
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
    lost,
    on_ground,
    sends_no_command,
    set_mode,
    status_is,
    suspended,
    upload_by_another,
)
from mission_bench import task_list
from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.mavlink.gcs.authority import Suspension
from uav_task_alloc.mavlink.gcs.onboard_mission import MissionState
from uav_task_alloc.sim.failsafe import FAILSAFE_KINDS

KIND_OF = pytest.mark.parametrize('failsafe', FAILSAFE_KINDS)
BACK = '~/hand_over, on the ground and disarmed'


# a failsafe that changes the mode

@BOTH
@KIND_OF
def test_a_failsafe_that_changes_the_mode_is_a_loss(kind, failsafe):
    bench = flying(kind)
    bench.vehicles[1].failsafe(failsafe, MODES[kind].rtl)
    assert bench.reaches(L, 3.0)
    assert status_is(bench, L, 'failsafe: ', f'-> {MODES[kind].names[MODES[kind].rtl]}')
    assert sends_no_command(bench)
    assert bench.authority() is L


@BOTH
@pytest.mark.parametrize('mode', ['hold', 'land', 'stick'])
def test_a_failsafe_into_any_mode_is_a_loss_that_outlasts_the_failsafe(kind, mode):
    bench = flying(kind)
    bench.vehicles[1].failsafe('battery', getattr(MODES[kind], mode))
    assert bench.reaches(L, 3.0)
    bench.run(limit=3.0)
    bench.vehicles[1].failsafe_over()
    bench.run(limit=8.0)
    assert sends_no_command(bench, 40.0)
    assert status_is(bench, L)


@BOTH
@KIND_OF
def test_a_failsafe_that_changes_the_mode_while_suspended_is_a_loss(kind, failsafe):
    bench = suspended(kind)
    bench.vehicles[1].failsafe(failsafe, MODES[kind].rtl)
    assert bench.reaches(L, 3.0)
    assert status_is(bench, L, 'failsafe: ')
    assert sends_no_command(bench, 20.0)


@BOTH
@pytest.mark.parametrize('state', [L, N])
def test_a_failsafe_of_a_vehicle_that_is_not_held_grants_nothing(kind, state):
    bench = in_flight(kind, state)
    bench.vehicles[1].failsafe('radio', MODES[kind].rtl)
    bench.run(limit=5.0)
    assert bench.authority() is state
    assert sends_no_command(bench, 20.0)
    assert bench.commands() == [] or state is L


@PX4
def test_a_text_alone_reports_a_failsafe_where_the_system_status_is_delayed(kind):
    bench = flying(kind)
    flight = bench.vehicles[1].flight
    flight.texts.append((2, 'Failsafe activated'))
    bench.vehicles[1].rc_mode(MODES[kind].hold)
    assert bench.reaches(L, 3.0)
    assert status_is(bench, L, 'failsafe: ')


# a failsafe while the mode stays

@BOTH
@KIND_OF
def test_a_failsafe_that_keeps_the_mode_suspends_until_it_is_cleared(kind, failsafe):
    bench = flying(kind)
    bench.vehicles[1].failsafe(failsafe, None)
    assert bench.reaches(S, 3.0)
    assert status_is(bench, S, 'a failsafe is active')
    assert sends_no_command(bench, names='ABC')
    bench.vehicles[1].failsafe_over()
    assert bench.reaches(H, 3.0)
    bench.run(limit=2.0)
    assert status_is(bench, H, 'the failsafe is over')
    bench.assign(task_list('ZY', 9))
    assert bench.run(lambda: bench.completed()[-2:] == ['Z', 'Y'], 200.0)


@BOTH
@pytest.mark.parametrize('state', [L, N])
def test_a_failsafe_that_keeps_the_mode_of_a_vehicle_not_held_changes_nothing(kind, state):
    bench = in_flight(kind, state)
    bench.vehicles[1].failsafe('gcs', None)
    bench.run(limit=5.0)
    assert bench.authority() is state
    bench.vehicles[1].failsafe_over()
    bench.run(limit=8.0)
    assert bench.authority() is state


@BOTH
def test_two_causes_of_a_suspension_must_both_end(kind):
    bench = suspended(kind)
    bench.line.cut = True
    bench.run(limit=5.0)
    assert set(bench.executor().authority.suspensions) == {Suspension.FAILSAFE, Suspension.LINK}
    bench.line.cut = False
    bench.run(limit=3.0)
    assert status_is(bench, S, 'a failsafe is active')
    bench.vehicles[1].failsafe_over()
    assert bench.reaches(H, 3.0)


@BOTH
def test_on_the_ground_a_failsafe_suspends_and_nothing_arms(kind):
    bench = on_ground(kind, S)
    assert sends_no_command(bench, 40.0)
    assert status_is(bench, S)
    bench.vehicles[1].failsafe_over()
    assert bench.reaches(H, 3.0)
    bench.assign(task_list('AB', 9))
    assert bench.run(lambda: bench.completed() == ['A', 'B'], 200.0)


# AVOID_ADSB

@ARDUPILOT
def test_while_it_avoids_traffic_nothing_is_sent_and_its_list_is_continued_afterwards(kind):
    bench = flying(kind)
    bench.vehicles[1].avoid(True)
    assert bench.reaches(S, 3.0)
    assert status_is(bench, S, 'AUTO -> AVOID_ADSB')
    assert sends_no_command(bench, names='ABC')
    bench.vehicles[1].avoid(False)
    assert bench.reaches(H, 3.0)
    bench.assign(task_list('ZY', 9))
    assert bench.run(lambda: bench.completed()[-2:] == ['Z', 'Y'], 200.0)


@ARDUPILOT
@pytest.mark.parametrize('state', [S, L, N])
def test_an_avoidance_by_a_vehicle_that_is_not_held_changes_nothing(kind, state):
    bench = in_flight(kind, state)
    bench.vehicles[1].avoid(True)
    bench.run(limit=5.0)
    assert bench.authority() is state
    bench.vehicles[1].avoid(False)
    bench.run(limit=8.0)
    assert bench.authority() is (L if state is N else state)  # back to a stick mode
    assert sends_no_command(bench, 20.0)


@ARDUPILOT
@pytest.mark.parametrize('mode', ['stick', 'rtl', 'hold', 'own'])
def test_a_pilot_who_ends_an_avoidance_by_another_mode_takes_the_vehicle(kind, mode):
    bench = suspended(kind, Suspension.AVOID)
    bench.vehicles[1].rc_mode(getattr(MODES[kind], mode))
    assert bench.reaches(L, 3.0)
    assert sends_no_command(bench)
    assert status_is(bench, L)


# kill

@BOTH
@pytest.mark.parametrize('state', [H, S, L, N])
def test_a_kill_is_a_loss_until_a_hand_over(kind, state):
    bench = in_flight(kind, state)
    bench.vehicles[1].kill_switch()
    assert bench.run(lambda: bench.executor().authority.killed, 3.0)
    assert bench.authority() is L
    assert status_is(bench, L, 'MotorEStop HIGH' if kind == 'ardupilot' else 'Kill engaged')
    assert bench.state().reason.endswith(BACK)
    assert sends_no_command(bench, 20.0)
    assert bench.hand_over() == 'a failsafe is active'
    bench.vehicles[1].kill_switch_off()
    bench.vehicles[1].failsafe_over()
    bench.run(limit=8.0)
    for takeoff in (False, True):
        bench.set_policy(takeoff=takeoff)
        bench.run(limit=3.0)
    assert status_is(bench, L)
    assert bench.state().reason.endswith(BACK)
    assert bench.hand_over() == ''
    bench.run(limit=0.2)
    assert status_is(bench, H, 'handed over by test')


@BOTH
def test_a_kill_on_the_ground_is_a_loss_too(kind):
    bench = on_ground(kind, H)
    bench.vehicles[1].kill_switch()
    assert bench.reaches(L, 3.0)
    bench.vehicles[1].kill_switch_off()
    assert sends_no_command(bench)
    assert bench.executor().authority.killed


@BOTH
@pytest.mark.parametrize('text', ['Kill engaged', 'Kill-switch engaged', 'Emergency Stop',
                                  'RC7: MotorEStop HIGH', 'Flight termination active'])
def test_a_text_that_reports_a_kill_is_a_loss(kind, text):
    bench = flying(kind)
    bench.vehicles[1].flight.texts.append((6 if 'RC7' in text else 2, text))
    assert bench.reaches(L, 3.0)
    assert status_is(bench, L, text)
    assert bench.executor().authority.killed


@BOTH
@pytest.mark.parametrize('text', ['Kill disengaged', 'Kill-switch disengaged',
                                  'RC7: MotorEStop LOW'])
def test_the_text_that_reports_the_end_of_a_kill_is_no_kill(kind, text):
    bench = flying(kind)
    bench.vehicles[1].flight.texts.append((6, text))
    bench.run(limit=3.0)
    assert status_is(bench, H)


@BOTH
def test_after_a_kill_a_hand_over_needs_the_ground_and_disarmed(kind):
    bench = flying(kind)
    bench.from_vehicle(d.MAVLink_statustext_message(2, b'Kill engaged'))
    assert bench.executor().authority.killed
    assert bench.hand_over() == 'after a kill only on the ground and disarmed'
    bench.vehicles[1].rc_mode(MODES[kind].stick)
    bench.run(limit=13.0)
    bench.vehicles[1].rc_mode(MODES[kind].mission)
    bench.run(limit=8.0)
    bench.vehicles[1].rc_mode(MODES[kind].stick)
    bench.run(limit=2.0)
    bench.vehicles[1].rc_mode(MODES[kind].hold)
    bench.run(limit=10.0)
    assert status_is(bench, L)
    bench.vehicles[1].rc_mode(MODES[kind].land)
    assert bench.run(lambda: not bench.vehicles[1].flight.armed, 60.0)
    bench.run(limit=3.0)
    assert bench.hand_over() == ''
    assert bench.authority() is H


@BOTH
def test_a_disarming_in_the_air_counts_as_a_kill(kind):
    bench = flying(kind)
    beat = bench.vehicles[1]._telemetry.heartbeat()
    beat.base_mode &= ~d.MAV_MODE_FLAG_SAFETY_ARMED
    bench.from_vehicle(beat)
    assert status_is(bench, L, 'disarmed in the air')
    assert bench.executor().authority.killed


@BOTH
def test_a_landing_by_the_pilot_is_no_kill(kind):
    bench = lost(kind)
    bench.vehicles[1].rc_mode(MODES[kind].rtl)
    assert bench.run(lambda: not bench.vehicles[1].flight.armed, 100.0)
    bench.run(limit=3.0)
    assert status_is(bench, L, 'not by the bridge')
    assert not bench.executor().authority.killed


# a foreign mission

@BOTH
def test_a_foreign_mission_suspends_until_our_mission_is_on_board_again(kind):
    bench = suspended(kind, Suspension.FOREIGN)
    assert status_is(bench, S, 'somebody else changed the mission')
    start = len(bench.sent)
    assert sends_no_command(bench, names='ABC')
    assert {action for _, action, _ in bench.sent[start:]} <= {'read'}
    bench.set_policy(when_foreign='reassert')
    assert bench.reaches(H, 3.0)
    bench.assign(task_list('ZY', 9))
    assert bench.run(lambda: bench.completed()[-2:] == ['Z', 'Y'], 200.0)


@BOTH
def test_with_reassert_a_foreign_mission_is_no_loss(kind):
    bench = flying(kind, when_foreign='reassert')
    bench.run(limit=3.0)
    upload_by_another(bench, items=20)
    bench.run(limit=10.0)
    assert status_is(bench, H)
    assert bench.run(lambda: bench.onboard().state is MissionState.VERIFIED, 60.0)


@BOTH
@pytest.mark.parametrize('state', [L, N])
def test_a_foreign_mission_on_a_vehicle_that_is_not_held_changes_nothing(kind, state):
    bench = in_flight(kind, state)
    upload_by_another(bench, items=20)
    bench.run(limit=10.0)
    assert bench.authority() is state
    assert sends_no_command(bench, 20.0)


def with_foreign_mission(kind):
    """NONE, on the ground, with a mission that another station has put on board."""
    bench = on_ground(kind, N)
    bench.assign(task_list('AB', 2))
    assert bench.run(lambda: bench.onboard().state is MissionState.VERIFIED, 20.0)
    bench.run(limit=5.0)
    upload_by_another(bench, items=7)
    assert bench.run(lambda: bench.onboard().mission.is_foreign, 70.0)
    return bench


@BOTH
def test_a_foreign_mission_on_the_ground_is_left_though_nothing_was_granted(kind):
    bench = with_foreign_mission(kind)
    stored, start = list(bench.vehicles[1].mission.items), len(bench.sent)
    bench.assign(task_list('ZY', 3))
    bench.run(limit=100.0)
    assert bench.vehicles[1].mission.items == stored
    assert {action for _, action, _ in bench.sent[start:]} <= {'read'}
    assert bench.authority() is N
    assert bench.state().reason == (
        'somebody else changed the mission: yield; given back by our mission on board, or '
        'when_foreign: reassert')
    bench.set_policy(when_foreign='reassert')
    assert bench.run(lambda: bench.onboard().state is MissionState.VERIFIED, 20.0)
    assert bench.state().available


@BOTH
def test_a_pilot_who_flies_a_mission_of_another_station_is_not_held(kind):
    bench = with_foreign_mission(kind)
    start, vehicle = len(bench.sent), bench.vehicles[1]
    vehicle.rc_mode(MODES[kind].stick)
    assert vehicle.rc_arm(True)
    vehicle.rc_stick((0.0, 0.0, 3.0))
    bench.run(limit=8.0)
    vehicle.rc_stick(None)
    bench.run(limit=4.0)
    vehicle.rc_mode(MODES[kind].mission)
    bench.run(limit=20.0)
    assert bench.commands(start) == []
    assert vehicle.flight.custom_mode == MODES[kind].mission
    assert bench.authority() is S


@BOTH
def test_a_foreign_mission_that_its_station_starts_again_stays_foreign(kind):
    bench = suspended(kind, Suspension.FOREIGN)
    bench.from_station(set_mode(MODES[kind].mission, kind))
    assert sends_no_command(bench, 20.0)
    assert bench.authority() is S
