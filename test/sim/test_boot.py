# SPDX-License-Identifier: Apache-2.0
"""The simulated autopilots from power-up to a position estimate, and why they refuse to arm."""
import pytest
from pymavlink.dialects.v20 import ardupilotmega as d
from vehicle_bench import ORIGIN, Bench, content, of, waypoint

from uav_task_alloc.sim.config import FlightMode, VehicleConfig
from uav_task_alloc.sim.vehicle import AUTOPILOTS, Vehicle

A, B = (100.0, 0.0, 30.0), (100.0, 100.0, 30.0)
KINDS = ['ardupilot', 'px4']
PREARM = d.MAV_SYS_STATUS_PREARM_CHECK


@pytest.fixture(params=KINDS)
def bench(request):
    return Bench(request.param)


@pytest.fixture
def copter():
    return Bench('ardupilot')


def states(messages):
    """MAV_STATE of the heartbeats, without repetitions."""
    return list(dict.fromkeys(m.system_status for m in of(messages, 'HEARTBEAT')))


@pytest.mark.parametrize(('kind', 'expected'), [
    ('ardupilot', [d.MAV_STATE_BOOT, d.MAV_STATE_CALIBRATING, d.MAV_STATE_STANDBY]),
    ('px4', [d.MAV_STATE_UNINIT, d.MAV_STATE_BOOT, d.MAV_STATE_STANDBY])])
def test_the_heartbeats_of_a_boot_have_its_state(kind, expected):
    bench = Bench(kind, ready=0.0)
    assert states(bench.pass_time(10.0)) == expected


@pytest.mark.parametrize(('kind', 'seconds'), [('ardupilot', 8.0), ('px4', 4.0)])
def test_the_boot_takes_as_long_as_the_real_one(kind, seconds):
    bench = Bench(kind, ready=0.0)
    bench.pass_time(seconds - 0.1)
    assert bench.flight.boot.booting
    bench.pass_time(0.2)
    assert not bench.flight.boot.booting


@pytest.mark.parametrize('kind', KINDS)
def test_without_an_arming_delay_there_is_no_boot_unless_it_is_given(kind):
    config = {'uav': 'u', 'system_id': 1, 'origin': ORIGIN, 'position': (0.0, 0.0, 0.0),
              'arming_delay': 0.0}
    assert not Vehicle(VehicleConfig(**config), AUTOPILOTS[kind]).flight.boot.booting
    booting = Vehicle(VehicleConfig(**config, boot_delay=3.0), AUTOPILOTS[kind])
    assert booting.flight.boot.booting
    assert not booting.flight.positioned


def test_it_does_not_arm_during_the_boot(bench):
    bench.vehicle.reboot(bench.now)
    bench.flight.arming_fault = 'Gyros inconsistent'  # not checked yet
    refused = d.MAV_RESULT_FAILED if bench.own else d.MAV_RESULT_TEMPORARILY_REJECTED
    assert bench.arm() == refused
    assert bench.command(d.MAV_CMD_COMPONENT_ARM_DISARM, 1, 21196) == refused
    assert bench.texts() == ['Arm: System not initialised'] * 2 * bench.own


def test_the_booting_copter_has_no_space_for_a_mission(copter):
    copter.load(waypoint(A), waypoint(B))
    copter.vehicle.reboot(copter.now)
    ack, text = copter.count(3)
    assert ack.type == d.MAV_MISSION_NO_SPACE
    assert (text.severity, text.text) == (d.MAV_SEVERITY_WARNING, 'Only 0 items are supported')
    assert not copter.download()


def test_the_mission_of_the_copter_is_restored_after_the_boot(copter):
    copter.load(waypoint(A), waypoint(B))
    before = [content(i) for i in copter.download()]
    copter.vehicle.reboot(copter.now)
    copter.pass_time(4.0)
    copter.vehicle.reboot(copter.now)  # a second time, in the middle of the boot
    copter.pass_time(8.1)
    assert [content(i) for i in copter.download()] == before


def test_a_mission_cleared_during_the_boot_stays_cleared(copter):
    copter.load(waypoint(A))
    copter.vehicle.reboot(copter.now)
    copter.send(d.MAVLink_mission_clear_all_message(1, 1, 0))
    copter.pass_time(9.0)
    assert not copter.download()


def test_a_mission_too_long_is_refused_with_a_text(copter):
    assert copter.count(651)[0].type == d.MAV_MISSION_NO_SPACE
    assert copter.texts() == ['Only 650 items are supported']


def test_a_mission_can_be_uploaded_before_there_is_a_position(bench):
    bench.vehicle.reboot(bench.now)
    bench.pass_time(9.0)
    bench.load(waypoint(A))


@pytest.mark.parametrize('kind', KINDS)
def test_a_reboot_in_the_air_falls_and_begins_a_new_estimate(kind):
    bench = Bench(kind)
    bench.rise()
    bench.vehicle.take_events()
    bench.vehicle.reboot(bench.now)
    assert not bench.flight.armed
    assert not bench.flight.positioned
    bench.pass_time(2.0)
    assert bench.flight.landed
    assert bench.flight.body.position[2] == 0.0
    events = bench.vehicle.take_events()
    assert {'reboot', 'disarmed', 'crashed'} <= {e.name for e in events}
    assert {e.cause for e in events if e.name in ('disarmed', 'crashed')} == {'self'}


def test_a_vehicle_that_is_revived_boots_on_the_ground():
    bench = Bench('px4')
    bench.rise()
    bench.vehicle.kill()
    bench.vehicle.revive(bench.now)
    assert bench.flight.landed
    assert bench.flight.body.position[2] == 0.0


# refusals


@pytest.mark.parametrize(('kind', 'result', 'texts'), [
    ('ardupilot', d.MAV_RESULT_FAILED, ['Arm: Gyros inconsistent']),
    ('px4', d.MAV_RESULT_TEMPORARILY_REJECTED, [])])
def test_a_forced_refusal_is_reported_as_by_the_autopilot(kind, result, texts):
    bench = Bench(kind)
    bench.flight.arming_fault = 'Gyros inconsistent'
    assert bench.arm() == result
    assert bench.texts() == texts
    bench.flight.arming_fault = ''
    assert bench.arm() == d.MAV_RESULT_ACCEPTED


def test_a_copter_that_cannot_arm_reports_why_every_30_s(copter):
    copter.flight.arming_fault = 'Gyros inconsistent'
    copter.pass_time(65.0)
    assert copter.texts() == ['PreArm: Gyros inconsistent'] * 2
    assert of(copter.received, 'STATUSTEXT')[0].severity == d.MAV_SEVERITY_CRITICAL


def test_the_arming_text_names_the_mode_that_is_not_armable(copter):
    copter.set_mode(6)
    assert copter.arm() == d.MAV_RESULT_FAILED
    assert copter.texts() == ['Arm: RTL mode not armable']


def test_a_forced_arming_skips_the_checks(bench):
    bench.flight.arming_fault = 'Gyros inconsistent'
    assert bench.command(d.MAV_CMD_COMPONENT_ARM_DISARM, 1, 21196) == 0
    assert bench.flight.armed


def test_the_prearm_bit_is_healthy_only_when_it_would_arm(bench):
    def bits():
        m, = bench.request('SYS_STATUS')
        return (m.onboard_control_sensors_present, m.onboard_control_sensors_enabled,
                m.onboard_control_sensors_health)
    assert bits() == (PREARM, PREARM, PREARM)
    bench.flight.arming_fault = 'Gyros inconsistent'
    assert bits() == (PREARM, PREARM, 0)
    bench.flight.arming_fault = ''
    bench.vehicle.reboot(bench.now)
    bench.pass_time(10.0)
    assert bits() == (PREARM, PREARM, 0)


def test_the_prearm_bit_stays_healthy_while_armed(bench):
    bench.set_mode(FlightMode.GUIDED if bench.own else FlightMode.HOLD)
    bench.arm()
    bench.flight.arming_fault = 'Gyros inconsistent'
    assert bench.request('SYS_STATUS')[0].onboard_control_sensors_health == PREARM
