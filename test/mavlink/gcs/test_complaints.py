# SPDX-License-Identifier: Apache-2.0
"""Problems that users of other tools have reported, by project and number, do not occur."""
import pytest
from flight_bench import FlightBench, flying, places
from mission_bench import ORIGIN, UploadBench, task_list, verified
from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.mavlink.gcs.onboard_mission import MissionState
from uav_task_alloc.mavlink.mission.items import mission_items
from uav_task_alloc.mavlink.mission.outcomes import Failed

BOTH = pytest.mark.parametrize('kind', ['ardupilot', 'px4'])


def test_ardupilot_138_3338_a_mission_that_is_half_old_is_never_flown():
    bench = flying('ardupilot', 'ABCDEF', delay=(0.1, 0.1))
    bench.assign(task_list('FEDCBA', 2))
    assert bench.run(lambda: len(bench.line.sent('MISSION_ITEM_INT')) == 10, 20.0)
    bench.line.cut = True
    modes = set()
    bench.run(lambda: modes.add(bench.vehicles[1].mode.name), 60.0)
    assert modes == {'GUIDED'}
    assert bench.onboard().state is MissionState.MIXED


def test_ardupilot_2445_6307_no_old_command_and_no_phantom_item_is_left():
    bench = flying('ardupilot', 'ABCDE')
    bench.assign(task_list('ED', 2))
    assert bench.run(lambda: bench.completed() == ['E', 'D'])
    assert len(bench.vehicles[1].mission.items) == 1 + 2  # home first
    assert places(bench) == ['E', 'D']


def test_px4_14981_the_old_waypoint_is_not_flown_to_after_a_replacement():
    bench = flying('px4', 'ABC')
    bench.run(limit=3.0)
    bench.assign(task_list('CB', 2))
    assert bench.run(lambda: bench.onboard().revision == 2)
    assert bench.vehicles[1].flight.seq == 0
    assert bench.run(lambda: bench.completed() == ['C', 'B'])
    assert places(bench) == ['C', 'B']


@BOTH
def test_qgroundcontrol_5664_no_vehicle_gets_the_mission_of_another(kind):
    bench = FlightBench(kind, kind, takeoff=False, delay=(0.0, 0.3)).discover()
    lists = {1: task_list('ABC'), 2: task_list('DEF')}
    for n, tasks in lists.items():
        bench.assign(tasks, n)
    assert bench.run(lambda: all(bench.onboard(n).revision == 1 for n in lists), 60.0)
    for n, tasks in lists.items():
        own = bench.onboard(n).own
        sent = mission_items(tasks, bench.executor(n).profile.rules, ORIGIN)
        held = bench.vehicles[n].mission.items[own:]
        assert [(i.x, i.y) for i in held] == [(i.x, i.y) for i in sent]


@BOTH
@pytest.mark.parametrize('delay', [0.4, 0.9])
def test_qgroundcontrol_12516_mavsdk_1316_a_slow_link_is_slow_and_not_a_failure(kind, delay):
    bench = UploadBench(kind, delay=(delay, delay))
    mission = bench.replace(bench.mission('ABCDEFGHIJKLMNOPQRST'))
    verified(bench, mission)
    assert not any(isinstance(event, Failed) for event in bench.events)
    assert len(bench.line.sent('MISSION_COUNT')) <= 2


@BOTH
def test_mavsdk_683_the_same_mission_twice_is_uploaded_and_verified_twice(kind):
    bench = UploadBench(kind)
    for _ in range(2):
        verified(bench, bench.replace(bench.mission('ABC')))
    assert bench.upload.uploads == 2


@BOTH
def test_mavros_1375_no_digit_is_cut_off(kind):
    bench = UploadBench(kind)
    mission = bench.replace(bench.mission('ABCDEFGH'))
    verified(bench, mission)
    sent = {m.seq: m for m in bench.line.sent('MISSION_ITEM_INT')}
    for seq, item in enumerate(mission.items):
        assert (sent[seq].x, sent[seq].y) == (item.x, item.y)


@BOTH
def test_mavros_1867_an_upload_always_ends_with_a_result(kind):
    bench = UploadBench(kind)
    bench.replace(bench.mission('ABC'))
    bench.line.tampers.append(
        lambda direction, m, now: [] if now > 0.0 or direction == 'down' else None)
    assert isinstance(bench.settle(60.0), Failed)


@BOTH
def test_a_status_text_is_logged_once(kind):
    bench = flying(kind, 'AB')
    for _ in range(3):
        bench.from_vehicle(d.MAVLink_statustext_message(
            d.MAV_SEVERITY_CRITICAL, b'Motor 3 is hot'))
    assert bench.notes.count('Motor 3 is hot') == 1
