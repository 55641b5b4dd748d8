# SPDX-License-Identifier: Apache-2.0
"""A list without a task that leads to a place: the UAV flies there, waits, and leaves at once."""
import math
from dataclasses import replace

import pytest
from flight_bench import FlightBench
from mission_bench import ORIGIN, task_list
from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.mavlink.autopilots import ARDUPILOT, ARDUPLANE, PX4, PX4_PLANE
from uav_task_alloc.mavlink.gcs.authority_state import AuthorityState
from uav_task_alloc.mavlink.gcs.status import UavMode
from uav_task_alloc.mavlink.mission.items import mission_items
from uav_task_alloc.mavlink.mission.task_list import TaskList

BOTH = pytest.mark.parametrize('kind', ['ardupilot', 'px4'])
WAY = ((60.0, 200.0, 50.0), (200.0, 260.0, 60.0))  # [m] ENU


def waits(revision, way=WAY):
    """A list that leads to the last point of a way."""
    return TaskList(revision, end_via=way)


def idle(kind, **more):
    """A vehicle in flight that has flown its only task."""
    bench = FlightBench(kind, **more).discover()
    bench.assign(task_list('A'))
    assert bench.run(lambda: bench.completed() == ['A'])
    return bench


def off(bench, point):
    """[m] from a vehicle to a point."""
    return math.dist(bench.vehicles[1].flight.body.position, point)


@BOTH
def test_it_flies_to_the_place_by_the_points_and_stays_there(kind):
    bench = idle(kind)
    bench.assign(waits(2))
    assert bench.run(lambda: off(bench, WAY[-1]) < 3.0, 60.0)
    bench.run(limit=60.0)
    assert off(bench, WAY[-1]) < 3.0
    assert (60, 200, 50) in bench.flown()
    state = bench.state()
    assert (state.mode, state.list_revision, state.active_task) == (UavMode.ON_MISSION, 2, '')
    assert state.available
    assert (bench.completed(), bench.failed()) == (['A'], [])
    assert bench.onboard().upload.uploads == 2
    assert bench.authority() is AuthorityState.HELD


@BOTH
@pytest.mark.parametrize('arrived', [False, True])
def test_a_task_is_flown_at_once(kind, arrived):
    bench = idle(kind)
    bench.assign(waits(2))
    assert bench.run(lambda: off(bench, WAY[-1]) < (3.0 if arrived else 120.0), 60.0)
    bench.assign(task_list('B', 3))
    began = bench.now
    assert bench.run(lambda: bench.started() == ['A', 'B'], 10.0)
    assert bench.now - began < 5.0
    assert bench.run(lambda: bench.completed() == ['A', 'B'], 60.0)


@BOTH
def test_a_vehicle_under_way_to_a_task_is_diverted_to_another_one(kind):
    bench = FlightBench(kind).discover()
    bench.assign(task_list('AB'))
    assert bench.run(lambda: bench.completed() == ['A'] and bench.started() == ['A', 'B'])
    bench.run(limit=2.0)
    bench.assign(task_list('C', 2))
    assert bench.run(lambda: bench.completed() == ['A', 'C'], 60.0)
    bench.run(limit=20.0)
    assert 'B' not in bench.completed()
    assert (100, 100, 50) not in bench.flown()
    bench.assign(task_list('B', 3))
    assert bench.run(lambda: bench.completed() == ['A', 'C', 'B'], 60.0)


@BOTH
def test_an_empty_list_on_the_way_lets_it_hold_where_it_is(kind):
    bench = idle(kind)
    bench.assign(waits(2))
    assert bench.run(lambda: off(bench, WAY[-1]) < 120.0, 60.0)
    bench.assign(TaskList(3))
    assert bench.run(lambda: bench.state().mode is UavMode.HOLD, 10.0)
    bench.run(limit=20.0)
    assert off(bench, WAY[-1]) > 50.0


@BOTH
def test_another_place_replaces_the_one_under_way(kind):
    bench = idle(kind)
    bench.assign(waits(2))
    assert bench.run(lambda: off(bench, WAY[-1]) < 120.0, 60.0)
    bench.assign(waits(3, ((-100.0, 150.0, 50.0),)))
    assert bench.run(lambda: off(bench, (-100.0, 150.0, 50.0)) < 3.0, 90.0)
    bench.run(limit=60.0)
    assert off(bench, (-100.0, 150.0, 50.0)) < 3.0
    assert not any('held for 30 s' in note for note in bench.notes)


@BOTH
def test_on_the_ground_it_stays_there(kind):
    bench = FlightBench(kind).discover()
    bench.assign(waits(1))
    bench.run(limit=60.0)
    assert bench.state().mode is UavMode.STANDBY
    assert not bench.vehicles[1].flight.armed


@BOTH
def test_where_an_empty_list_means_the_return_it_returns(kind):
    bench = idle(kind, when_empty='return')
    bench.assign(waits(2))
    assert bench.run(lambda: bench.state().mode is UavMode.RETURNING, 10.0)


@BOTH
def test_a_bridge_that_was_killed_lets_it_fly_on(kind):
    bench = idle(kind)
    bench.assign(waits(2))
    assert bench.run(lambda: off(bench, WAY[-1]) < 120.0, 60.0)
    bench.start()
    bench.discover()
    bench.assign(waits(2))
    assert bench.run(lambda: off(bench, WAY[-1]) < 3.0, 60.0)
    bench.run(limit=20.0)
    assert off(bench, WAY[-1]) < 3.0
    assert bench.onboard().upload.uploads == 0
    bench.assign(task_list('B', 3))
    assert bench.run(lambda: bench.completed() == ['B'], 90.0)


@pytest.mark.parametrize('profile', [ARDUPILOT, ARDUPLANE, PX4, PX4_PLANE])
def test_its_mission_ends_with_a_loiter_without_an_end(profile):
    items = mission_items(waits(1), profile.rules, ORIGIN)
    assert [item.command for item in items] == [
        d.MAV_CMD_NAV_WAYPOINT, d.MAV_CMD_NAV_LOITER_UNLIM]
    assert items[-1].position == WAY[-1]
    assert not any(item.task or item.completes for item in items)
    assert not math.isnan(items[-1].params[3]) or profile is PX4


def test_points_after_the_last_task_of_a_list_that_holds_are_not_flown():
    with_task = replace(task_list('A'), end_via=WAY)
    assert mission_items(with_task, PX4.rules, ORIGIN) == mission_items(
        task_list('A'), PX4.rules, ORIGIN)


@BOTH
def test_such_points_are_not_flown_once_its_tasks_are_flown_either(kind):
    bench = FlightBench(kind).discover()
    bench.assign(replace(task_list('A'), end_via=WAY))
    assert bench.run(lambda: bench.completed() == ['A'])
    place = bench.vehicles[1].flight.body.position
    bench.run(limit=20.0)
    assert off(bench, place) < 10.0
