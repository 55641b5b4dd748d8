# SPDX-License-Identifier: Apache-2.0
"""What is still to be judged when the bridge is killed, or another mission is read, is known."""
import pytest
from authority_bench import BOTH, MODES, PX4, flying
from findings_bench import distance, drop_messages, flown_once_each
from flight_bench import places
from mission_bench import task_list
from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.mavlink.mission.flown_path import FlownPath
from uav_task_alloc.mavlink.mission.verified_mission import MissionState
from uav_task_alloc.mavlink.transport.codec import Codec

AT_A = (0.0, 100.0, 50.0)


@PX4
def test_a_task_of_a_mission_that_was_read_and_is_not_the_uploaded_one_is_flown_once(kind):
    bench, uploads = flying(kind, 'AB'), []

    def tamper(direction, m, now):
        if direction == 'up' and m.get_type() == 'MISSION_COUNT':
            uploads.append(now)
        if direction != 'up' or m.get_type() not in ('MISSION_COUNT', 'MISSION_ITEM_INT'):
            return None
        if len(uploads) > 1:
            return []
        if m.get_type() == 'MISSION_ITEM_INT' and m.seq == 2:
            m.z += 20.0
        return [(0.0, m)]
    bench.line.tampers.append(tamper)
    bench.assign(task_list('ABCD', 2))
    assert bench.run(lambda: places(bench) == ['A', 'B'], 60.0)
    assert bench.onboard().stored is not MissionState.VERIFIED
    assert bench.run(lambda: bench.completed() == ['A', 'B'], 10.0)
    bench.line.tampers.clear()
    flown_once_each(bench, 'ABCD')


@BOTH
@pytest.mark.parametrize('seconds', [0.4, 3.0])
def test_a_task_passed_in_a_cut_in_which_the_mission_was_left_survives_a_kill(kind, seconds):
    bench = flying(kind, 'ABC')
    bench.run(lambda: distance(bench, AT_A) < 45.0)
    bench.line.cut = True
    assert bench.run(lambda: places(bench) == ['A'], 20.0)
    bench.run(limit=0.4)
    bench.vehicles[1].failsafe('ekf', MODES[kind].land)
    drop_messages(bench, 'down', 'MISSION_ITEM_REACHED', lambda m: places(bench) == ['A'])
    bench.run(limit=4.0)
    bench.line.cut = False
    assert bench.run(lambda: bench.onboard().progress.pending, 5.0)
    bench.run(limit=seconds)
    bench.kill_and_restart(0.0)
    bench.assign(task_list('ABC', 2))
    bench.vehicles[1].failsafe_over()
    assert bench.run(lambda: not bench.executor().telemetry.airborne, 30.0)
    bench.run(limit=8.0)
    bench.hand_over()
    flown_once_each(bench, 'ABC')


@BOTH
@pytest.mark.parametrize('place', ['after', 'at'])
def test_tasks_passed_at_once_survive_a_kill_before_they_are_judged(kind, place):
    bench = flying(kind, 'ABC')
    bench.run(lambda: distance(bench, AT_A) < 45.0)
    lost = []
    if place == 'after':
        bench.line.cut = True
    drop_messages(bench, 'down', 'MISSION_ITEM_REACHED', lambda m: True)
    drop_messages(bench, 'down', 'MISSION_CURRENT', lambda m: not lost)
    assert bench.run(lambda: places(bench) == ['A', 'B'], 60.0)
    bench.run(limit=2.0)
    bench.line.cut = False
    lost.append(True)
    assert bench.run(lambda: bench.onboard().progress.pending, 5.0)
    bench.run(limit=2.0)
    bench.kill_and_restart(0.0)
    bench.line.tampers.clear()
    bench.vehicles[1].failsafe('ekf', MODES[kind].land)
    bench.run(limit=4.0)
    bench.vehicles[1].failsafe_over()
    bench.assign(task_list('ABC', 2))
    assert bench.run(lambda: not bench.executor().telemetry.airborne, 30.0)
    bench.run(limit=8.0)
    bench.hand_over()
    flown_once_each(bench, 'ABC')


@PX4
@pytest.mark.parametrize(('state', 'completed'), [
    (d.MISSION_STATE_COMPLETE, ['A', 'B']), (d.MISSION_STATE_ACTIVE, ['A'])])
def test_an_end_reported_just_before_a_reboot_counts_where_it_comes_after_it(
        kind, state, completed):
    bench = flying(kind, 'AB')
    assert bench.run(lambda: bench.completed() == ['A'])
    for lost in ('MISSION_ITEM_REACHED', 'MISSION_CURRENT'):
        drop_messages(bench, 'down', lost, lambda m: True)
    assert bench.run(lambda: places(bench) == ['A', 'B'])
    bench.run(limit=0.8)
    bench.vehicles[1].reboot(bench.now)
    bench.run(limit=2.0)
    late = d.MAVLink_mission_current_message(1, 2, state, 2)
    bench.line.tampers.clear()
    bench.ground_station.receive(1, Codec(1, 1).parse(Codec(1, 1).pack(late))[0], bench.now)
    bench.run(limit=2.0)
    assert bench.completed() == completed


def test_a_vehicle_without_a_position_has_the_usual_speed():
    assert FlownPath().fastest == 15.0
