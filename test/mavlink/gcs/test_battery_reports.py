# SPDX-License-Identifier: Apache-2.0
"""What the bridge makes of battery messages: capacities, currents, unknown values, diagnostics."""
import math

import pytest
from flight_bench import FlightBench
from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.mavlink.gcs.energy_estimate import NominalEnergy
from uav_task_alloc.mavlink.gcs.status import state_of
from uav_task_alloc.mavlink.gcs.vehicle_diagnostics import diagnostics_of
from uav_task_alloc.mavlink.mission.items import MissionStop, TaskList
from uav_task_alloc.model import Task

KINDS = ('ardupilot', 'px4')
CAPACITY = {'ardupilot': 'BATT_CAPACITY', 'px4': 'BAT1_CAPACITY'}
PLACES = [(x, y, 50.0) for x, y in ((200, 0), (0, 0), (0, 250), (200, 100), (0, 50), (150, 0))]
WARN = 1


def flown(kind, tasks=5, **config):
    """A flight of some tasks; 3000 m on a full battery, 6000 m are stated."""
    bench = FlightBench(kind, takeoff=True, configs={1: {'range': 3000.0, **config}})
    bench.discover()
    assert bench.run(lambda: bench.executor().telemetry.has_position)
    bench.executor().energy.nominal = NominalEnergy(6000.0, 0.0, 15.0)
    bench.assign(TaskList(1, tuple(MissionStop(Task(f't{k}', place, service_time=2.0))
                                   for k, place in enumerate(PLACES)), returns=True))
    assert bench.run(lambda: len(bench.executor().onboard.progress.completed) >= tasks)
    return bench


def battery(number=0, remaining=80, consumed=-1, current=-1):
    return d.MAVLink_battery_status_message(
        number, d.MAV_BATTERY_FUNCTION_ALL, d.MAV_BATTERY_TYPE_LIPO, 32767,
        [12_000] + [65535] * 9, current, consumed, -1, remaining)


def info(capacity, number=0):
    return d.MAVLink_smart_battery_info_message(
        number, d.MAV_BATTERY_FUNCTION_ALL, d.MAV_BATTERY_TYPE_LIPO, capacity, capacity, 10, b'',
        b'', 1000, 3000, 3500, 3600)


@pytest.mark.parametrize('kind', KINDS)
def test_the_charge_used_and_the_capacity_that_is_set_count(kind):
    bench = flown(kind)
    energy = bench.executor().energy
    assert energy.batteries[0].count.capacity == 5000.0
    assert energy.batteries[0].estimate.counting
    assert energy.limits.full_range == pytest.approx(3000.0, rel=0.1)
    assert energy.batteries[0].estimate.charge == pytest.approx(
        bench.vehicles[1].flight.body.battery, abs=0.01)
    row = diagnostics_of(bench.ground_station.sessions[1], bench.now)
    assert 'by the charge used, of 5000 mAh' in row.facts.batteries
    assert energy.warning == ''


def test_a_smart_battery_with_less_than_is_set_counts_and_is_reported():
    bench = flown('ardupilot', tasks=0)  # counts its per cent by 5000 mAh, which it has no more
    bench.from_vehicle(info(-1))
    bench.from_vehicle(info(3500))
    assert bench.run(lambda: len(bench.executor().onboard.progress.completed) >= 4)
    energy = bench.executor().energy
    left = 1.0 - (1.0 - bench.vehicles[1].flight.body.battery) * 5000.0 / 3500.0
    assert energy.batteries[0].estimate.charge == pytest.approx(left, abs=0.02)
    assert energy.limits.range < 1.1 * 2100.0 * left
    row = diagnostics_of(bench.ground_station.sessions[1], bench.now)
    assert row.level == WARN
    assert 'battery 0: its per cent fell by' in row.summary
    assert 'the charge counts; check the capacity' in row.summary


def test_px4_with_too_large_a_capacity_is_counted_by_its_per_cent():
    bench = flown('px4', parameters=(('BAT1_CAPACITY', 9000.0),))
    energy = bench.executor().energy
    assert energy.batteries[0].estimate.charge == pytest.approx(
        bench.vehicles[1].flight.body.battery, abs=0.015)
    assert energy.limits.full_range == pytest.approx(3000.0, rel=0.12)
    assert 'the per cent counts; check the capacity' in energy.warning


@pytest.mark.parametrize('set_to', [-1.0, 0.0, math.nan])
def test_a_capacity_that_is_not_set_is_learnt(set_to):
    bench = flown('px4', parameters=(('BAT1_CAPACITY', set_to),))
    known = bench.executor().energy.batteries[0].count
    assert math.isnan(known.capacity)
    assert known.used_capacity == pytest.approx(5000.0, rel=0.05)


def test_ardupilot_without_a_capacity_reports_nothing_that_counts():
    bench = flown('ardupilot', tasks=1, parameters=(('BATT_CAPACITY', 0.0),))
    assert bench.executor().energy.batteries == {}
    assert math.isnan(state_of(bench.ground_station.sessions[1], bench.now).range_remaining)


def test_without_a_sensor_px4_is_counted_by_its_per_cent():
    bench = flown('px4', current_sensors=0)
    energy = bench.executor().energy
    assert not energy.batteries[0].estimate.counting
    assert energy.warning == ''
    assert energy.limits.full_range == pytest.approx(3000.0, rel=0.25)
    assert CAPACITY['px4'] not in bench.executor().fence.parameters.values  # nobody needs it


def test_of_two_batteries_one_without_a_sensor_each_counts_as_it_can():
    bench = flown('px4', batteries=2, current_sensors=1, second_battery=0.8)
    first, second = (bench.executor().energy.batteries[n].estimate for n in (0, 1))
    left = bench.vehicles[1].flight.body.battery
    assert (first.counting, second.counting) == (True, False)
    assert first.charge == pytest.approx(left, abs=0.01)
    assert second.charge == pytest.approx(0.8 * left, abs=0.02)
    assert bench.executor().energy.limits.range == pytest.approx(3000.0 * left, rel=0.25)


def test_a_per_cent_that_is_no_longer_known_still_empties():
    bench = flown('ardupilot', tasks=3)
    energy = bench.executor().energy
    before = energy.limits.range
    bench.vehicles[1]._batteries.percent = lambda number: -1
    assert bench.run(lambda: len(bench.executor().onboard.progress.completed) >= 5)
    assert energy.limits.range < before - 300.0


@pytest.mark.parametrize('unknown', [
    {'consumed': -1, 'current': -1}, {'consumed': 2**31 - 1, 'current': 32767},
    {'consumed': 0, 'current': -100}, {'consumed': -2**31, 'current': -32768}])
def test_unknown_charges_and_currents_are_no_charge(unknown):
    bench = FlightBench('px4', configs={1: {'batteries': 0}})
    bench.discover()
    for remaining in range(80, 60, -1):
        bench.from_vehicle(battery(remaining=remaining, **unknown))
        bench.run(limit=1.0)
    known = bench.executor().energy.batteries[0]
    assert not known.estimate.counting
    assert known.doubt == ''


def test_a_current_is_summed_where_no_charge_is_counted():
    bench = FlightBench('px4', configs={1: {'batteries': 0, 'parameters': (
        ('BAT1_CAPACITY', -1.0),)}})
    bench.discover()
    for n in range(120):  # 90 A for 2 minutes: 3000 mAh of 10 Ah
        bench.from_vehicle(battery(remaining=80 - n // 4, current=9000))
        bench.run(limit=1.0)
    known = bench.executor().energy.batteries[0]
    assert known.estimate.counting
    assert known.count.used_capacity == pytest.approx(10_000.0, rel=0.1)


def test_before_the_flight_shows_its_drain_a_doubted_charge_limits_what_is_stated():
    bench = FlightBench('px4', configs={1: {'batteries': 0}})
    bench.discover()
    assert bench.run(lambda: bench.executor().telemetry.has_position)
    bench.executor().energy.nominal = NominalEnergy(6000.0, 0.0, 15.0)
    bench.from_vehicle(info(2000))
    for n in range(40):  # on the ground: 1000 of 2000 mAh, and the per cent does not fall
        bench.from_vehicle(battery(remaining=90, consumed=100 + 25 * n))
        bench.run(limit=1.0)
    status = state_of(bench.ground_station.sessions[1], bench.now + 1.0)
    assert status.battery == pytest.approx(0.9)
    assert status.range_remaining == pytest.approx(6000.0 * 0.41, rel=0.05)
    assert 'the charge counts' in bench.executor().energy.warning
