# SPDX-License-Identifier: Apache-2.0
"""A hold during a take-off, also of a PX4 that its mission takes off, as it looked airborne."""
import pytest
from findings_bench import FindingsBench
from flight_bench import FlightBench
from mission_bench import task_list
from pymavlink.dialects.v20 import ardupilotmega as d
from test_settling_estimate import SETTLES

from uav_task_alloc.mavlink.gcs.operator_hold import HoldRequest
from uav_task_alloc.mavlink.gcs.takeoff import Takeoff

MOMENTS = pytest.mark.parametrize('after', [0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.7, 1.0])  # [s] armed
LATE = pytest.mark.parametrize('late', [0.3, 1.5])  # [s] each landed state
HOLD, GO_ON = HoldRequest('operator', True, 'order o1'), HoldRequest('operator', False)


def held_after_arming(after, late, wait=0.5):
    """A PX4 whose first position estimates jump, and that is to hold just after its arming."""
    bench = FindingsBench('px4', configs={1: SETTLES}).discover()
    assert bench.run(lambda: bench.vehicles[1].flight.positioned, 30.0)
    bench.run(limit=wait)
    bench.line.tampers.append(lambda direction, m, now: [(late, m)] if (
        m.get_type() == 'EXTENDED_SYS_STATE') else None)
    bench.assign(task_list('ABC', side=300.0))
    assert bench.run(lambda: bench.vehicles[1].flight.armed, 60.0)
    bench.run(limit=after)
    bench.ground_station.hold('uav_1', HOLD, bench.now)
    return bench


@MOMENTS
@LATE
def test_it_flies_its_list_once_the_hold_has_ended(after, late):
    bench = held_after_arming(after, late)
    bench.run(limit=60.0)
    assert not bench.executor().sender.climbing
    assert bench.completed() == []
    bench.ground_station.hold('uav_1', GO_ON, bench.now)
    assert bench.run(lambda: bench.completed() == ['A', 'B', 'C'], 300.0)


@MOMENTS
@LATE
def test_in_the_air_no_disarming_is_sent_or_repeated(after, late):
    bench = held_after_arming(after, late)
    sent = []
    bench.line.tampers.append(lambda direction, m, now: sent.append(
        bench.vehicles[1].flight.body.position[2]) if direction == 'up' and (
            m.get_type() == 'COMMAND_LONG' and m.param1 == 0.0
            and m.command == d.MAV_CMD_COMPONENT_ARM_DISARM) else None)
    bench.run(limit=20.0)
    assert all(height < 0.5 for height in sent)


@pytest.mark.parametrize(('held_by', 'sent'), [('operator: o1', []), ('', None)])
def test_at_the_end_of_its_climb_the_hold_comes_before_mission_mode(held_by, sent):
    bench = FlightBench('ardupilot').discover()
    bench.assign(task_list('ABC'))
    executor = bench.executor()
    assert bench.run(lambda: executor.sender.climbing, 60.0)
    assert bench.run(lambda: executor.telemetry.height > 44.0, 60.0)
    executor.telemetry.height = 51.0  # at its height, and not stepped since
    takeoff = Takeoff(executor.sender, executor.telemetry, executor.onboard, executor.authority,
                      lambda: executor.policy, lambda: held_by)
    assert takeoff.take_off(bench.now) == sent  # None: the rule that flies the list follows
    assert not executor.sender.climbing
