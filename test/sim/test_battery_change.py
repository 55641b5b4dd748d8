# SPDX-License-Identifier: Apache-2.0
"""A crew changes the battery at the base: power off, boot, full; never elsewhere or unflown."""
import pytest
from vehicle_bench import Bench

from uav_task_alloc.sim.config import FlightMode

BOTH = pytest.mark.parametrize('autopilot', ['ardupilot', 'px4'])


def after_a_flight(autopilot, to=(60.0, 0.0, 20.0), **config):
    """A vehicle that has flown to a point, returned and landed."""
    bench = Bench(autopilot, range=2000.0, turnaround=120.0, **config)
    flight = bench.flight
    if autopilot == 'ardupilot':
        assert flight.set_mode(FlightMode.GUIDED)
    flight.arm()
    flight.takeoff(20.0)
    bench.until(lambda: flight.body.position[2] > 19.0)
    bench.pass_time(60.0)
    flight.set_mode(FlightMode.RETURN)
    bench.until(lambda: flight.landed and not flight.armed)
    return bench


def names(bench):
    return [event.name for event in bench.vehicle.take_events()]


@BOTH
def test_it_is_powered_off_boots_with_a_full_battery_and_is_ready_after_the_turnaround(autopilot):
    bench = after_a_flight(autopilot)
    landed_at, used = bench.now, bench.flight.body.battery
    assert used < 0.9
    names(bench)
    bench.until(lambda: bench.vehicle.silent)
    assert bench.now - landed_at == pytest.approx(5.0, abs=0.5)
    assert bench.pass_time(10.0) == []  # no heartbeat, and no answer
    assert bench.flight.body.battery == used
    bench.until(lambda: not bench.vehicle.silent)
    assert names(bench) == ['power_off', 'battery_changed', 'reboot'] + (
        ['mode'] if autopilot == 'ardupilot' else ['mode'][:0])
    assert bench.flight.body.battery == 1.0
    bench.until(lambda: bench.flight.positioned and not bench.flight.boot.settling)
    assert bench.now - landed_at == pytest.approx(120.0, abs=1.0)
    bench.pass_time(300.0)
    assert not bench.vehicle.silent  # once a flight


@BOTH
def test_without_a_turnaround_or_away_from_home_nobody_changes_it(autopilot):
    for config in ({'turnaround': float('inf')}, {'home': (500.0, 0.0, 0.0)}):
        bench = Bench(autopilot, range=2000.0, **{'turnaround': 120.0, **config})
        if autopilot == 'ardupilot':
            bench.flight.set_mode(FlightMode.GUIDED)
        bench.flight.arm()
        bench.flight.takeoff(20.0)
        bench.pass_time(60.0)
        bench.flight.set_mode(FlightMode.LAND)
        bench.until(lambda: bench.flight.landed and not bench.flight.armed)  # noqa: B023
        bench.pass_time(300.0)
        assert 'power_off' not in names(bench)
        assert bench.flight.body.battery < 0.9


def test_a_battery_that_was_not_used_stays_even_if_it_is_not_full():
    bench = Bench('px4', range=2000.0, turnaround=10.0, charge=0.5)
    bench.pass_time(100.0)
    assert not names(bench)
    assert bench.flight.body.battery == 0.5


def test_a_vehicle_that_is_lost_during_the_change_stays_lost_until_it_is_revived():
    bench = after_a_flight('px4')
    bench.until(lambda: bench.vehicle.silent)
    bench.vehicle.kill()
    assert bench.pass_time(300.0) == []
    bench.vehicle.revive(bench.now)
    assert not bench.vehicle.silent
