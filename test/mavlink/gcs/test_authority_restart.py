# SPDX-License-Identifier: Apache-2.0
"""Authority after the bridge is killed and restarted with its record."""
import pytest
from authority_bench import (
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
    lost,
    on_ground,
    sends_no_command,
    status_is,
    suspended,
)
from findings_bench import set_current
from flight_bench import places
from mission_bench import REPORTS_STATE, task_list

from uav_task_alloc.mavlink.gcs.authority import Suspension

# its record agrees

@BOTH
@pytest.mark.parametrize('seconds', [0.0, 5.0, 30.0])
def test_in_the_mission_mode_it_flies_on_and_stays_held(kind, seconds):
    bench = flying(kind)
    bench.kill_and_restart(seconds)
    assert bench.authority() is H
    bench.run(limit=3.0)
    assert status_is(bench, H, 'the bridge was restarted, the vehicle is in ')
    start = len(bench.sent)
    bench.assign(task_list('ABCDEFGHIJKLMNOPQRSTUVWXY', 2))
    bench.run(limit=20.0)
    assert bench.modes(start) == []
    assert bench.authority() is H


@BOTH
def test_in_hold_without_tasks_it_stays_held(kind):
    bench = flying(kind)
    bench.assign(task_list('', 2))
    bench.run(limit=8.0)
    bench.kill_and_restart(100.0)
    bench.run(limit=2.0)
    assert status_is(bench, H)
    bench.assign(task_list('DE', 3))
    assert bench.run(lambda: bench.completed() == ['D', 'E'], 100.0)


@BOTH
def test_on_the_ground_it_stays_held(kind):
    bench = on_ground(kind, H)
    bench.kill_and_restart(10.0)
    bench.run(limit=2.0)
    assert status_is(bench, H)
    bench.assign(task_list('AB'))
    assert bench.run(lambda: bench.completed() == ['A', 'B'], 100.0)


@BOTH
@pytest.mark.parametrize('cause', [Suspension.FAILSAFE, Suspension.LINK])
def test_suspended_it_is_held_again_when_nothing_has_changed_and_the_cause_is_over(kind, cause):
    bench = suspended(kind, cause)
    if cause is Suspension.LINK:
        bench.line.cut = False
        bench.kill_and_restart()
        bench.run(limit=1.0)
        assert status_is(bench, H)
        return
    bench.kill_and_restart(3.0)
    bench.run(limit=1.0)
    assert status_is(bench, S, 'a failsafe is active')
    bench.vehicles[1].failsafe_over()
    assert bench.reaches(H, 3.0)


@BOTH
@pytest.mark.parametrize('state', [L, N])
def test_what_was_not_held_is_not_held_after_a_restart(kind, state):
    bench = in_flight(kind, state)
    why = bench.executor().authority.why
    bench.kill_and_restart(5.0)
    bench.run(limit=10.0)
    assert status_is(bench, state, why)
    assert sends_no_command(bench, names='ABC')


@BOTH
def test_a_kill_is_kept(kind):
    bench = on_ground(kind, H)
    bench.vehicles[1].kill_switch()
    assert bench.reaches(L, 3.0)
    bench.vehicles[1].kill_switch_off()
    bench.run(limit=3.0)
    bench.kill_and_restart(5.0)
    assert sends_no_command(bench)
    assert bench.executor().authority.killed
    assert bench.hand_over() == ''
    assert bench.authority() is H


# its record does not agree

@BOTH
@pytest.mark.parametrize('mode', ['hold', 'stick', 'rtl', 'own'])
def test_another_mode_than_before_the_restart_is_a_loss(kind, mode):
    bench = flying(kind)
    bench.ground_station.step = lambda now: []
    bench.ground_station.receive = lambda address, m, now: []
    bench.vehicles[1].rc_mode(getattr(MODES[kind], mode))
    bench.kill_and_restart(3.0)
    bench.run(limit=1.0)
    assert status_is(bench, L, 'the bridge was restarted, the vehicle is in ')
    assert sends_no_command(bench, names='ABC')


@BOTH
def test_an_arming_while_no_bridge_ran_is_a_loss(kind):
    bench = on_ground(kind, H)
    bench.vehicles[1].rc_arm(True)
    bench.kill_and_restart(2.0)
    bench.run(limit=1.0)
    assert status_is(bench, L)
    assert sends_no_command(bench, 20.0)


@BOTH
def test_suspended_and_then_in_another_mode_it_is_a_loss(kind):
    bench = suspended(kind)
    bench.vehicles[1].failsafe('radio', MODES[kind].rtl)
    bench.kill_and_restart(3.0)
    bench.run(limit=1.0)
    assert status_is(bench, L)
    assert sends_no_command(bench, 20.0)


# a replacement in progress

def replacing(moment, kind='ardupilot', speed=0.0):
    """Killed while ArduPilot is held for an upload that the line lets through slowly."""
    bench = flying(kind, delay=(0.1, 0.1))
    assert bench.run(lambda: bench.executor().telemetry.speed > speed, 20.0)
    bench.assign(task_list('ZYXWV', 2))
    assert bench.run(lambda: bench.vehicles[1].flight.custom_mode == COPTER.hold, 10.0)
    bench.run(limit=moment)
    assert bench.executor().watch.replacing_since is not None
    return bench


def test_an_item_passed_before_a_kill_counts_where_it_is_held_for_a_replacement():
    bench = flying('ardupilot', 'ABCD')
    bench.line.tampers.append(lambda direction, m, now: [] if (
        m.get_type() == 'MISSION_ITEM_REACHED') else None)
    assert bench.run(lambda: places(bench) == ['A'])
    bench.run(limit=0.6)
    assert bench.completed() == []  # its REACHED is awaited
    bench.vehicles[1].rc_mode(COPTER.hold)
    bench.run(limit=0.2)
    bench.kill_and_restart(0.2)
    bench.assign(task_list('BAC', 2))
    bench.run(limit=4.0)
    assert 'A' in bench.completed()


@pytest.mark.parametrize(('dead', 'state'), [(5.0, H), (50.0, H), (65.0, L)])
def test_held_for_a_replacement_it_stays_held_for_a_minute(dead, state):
    bench = replacing(2.0)
    bench.kill_and_restart(dead)
    bench.run(limit=2.0)
    assert status_is(bench, state)
    if state is H:
        bench.assign(task_list('ZYXWV', 2))
        assert bench.run(lambda: bench.completed() == list('ZYXWV'), 200.0)
    else:
        assert sends_no_command(bench, names='ABC')


def test_killed_in_a_replacement_the_current_item_does_not_refer_to_the_new_mission():
    """ArduPilot keeps the number of its current item while another mission is written."""
    bench = flying('ardupilot', delay=(0.1, 0.1))
    assert bench.run(lambda: len(bench.completed()) == 2, 200.0)
    bench.assign(task_list('ZYXWV', 2))
    assert bench.run(lambda: bench.onboard().upload.sent_all, 30.0)
    bench.run(limit=0.3)
    bench.vehicles[1].rc_mode(COPTER.mission)  # a pilot continues the mission
    bench.kill_and_restart(0.5)
    bench.assign(task_list('ZYXWV', 2))
    bench.run(limit=8.0)
    assert not set(bench.completed()) & set('ZYXWV') - set(places(bench))


@BOTH
def test_a_current_item_set_while_lost_completes_nothing(kind):
    bench = lost(kind)
    bench.kill_and_restart(1.0)
    set_current(bench, 3)
    bench.assign(task_list(LONG, 2))
    bench.run(limit=10.0)
    assert set(bench.completed()) <= set(places(bench))


@pytest.mark.parametrize('moment', [0.0, 0.5, 1.0])
def test_killed_while_it_brakes_for_a_replacement_it_stays_held(moment):
    bench = replacing(moment, speed=14.0)
    bench.kill_and_restart(0.2)
    bench.assign(task_list('ZYXWV', 2))
    assert bench.run(lambda: bench.completed()[-5:] == list('ZYXWV'), 200.0)


def test_held_for_a_replacement_and_moved_by_somebody_else_it_is_a_loss():
    bench = replacing(2.0)
    bench.vehicles[1].flight.set_mode(bench.vehicles[1].mode)
    bench.kill_and_restart(1.0)
    bench.vehicles[1].flight.body.velocity = (5.0, 0.0, 0.0)
    flight = bench.vehicles[1].flight
    move = flight._follow
    flight._follow = lambda dt: flight._steer(dt, (5.0, 0.0, 0.0))
    bench.run(limit=1.0)
    assert sends_no_command(bench, 3.0, names='ABC')  # it might still brake
    bench.run(limit=4.0)
    flight._follow = move
    bench.run(limit=1.0)
    assert status_is(bench, L, 'the bridge was restarted, the vehicle is in GUIDED')
    assert sends_no_command(bench, names='ABC')


def test_another_mode_after_a_replacement_is_a_loss():
    bench = replacing(2.0)
    bench.vehicles[1].rc_mode(COPTER.stick)
    bench.kill_and_restart(5.0)
    bench.run(limit=1.0)
    assert status_is(bench, L, 'LOITER')
    assert sends_no_command(bench, names='ABC')


@pytest.mark.parametrize('moment', [0.0, 0.05, 0.1, 0.15, 0.3, 1.0])
def test_killed_just_after_the_hold_command_it_is_not_lost(moment):
    """The command is in the record, and takes effect while no bridge runs."""
    bench = flying('ardupilot', delay=(0.05, 0.05), tick=0.05)
    bench.assign(task_list('ZYXWV', 2))
    assert bench.run(lambda: COPTER.hold in bench.modes()[-1:], 20.0)
    bench.run(limit=moment)
    bench.kill_and_restart(0.0)
    bench.run(limit=0.5)
    assert bench.authority() in (H, S)
    bench.assign(task_list('ZYXWV', 2))
    assert bench.run(lambda: bench.completed() == list('ZYXWV'), 200.0)


# a climb

@BOTH
@pytest.mark.parametrize('height', [2.0, 20.0, 30.0])
def test_killed_in_a_climb_it_stays_held_and_flies_its_list(kind, height):
    bench = AuthorityBench(kind).discover()
    bench.assign(task_list('AB'))
    assert bench.run(lambda: bench.vehicles[1].flight.body.position[2] > height, 60.0)
    bench.kill_and_restart(3.0)
    bench.run(limit=1.0)
    assert bench.authority() is H
    bench.assign(task_list('AB'))
    assert bench.run(lambda: bench.completed() == ['A', 'B'], 100.0)
    assert bench.executor().authority.state is H


def killed_in_climb(kind, height):
    """Killed while it takes off, at this height [m]."""
    bench = AuthorityBench(kind).discover()
    bench.assign(task_list('AB'))
    assert bench.run(lambda: bench.vehicles[1].flight.body.position[2] > height, 60.0)
    bench.kill()
    return bench


@PX4
@pytest.mark.parametrize(('height', 'seconds'), [(2.0, 60.0), (20.0, 30.0), (45.0, 10.0)])
def test_a_climb_that_ended_while_no_bridge_ran_leaves_it_held(kind, height, seconds):
    bench = killed_in_climb(kind, height)
    bench.run(limit=seconds)
    assert bench.vehicles[1].flight.custom_mode == MODES[kind].hold
    bench.kill_and_restart()
    assert bench.reaches(H, 5.0)
    assert status_is(bench, H, 'the vehicle is in Hold')
    bench.assign(task_list('AB'))
    assert bench.run(lambda: bench.completed() == ['A', 'B'], 100.0)


def move_by_stick(bench, kind, velocity, seconds):
    """A pilot moves the vehicle, lets it come to rest and leaves it in Hold."""
    vehicle = bench.vehicles[1]
    vehicle.rc_mode(MODES[kind].stick)
    vehicle.rc_stick(velocity)
    bench.run(limit=seconds)
    vehicle.rc_stick(None)
    bench.run(limit=seconds)
    vehicle.rc_mode(MODES[kind].hold)


@PX4
@pytest.mark.parametrize('speed', [(3.0, 0.0, 0.0), (0.0, 0.0, 3.0), (0.0, 0.0, -3.0)])
def test_a_climb_after_which_somebody_moved_it_while_no_bridge_ran_is_a_loss(kind, speed):
    bench = killed_in_climb(kind, 20.0)
    bench.run(limit=20.0)
    move_by_stick(bench, kind, speed, 3.0)
    bench.kill_and_restart()
    assert bench.reaches(L, 5.0)
    assert status_is(bench, L, 'the vehicle is in Hold')
    assert sends_no_command(bench, names='AB')


@PX4
@pytest.mark.parametrize('missing', ['GLOBAL_POSITION_INT', 'HOME_POSITION'])
def test_a_climb_whose_end_is_not_shown_after_a_restart_is_a_loss(kind, missing):
    bench = killed_in_climb(kind, 20.0)
    bench.run(limit=20.0)
    bench.line.tampers.append(lambda direction, m, now: [] if m.get_type() == missing else None)
    bench.kill_and_restart()
    bench.run(limit=8.0 if missing == 'HOME_POSITION' else 2.0)
    assert bench.authority() is S
    assert bench.reaches(L, 5.0)
    assert bench.hand_over() == ''


@PX4
def test_a_climb_that_is_ended_while_no_bridge_runs_below_its_height_is_a_loss(kind):
    bench = killed_in_climb(kind, 10.0)
    bench.vehicles[1].rc_mode(MODES[kind].hold)
    bench.run(limit=10.0)
    bench.kill_and_restart()
    assert bench.reaches(L, 5.0)
    assert sends_no_command(bench, names='AB')


@PX4
def test_a_climb_that_a_pilot_ends_below_its_height_is_a_loss(kind):
    bench = AuthorityBench(kind).discover()
    bench.assign(task_list('AB'))
    assert bench.run(lambda: bench.vehicles[1].flight.body.position[2] > 10.0, 60.0)
    bench.kill_and_restart()
    bench.vehicles[1].rc_mode(MODES[kind].hold)
    bench.run(limit=8.0)
    assert status_is(bench, L, 'Takeoff -> Hold')
    assert sends_no_command(bench, names='AB')


# the end of a mission without a return

@PX4
def test_a_mission_that_ended_while_no_bridge_ran_leaves_it_held(kind):
    bench = flying(kind, 'AB', configs=REPORTS_STATE)
    bench.kill_and_restart(60.0)
    bench.assign(task_list('ABC', 2))
    assert bench.reaches(H, 5.0)
    assert status_is(bench, H, 'holds at the end of our mission')
    assert bench.run(lambda: bench.completed() == ['A', 'B', 'C'], 60.0)


@PX4
@pytest.mark.parametrize('moved', [(8.0, 0.0, 0.0), (0.0, 0.0, 8.0)])
def test_a_mission_that_ended_and_after_which_it_was_moved_is_a_loss(kind, moved):
    bench = flying(kind, 'AB')
    bench.kill()
    bench.run(limit=60.0)
    move_by_stick(bench, kind, moved, 5.0)
    bench.kill_and_restart()
    assert sends_no_command(bench, names='ABC')
    assert status_is(bench, L, 'the vehicle is in Hold')


@PX4
def test_a_mission_that_somebody_stopped_while_no_bridge_ran_is_a_loss(kind):
    bench = flying(kind, 'AB')
    bench.kill()
    bench.vehicles[1].rc_mode(MODES[kind].hold)
    bench.run(limit=10.0)
    bench.kill_and_restart()
    assert sends_no_command(bench, names='ABC')
    assert status_is(bench, L, 'the vehicle is in Hold')


@PX4
def test_a_mission_that_ended_is_a_loss_once_somebody_has_changed_the_mode(kind):
    bench = flying(kind, 'AB')
    bench.kill_and_restart(60.0)
    bench.run(limit=2.0)
    bench.vehicles[1].rc_mode(MODES[kind].stick)
    bench.run(limit=2.0)
    bench.vehicles[1].rc_mode(MODES[kind].hold)
    bench.assign(task_list('ABC', 2))
    bench.run(limit=3.0)
    assert status_is(bench, L)
