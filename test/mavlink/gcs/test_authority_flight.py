# SPDX-License-Identifier: Apache-2.0
"""Authority and the messages sent when pilots and other stations change modes in flight."""
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
    delay_one_command,
    flying,
    in_flight,
    lose_command,
    sends_no_command,
    set_mode,
    status_is,
    suspended,
)
from findings_bench import drop_messages
from flight_bench import FlightBench
from mission_bench import OURS, task_list
from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.mavlink.gcs.authority import Suspension
from uav_task_alloc.mavlink.gcs.flight_modes import mode_name
from uav_task_alloc.sim.modes import COPTER_MODES, PX4_MODES, px4_mode

STICKS = [('ardupilot', n) for n, m in COPTER_MODES.items() if m.stick] + [
    ('px4', n) for n, m in PX4_MODES.items() if m.stick]
OWN = [('ardupilot', n) for n in (
    d.COPTER_MODE_RTL, d.COPTER_MODE_CIRCLE, d.COPTER_MODE_LAND, d.COPTER_MODE_BRAKE,
    d.COPTER_MODE_GUIDED_NOGPS, d.COPTER_MODE_SMART_RTL, d.COPTER_MODE_FOLLOW,
    d.COPTER_MODE_AUTO_RTL)] + [
    ('px4', px4_mode(*n)) for n in ((4, 1), (4, 2), (4, 5), (4, 6), (4, 8), (4, 9), (4, 10), (6,),
                                    (10,))]
TO_HOLD = [(kind, MODES[kind].hold) for kind in MODES]
FEW = [(kind, mode) for kind in MODES
       for mode in (MODES[kind].stick, MODES[kind].rtl, MODES[kind].own, MODES[kind].hold)]


@pytest.mark.parametrize(('kind', 'mode'), STICKS + OWN + TO_HOLD)
def test_any_mode_that_a_pilot_sets_during_the_mission_is_a_loss(kind, mode):
    bench = flying(kind)
    start = len(bench.sent)
    bench.vehicles[1].rc_mode(mode)
    assert bench.reaches(L, 3.0)
    assert bench.commands(start) == []
    name = mode_name(bench.executor().profile.family, mode)
    assert status_is(bench, L, 'not by the bridge: ', name)
    assert 'MISSION mode set in flight' in bench.state().reason


@pytest.mark.parametrize(('kind', 'mode'), FEW)
def test_after_a_loss_to_a_pilot_no_command_is_sent_whatever_lists_arrive(kind, mode):
    bench = flying(kind)
    bench.vehicles[1].rc_mode(mode)
    assert bench.reaches(L, 3.0)
    assert sends_no_command(bench)
    assert 'waits for the pilot to give it back' in bench.notes


@pytest.mark.parametrize(('kind', 'mode'), FEW)
def test_a_mode_set_by_another_station_is_a_loss_as_by_a_pilot(kind, mode):
    bench = flying(kind)
    bench.from_station(set_mode(mode, kind))
    assert bench.reaches(L, 3.0)
    assert sends_no_command(bench)
    assert status_is(bench, L)


@pytest.mark.parametrize(('kind', 'mode'), FEW)
def test_a_mode_set_while_suspended_is_a_loss(kind, mode):
    bench = suspended(kind, Suspension.FOREIGN)
    start = len(bench.sent)
    bench.vehicles[1].rc_mode(mode)
    assert bench.reaches(L, 3.0)
    assert sends_no_command(bench)
    assert bench.commands(start) == []
    assert status_is(bench, L, 'not by the bridge')


@pytest.mark.parametrize(('kind', 'mode'), FEW)
@pytest.mark.parametrize('state', [L, N])
def test_a_pilot_in_control_may_set_any_mode(kind, mode, state):
    bench = in_flight(kind, state)
    if mode == MODES[kind].hold:
        bench.vehicles[1].rc_mode(MODES[kind].own)
        bench.run(limit=2.0)  # OWN -> HOLD is no hand-over, STICK -> HOLD is one
    bench.vehicles[1].rc_mode(mode)
    bench.run(limit=3.0)
    assert bench.authority() is (N if state is N and mode == MODES[kind].stick else L)
    assert sends_no_command(bench)
    assert status_is(bench, bench.authority())


def climbing(kind, mode):
    """On the ground in a mode, then taken off by the bridge; no heartbeat has shown TAKEOFF.

    The climb is short: 5 s without a heartbeat are a stale link.
    """
    bench = AuthorityBench(kind, tick=0.1, cruise_altitude=8.0)
    bench.vehicles[1].rc_mode(mode)
    bench.discover()
    bench.line.tampers.append(lambda direction, m, now: [] if m.get_type() == 'HEARTBEAT' and (
        bench.vehicles[1].mode.name == 'TAKEOFF') else None)
    bench.assign(task_list('AB'))
    assert bench.run(lambda: bench.vehicles[1].mode.name == 'TAKEOFF', 30.0)
    bench.run(limit=0.5)
    return bench


@PX4
@pytest.mark.parametrize('mode', ['rtl', 'hold'])
def test_the_mode_before_the_take_off_is_a_loss_in_the_climb(kind, mode):
    bench = climbing(kind, getattr(MODES[kind], mode))
    bench.from_station(set_mode(getattr(MODES[kind], mode), kind))
    assert bench.reaches(L, 5.0)
    assert sends_no_command(bench)


@PX4
@pytest.mark.parametrize('mode', ['rtl', 'hold'])
def test_a_climb_that_no_heartbeat_shows_is_no_loss(kind, mode):
    bench = climbing(kind, getattr(MODES[kind], mode))
    assert bench.run(lambda: bench.completed() == ['A', 'B'], 90.0)
    assert not any('LOST' in note for note in bench.notes)


def lifted_off(kind, height):
    """Taken off by the bridge, at this height [m]."""
    bench = AuthorityBench(kind, tick=0.1).discover()
    bench.assign(task_list('AB'))
    assert bench.run(lambda: bench.vehicles[1].flight.body.position[2] > height, 30.0)
    return bench


@BOTH
@pytest.mark.parametrize('height', [0.02, 8.0])
def test_a_climb_that_ends_below_its_height_with_no_other_mode_shown_is_a_loss(kind, height):
    bench = lifted_off(kind, height)
    bench.vehicles[1].flight.track = None  # as when a mode was set, and set back, unseen
    bench.run(limit=6.0)
    assert bench.authority() is H
    assert bench.reaches(L, 20.0)
    assert status_is(bench, L, 'its take-off ended at ', ' m of 50.0 m')
    assert sends_no_command(bench)
    assert bench.hand_over() == ''
    bench.assign(task_list('AB', 9))
    assert bench.run(lambda: bench.completed() == ['A', 'B'], 90.0)


@ARDUPILOT
def test_a_climb_that_a_pilot_ended_before_our_late_mode_command_is_a_loss(kind):
    bench = lifted_off(kind, 0.02)
    bench.vehicles[1].rc_mode(MODES[kind].stick)
    bench.from_station(set_mode(MODES[kind].hold, kind), system=OURS[0])  # no heartbeat between
    assert bench.reaches(L, 20.0)
    assert sends_no_command(bench)


@BOTH
@pytest.mark.parametrize('speed', [0.1, 8.0])
def test_a_climb_is_no_loss_however_slow_it_is_and_without_positions(kind, speed):
    bench = lifted_off(kind, 0.02)
    bench.vehicles[1].flight.speed = speed
    lost_until = bench.now + 12.0
    bench.line.tampers.append(lambda direction, m, now: [] if (
        m.get_type() == 'GLOBAL_POSITION_INT' and now < lost_until) else None)
    bench.run(limit=40.0)
    assert bench.authority() is H


# retries

@BOTH
@pytest.mark.parametrize('state', [L, S])
def test_a_command_that_is_being_retried_is_dropped_on_a_loss_or_suspension(kind, state):
    bench = flying(kind)
    lose_command(bench, d.MAV_CMD_DO_SET_MODE)
    bench.assign(task_list('', 2))  # hold
    bench.run(limit=1.5)
    assert len(bench.modes()) >= 2
    assert bench.executor().sender.busy
    start = len(bench.sent)
    if state is L:
        bench.vehicles[1].rc_mode(MODES[kind].stick)
    else:
        bench.vehicles[1].failsafe('radio', None)
    assert bench.reaches(state, 3.0)
    start = len(bench.sent)
    assert sends_no_command(bench)
    assert bench.commands(start) == []
    assert not bench.executor().sender.busy
    assert not bench.executor().sender.must_start


@BOTH
@pytest.mark.parametrize('delay', [1.0, 5.0, 11.0])
def test_our_own_delayed_command_is_no_hand_over_by_the_pilot(kind, delay):
    bench, modes = flying(kind), MODES[kind]
    bench.assign(task_list('', 2))
    assert bench.run(lambda: bench.vehicles[1].flight.custom_mode == modes.hold, 5.0)
    bench.run(limit=2.0)
    due = delay_one_command(bench, d.MAV_CMD_DO_SET_MODE, delay)
    bench.assign(task_list('XYZ', 3))
    assert bench.run(lambda: not due, 20.0)
    assert bench.modes()[-1] == modes.mission
    bench.vehicles[1].rc_mode(modes.stick)
    taken = bench.now
    assert bench.reaches(L, 3.0)
    assert bench.run(lambda: bench.vehicles[1].flight.custom_mode == modes.mission,
                     delay + 1.0) or bench.now < taken
    assert sends_no_command(bench, 40.0, 'YX')
    assert status_is(bench, L, 'not by the bridge')


@BOTH
def test_our_own_delayed_hold_is_no_hand_over_by_the_pilot(kind):
    bench, modes = flying(kind), MODES[kind]
    delay_one_command(bench, d.MAV_CMD_DO_SET_MODE, 4.0)
    bench.assign(task_list('', 2))
    bench.run(limit=0.5)
    bench.vehicles[1].rc_mode(modes.stick)
    assert bench.reaches(L, 3.0)
    assert bench.run(lambda: bench.vehicles[1].flight.custom_mode == modes.hold, 6.0)
    assert sends_no_command(bench, 40.0)
    assert status_is(bench, L)


@BOTH
def test_delayed_commands_of_another_station_are_not_taken_for_ours(kind):
    bench, modes = flying(kind), MODES[kind]
    bench.assign(task_list('', 2))  # the bridge holds it
    bench.run(limit=5.0)
    assert bench.authority() is H
    bench.from_station(set_mode(modes.rtl, kind))
    assert bench.reaches(L, 3.0)
    bench.from_station(set_mode(modes.hold, kind))
    bench.run(limit=12.0)
    assert bench.authority() is L
    assert sends_no_command(bench, 40.0)


def test_an_upload_begun_on_the_ground_does_not_replace_the_mission_that_a_pilot_flies():
    bench = FlightBench('px4', takeoff=False).discover()
    vehicle, lost = bench.vehicles[1], [True]
    bench.assign(task_list('ABCDEF'))
    assert bench.run(lambda: bench.onboard().verified(), 20.0)
    before = vehicle.mission.items[:]
    vehicle.rc_mode(px4_mode(4, 4))
    drop_messages(bench, 'up', 'MISSION_ITEM_INT', lambda m: lost[0] and m.seq >= 3)
    bench.run(limit=3.0)
    bench.assign(task_list('UVWXYZ', 2))
    assert bench.run(lambda: bench.onboard().upload.busy, 10.0)
    vehicle.rc_arm(True)
    assert bench.run(lambda: bench.executor().telemetry.airborne, 10.0)
    lost[0], sent = False, len(bench.line.sent('MISSION_ITEM_INT'))
    bench.run(limit=30.0)
    assert bench.authority() is N
    assert len(bench.line.sent('MISSION_ITEM_INT')) == sent
    assert vehicle.mission.items == before
