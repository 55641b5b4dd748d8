# SPDX-License-Identifier: Apache-2.0
"""The rate of a vehicle's clock, by which ages and arrivals are shown at any speed-up."""
import math
import random

import pytest
from flight_bench import FlightBench, places
from mission_bench import ORIGIN, PROFILES, task_list
from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.mavlink.gcs.clock_rate import ClockRate
from uav_task_alloc.mavlink.gcs.telemetry import Telemetry
from uav_task_alloc.mavlink.transport.codec import Codec


@pytest.mark.parametrize('rate', [0.5, 1.0, 8.0, 40.0])
def test_the_rate_is_that_of_the_last_seconds(rate):
    rng, clock = random.Random(1), ClockRate()
    assert math.isnan(clock.value)
    for k in range(300):  # 30 s, a message each 0.1 s, up to 0.1 s late
        clock.add(7.0 + 0.1 * k * rate, 100.0 + 0.1 * k + rng.uniform(0.0, 0.1))
    assert clock.value == pytest.approx(rate, rel=0.01)
    for k in range(300):  # the simulator is set to run twice as fast
        clock.add(37.0 + 30.0 * rate + 0.2 * k * rate, 130.0 + 0.1 * k)
    assert clock.value == pytest.approx(2.0 * rate, rel=0.01)


def test_a_restart_begins_a_new_measurement():
    clock = ClockRate()
    for k in range(10):
        clock.add(900.0 + 8.0 * k, float(k))
    assert clock.value == 8.0
    clock.reset()
    clock.add(1.0, 10.0)
    assert math.isnan(clock.value)


@pytest.mark.parametrize(('rate', 'seconds'), [(1.0, 6.0), (1.3, 6.0), (8.0, 0.75)])
def test_a_transfer_is_given_up_by_the_clock_of_the_vehicle(rate, seconds):
    telemetry, codec = Telemetry(PROFILES['px4'], ORIGIN, 0.0), Codec(1, 1)
    assert telemetry.idle_after() == 6.0
    for k in range(60):
        message, = codec.parse(codec.pack(d.MAVLink_system_time_message(0, int(100 * rate * k))))
        telemetry.receive(message, 0.1 * k)
    assert telemetry.idle_after() == pytest.approx(seconds, rel=0.01)


def clocked(telemetry, boot_ms, now):
    message, = Codec(1, 1).parse(Codec(1, 1).pack(d.MAVLink_system_time_message(0, int(boot_ms))))
    telemetry.receive(message, now)


@pytest.fixture
def flying():
    """A vehicle that has run for 60 s, up to the time 6 s."""
    telemetry = Telemetry(PROFILES['px4'], ORIGIN, 0.0)
    for k in range(60):
        clocked(telemetry, 54000 + 100 * k, 0.1 * k)
    return telemetry


@pytest.mark.parametrize('silence', [7.0, 10.0, 60.0])
def test_buffered_messages_in_order_are_no_restart(flying, silence):
    for k in range(int(5 * silence)):  # 5 Hz, all delivered within 0.8 s
        clocked(flying, 60000 + 200 * k, 6.0 + silence + 0.8 * k / (5 * silence))
    for k in range(20):
        clocked(flying, 60800 + 1000 * silence + 200 * k, 6.8 + silence + 0.2 * k)
    assert flying.restarts == 0


def test_a_restart_in_a_long_silence_shows_by_a_clock_that_stays_behind(flying):
    for k in range(8):  # 90 s of silence; it has run for 70 s: ahead of the clock before
        clocked(flying, 70000 + 200 * k, 96.0 + 0.2 * k)
    assert flying.restarts == 1
    assert flying.booted_at == pytest.approx(26.0, abs=0.1)


def test_a_restart_shows_by_two_clocks_that_went_back(flying):
    clocked(flying, 3000, 13.0)
    assert flying.restarts == 0
    clocked(flying, 3200, 13.2)
    assert flying.restarts == 1


@pytest.mark.parametrize('late', [20000, 59500, 61000])
def test_late_messages_of_before_a_restart_show_no_other_one(flying, late):
    for k in range(3):
        clocked(flying, 500 + 200 * k, 6.5 + 0.2 * k)
    assert flying.restarts == 1
    clocked(flying, late, 7.0)
    for k in range(40):
        clocked(flying, 1100 + 200 * k, 7.1 + 0.2 * k)
        if k in (3, 18):
            clocked(flying, late, 7.1 + 0.2 * k)
    assert flying.restarts == 1
    assert flying.boot_ms == 8900


def test_a_faster_clock_after_a_restart_is_followed():
    telemetry = Telemetry(PROFILES['px4'], ORIGIN, 0.0)
    for k in range(60):
        clocked(telemetry, 2000 * k, 0.2 * k)  # ten times real time
    for k in range(3):
        clocked(telemetry, 4000 + 6000 * k, 12.0 + 0.6 * k)
    assert telemetry.restarts == 1
    assert telemetry.boot_ms == 16000


def test_another_restart_soon_after_one_is_seen(flying):
    for k in range(60):
        clocked(flying, 500 + 200 * k, 6.5 + 0.2 * k)
    for k in range(3):
        clocked(flying, 300 + 200 * k, 18.5 + 0.2 * k)
    assert flying.restarts == 2


WRAP = 2**32  # [ms] after which a uint32 begins again at 0


@pytest.mark.parametrize('silence', [0.2, 60.0, 7200.0])
def test_a_clock_that_begins_again_after_49_7_days_shows_no_restart(silence):
    telemetry = Telemetry(PROFILES['px4'], ORIGIN, 0.0)
    for k in range(60):
        clocked(telemetry, WRAP - 6000 + 100 * k, 0.1 * k)
    for k in range(60):
        clocked(telemetry, 1000.0 * silence + 200 * k - 100, 5.9 + silence + 0.2 * k)
    clocked(telemetry, WRAP - 300, 7.0 + silence + 0.2 * 60)  # late
    assert telemetry.restarts == 0
    assert telemetry.boot_ms == pytest.approx(WRAP + 1000 * silence + 11700, abs=1)


@pytest.mark.parametrize('age', [WRAP - 60_000, WRAP * 3 // 4])
def test_a_restart_of_an_old_clock_is_seen(age):
    telemetry = Telemetry(PROFILES['px4'], ORIGIN, 0.0)
    for k in range(60):
        clocked(telemetry, age + 100 * k, 0.1 * k)
    for k in range(3):
        clocked(telemetry, 500 + 200 * k, 6.0 + 0.2 * k)
    assert telemetry.restarts == 1


@pytest.mark.parametrize('kind', ['ardupilot', 'px4'])
def test_a_flight_over_the_49th_day_of_its_clock_stays_with_the_bridge(kind):
    bench = FlightBench(kind)
    bench.vehicles[1].flight.booted = 60.0 - 1e-3 * WRAP
    bench.discover()
    bench.assign(task_list('ABCDEF'))
    assert bench.run(lambda: bench.completed() == [*'ABCDEF'])
    assert bench.now > 70.0
    assert not any('restarted' in note or 'LOST' in note for note in bench.notes)
    assert places(bench) == [*'ABCDEF']
