# SPDX-License-Identifier: Apache-2.0
"""PX4 reports its mission as complete after a take-off and a landing: that completes no task."""
import math

import pytest
from authority_bench import MODES, flying as authority_flying
from flight_bench import FlightBench, flying, places
from mission_bench import REPORTS_STATE, task_list
from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.sim.config import FlightMode


def taken_off(names):
    """Over its home in Hold, with the list on board."""
    bench = FlightBench('px4', configs=REPORTS_STATE)
    bench.discover()
    bench.assign(task_list(names))
    vehicle = bench.vehicles[1]
    assert bench.run(lambda: vehicle.flight.mode is FlightMode.TAKEOFF)
    assert bench.run(lambda: vehicle.flight.mode is FlightMode.HOLD)
    assert vehicle.mission.progress()[1] == d.MISSION_STATE_COMPLETE
    return bench


def test_a_restarted_bridge_after_a_take_off_completes_no_task_before_it_is_flown():
    bench = taken_off('ABC')
    bench.start()
    bench.discover()
    bench.assign(task_list('ABC', 2))
    assert bench.run(lambda: bool(bench.completed()))
    assert places(bench) == bench.completed() == ['A']
    assert bench.run(lambda: bench.completed() == ['A', 'B', 'C'])
    assert places(bench) == ['A', 'B', 'C']


def test_a_restarted_bridge_after_a_landing_completes_no_task():
    bench = flying('px4', 'ABC', configs=REPORTS_STATE)
    vehicle = bench.vehicles[1]
    assert bench.run(lambda: bench.completed() == ['A'])
    vehicle.flight.set_mode(FlightMode.LAND)
    assert bench.run(lambda: not vehicle.flight.armed)
    assert vehicle.mission.progress()[1] == d.MISSION_STATE_COMPLETE
    bench.start()
    bench.discover()
    bench.assign(task_list('ABC', 2))
    bench.run(limit=20.0)
    assert not {'B', 'C'} & set(bench.completed())


def test_complete_left_over_from_the_take_off_ends_no_list_of_one_task():
    bench = taken_off('A')

    def late(direction, message, now):
        """Deliver an older MISSION_CURRENT after the change to mission mode."""
        if direction == 'down' and message.get_type() == 'MISSION_CURRENT':
            message.mission_state = d.MISSION_STATE_COMPLETE
        return None

    bench.line.tampers.append(late)
    assert bench.run(lambda: bench.completed() == ['A'])
    assert places(bench) == ['A']
    assert not any('was skipped' in str(note) for note in bench.notes)


def test_the_last_task_is_complete_by_the_end_where_its_reached_is_lost_and_a_cut_follows():
    bench = flying('px4', 'AB', configs=REPORTS_STATE)
    vehicle, ended = bench.vehicles[1], []

    def tamper(direction, message, now):
        if direction == 'up' or message.get_type() == 'MISSION_ITEM_REACHED':
            return None if direction == 'up' else []
        if ended and now > ended[0] + 1.0:
            return []
        if message.get_type() == 'MISSION_CURRENT' and (
                message.mission_state == d.MISSION_STATE_COMPLETE and message.seq == 1):
            ended[:1] = ended or [now]
        return None

    bench.line.tampers.append(tamper)
    assert bench.run(lambda: bool(ended) and vehicle.flight.mode is FlightMode.HOLD)
    bench.run(limit=10.0)
    bench.line.tampers.clear()
    bench.run(limit=5.0)
    assert bench.completed() == ['A', 'B']
    assert places(bench) == ['A', 'B']


def test_a_take_off_after_a_landing_is_no_flight_in_which_the_mission_can_have_ended():
    bench = authority_flying('px4', 'A', configs=REPORTS_STATE)
    vehicle, telemetry = bench.vehicles[1], bench.executor().telemetry
    assert telemetry.airborne_since_mission
    vehicle.failsafe('ekf', MODES['px4'].land)
    assert bench.run(lambda: not vehicle.flight.armed)
    vehicle.failsafe_over()
    bench.run(limit=8.0)
    assert bench.hand_over() == ''
    assert bench.run(lambda: telemetry.airborne, 60.0)
    assert not telemetry.airborne_since_mission
    assert bench.run(lambda: bench.completed() == ['A'])
    assert telemetry.airborne_since_mission


@pytest.mark.parametrize('wait', [3.8, 3.9])
def test_a_landing_just_before_the_end_of_a_service_completes_no_task(wait):
    bench = flying('px4', 'A', service=4.0, configs=REPORTS_STATE)
    vehicle = bench.vehicles[1]
    body, (x, y, _) = vehicle.flight.body, task_list('A').stops[0].task.position
    assert bench.run(lambda: math.dist(body.position[:2], (x, y)) < 2.0)
    bench.run(limit=wait)
    assert places(bench) == []
    vehicle.failsafe('ekf', MODES['px4'].land)  # no position is valid from here on
    assert bench.run(lambda: not vehicle.flight.armed, 60.0)
    bench.run(limit=10.0)
    assert bench.completed() == []
