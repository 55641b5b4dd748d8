# SPDX-License-Identifier: Apache-2.0
"""Pilots, failsafes and kill switches that act on the simulated vehicles at any moment."""
import pytest
from pymavlink.dialects.v20 import ardupilotmega as d
from vehicle_bench import Bench, of, waypoint

from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.sim.config import FlightMode
from uav_task_alloc.sim.failsafe import FAILSAFE_KINDS
from uav_task_alloc.sim.modes import px4_mode

FAR = (400.0, 0.0, 30.0)
TEXTS = {'radio': 'Radio Failsafe', 'gcs': 'GCS Failsafe', 'battery': 'Battery Failsafe',
         'ekf': 'EKF Failsafe: changed to RTL Mode', 'fence': 'Fence Breached'}


@pytest.fixture(params=['ardupilot', 'px4'])
def bench(request):
    bench = Bench(request.param)
    bench.fly(waypoint(FAR))
    bench.pass_time(5.0)
    bench.received.clear()
    bench.vehicle.take_events()
    return bench


def heartbeat(bench):
    return of(bench.pass_time(1.1), 'HEARTBEAT')[-1]


def return_mode(bench):
    return bench.flight.custom_modes[FlightMode.RETURN]


@pytest.mark.parametrize('kind', FAILSAFE_KINDS)
def test_a_failsafe_that_changes_the_mode_is_critical_and_reports_why(bench, kind):
    bench.vehicle.failsafe(kind, return_mode(bench))
    beat = heartbeat(bench)
    assert (beat.custom_mode, beat.system_status) == (return_mode(bench), d.MAV_STATE_CRITICAL)
    assert (TEXTS[kind] if bench.own else 'Failsafe activated') in bench.texts()


@pytest.mark.parametrize('kind', FAILSAFE_KINDS)
def test_a_failsafe_that_keeps_the_mode_is_critical_until_it_is_over(bench, kind):
    before = bench.flight.custom_mode
    bench.vehicle.failsafe(kind, None)
    beat = heartbeat(bench)
    assert (beat.custom_mode, beat.system_status) == (before, d.MAV_STATE_CRITICAL)
    bench.vehicle.failsafe_over()
    beat = heartbeat(bench)
    assert (beat.custom_mode, beat.system_status) == (before, d.MAV_STATE_ACTIVE)
    text = bench.texts()[-1]
    if bench.own and kind == 'battery':  # ArduPilot sends none
        assert text == 'Battery Failsafe'
    else:
        assert ('Failsafe Cleared' if bench.own else 'Failsafe mode deactivated') in text


def test_two_failsafes_last_until_both_are_over(bench):
    bench.vehicle.failsafe('radio', return_mode(bench))
    bench.vehicle.failsafe('battery', None)
    bench.received.clear()
    bench.vehicle.failsafe_over()
    assert heartbeat(bench).system_status == d.MAV_STATE_ACTIVE
    assert bench.flight.mode is FlightMode.RETURN
    assert [e.cause for e in bench.vehicle.take_events() if e.name == 'failsafe_over'] == [
        'radio', 'battery']


def test_a_kind_that_does_not_exist_is_an_error(bench):
    with pytest.raises(InvalidValue, match=r"kind = 'wind': expected one of radio, gcs"):
        bench.vehicle.failsafe('wind', None)


def test_an_estimator_failsafe_loses_the_absolute_position(bench):
    kind = 'EKF_STATUS_REPORT' if bench.own else 'ESTIMATOR_STATUS'
    bench.vehicle.failsafe('ekf', None)
    assert not bench.request(kind)[0].flags & d.EKF_POS_HORIZ_ABS


def test_a_reboot_ends_failsafes(bench):
    bench.vehicle.failsafe('radio', None)
    bench.vehicle.reboot(bench.now)
    bench.pass_time(10.0)
    assert heartbeat(bench).system_status == d.MAV_STATE_STANDBY


# kill switch


def test_the_kill_switch_stops_the_motors_and_it_falls(bench):
    bench.vehicle.kill_switch()
    assert not bench.flight.armed
    assert not bench.flight.landed
    bench.pass_time(2.0)
    assert bench.flight.landed
    assert bench.flight.body.position[2] == 0.0
    events = [(e.name, e.cause) for e in bench.vehicle.take_events()]
    assert [e for e in events if e[0] in ('kill_switch', 'disarmed', 'crashed')] == [
        ('kill_switch', 'pilot'), ('disarmed', 'pilot'), ('crashed', 'pilot')]


def test_the_heartbeat_reports_flight_termination_until_the_kill_switch_is_off(bench):
    bench.vehicle.kill_switch()
    assert heartbeat(bench).system_status == d.MAV_STATE_FLIGHT_TERMINATION
    bench.pass_time(5.0)
    assert heartbeat(bench).system_status == d.MAV_STATE_FLIGHT_TERMINATION
    bench.vehicle.kill_switch_off()
    assert heartbeat(bench).system_status == d.MAV_STATE_STANDBY


def test_it_does_not_arm_while_the_kill_switch_is_on(bench):
    bench.vehicle.kill_switch()
    bench.pass_time(2.0)
    bench.set_mode(FlightMode.GUIDED if bench.own else FlightMode.HOLD)
    assert bench.arm() != 0
    bench.vehicle.kill_switch_off()
    assert bench.arm() == 0


def test_nothing_arms_while_it_falls(bench):
    bench.set_mode(FlightMode.GUIDED if bench.own else FlightMode.HOLD)
    bench.vehicle.kill_switch()
    bench.vehicle.kill_switch_off()
    bench.pass_time(0.5)
    assert bench.arm() != 0
    assert bench.command(d.MAV_CMD_COMPONENT_ARM_DISARM, 1, 21196) != 0
    bench.pass_time(1.5)
    assert bench.arm() == 0


def test_a_fall_does_not_begin_the_return_again_when_it_is_armed_later(bench):
    bench.vehicle.rc_mode(return_mode(bench))
    bench.vehicle.rc_arm(False, force=True)
    bench.pass_time(3.0)
    bench.vehicle.rc_mode(return_mode(bench))  # PX4 has left it
    bench.vehicle.rc_arm(True, force=True)
    bench.pass_time(5.0)
    assert bench.flight.landed


# the pilot


def test_the_pilot_arms_and_disarms():
    for kind in ('ardupilot', 'px4'):
        bench = Bench(kind)
        assert bench.vehicle.rc_arm(True)
        assert bench.vehicle.rc_arm(False)
        assert [(e.name, e.cause) for e in bench.vehicle.take_events()
                if e.name in ('armed', 'disarmed')] == [('armed', 'pilot'), ('disarmed', 'pilot')]


def test_the_pilot_does_not_disarm_in_the_air_unless_forced(bench):
    assert not bench.vehicle.rc_arm(False)
    assert bench.flight.armed
    assert bench.vehicle.rc_arm(False, force=True)
    bench.pass_time(2.0)
    assert bench.flight.landed


def test_a_refusal_holds_for_the_pilot_too():
    bench = Bench('ardupilot')
    bench.flight.arming_fault = 'Gyros inconsistent'
    assert not bench.vehicle.rc_arm(True)
    assert bench.vehicle.rc_arm(True, force=True)


# avoidance


def test_the_copter_avoids_and_comes_back_to_the_mode_before():
    bench = Bench('ardupilot')
    bench.fly(waypoint(FAR))
    bench.pass_time(3.0)
    bench.vehicle.avoid(True)
    beat = heartbeat(bench)
    assert (beat.custom_mode, beat.system_status) == (19, d.MAV_STATE_CRITICAL)
    bench.vehicle.avoid(False)
    beat = heartbeat(bench)
    assert (beat.custom_mode, beat.system_status) == (3, d.MAV_STATE_ACTIVE)
    bench.reach(0)


def test_an_avoidance_that_the_pilot_ended_does_not_come_back():
    bench = Bench('ardupilot')
    bench.rise()
    bench.vehicle.avoid(True)
    bench.vehicle.rc_mode(5)
    bench.vehicle.avoid(False)
    assert bench.flight.custom_mode == 5


def test_px4_does_not_avoid():
    bench = Bench('px4')
    bench.rise()
    bench.vehicle.avoid(True)
    beat = heartbeat(bench)
    assert (beat.custom_mode, beat.system_status) == (px4_mode(4, 3), d.MAV_STATE_ACTIVE)
