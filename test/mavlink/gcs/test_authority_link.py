# SPDX-License-Identifier: Apache-2.0
"""Authority and the messages sent during silence, new addresses and reboots of a vehicle."""
import pytest
from authority_bench import (
    ARDUPILOT,
    BOTH,
    COPTER,
    LONG,
    MODES,
    PX4,
    AuthorityBench,
    H,
    L,
    N,
    S,
    flying,
    in_flight,
    on_ground,
    sends_no_command,
    status_is,
    suspended,
)
from mission_bench import drop, task_list

from uav_task_alloc.mavlink.gcs.authority import Suspension


def cut_link(bench, seconds=6.0):
    bench.line.cut = True
    bench.run(limit=seconds)


def restore_link(bench, seconds=4.0):
    bench.line.cut = False
    bench.run(limit=seconds)


# silence

@BOTH
@pytest.mark.parametrize('seconds', [4.0, 20.0])
def test_during_silence_nothing_is_sent_and_the_same_mode_ends_the_suspension(kind, seconds):
    bench = flying(kind)
    cut_link(bench, 3.5)
    assert status_is(bench, S, 'no message for 3 s')
    assert bench.state().reason == 'its link is stale'
    start = len(bench.sent)
    bench.assign(task_list('ZYX', 2))
    bench.run(limit=seconds)
    assert bench.sent[start:] == []
    restore_link(bench, 1.5)
    assert status_is(bench, H, 'the link is back, in ')
    assert bench.run(lambda: bench.completed()[-3:] == ['Z', 'Y', 'X'], 200.0)


@BOTH
def test_the_mode_before_our_acknowledged_one_is_a_change_after_silence(kind):
    bench = AuthorityBench(kind).discover()
    bench.assign(task_list(LONG))
    assert bench.run(lambda: bench.started() == ['A'])  # no heartbeat has shown MISSION
    before = bench.executor().watch.mode
    assert before == MODES[kind].hold
    cut_link(bench)
    bench.vehicles[1].rc_mode(before)
    restore_link(bench, 1.5)
    assert status_is(bench, L, 'the link is back, in ', ' instead of ')
    assert sends_no_command(bench)


@BOTH
@pytest.mark.parametrize('mode', ['hold', 'stick', 'rtl', 'land', 'own'])
def test_another_mode_after_silence_is_a_loss(kind, mode):
    bench = flying(kind)
    cut_link(bench)
    bench.vehicles[1].rc_mode(getattr(MODES[kind], mode))
    restore_link(bench, 1.5)
    assert status_is(bench, L, 'the link is back, in ', ' instead of ')
    assert sends_no_command(bench)


@PX4
def test_a_mission_that_ended_during_silence_is_a_loss(kind):
    bench = flying(kind, 'AB')
    cut_link(bench, 60.0)
    restore_link(bench)
    assert status_is(bench, L, 'Hold instead of Mission')


@BOTH
def test_a_mode_that_we_commanded_just_before_the_silence_is_no_loss(kind):
    bench = flying(kind)
    bench.assign(task_list('', 2))
    assert bench.run(lambda: bench.vehicles[1].flight.custom_mode == MODES[kind].hold, 3.0)
    cut_link(bench)
    restore_link(bench, 1.5)
    assert status_is(bench, H, 'the link is back, in ')


@BOTH
def test_an_arming_by_somebody_else_during_silence_is_a_loss(kind):
    bench = on_ground(kind, H)
    cut_link(bench)
    bench.vehicles[1].rc_arm(True)
    restore_link(bench, 1.5)
    assert status_is(bench, L)
    assert sends_no_command(bench, 20.0)


@BOTH
@pytest.mark.parametrize('state', [L, N])
@pytest.mark.parametrize('mode', ['same', 'hold', 'mission', 'rtl'])
def test_silence_changes_nothing_while_not_held(kind, state, mode):
    bench = in_flight(kind, state)
    cut_link(bench)
    assert bench.authority() is state
    if mode != 'same':
        bench.vehicles[1].rc_mode(getattr(MODES[kind], mode))
    restore_link(bench, 3.0)
    assert bench.authority() is state
    assert sends_no_command(bench, 20.0)


@BOTH
def test_another_mode_after_silence_while_suspended_is_a_loss(kind):
    bench = suspended(kind)
    cut_link(bench)
    assert set(bench.executor().authority.suspensions) == {Suspension.FAILSAFE, Suspension.LINK}
    bench.vehicles[1].rc_mode(MODES[kind].stick)
    restore_link(bench, 1.5)
    assert status_is(bench, L)


def lose_heartbeats(bench):
    """Only the heartbeats of the vehicle are lost from now on."""
    bench.line.tampers.append(drop({'HEARTBEAT'}, 1 << 30))


@BOTH
def test_without_heartbeats_nothing_is_sent_though_other_messages_arrive(kind):
    bench = flying(kind)
    lose_heartbeats(bench)
    bench.run(limit=6.0)
    assert status_is(bench, S, 'no heartbeat for 5 s')
    assert bench.state().reason == 'its link is stale'
    start = len(bench.sent)
    bench.assign(task_list('ZYX', 2))
    bench.run(limit=10.0)
    assert bench.sent[start:] == []
    bench.line.tampers.clear()
    assert bench.reaches(H, 1.5)
    assert bench.run(lambda: bench.completed()[-3:] == ['Z', 'Y', 'X'], 200.0)


@BOTH
def test_a_pilot_who_takes_over_while_only_heartbeats_are_lost_keeps_it(kind):
    bench = flying(kind)
    lose_heartbeats(bench)
    bench.vehicles[1].rc_mode(MODES[kind].stick)
    bench.run(limit=6.0)
    start = len(bench.sent)
    bench.assign(task_list('ZYX', 2))
    bench.run(limit=20.0)
    assert bench.sent[start:] == []
    assert bench.vehicles[1].flight.custom_mode == MODES[kind].stick
    bench.line.tampers.clear()
    bench.run(limit=1.5)
    assert status_is(bench, L, 'the link is back, in ', ' instead of ')
    assert sends_no_command(bench)


@BOTH
def test_without_heartbeats_another_address_does_not_take_its_place(kind):
    bench = flying(kind)
    lose_heartbeats(bench)
    bench.run(limit=6.0)
    bench.move_address()
    bench.run(limit=0.5)
    assert not any('new address' in note for note in bench.notes)


# a new address

@BOTH
def test_from_a_new_address_nothing_is_sent_before_the_mode_is_confirmed(kind):
    bench = flying(kind)
    cut_link(bench)
    bench.move_address()
    bench.line.tampers.append(drop({'HEARTBEAT'}, 1 << 30))
    restore_link(bench, 2.0)
    assert bench.authority() is S
    assert any('its messages come from a new address' in note for note in bench.notes)
    start = len(bench.sent)
    bench.assign(task_list('ZYX', 2))
    bench.run(limit=5.0)
    assert bench.sent[start:] == []
    bench.line.tampers.clear()
    assert bench.reaches(H, 1.5)
    assert bench.run(lambda: bench.completed()[-3:] == ['Z', 'Y', 'X'], 200.0)


@BOTH
@pytest.mark.parametrize('mode', ['stick', 'hold'])
def test_another_mode_from_a_new_address_is_a_loss(kind, mode):
    bench = flying(kind)
    cut_link(bench)
    bench.move_address()
    bench.vehicles[1].rc_mode(getattr(MODES[kind], mode))
    restore_link(bench, 2.0)
    assert status_is(bench, L, 'the link is back, in ')
    assert sends_no_command(bench)


@BOTH
@pytest.mark.parametrize('what', ['place', 'clock', 'silence'])
def test_another_vehicle_in_flight_at_the_new_address_is_a_loss(kind, what):
    bench = flying(kind)
    cut_link(bench)
    bench.move_address()

    def of_another(direction, m, now):
        if direction == 'down' and m.get_type() == 'GLOBAL_POSITION_INT':
            if what == 'silence':
                return []
            m.lat += 50000 * (what == 'place')  # 556 m
        if direction == 'down' and what == 'clock' and hasattr(m, 'time_boot_ms'):
            m.time_boot_ms += 600_000
        return None

    bench.line.tampers.append(of_another)
    start = len(bench.sent)
    restore_link(bench, 6.0)
    assert status_is(bench, L, 'the vehicle at its new address is another one')
    assert bench.commands(start) == []
    assert sends_no_command(bench)


@BOTH
@pytest.mark.parametrize('state', [S, L, N])
def test_a_new_address_of_a_vehicle_that_is_not_held_changes_nothing(kind, state):
    bench = in_flight(kind, state)
    cut_link(bench)
    bench.move_address()
    restore_link(bench)
    assert bench.authority() is state
    assert sends_no_command(bench, 20.0)


# reboots

@BOTH
@pytest.mark.parametrize('silence', [0.0, 6.0])
def test_a_reboot_of_a_vehicle_never_armed_keeps_it_held(kind, silence):
    bench = on_ground(kind, H)
    bench.line.cut = silence > 0.0
    bench.vehicles[1].reboot(bench.now)
    bench.run(limit=silence)
    restore_link(bench, 8.0)
    assert 'was restarted' in bench.notes
    assert status_is(bench, H)
    bench.assign(task_list('AB', 2))
    assert bench.run(lambda: bench.completed() == ['A', 'B'], 100.0)


@ARDUPILOT
@pytest.mark.parametrize('silence', [0.0, 6.0])
def test_a_reboot_while_it_refuses_to_arm_keeps_it_held(kind, silence):
    bench = AuthorityBench(kind, configs={1: {'boot_delay': 8.0}}).discover()
    bench.vehicles[1].flight.arming_fault = 'Gyros inconsistent'
    bench.assign(task_list('AB'))
    assert bench.run(lambda: bench.vehicles[1].flight.custom_mode == COPTER.hold, 20.0)
    bench.run(limit=8.0)
    bench.line.cut = silence > 0.0
    bench.vehicles[1].reboot(bench.now)
    bench.vehicles[1].flight.arming_fault = ''
    bench.run(limit=silence)
    restore_link(bench, 8.0)
    assert bench.authority() is H
    assert bench.run(lambda: bench.completed() == ['A', 'B'], 100.0)


@BOTH
@pytest.mark.parametrize('silence', [0.0, 6.0])
def test_a_reboot_in_the_air_is_a_loss(kind, silence):
    bench = flying(kind)
    bench.line.cut = silence > 0.0
    bench.vehicles[1].reboot(bench.now)
    bench.run(limit=silence)
    restore_link(bench)
    assert status_is(bench, L)
    assert sends_no_command(bench)


@BOTH
@pytest.mark.parametrize('silence', [0.0, 6.0])
def test_a_reboot_after_a_flight_is_a_loss(kind, silence):
    bench = flying(kind, 'A', relaunch='automatic')
    bench.assign(task_list('', 2, returns=True))
    assert bench.run(lambda: not bench.vehicles[1].flight.armed, 100.0)
    bench.run(limit=15.0)
    assert bench.authority() is H
    bench.line.cut = silence > 0.0
    bench.vehicles[1].reboot(bench.now)
    bench.run(limit=silence)
    restore_link(bench)
    assert bench.authority() is L
    bench.run(limit=3.0)
    assert status_is(bench, L)
    assert sends_no_command(bench)


@BOTH
@pytest.mark.parametrize('state', [L, N])
def test_a_reboot_of_a_vehicle_that_is_not_held_grants_nothing(kind, state):
    bench = on_ground(kind, state)
    bench.vehicles[1].reboot(bench.now)
    bench.run(limit=10.0)
    assert bench.authority() is state
    assert sends_no_command(bench, 20.0)


@BOTH
def test_a_reboot_on_the_ground_while_it_is_suspended_changes_nothing(kind):
    bench = on_ground(kind, S)
    bench.vehicles[1].reboot(bench.now)  # which ends the failsafe
    bench.run(limit=10.0)
    assert status_is(bench, H)


@BOTH
def test_a_change_that_nothing_explains_is_a_loss_where_the_link_is_lost_meanwhile(kind):
    bench = AuthorityBench(kind).discover()
    bench.vehicles[1].rc_mode(MODES[kind].stick)
    assert bench.run(lambda: bench.authority() is S, 10.0)
    bench.line.cut = True
    bench.run(limit=3.6)
    bench.line.cut = False
    bench.run(limit=8.0)
    assert status_is(bench, L)
    assert bench.hand_over() == ''
