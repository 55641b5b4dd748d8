# SPDX-License-Identifier: Apache-2.0
"""Silence, new addresses and reboots of a vehicle: who has the aircraft, and what is sent."""
import pytest
from authority_bench import (
    ARDUPILOT,
    BOTH,
    MODES,
    PX4,
    AuthorityBench,
    H,
    L,
    N,
    S,
    flying,
    in_flight,
    keeps_quiet,
    on_ground,
    shows,
    suspended,
)
from mission_bench import task_list

from uav_task_alloc.mavlink.gcs.authority import Suspension


def silent(bench, seconds=6.0):
    bench.line.cut = True
    bench.run(limit=seconds)


def heard_again(bench, seconds=4.0):
    bench.line.cut = False
    bench.run(limit=seconds)


# silence

@BOTH
@pytest.mark.parametrize('seconds', [4.0, 20.0])
def test_while_nothing_is_heard_nothing_is_sent_and_the_same_mode_gives_it_back(kind, seconds):
    bench = flying(kind)
    silent(bench, 3.5)
    assert shows(bench, S, 'no message for 3 s')
    assert bench.state().reason == 'its link is stale'
    start = len(bench.sent)
    bench.assign(task_list('ZYX', 2))
    bench.run(limit=seconds)
    assert bench.sent[start:] == []
    heard_again(bench, 1.5)
    assert shows(bench, H, 'the link is back, in ')
    assert bench.run(lambda: bench.completed()[-3:] == ['Z', 'Y', 'X'], 200.0)


@BOTH
@pytest.mark.parametrize('mode', ['hold', 'stick', 'rtl', 'land', 'own'])
def test_another_mode_after_silence_is_a_loss(kind, mode):
    bench = flying(kind)
    silent(bench)
    bench.vehicles[1].rc_mode(getattr(MODES[kind], mode))
    heard_again(bench, 1.5)
    assert shows(bench, L, 'the link is back, in ', ' instead of ')
    assert keeps_quiet(bench)


@PX4
def test_a_mission_that_ended_during_silence_is_a_loss(kind):
    bench = flying(kind, 'AB')
    silent(bench, 60.0)
    heard_again(bench)
    assert shows(bench, L, 'Hold instead of Mission')


@BOTH
def test_what_we_had_commanded_just_before_the_silence_is_no_other_mode(kind):
    bench = flying(kind)
    bench.assign(task_list('', 2))
    assert bench.run(lambda: bench.vehicles[1].flight.custom_mode == MODES[kind].hold, 3.0)
    silent(bench)
    heard_again(bench, 1.5)
    assert shows(bench, H, 'the link is back, in ')


@BOTH
def test_armed_by_another_during_silence_is_a_loss(kind):
    bench = on_ground(kind, H)
    silent(bench)
    bench.vehicles[1].rc_arm(True)
    heard_again(bench, 1.5)
    assert shows(bench, L)
    assert keeps_quiet(bench, 20.0)


@BOTH
@pytest.mark.parametrize('state', [L, N])
@pytest.mark.parametrize('mode', ['same', 'hold', 'mission', 'rtl'])
def test_silence_gives_and_takes_nothing_where_it_is_not_ours(kind, state, mode):
    bench = in_flight(kind, state)
    silent(bench)
    assert bench.authority() is state
    if mode != 'same':
        bench.vehicles[1].rc_mode(getattr(MODES[kind], mode))
    heard_again(bench, 3.0)
    assert bench.authority() is state
    assert keeps_quiet(bench, 20.0)


@BOTH
def test_silence_while_it_is_suspended_takes_it_where_the_mode_has_changed(kind):
    bench = suspended(kind)
    silent(bench)
    assert set(bench.executor().authority.suspensions) == {Suspension.FAILSAFE, Suspension.LINK}
    bench.vehicles[1].rc_mode(MODES[kind].stick)
    heard_again(bench, 1.5)
    assert shows(bench, L)


# a new address

@BOTH
def test_from_a_new_address_nothing_is_done_before_the_mode_is_confirmed(kind):
    bench = flying(kind)
    silent(bench)
    bench.move_address()
    bench.line.tampers.append(lambda way, m, now: [] if m.get_type() == 'HEARTBEAT' else None)
    heard_again(bench, 2.0)
    assert bench.authority() is S
    assert any('its messages come from a new address' in note for note in bench.notes)
    start = len(bench.sent)
    bench.assign(task_list('ZYX', 2))
    bench.run(limit=5.0)
    assert bench.sent[start:] == []
    bench.line.tampers.clear()
    assert bench.becomes(H, 1.5)
    assert bench.run(lambda: bench.completed()[-3:] == ['Z', 'Y', 'X'], 200.0)


@BOTH
@pytest.mark.parametrize('mode', ['stick', 'hold'])
def test_from_a_new_address_in_another_mode_it_is_a_loss(kind, mode):
    bench = flying(kind)
    silent(bench)
    bench.move_address()
    bench.vehicles[1].rc_mode(getattr(MODES[kind], mode))
    heard_again(bench, 2.0)
    assert shows(bench, L, 'the link is back, in ')
    assert keeps_quiet(bench)


@BOTH
@pytest.mark.parametrize('state', [S, L, N])
def test_a_new_address_of_one_that_is_not_held_changes_nothing(kind, state):
    bench = in_flight(kind, state)
    silent(bench)
    bench.move_address()
    heard_again(bench)
    assert bench.authority() is state
    assert keeps_quiet(bench, 20.0)


# reboots

@BOTH
@pytest.mark.parametrize('silence', [0.0, 6.0])
def test_a_reboot_of_one_never_armed_leaves_it_ours(kind, silence):
    bench = on_ground(kind, H)
    bench.line.cut = silence > 0.0
    bench.vehicles[1].reboot(bench.now)
    bench.run(limit=silence)
    heard_again(bench, 8.0)
    assert 'was restarted' in bench.notes
    assert shows(bench, H)
    bench.assign(task_list('AB', 2))
    assert bench.run(lambda: bench.completed() == ['A', 'B'], 100.0)


@ARDUPILOT
@pytest.mark.parametrize('silence', [0.0, 6.0])
def test_a_reboot_while_it_refuses_to_arm_leaves_it_ours(kind, silence):
    bench = AuthorityBench(kind, configs={1: {'boot_delay': 8.0}}).discover()
    bench.vehicles[1].flight.arming_fault = 'Gyros inconsistent'
    bench.assign(task_list('AB'))
    assert bench.run(lambda: bench.vehicles[1].flight.custom_mode == 4, 20.0)
    bench.run(limit=8.0)
    bench.line.cut = silence > 0.0
    bench.vehicles[1].reboot(bench.now)
    bench.vehicles[1].flight.arming_fault = ''
    bench.run(limit=silence)
    heard_again(bench, 8.0)
    assert bench.authority() is H
    assert bench.run(lambda: bench.completed() == ['A', 'B'], 100.0)


@BOTH
@pytest.mark.parametrize('silence', [0.0, 6.0])
def test_a_reboot_in_the_air_is_a_loss(kind, silence):
    bench = flying(kind)
    bench.line.cut = silence > 0.0
    bench.vehicles[1].reboot(bench.now)
    bench.run(limit=silence)
    heard_again(bench)
    assert shows(bench, L)
    assert keeps_quiet(bench)


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
    heard_again(bench)
    assert bench.authority() is L
    bench.run(limit=3.0)
    assert shows(bench, L)
    assert keeps_quiet(bench)


@BOTH
@pytest.mark.parametrize('state', [L, N])
def test_a_reboot_of_one_that_is_not_ours_gives_nothing(kind, state):
    bench = on_ground(kind, state)
    bench.vehicles[1].reboot(bench.now)
    bench.run(limit=10.0)
    assert bench.authority() is state
    assert keeps_quiet(bench, 20.0)


@BOTH
def test_a_reboot_on_the_ground_while_it_is_suspended_changes_nothing(kind):
    bench = on_ground(kind, S)
    bench.vehicles[1].reboot(bench.now)  # which ends the failsafe
    bench.run(limit=10.0)
    assert shows(bench, H)
