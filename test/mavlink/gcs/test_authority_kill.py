# SPDX-License-Identifier: Apache-2.0
"""A disarming in the air is a kill whatever came before; what only looks like our own is none."""
from dataclasses import replace

import pytest
from authority_bench import (
    BOTH,
    MODES,
    AuthorityBench,
    H,
    L,
    N,
    lose_command,
    on_ground,
    sends_no_command,
    set_mode,
)
from mission_bench import task_list
from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.mavlink.gcs.authority_state import UNUSABLE, AuthorityState
from uav_task_alloc.mavlink.gcs.sent_commands import SentCommands


def killed(bench):
    """The pilot disarms it in the air; it is LOST, and a new list arms nothing."""
    bench.vehicles[1].rc_arm(False, force=True)
    assert bench.reaches(L, 3.0)
    assert bench.executor().authority.killed
    bench.line.tampers.clear()
    assert sends_no_command(bench, 40.0)
    assert not bench.vehicles[1].flight.armed
    return True


@BOTH
@pytest.mark.parametrize('relaunch', ['automatic', 'operator'])
@pytest.mark.parametrize('by', ['item', 'mode'])
def test_a_kill_on_the_way_home_is_no_landing(kind, relaunch, by):
    bench = AuthorityBench(kind, relaunch=relaunch).discover()
    bench.assign(task_list('A', 1, returns=by == 'item'))
    assert bench.run(lambda: bench.completed() == ['A'], 200.0)
    if by == 'mode':
        bench.set_policy(when_empty='return')
        bench.assign(task_list('', 2))
    assert bench.run(lambda: bench.vehicles[1].flight.body.position[1] < 60.0, 60.0)
    bench.run(limit=1.0)
    assert bench.authority() is H
    assert killed(bench)


def on_its_way_home(kind):
    """The flight of a UAV whose list has ended, with `relaunch: automatic`."""
    bench = AuthorityBench(kind, relaunch='automatic').discover()
    bench.assign(task_list('A', 1, returns=True))
    assert bench.run(lambda: bench.completed() == ['A'], 200.0)
    return bench, bench.vehicles[1].flight


@BOTH
def test_a_kill_while_it_hovers_over_its_home_is_seen_by_its_fall(kind):
    bench, flight = on_its_way_home(kind)

    def at_rest(direction, m, now):
        if m.get_type() == 'GLOBAL_POSITION_INT':
            m.vx = m.vy = m.vz = 0
        return None

    bench.line.tampers.append(at_rest)
    assert bench.run(lambda: abs(flight.body.position[1]) < 20.0 and (
        flight.body.position[2] < 12.0), 100.0)
    assert killed(bench)
    assert bench.executor().authority.why == 'fell after it was disarmed'


@BOTH
def test_a_kill_in_the_climb_after_our_own_landing_is_a_kill(kind):
    bench, flight = on_its_way_home(kind)
    assert bench.run(lambda: not flight.armed, 200.0)
    bench.run(limit=0.4)
    bench.assign(task_list('B', 2, returns=True))
    assert bench.run(lambda: flight.armed and flight.body.position[2] > 4.0, 30.0)
    assert killed(bench)


@BOTH
@pytest.mark.parametrize('place', ['air', 'ground'])
def test_our_own_disarming_explains_no_later_one(kind, place):
    bench = on_ground(kind, H)
    flight = bench.vehicles[1].flight
    lose_command(bench, d.MAV_CMD_NAV_TAKEOFF)
    bench.assign(task_list('AB', 2))
    assert bench.run(lambda: flight.armed, 10.0)
    bench.run(limit=2.0)
    bench.assign(task_list('', 3))
    assert bench.run(lambda: not flight.armed, 10.0)
    bench.run(limit=1.0)
    bench.assign(task_list('AB', 4))
    assert bench.run(lambda: flight.armed, 10.0)
    bench.run(limit=1.5)
    if place == 'ground':
        bench.vehicles[1].rc_arm(False)
        assert bench.reaches(L, 3.0)
        assert sends_no_command(bench, 30.0)
    else:
        bench.line.tampers.clear()
        assert bench.run(lambda: flight.body.position[2] > 4.0, 20.0)
        assert killed(bench)


@BOTH
def test_after_a_landing_it_is_armed_again_only_after_a_moment(kind):
    bench, flight = on_its_way_home(kind)
    assert bench.run(lambda: not flight.armed, 200.0)
    landed_at = bench.now
    bench.assign(task_list('B', 2, returns=True))
    assert bench.run(lambda: flight.armed, 20.0)
    assert bench.now - landed_at >= 3.0


@BOTH
def test_a_crash_while_the_bridge_was_down_is_no_landing(kind):
    bench = AuthorityBench(kind, relaunch='automatic',
                           configs={1: {'range': 4000.0, 'endurance': 600.0}}).discover()
    bench.assign(task_list('ABCDEFG', 1))
    assert bench.run(lambda: len(bench.completed()) == 3, 200.0)
    bench.run(limit=2.0)
    bench.kill()
    vehicle = bench.vehicles[1]
    vehicle.rc_arm(False, force=True)
    bench.run(limit=4.0)
    bench.start()
    bench.discover()
    bench.assign(task_list('DEFG', 2))
    bench.run(limit=10.0)
    assert bench.authority() is L
    vehicle.flight.body.battery = 1.0
    vehicle.reboot(bench.now)
    bench.run(limit=60.0)
    assert bench.authority() is L
    assert not vehicle.flight.armed


@BOTH
def test_a_return_of_the_pilot_after_ours_was_refused_is_a_loss(kind):
    bench = AuthorityBench(kind, when_empty='return').discover()
    bench.assign(task_list('ABCDE', 1))
    assert bench.run(lambda: bench.completed() == ['A'], 200.0)
    refused = bench.executor().profile.commanded_mode

    def refuse(direction, m, now):
        if direction != 'up' or m.get_type() != 'COMMAND_LONG' or refused(m) != MODES[kind].rtl:
            return None
        bench.from_vehicle(d.MAVLink_command_ack_message(
            m.command, d.MAV_RESULT_DENIED, 0, 0, 245, 190))
        return []

    bench.line.tampers.append(refuse)
    bench.assign(task_list('', 2))
    bench.run(limit=4.0)
    assert bench.authority() is H
    bench.line.tampers.clear()
    bench.from_station(set_mode(MODES[kind].rtl, kind))
    assert bench.reaches(L, 3.0)
    assert sends_no_command(bench, 40.0)


@pytest.mark.parametrize(('attempts', 'expected'), [(1, False), (2, True)])
def test_a_refusal_ends_the_wait_for_a_mode_unless_another_attempt_may_set_it(
        attempts, expected):
    sent, command = SentCommands(), d.MAV_CMD_DO_SET_MODE
    for n in range(attempts):
        sent.acks.command_sent(command, 6, float(n))
        sent.add_mode(6, float(n))
    sent.receive_command_ack(d.MAVLink_command_ack_message(
        command, d.MAV_RESULT_TEMPORARILY_REJECTED, 0, 0, 245, 190), 9)
    assert sent.was_recently_sent(6, 3.0) is expected
    assert sent.confirm_mode(6, 3.0) is expected


# a grant by `takeoff`

@BOTH
@pytest.mark.parametrize('by', ['parameter', 'restart'])
def test_takeoff_that_becomes_true_in_a_flight_of_a_pilot_arms_nothing_after_it(kind, by):
    bench = AuthorityBench(kind, takeoff=False)
    vehicle = bench.vehicles[1]
    vehicle.rc_mode(MODES[kind].stick)
    bench.discover()
    bench.assign(task_list('AB'))
    bench.run(limit=10.0)
    assert vehicle.rc_arm(True)
    vehicle.rc_stick((0.0, 0.0, 3.0))
    bench.run(limit=6.0)
    assert bench.authority() is N
    if by == 'parameter':
        bench.set_policy(takeoff=True)
    else:
        bench.policy = replace(bench.policy, takeoff=True)
        bench.kill_and_restart()
        bench.assign(task_list('AB'))
    vehicle.rc_stick((0.0, 0.0, -2.0))
    assert bench.run(lambda: vehicle.flight.landed, 60.0)
    vehicle.rc_stick(None)
    vehicle.rc_arm(False)
    bench.run(limit=20.0)
    assert bench.authority() is N
    assert not vehicle.flight.armed
    assert bench.executor().authority.given_back_by == '~/hand_over'
    assert bench.hand_over() == ''
    assert bench.run(lambda: vehicle.flight.armed, 20.0)


# a file that cannot be used

@BOTH
def test_on_the_ground_a_file_that_cannot_be_used_awaits_a_hand_over(kind):
    bench = AuthorityBench(kind)
    bench.store.records['uav_1'] = UNUSABLE
    bench.discover()
    bench.assign(task_list('AB'))
    bench.run(limit=30.0)
    assert bench.authority() is N
    assert not bench.vehicles[1].flight.armed
    assert bench.state().reason == ('authority NONE: its authority file cannot be used; given '
                                    'back by ~/hand_over')
    assert bench.store.records['uav_1'].landed
    bench.kill_and_restart()
    bench.assign(task_list('AB'))
    bench.run(limit=20.0)
    assert bench.authority() is N
    assert bench.hand_over() == ''
    assert bench.run(lambda: bench.completed() == ['A', 'B'], 100.0)


@BOTH
def test_in_flight_a_file_that_cannot_be_used_is_as_none(kind):
    bench = AuthorityBench(kind).discover()
    bench.assign(task_list('ABCDE'))
    assert bench.run(lambda: bench.completed() == ['A'], 100.0)
    bench.kill()
    bench.store.records['uav_1'] = UNUSABLE
    bench.start()
    bench.discover()
    bench.assign(task_list('ABCDE'))
    assert bench.reaches(AuthorityState.HELD, 20.0)
    assert bench.run(lambda: bench.completed()[-1:] == ['E'], 200.0)


@BOTH
def test_a_killed_vehicle_is_handed_over_only_at_rest(kind):
    bench = AuthorityBench(kind).discover()
    bench.assign(task_list('A', 1))
    flight = bench.vehicles[1].flight
    assert bench.run(lambda: flight.body.position[2] > 25.0, 60.0)
    bench.vehicles[1].rc_arm(False, force=True)
    assert bench.reaches(L, 3.0)
    answers = []
    while flight.body.position[2] > 1.0:
        answers.append(bench.hand_over())
        bench.run(limit=0.1)
    assert answers
    assert set(answers) == {'after a kill only at rest: it has not been for 2 s'}
    bench.run(limit=4.0)
    assert bench.hand_over() == ''
    assert bench.authority() is H
