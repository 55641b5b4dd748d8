# SPDX-License-Identifier: Apache-2.0
"""Messages are requested at their rates, again when missing."""
import random

import pytest
from flight_bench import FlightBench
from mission_bench import ORIGIN, OURS
from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.mavlink.autopilots import PX4
from uav_task_alloc.mavlink.gcs.message_rates import MAX_REQUESTS, MessageRates
from uav_task_alloc.mavlink.gcs.telemetry import Telemetry
from uav_task_alloc.mavlink.gcs.telemetry_messages import RATES
from uav_task_alloc.mavlink.mission.peer import Peer
from uav_task_alloc.mavlink.transport.codec import Codec

BOTH = pytest.mark.parametrize('kind', ['ardupilot', 'px4'])
SPEC = {'GLOBAL_POSITION_INT': 5.0, 'MISSION_CURRENT': 2.0, 'BATTERY_STATUS': 1.0,
        'SYS_STATUS': 1.0, 'EXTENDED_SYS_STATE': 1.0, 'HOME_POSITION': 0.2}


def requested_rates(bench, kind):
    """Rates [Hz] requested for one message."""
    number = getattr(d, 'MAVLINK_MSG_ID_' + kind)
    return [round(1e6 / m.param2, 3) for m in bench.line.sent('COMMAND_LONG')
            if m.command == d.MAV_CMD_SET_MESSAGE_INTERVAL and m.param1 == number]


@BOTH
def test_each_message_is_requested_and_received_at_its_rate(kind):
    bench = FlightBench(kind, takeoff=False).discover()
    bench.run(limit=2.0)
    assert {name: requested_rates(bench, name)[0] for name in SPEC} == SPEC
    before = {name: len(bench.line.sent(name, 'down')) for name in SPEC}
    bench.run(limit=30.0)
    for name, rate in SPEC.items():
        received = (len(bench.line.sent(name, 'down')) - before[name]) / 30.0
        # PX4 sends MISSION_CURRENT at its own 1 Hz
        own = kind == 'px4' and name == 'MISSION_CURRENT'
        assert received == pytest.approx(1.0 if own else rate, rel=0.15), name


def without_message(kind, name):
    """A bench on the ground, a minute after its discovery, that never received one message."""
    bench = FlightBench(kind, takeoff=False)
    bench.line.tampers.append(lambda direction, m, now: [] if m.get_type() == name else None)
    bench.discover()
    bench.run(limit=60.0)
    return bench


@BOTH
def test_a_missing_message_that_no_flight_needs_is_given_up_in_the_end(kind):
    bench = without_message(kind, 'BATTERY_STATUS')
    assert len(requested_rates(bench, 'BATTERY_STATUS')) == MAX_REQUESTS
    assert len(requested_rates(bench, 'GLOBAL_POSITION_INT')) == 1


@BOTH
def test_a_stream_that_stops_is_requested_again(kind):
    bench = FlightBench(kind, takeoff=False).discover()
    bench.run(limit=10.0)
    assert len(requested_rates(bench, 'EXTENDED_SYS_STATE')) == 1
    bench.line.tampers.append(lambda direction, m, now: [] if (
        m.get_type() == 'EXTENDED_SYS_STATE') else None)
    bench.run(limit=60.0)
    asked = len(requested_rates(bench, 'EXTENDED_SYS_STATE'))
    assert 1 + MAX_REQUESTS < asked <= 1 + MAX_REQUESTS + 5  # slowly in the end
    bench.line.tampers.clear()
    bench.run(limit=30.0)
    assert len(requested_rates(bench, 'EXTENDED_SYS_STATE')) <= asked + 1


@BOTH
def test_positions_that_stop_are_requested_again(kind):
    bench = FlightBench(kind, takeoff=False).discover()
    bench.run(limit=10.0)
    before = len(requested_rates(bench, 'GLOBAL_POSITION_INT'))
    bench.line.tampers.append(lambda direction, m, now: [] if (
        m.get_type() == 'GLOBAL_POSITION_INT') else None)
    bench.run(limit=5.0)
    assert len(requested_rates(bench, 'GLOBAL_POSITION_INT')) > before


@BOTH
@pytest.mark.parametrize('name', [
    'GLOBAL_POSITION_INT', 'MISSION_CURRENT', 'EXTENDED_SYS_STATE'])
def test_what_a_flight_needs_and_never_came_is_requested_until_it_comes(kind, name):
    bench = without_message(kind, name)
    asked = len(requested_rates(bench, name))
    assert MAX_REQUESTS < asked <= MAX_REQUESTS + 6  # slowly in the end
    bench.line.tampers.clear()
    bench.run(limit=30.0)
    assert len(requested_rates(bench, name)) <= asked + 1


@pytest.mark.parametrize('others', [100, 130, 200, 255, 400])
def test_a_message_is_not_late_whose_kind_is_rare_among_many_frames(others):
    telemetry, sends, receives = Telemetry(PX4, ORIGIN, 0.0), Codec(1, 1), Codec(*OURS)

    def receive(message, now):
        for decoded in receives.parse(sends.pack(message)):
            telemetry.receive(decoded, now)

    for second in range(5):
        for n in range(others):
            receive(d.MAVLink_attitude_message(0, 0, 0, 0, 0, 0, 0), second + n / others)
        receive(d.MAVLink_mission_current_message(second), second + 1.0)
        assert telemetry.mission.current == second


@pytest.mark.parametrize('seed', range(4))
def test_a_message_is_missed_at_the_first_step_after_its_time(seed):
    """Most steps do not look: none may be missing yet."""
    rng, telemetry = random.Random(seed), Telemetry(PX4, ORIGIN, 0.0)
    rates = MessageRates(Peer(1), telemetry, 0.0)
    last, missed = telemetry.received_last, 0
    for k in range(2000):
        now = 0.1 * k
        for number, rate in RATES.items():
            if rng.random() < 0.02 * rate and not 60.0 < now < 60.0 + 5 * (number % 7):
                last[number] = now
        if rng.random() < 0.002:
            last.clear()  # as a restart of the vehicle does
        rates.step(now)
        silent = {n for n, rate in RATES.items() if now - last.get(n, now) > 10.0 + 4.0 / rate}
        assert rates._silent == silent
        missed += bool(silent)
    assert 0 < missed < 2000
