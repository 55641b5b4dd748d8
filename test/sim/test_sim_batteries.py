# SPDX-License-Identifier: Apache-2.0
"""BATTERY_STATUS of a simulated vehicle, as ArduPilot and PX4 send it."""
import pytest
from mission_bench import make_vehicle

KINDS = ('ardupilot', 'px4')


def status(vehicle, number=0):
    return vehicle._batteries.messages()[number]


def used_up(kind, left, **config):
    vehicle = make_vehicle(kind, 1, **config)
    vehicle.flight.body.battery = left
    return vehicle


@pytest.mark.parametrize('kind', KINDS)
def test_the_charge_used_is_counted_from_boot(kind):
    vehicle = used_up(kind, 0.745, battery_capacity=4000.0, batteries=2, parameters=(
        ('BATT_CAPACITY', 4000.0), ('BAT1_CAPACITY', 4000.0)))
    assert status(vehicle).current_consumed == 1020
    assert status(vehicle).battery_remaining == 74
    assert status(vehicle, 1).current_consumed == round(1020 * 0.7)
    vehicle.reboot(10.0)
    assert status(vehicle).current_consumed == 0
    assert status(vehicle).battery_remaining == 74


def test_ardupilot_counts_its_per_cent_by_the_capacity_that_is_set():
    vehicle = used_up('ardupilot', 0.5, parameters=(('BATT_CAPACITY', 10_000.0),))
    assert status(vehicle).battery_remaining == 75
    assert used_up('ardupilot', 0.2, parameters=(
        ('BATT_CAPACITY', 3300.0),)).parameters.get('BATT_CAPACITY') == 3300.0
    assert status(used_up('ardupilot', 0.2, parameters=(
        ('BATT_CAPACITY', 3300.0),))).battery_remaining == 0


def test_px4_never_reports_more_than_its_capacity_less_the_charge():
    assert status(used_up('px4', 0.5, parameters=(
        ('BAT1_CAPACITY', 10_000.0),))).battery_remaining == 50
    assert status(used_up('px4', 0.75, parameters=(
        ('BAT1_CAPACITY', 2500.0),))).battery_remaining == 50


def test_what_a_battery_without_a_sensor_of_its_current_reports():
    plain = [status(used_up(kind, 0.8, current_sensors=0)) for kind in KINDS]
    assert [m.current_battery for m in plain] == [-1, -100]
    assert [m.current_consumed for m in plain] == [-1, 0]
    assert [m.battery_remaining for m in plain] == [-1, 80]
