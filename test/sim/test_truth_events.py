# SPDX-License-Identifier: Apache-2.0
"""The ground truth of the simulated vehicles: causes of modes, arming and commands."""
import json

import pytest
from pymavlink.dialects.v20 import ardupilotmega as d
from vehicle_bench import ORIGIN, Bench, waypoint

from uav_task_alloc.record.ground_truth import GroundTruth
from uav_task_alloc.sim.config import FlightMode, VehicleConfig
from uav_task_alloc.sim.modes import px4_mode
from uav_task_alloc.sim.udp_fleet import UdpFleet

FAR = (400.0, 0.0, 30.0)
OURS = {'station': (245, 190)}


@pytest.fixture(params=['ardupilot', 'px4'])
def bench(request):
    bench = Bench(request.param)
    bench.vehicle.take_events()
    return bench


def named(bench, *names):
    return [e for e in bench.vehicle.take_events() if e.name in names]


def start_mode(bench):
    return bench.flight.custom_modes[FlightMode.GUIDED if bench.own else FlightMode.MANUAL]


def test_a_mode_change_is_noted_with_its_number_and_the_station(bench):
    number = start_mode(bench)
    bench.send(d.MAVLink_set_mode_message(1, 1, number), **OURS)
    event, = named(bench, 'mode')
    assert (event.mode, event.cause) == (number, 'station 245/190')


def test_a_mode_that_is_set_again_is_no_change(bench):
    bench.send(d.MAVLink_set_mode_message(1, 1, bench.flight.custom_mode), **OURS)
    assert not named(bench, 'mode')


def test_modes_changed_by_the_pilot_and_by_a_failsafe_say_so(bench):
    bench.rise()
    bench.vehicle.take_events()
    home = bench.flight.custom_modes[FlightMode.RETURN]
    bench.vehicle.rc_mode(start_mode(bench))
    bench.vehicle.rc_mode(bench.flight.custom_modes[FlightMode.HOLD])
    bench.vehicle.failsafe('radio', home)
    modes = named(bench, 'mode', 'failsafe')
    assert [(e.name, e.cause) for e in modes][-2:] == [('failsafe', 'radio'), ('mode', 'failsafe')]
    assert {e.cause for e in modes[:-2]} == {'pilot'}
    assert modes[-1].mode == home


def test_what_px4_does_after_its_landing_is_its_own_doing():
    bench = Bench('px4')
    bench.rise()
    bench.set_mode(FlightMode.LAND)
    bench.vehicle.take_events()
    bench.until(lambda: not bench.flight.armed)
    assert [(e.name, e.mode, e.cause) for e in named(bench, 'mode', 'disarmed')] == [
        ('disarmed', None, 'self'), ('mode', px4_mode(4, 3), 'self')]


def test_arming_is_noted_with_the_station(bench):
    bench.send(d.MAVLink_set_mode_message(1, 1, start_mode(bench)), **OURS)
    bench.command(d.MAV_CMD_COMPONENT_ARM_DISARM, 1, **OURS)
    bench.command(d.MAV_CMD_COMPONENT_ARM_DISARM, 0, station=(7, 8))
    assert [(e.name, e.cause) for e in named(bench, 'armed', 'disarmed')] == [
        ('armed', 'station 245/190'), ('disarmed', 'station 7/8')]


def test_a_vehicle_that_disarms_itself_records_that(bench):
    bench.send(d.MAVLink_set_mode_message(1, 1, start_mode(bench)), **OURS)
    bench.command(d.MAV_CMD_COMPONENT_ARM_DISARM, 1)
    bench.pass_time(11.0)
    assert named(bench, 'disarmed')[0].cause == 'self'


def commands(bench):
    return [(e.command, e.mode, e.seq) for e in named(bench, 'command')
            if e.cause == 'station 245/190']


@pytest.mark.parametrize(('number', 'params', 'expected'), [
    (d.MAV_CMD_COMPONENT_ARM_DISARM, (1,), 'arm'),
    (d.MAV_CMD_COMPONENT_ARM_DISARM, (0,), 'disarm'),
    (d.MAV_CMD_COMPONENT_ARM_DISARM, (0, 21196), 'forced disarm'),
    (d.MAV_CMD_NAV_TAKEOFF, (0, 0, 0, 0, 0, 0, 20), 'takeoff'),
    (d.MAV_CMD_MISSION_START, (), 'mission start')])
def test_a_command_is_noted_with_its_sender_even_when_refused(bench, number, params, expected):
    bench.flight.arming_fault = 'Gyros inconsistent'
    bench.command(number, *params, **OURS)
    assert commands(bench) == [(expected, None, None)]


def test_commands_to_change_the_mode_are_noted_with_its_number(bench):
    main, sub = (9, 0) if bench.own else (4, 6)
    land = 9 if bench.own else px4_mode(4, 6)
    bench.command(d.MAV_CMD_DO_SET_MODE, 1, main, sub, **OURS)
    bench.command(d.MAV_CMD_NAV_LAND, **OURS)
    bench.send(d.MAVLink_set_mode_message(1, 1, land), **OURS)
    assert commands(bench) == [('mode', land, None)] * 3


def test_commands_to_set_the_current_item_are_noted_with_its_seq(bench):
    bench.load(waypoint(FAR), waypoint(FAR))
    bench.command(d.MAV_CMD_DO_SET_MISSION_CURRENT, 1, **OURS)
    bench.send(d.MAVLink_mission_set_current_message(1, 1, 1), **OURS)
    bench.send(d.MAVLink_command_int_message(
        1, 1, 0, d.MAV_CMD_MISSION_START, 0, 0, 0, 0, 0, 0, 0, 0, 0), **OURS)
    assert commands(bench) == [('set current', None, 1)] * 2 + [('mission start', None, None)]


def test_other_commands_are_not_noted(bench):
    bench.command(d.MAV_CMD_SET_MESSAGE_INTERVAL, 33, 200_000, **OURS)
    assert not commands(bench)


def test_the_log_has_only_the_fields_that_apply_and_the_record_reads_it(tmp_path):
    path = tmp_path / 'log.jsonl'
    config = VehicleConfig('uav_1', 1, ORIGIN, (0.0, 0.0, 0.0), arming_delay=0.0)
    fleet = UdpFleet([(config, 'ardupilot')], ('127.0.0.1', 9), log_file=path)
    vehicle = fleet.vehicles['uav_1']
    vehicle.rc_mode(16)
    vehicle.rc_arm(True)
    vehicle.failsafe('fence', None)
    vehicle.kill_switch()
    fleet._step(0.1)
    fleet.close()
    lines = [json.loads(line) for line in path.read_text().splitlines()]
    base = {'t', 'wall', 'clock', 'uav', 'x', 'y', 'z'}
    report = {line['event']: {k: line[k] for k in line.keys() - base - {'event'}}
            for line in lines if 'event' in line}
    assert report == {
        'mode': {'mode': 16, 'cause': 'pilot'}, 'armed': {'cause': 'pilot'},
        'failsafe': {'cause': 'fence'}, 'kill_switch': {'cause': 'pilot'},
        'disarmed': {'cause': 'pilot'}}
    truth = GroundTruth()
    for line in lines:
        truth.apply(line)
    assert len(truth.tracks['uav_1']) == 1
