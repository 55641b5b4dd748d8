# SPDX-License-Identifier: Apache-2.0
"""The rate of a vehicle's clock, by which ages and arrivals are shown at any speed-up."""
import math
import random

import pytest
from mission_bench import ORIGIN, PROFILES
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
