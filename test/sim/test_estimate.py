# SPDX-License-Identifier: Apache-2.0
"""What the simulated vehicles report as their position before and after there is one."""
import math

import pytest
from pymavlink.dialects.v20 import ardupilotmega as d
from vehicle_bench import ORIGIN, Bench, of

from uav_task_alloc.geometry.frames import to_enu

KINDS = ['ardupilot', 'px4']
ABS = d.EKF_POS_HORIZ_ABS


@pytest.fixture(params=KINDS)
def bench(request):
    return Bench(request.param)


def place(message):
    """ENU [m] of a reported position."""
    return to_enu(ORIGIN, message.lat * 1e-7, message.lon * 1e-7, message.alt * 1e-3)


def flags(bench):
    kind = 'EKF_STATUS_REPORT' if bench.own else 'ESTIMATOR_STATUS'
    return bench.request(kind)[0].flags


def test_the_copter_reports_zeros_before_it_has_a_position():
    bench = Bench('ardupilot', ready=20.0)
    report, = bench.request('GLOBAL_POSITION_INT')
    assert (report.lat, report.lon) == (0, 0)
    bench.pass_time(22.0)
    report, = bench.request('GLOBAL_POSITION_INT')
    assert place(report) == pytest.approx((0.0, 0.0, 0.0), abs=0.02)


def test_px4_reports_no_position_before_it_has_one():
    bench = Bench('px4', ready=15.0, floods=True)
    assert not of(bench.pass_time(4.0), 'GLOBAL_POSITION_INT', 'LOCAL_POSITION_NED')
    assert of(bench.pass_time(2.0), 'GLOBAL_POSITION_INT', 'LOCAL_POSITION_NED')


def test_the_first_estimate_of_px4_jumps_by_tens_of_metres_for_some_seconds():
    bench = Bench('px4', ready=19.9, floods=True)
    jumping = [math.dist(place(m), (0.0, 0.0, 0.0))
               for m in of(bench.pass_time(5.0), 'GLOBAL_POSITION_INT')]
    assert min(jumping) > 20.0
    assert len({round(jump) for jump in jumping}) > 2
    bench.pass_time(0.5)
    steady = of(bench.pass_time(5.0), 'GLOBAL_POSITION_INT')
    assert max(math.dist(place(m), (0.0, 0.0, 0.0)) for m in steady) < 0.1


def test_the_time_of_jumps_can_be_set():
    bench = Bench('px4', ready=21.0, settling_time=0.0)
    assert place(bench.request('GLOBAL_POSITION_INT')[0]) == pytest.approx((0, 0, 0), abs=0.02)


def test_home_is_sent_only_once_there_is_a_position(bench):
    assert bench.request('HOME_POSITION')
    bench.vehicle.reboot(bench.now)
    bench.pass_time(10.0)
    assert not bench.request('HOME_POSITION')


def test_the_satellite_fix_comes_with_the_position(bench):
    report, = bench.request('GPS_RAW_INT')
    assert report.fix_type == d.GPS_FIX_TYPE_3D_FIX
    assert place(report) == pytest.approx((0.0, 0.0, 0.0), abs=0.02)
    bench.vehicle.reboot(bench.now)
    report, = bench.request('GPS_RAW_INT')
    assert (report.fix_type, report.lat, report.lon) == (d.GPS_FIX_TYPE_NO_FIX, 0, 0)


def test_the_estimator_has_an_absolute_position_only_when_positioned(bench):
    assert flags(bench) & ABS
    bench.vehicle.reboot(bench.now)
    bench.pass_time(10.0)
    assert not flags(bench) & ABS


def test_the_estimator_of_a_booting_copter_is_not_initialised():
    assert flags(Bench('ardupilot', ready=1.0)) == d.EKF_UNINITIALIZED


def test_each_autopilot_has_its_own_estimator_message(bench):
    other = 'ESTIMATOR_STATUS' if bench.own else 'EKF_STATUS_REPORT'
    assert not bench.request(other)


@pytest.mark.parametrize('name', ['GPS_RAW_INT', 'estimator'])
def test_the_new_streams_come_at_the_rate_asked_for(bench, name):
    if name == 'estimator':
        name = 'EKF_STATUS_REPORT' if bench.own else 'ESTIMATOR_STATUS'
    number = getattr(d, f'MAVLINK_MSG_ID_{name}')
    assert bench.command(d.MAV_CMD_SET_MESSAGE_INTERVAL, number, 200_000) == 0
    assert len(of(bench.pass_time(10.0), name)) in (50, 51)


@pytest.mark.parametrize('name', ['GPS_RAW_INT', 'ESTIMATOR_STATUS'])
def test_px4_streams_fix_and_estimator_at_1_hz_unasked(name):
    assert len(of(Bench('px4').pass_time(10.0), name)) in (9, 10, 11)


def test_a_glitch_moves_the_reported_position_for_its_time(bench):
    bench.rise()
    real = bench.flight.body.position
    bench.vehicle.glitch((80.0, -40.0, 5.0), 3.0)
    for kind in ('GLOBAL_POSITION_INT', 'GPS_RAW_INT'):
        moved = place(bench.request(kind)[0])
        assert moved == pytest.approx((real[0] + 80.0, real[1] - 40.0, real[2] + 5.0), abs=0.5)
    assert bench.flight.body.position == real
    local, = bench.request('LOCAL_POSITION_NED')
    assert (local.x, local.y) == pytest.approx((real[1] - 40.0, real[0] + 80.0), abs=0.01)
    bench.pass_time(3.1)
    assert place(bench.request('GLOBAL_POSITION_INT')[0]) == pytest.approx(real, abs=0.5)


def test_the_estimator_notices_a_glitch(bench):
    bit = d.EKF_GPS_GLITCHING if bench.own else d.ESTIMATOR_GPS_GLITCH
    assert not flags(bench) & bit
    bench.vehicle.glitch((80.0, 0.0, 0.0), 3.0)
    assert flags(bench) & bit


# batteries


def test_two_batteries_are_sent_each_at_the_requested_rate(bench):
    bench = Bench('ardupilot' if bench.own else 'px4', batteries=2)
    bench.command(d.MAV_CMD_SET_MESSAGE_INTERVAL, d.MAVLINK_MSG_ID_BATTERY_STATUS, 500_000)
    report = [m.id for m in of(bench.pass_time(10.0), 'BATTERY_STATUS')]
    assert len(report) in (40, 42)
    assert report == [0, 1] * (len(report) // 2)


def test_the_second_battery_is_worse_and_sys_status_reports_the_first(bench):
    bench = Bench('ardupilot' if bench.own else 'px4', batteries=2, second_battery=0.5)
    bench.flight.body.battery = 0.8
    first, second = bench.request('BATTERY_STATUS')
    assert (first.battery_remaining, second.battery_remaining) == (80, 40)
    assert second.voltages[0] < first.voltages[0]
    report, = bench.request('SYS_STATUS')
    assert (report.battery_remaining, report.voltage_battery) == (80, first.voltages[0])


def test_one_battery_is_sent_as_number_0(bench):
    assert [m.id for m in bench.request('BATTERY_STATUS')] == [0]
