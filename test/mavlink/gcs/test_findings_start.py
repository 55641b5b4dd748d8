# SPDX-License-Identifier: Apache-2.0
"""Findings 9, 18, 26-28, 30: from power-on to the first flight, and its texts for the operator."""
import itertools
import math
import re

import pytest
from findings_bench import (
    BOTH,
    FindingsBench,
    distance,
    drop_messages,
    flown_once_each,
    flying,
)
from flight_bench import places
from mission_bench import task_list
from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.mavlink.gcs.onboard_mission import MissionState
from uav_task_alloc.mavlink.gcs.vehicle_diagnostics import diagnostics_of

REAL = {'arming_delay': None, 'boot_delay': None, 'settling_time': None}  # as the real ones boot
FLOOD = 'Auto mission changed, restarted command'


def powered_on(kind, **kwargs):
    """A vehicle that boots as the real one does, seen from its first heartbeat on."""
    return FindingsBench(kind, configs={1: REAL}, **kwargs).discover()


def line_of(bench):
    """The status line of the diagnostics."""
    return diagnostics_of(bench.ground_station.sessions[1], bench.now).summary


# 9: unlimited retries


@BOTH
def test_finding_09_after_many_failures_it_is_not_available_and_retries(kind):
    bench = FindingsBench(kind).discover()
    broken = [True]
    drop_messages(bench, 'up', 'MISSION_ITEM_INT', lambda m: broken[0] and m.seq == 2)
    bench.assign(task_list('ABC'))
    bench.run(limit=400.0)
    assert not bench.state().available
    assert bench.run(lambda: bench.state().mission_state is not MissionState.UPLOADING, 60.0)
    state = MissionState.MIXED if kind == 'ardupilot' else MissionState.UNKNOWN
    assert bench.state().mission_state is state
    assert bench.state().reason == (
        f'its commands or uploads fail repeatedly: mission {state.name}')
    tries = len(bench.line.sent('MISSION_COUNT'))
    bench.run(limit=200.0)
    assert 0 < len(bench.line.sent('MISSION_COUNT')) - tries <= 20
    broken[0] = False
    assert bench.run(lambda: bench.completed() == ['A', 'B', 'C'], 200.0)
    assert bench.state().available


# 18: batteries


@BOTH
def test_finding_18_of_two_batteries_the_one_with_least_remaining_decides(kind):
    bench = flying(kind, 'EA', side=300.0, delay=(0.0, 0.4), configs={1: {
        'batteries': 2, 'second_battery': 0.6, 'range': 8000.0}})
    readings = []
    bench.run(lambda: readings.append(bench.state().battery), 60.0)
    assert max(b - a for a, b in itertools.pairwise(readings)) <= 0.0
    body = bench.vehicles[1].flight.body
    assert readings[-1] == pytest.approx(0.6 * body.battery, abs=0.02)


@BOTH
def test_finding_18_a_fluctuating_reading_changes_nothing(kind):
    bench = FindingsBench(kind, takeoff=False).discover()
    drop_messages(bench, 'down', 'SYS_STATUS', lambda m: True)
    drop_messages(bench, 'down', 'BATTERY_STATUS', lambda m: True)
    bench.run(limit=12.0)
    readings = set()
    for n in range(20):
        bench.from_vehicle(battery(0, 50 + n % 2))
        readings.add(bench.state().battery)
    assert readings == {0.5}


def battery(number, percent):
    return d.MAVLink_battery_status_message(
        number, 0, 0, 32767, [65535] * 10, -1, -1, -1, percent)


def test_a_battery_without_messages_no_longer_decides():
    bench = FindingsBench('px4', takeoff=False, configs={1: {'batteries': 2}}).discover()
    bench.run(limit=5.0)
    assert bench.state().battery == pytest.approx(0.7)
    drop_messages(bench, 'down', 'BATTERY_STATUS', lambda m: m.id == 1)
    bench.run(limit=15.0)
    assert bench.state().battery == 1.0


# 26: the mission store of a vehicle that boots


def test_finding_26_a_list_assigned_at_power_on_is_flown_completely():
    bench = powered_on('ardupilot')
    bench.assign(task_list('ABCDE'))
    assert bench.run(lambda: len(bench.completed()) == 5)
    assert places(bench) == list('ABCDE')
    assert bench.failed() == []
    assert bench.onboard().upload.uploads == 1
    assert bench.noted('no space') == []


@BOTH
@pytest.mark.parametrize('names', ['A', 'ABCDE'])
def test_finding_26_nothing_is_uploaded_before_the_boot_has_ended(kind, names):
    bench = powered_on(kind)
    bench.assign(task_list(names))
    assert bench.run(lambda: bench.line.sent('MISSION_COUNT'), 60.0)
    assert not bench.vehicles[1].flight.boot.booting
    assert bench.run(lambda: len(bench.completed()) == len(names))


@BOTH
@pytest.mark.parametrize('names', ['A', 'ABCDE'])
def test_finding_26_a_mission_store_without_space_during_boot_is_retried(kind, names):
    bench = FindingsBench(kind).discover()
    closed = [True]

    def refuse(direction, message, now):
        if direction == 'up' and message.get_type() == 'MISSION_COUNT' and closed[0]:
            bench.from_vehicle(d.MAVLink_statustext_message(4, b'Only 0 items are supported'))
            bench.from_vehicle(d.MAVLink_mission_ack_message(245, 190, d.MAV_MISSION_NO_SPACE, 0))
            return []
        return None
    bench.line.tampers.append(refuse)
    bench.assign(task_list(names))
    bench.run(limit=45.0)
    assert bench.failed() == []
    closed[0] = False
    assert bench.run(lambda: len(bench.completed()) == len(names))
    assert {m.count for m in bench.line.sent('MISSION_COUNT')} == {
        len(names) + bench.onboard().own}


@BOTH
def test_finding_26_a_horizon_grows_again_when_there_is_space(kind):
    bench = FindingsBench(kind, configs={1: {'capacity': 5}}).discover()
    bench.assign(task_list('ABCDEFGHIJ'))
    assert bench.run(lambda: bench.completed() == ['A'])
    assert max(len(bench.vehicles[1].mission.items), 5) == 5
    bench.vehicles[1].mission.capacities[d.MAV_MISSION_TYPE_MISSION] = 100
    assert bench.run(lambda: len(bench.completed()) == 10, 600.0)
    assert places(bench) == list('ABCDEFGHIJ')
    counts = [m.count - bench.onboard().own for m in bench.line.sent('MISSION_COUNT')]
    assert counts[-1] > 4
    assert bench.failed() == []


# 27: invalid positions


@BOTH
def test_finding_27_before_there_is_a_position_the_vehicle_is_not_available(kind):
    bench = powered_on(kind)
    booted = []

    def checked():
        state, flight = bench.state(), bench.vehicles[1].flight
        if not flight.positioned:
            assert not state.available
            assert all(map(math.isnan, state.position))
        if not flight.boot.booting and not flight.positioned:
            booted.append(state.reason)
        return state.available
    assert bench.run(checked, 90.0)
    assert booted[-1] == 'no position yet'
    assert math.dist(bench.state().position, bench.vehicles[1].flight.body.position) < 60.0


@BOTH
@pytest.mark.parametrize('lost', ['', 'GPS_RAW_INT', 'estimator'])
def test_finding_27_a_position_without_a_fix_or_estimator_is_not_published(kind, lost):
    bench = FindingsBench(kind, takeoff=False).discover()
    bench.run(limit=5.0)
    assert bench.state().available
    estimator = 'EKF_STATUS_REPORT' if kind == 'ardupilot' else 'ESTIMATOR_STATUS'
    drop_messages(bench, 'down', estimator if lost == 'estimator' else lost, lambda m: True)
    bench.vehicles[1].failsafe('ekf', None)  # the estimator has no absolute position
    if lost == 'estimator':
        drop_messages(bench, 'down', 'GPS_RAW_INT', lambda m: True)
    bench.start()
    bench.discover()
    if lost == 'estimator':
        bench.from_vehicle(d.MAVLink_gps_raw_int_message(
            0, d.GPS_FIX_TYPE_2D_FIX, 0, 0, 0, 0, 0, 0, 0, 5))
    bench.run(limit=6.0)
    assert all(map(math.isnan, bench.state().position))
    assert not bench.state().available


@BOTH
def test_finding_27_a_rebooted_vehicle_has_no_position(kind):
    bench = FindingsBench(kind, takeoff=False, configs={1: {
        'arming_delay': 20.0, 'boot_delay': 4.0}}).discover()
    assert bench.run(lambda: bench.state().available, 40.0)
    bench.vehicles[1].reboot(bench.now)
    assert bench.run(lambda: not bench.state().available, 10.0)

    def available():
        assert bench.vehicles[1].flight.positioned or not bench.state().available
        return bench.state().available
    assert bench.run(available, 60.0)


@BOTH
@pytest.mark.parametrize('seconds', [1.0, 6.0, 30.0])
@pytest.mark.parametrize('before', [60.0, 20.0, 5.0])
def test_a_position_that_jumps_in_flight_loses_no_task(kind, seconds, before):
    bench = flying(kind, 'ABC')
    assert bench.run(lambda: distance(bench, (100.0, 100.0, 50.0)) < before)
    bench.vehicles[1].glitch((300.0, 0.0, 0.0), seconds)
    flown_once_each(bench, 'ABC')


# 28: why it does not arm


@BOTH
def test_finding_28_a_refused_arming_is_logged_once_with_its_reason_and_duration(kind):
    bench = FindingsBench(kind).discover()
    flight = bench.vehicles[1].flight
    flight.arming_fault = 'Gyros inconsistent'
    bench.assign(task_list('AB'))
    bench.run(limit=25.0)
    why = 'Gyros inconsistent' if kind == 'ardupilot' else 'preflight checks fail'
    assert len(bench.noted('arm: refused for', why)) == 1
    assert re.search(rf'arm: refused for 2[45] s: {why}', line_of(bench))
    if kind == 'ardupilot':
        flight.arming_fault = 'Compass not calibrated'
        bench.run(limit=25.0)
        assert len(bench.noted('arm: refused for', 'Gyros inconsistent')) == 1
        assert len(bench.noted('arm: refused for', 'Compass not calibrated')) == 1
    bench.run(limit=150.0)  # more tries than one command has
    assert len(bench.noted('arm: refused')) == 1 + (kind == 'ardupilot')
    flight.arming_fault = ''
    assert bench.run(lambda: bench.completed() == ['A', 'B'])


def test_finding_28_the_sensors_that_px4_calls_unhealthy_are_named():
    bench = FindingsBench('px4').discover()
    bench.vehicles[1].flight.arming_fault = 'horizontal velocity unstable'
    gyro, prearm = d.MAV_SYS_STATUS_SENSOR_3D_GYRO, d.MAV_SYS_STATUS_PREARM_CHECK

    def gyro_fails(direction, message, now):
        if direction == 'down' and message.get_type() == 'SYS_STATUS':
            return [(0.0, d.MAVLink_sys_status_message(
                gyro | prearm, gyro | prearm, 0, 0, 12000, 0, 90, 0, 0, 0, 0, 0, 0))]
        return None
    bench.line.tampers.append(gyro_fails)
    bench.assign(task_list('AB'))
    bench.run(limit=25.0)
    assert bench.noted('arm: refused for', 'preflight checks fail (3d_gyro)')


def test_finding_28_a_px4_that_reports_uninit_as_its_checks_fail_says_why():
    bench = FindingsBench('px4')
    gyro, prearm = d.MAV_SYS_STATUS_SENSOR_3D_GYRO, d.MAV_SYS_STATUS_PREARM_CHECK

    def checks_fail(direction, message, now):
        if direction == 'down' and message.get_type() == 'SYS_STATUS':
            return [(0.0, d.MAVLink_sys_status_message(
                gyro | prearm, gyro | prearm, 0, 0, 12000, 0, 90, 0, 0, 0, 0, 0, 0))]
        if direction == 'down' and message.get_type() == 'HEARTBEAT':
            message.system_status = d.MAV_STATE_UNINIT
        return None
    bench.line.tampers.append(checks_fail)
    bench.discover()
    bench.run(limit=25.0)
    why = 'the autopilot is starting: preflight checks fail (3d_gyro)'
    assert bench.state().reason == why
    assert bench.hand_over() == why


# 30: texts for the operator


def test_finding_30_the_restarted_commands_of_an_append_are_logged_once_as_info():
    bench = flying('ardupilot', 'AB')
    for revision, names in enumerate(('ABCDEF', 'ABCDEFGHI', 'ABCDEFGHIJKL'), 2):
        bench.assign(task_list(names, revision))
        bench.run(limit=2.0)
        bench.from_vehicle(d.MAVLink_statustext_message(6, f'Mission: {revision} WP'.encode()))
    sent = [m for m in bench.line.sent('STATUSTEXT', 'down') if str(m.text) == FLOOD]
    assert len(sent) > 10
    assert [level for level, text in bench.levels if text == FLOOD] == ['info']


def test_finding_30_a_refusal_is_logged_once_until_it_changes():
    bench = FindingsBench('ardupilot').discover()
    result = [d.MAV_RESULT_DENIED]

    def refuse(direction, message, now):
        if (direction == 'up' and message.get_type() == 'COMMAND_LONG' and result[0]
                and message.command == d.MAV_CMD_DO_SET_MODE):
            bench.from_vehicle(d.MAVLink_command_ack_message(message.command, result[0]))
            return []
        return None
    bench.line.tampers.append(refuse)
    bench.assign(task_list('AB'))
    bench.run(limit=60.0)
    assert bench.noted('mode') == ['mode hold: refused with MAV_RESULT 2']
    result[0] = d.MAV_RESULT_FAILED
    assert bench.run(lambda: len(bench.noted('mode hold')) == 2, 200.0)
    result[0] = 0
    assert bench.run(lambda: bench.completed() == ['A', 'B'], 400.0)
