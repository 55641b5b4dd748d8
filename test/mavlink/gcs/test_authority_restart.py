# SPDX-License-Identifier: Apache-2.0
"""A bridge killed and started again, with its file: who has the aircraft."""
import pytest
from authority_bench import (
    BOTH,
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
    keeps_quiet,
    lost,
    on_ground,
    shows,
    suspended,
)
from findings_bench import set_current
from flight_bench import places
from mission_bench import task_list

from uav_task_alloc.mavlink.gcs.authority import Suspension

# its file agrees

@BOTH
@pytest.mark.parametrize('seconds', [0.0, 5.0, 30.0])
def test_in_the_mission_mode_it_flies_on_and_stays_ours(kind, seconds):
    bench = flying(kind)
    bench.dead_for(seconds)
    assert bench.authority() is H
    bench.run(limit=3.0)
    assert shows(bench, H, 'the bridge was restarted, the vehicle is in ')
    start = len(bench.sent)
    bench.assign(task_list('ABCDEFGHIJKLMNOPQRSTUVWXY', 2))
    bench.run(limit=20.0)
    assert bench.modes(start) == []
    assert bench.authority() is H


@BOTH
def test_held_for_want_of_tasks_it_stays_ours(kind):
    bench = flying(kind)
    bench.assign(task_list('', 2))
    bench.run(limit=8.0)
    bench.dead_for(100.0)
    bench.run(limit=2.0)
    assert shows(bench, H)
    bench.assign(task_list('DE', 3))
    assert bench.run(lambda: bench.completed() == ['D', 'E'], 100.0)


@BOTH
def test_on_the_ground_it_stays_ours(kind):
    bench = on_ground(kind, H)
    bench.dead_for(10.0)
    bench.run(limit=2.0)
    assert shows(bench, H)
    bench.assign(task_list('AB'))
    assert bench.run(lambda: bench.completed() == ['A', 'B'], 100.0)


@BOTH
@pytest.mark.parametrize('cause', [Suspension.FAILSAFE, Suspension.LINK])
def test_suspended_it_is_ours_again_where_nothing_has_changed_and_the_cause_is_over(kind, cause):
    bench = suspended(kind, cause)
    if cause is Suspension.LINK:
        bench.line.cut = False
        bench.dead_for()
        bench.run(limit=1.0)
        assert shows(bench, H)
        return
    bench.dead_for(3.0)
    bench.run(limit=1.0)
    assert shows(bench, S, 'a failsafe is active')
    bench.vehicles[1].failsafe_over()
    assert bench.becomes(H, 3.0)


@BOTH
@pytest.mark.parametrize('state', [L, N])
def test_what_was_not_ours_is_not_ours_after_a_restart(kind, state):
    bench = in_flight(kind, state)
    why = bench.executor().authority.why
    bench.dead_for(5.0)
    bench.run(limit=10.0)
    assert shows(bench, state, why)
    assert keeps_quiet(bench, names='ABC')


@BOTH
def test_a_kill_is_kept(kind):
    bench = on_ground(kind, H)
    bench.vehicles[1].kill_switch()
    assert bench.becomes(L, 3.0)
    bench.vehicles[1].kill_switch_off()
    bench.run(limit=3.0)
    bench.dead_for(5.0)
    assert keeps_quiet(bench)
    assert bench.executor().authority.killed
    assert bench.hand_over() == ''
    assert bench.authority() is H


# its file does not agree

@BOTH
@pytest.mark.parametrize('mode', ['hold', 'stick', 'rtl', 'own'])
def test_in_another_mode_than_it_was_left_it_is_a_loss(kind, mode):
    bench = flying(kind)
    bench.ground_station.step = lambda now: []
    bench.ground_station.receive = lambda address, m, now: []
    bench.vehicles[1].rc_mode(getattr(MODES[kind], mode))
    bench.dead_for(3.0)
    bench.run(limit=1.0)
    assert shows(bench, L, 'the bridge was restarted, the vehicle is in ')
    assert keeps_quiet(bench, names='ABC')


@BOTH
def test_armed_while_no_bridge_was_there_it_is_a_loss(kind):
    bench = on_ground(kind, H)
    bench.vehicles[1].rc_arm(True)
    bench.dead_for(2.0)
    bench.run(limit=1.0)
    assert shows(bench, L)
    assert keeps_quiet(bench, 20.0)


@BOTH
def test_suspended_and_found_in_another_mode_it_is_a_loss(kind):
    bench = suspended(kind)
    bench.vehicles[1].failsafe('radio', MODES[kind].rtl)
    bench.dead_for(3.0)
    bench.run(limit=1.0)
    assert shows(bench, L)
    assert keeps_quiet(bench, 20.0)


# a swap under way

def swapping(moment, kind='ardupilot', speed=0.0):
    """Killed while ArduPilot is held for an upload that the line lets through slowly."""
    bench = flying(kind, delay=(0.1, 0.1))
    assert bench.run(lambda: bench.executor().telemetry.speed > speed, 20.0)
    bench.assign(task_list('ZYXWV', 2))
    assert bench.run(lambda: bench.vehicles[1].flight.custom_mode == 4, 10.0)
    bench.run(limit=moment)
    assert bench.executor().watch.swap_at is not None
    return bench


@pytest.mark.parametrize(('dead', 'state'), [(5.0, H), (50.0, H), (65.0, L)])
def test_held_for_a_swap_it_is_ours_for_a_minute(dead, state):
    bench = swapping(2.0)
    bench.dead_for(dead)
    bench.run(limit=2.0)
    assert shows(bench, state)
    if state is H:
        bench.assign(task_list('ZYXWV', 2))
        assert bench.run(lambda: bench.completed() == list('ZYXWV'), 200.0)
    else:
        assert keeps_quiet(bench, names='ABC')


def test_killed_in_a_swap_the_current_item_says_nothing_of_the_new_mission():
    """ArduPilot keeps the number of its current item while another mission is written."""
    bench = flying('ardupilot', delay=(0.1, 0.1))
    assert bench.run(lambda: len(bench.completed()) == 2, 200.0)
    bench.assign(task_list('ZYXWV', 2))
    assert bench.run(lambda: bench.onboard().upload.sent_all, 30.0)
    bench.run(limit=0.3)
    bench.vehicles[1].rc_mode(3)  # a pilot has it fly on from there
    bench.dead_for(0.5)
    bench.assign(task_list('ZYXWV', 2))
    bench.run(limit=8.0)
    assert not set(bench.completed()) & set('ZYXWV') - set(places(bench))


@BOTH
def test_a_current_item_set_while_another_had_it_completes_nothing(kind):
    bench = lost(kind)
    bench.dead_for(1.0)
    set_current(bench, 3)
    bench.assign(task_list(LONG, 2))
    bench.run(limit=10.0)
    assert set(bench.completed()) <= set(places(bench))


@pytest.mark.parametrize('moment', [0.0, 0.5, 1.0])
def test_killed_while_it_brakes_for_a_swap_it_is_still_ours(moment):
    bench = swapping(moment, speed=14.0)
    bench.dead_for(0.2)
    bench.assign(task_list('ZYXWV', 2))
    assert bench.run(lambda: bench.completed()[-5:] == list('ZYXWV'), 200.0)


def test_held_for_a_swap_and_moved_by_somebody_it_is_a_loss():
    bench = swapping(2.0)
    bench.vehicles[1].flight.set_mode(bench.vehicles[1].mode)
    bench.dead_for(1.0)
    bench.vehicles[1].flight.body.velocity = (5.0, 0.0, 0.0)
    flight = bench.vehicles[1].flight
    move = flight._follow
    flight._follow = lambda dt: flight._steer(dt, (5.0, 0.0, 0.0))
    bench.run(limit=1.0)
    assert keeps_quiet(bench, 3.0, names='ABC')  # it might still brake
    bench.run(limit=4.0)
    flight._follow = move
    bench.run(limit=1.0)
    assert shows(bench, L, 'the bridge was restarted, the vehicle is in GUIDED')
    assert keeps_quiet(bench, names='ABC')


def test_a_swap_found_in_another_mode_is_a_loss():
    bench = swapping(2.0)
    bench.vehicles[1].rc_mode(5)
    bench.dead_for(5.0)
    bench.run(limit=1.0)
    assert shows(bench, L, 'LOITER')
    assert keeps_quiet(bench, names='ABC')


@pytest.mark.parametrize('moment', [0.0, 0.05, 0.1, 0.15, 0.3, 1.0])
def test_killed_just_after_it_was_told_to_hold_it_is_not_lost(moment):
    """The command is written down, and takes effect while no bridge is there."""
    bench = flying('ardupilot', delay=(0.05, 0.05), tick=0.05)
    bench.assign(task_list('ZYXWV', 2))
    assert bench.run(lambda: 4 in bench.modes()[-1:], 20.0)
    bench.run(limit=moment)
    bench.dead_for(0.0)
    bench.run(limit=0.5)
    assert bench.authority() in (H, S)
    bench.assign(task_list('ZYXWV', 2))
    assert bench.run(lambda: bench.completed() == list('ZYXWV'), 200.0)


# a climb

@BOTH
@pytest.mark.parametrize('height', [2.0, 20.0, 30.0])
def test_killed_in_a_climb_it_is_ours_and_flies_its_list(kind, height):
    bench = AuthorityBench(kind).discover()
    bench.assign(task_list('AB'))
    assert bench.run(lambda: bench.vehicles[1].flight.body.position[2] > height, 60.0)
    bench.dead_for(3.0)
    bench.run(limit=1.0)
    assert bench.authority() is H
    bench.assign(task_list('AB'))
    assert bench.run(lambda: bench.completed() == ['A', 'B'], 100.0)
    assert bench.executor().authority.state is H


@PX4
def test_a_climb_that_ended_while_no_bridge_was_there_is_a_loss(kind):
    bench = AuthorityBench(kind).discover()
    bench.assign(task_list('AB'))
    assert bench.run(lambda: bench.vehicles[1].flight.body.position[2] > 20.0, 60.0)
    bench.dead_for(30.0)
    bench.run(limit=1.0)
    assert shows(bench, L, 'the vehicle is in Hold')
    assert bench.hand_over() == ''


@PX4
def test_a_climb_that_a_pilot_ends_below_its_height_is_a_loss(kind):
    bench = AuthorityBench(kind).discover()
    bench.assign(task_list('AB'))
    assert bench.run(lambda: bench.vehicles[1].flight.body.position[2] > 10.0, 60.0)
    bench.dead_for()
    bench.vehicles[1].rc_mode(MODES[kind].hold)
    bench.run(limit=8.0)
    assert shows(bench, L, 'Takeoff -> Hold')
    assert keeps_quiet(bench, names='AB')
