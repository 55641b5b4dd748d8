# SPDX-License-Identifier: Apache-2.0
"""The return path around zones: flown point by point, after the last task, after a restart."""
import dataclasses

import pytest
from flight_bench import FlightBench
from mission_bench import task_list
from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.mavlink.gcs.authority_state import AuthorityState
from uav_task_alloc.mavlink.gcs.status import UavMode
from uav_task_alloc.mavlink.gcs.telemetry import Telemetry

BOTH = pytest.mark.parametrize('kind', ['ardupilot', 'px4'])
RETURN_PATH = ((-80.0, 60.0, 50.0), (-40.0, 20.0, 50.0))  # [m] ENU
REACHED = [(-80, 60, 50), (-40, 20, 50)]
ABOVE_HOME = ((0.0, 60.0, 57.0), (0.0, 10.0, 57.0))


def homeward(names, revision):
    """A list that ends at home by the return path."""
    return dataclasses.replace(task_list(names, revision, returns=True), end_via=RETURN_PATH)


def landing(names, revision):
    """A list whose way home ends above the home, in a layer of its own."""
    return dataclasses.replace(task_list(names, revision, returns=True), end_via=ABOVE_HOME)


def shrink(bench, names, make=homeward):
    """The allocator takes each task off the list once it is completed."""
    for revision in range(2, 2 + len(names)):
        done = len(bench.completed()) + 1
        assert bench.run(lambda done=done: len(bench.completed()) == done)
        bench.assign(make([n for n in names if n not in bench.completed()], revision))


def commands(bench):
    """The commands of the mission on board."""
    return [item.command for item in bench.vehicles[1].flight.items]


@BOTH
def test_after_the_last_task_the_points_of_the_return_path_are_flown(kind):
    bench = FlightBench(kind).discover()
    bench.assign(homeward('AB', 1))
    shrink(bench, 'AB')
    assert bench.run(lambda: bench.state().mode is UavMode.RETURNING, 10.0)
    assert bench.run(lambda: bench.state().mode is UavMode.STANDBY)
    assert [p for p in bench.flown() if p in REACHED] == REACHED
    assert bench.flown()[:4] == [(0, 100, 50), (100, 100, 50), *REACHED]
    assert bench.completed() == ['A', 'B']
    assert bench.onboard().upload.uploads == 1
    assert bench.onboard().revision == 3
    x, y, z = bench.vehicles[1].flight.body.position
    assert (abs(x), abs(y - 10.0), abs(z)) < (3.0, 3.0, 1.0)


@BOTH
@pytest.mark.parametrize('reached', [2, 3])
def test_a_bridge_killed_on_the_return_path_lets_the_vehicle_complete_it(kind, reached):
    bench = FlightBench(kind).discover()
    bench.assign(homeward('AB', 1))
    shrink(bench, 'AB')
    assert bench.run(lambda: len(bench.flown()) == reached)
    bench.start()
    bench.discover()
    bench.assign(homeward('', 3))
    assert bench.run(lambda: bench.state().mode is UavMode.STANDBY)
    assert bench.flown()[:4] == [(0, 100, 50), (100, 100, 50), *REACHED]
    assert bench.onboard().upload.uploads == 0


@BOTH
def test_a_new_return_path_replaces_the_one_being_flown(kind):
    bench = FlightBench(kind).discover()
    bench.assign(homeward('AB', 1))
    shrink(bench, 'AB')
    bench.run(limit=2.0)
    other = ((200.0, 60.0, 50.0),)
    bench.assign(dataclasses.replace(task_list('', 4, returns=True), end_via=other))
    assert bench.run(lambda: bench.state().mode is UavMode.STANDBY)
    assert bench.flown()[2] == (200, 60, 50)
    assert not set(REACHED) & set(bench.flown())


@BOTH
def test_a_task_assigned_on_the_return_path_is_flown_first(kind):
    bench = FlightBench(kind).discover()
    bench.assign(homeward('A', 1))
    shrink(bench, 'A')
    bench.run(limit=2.0)
    bench.assign(homeward('C', 3))
    assert bench.run(lambda: bench.completed() == ['A', 'C'])
    assert bench.run(lambda: bench.state().mode is UavMode.STANDBY)
    assert bench.flown()[:4] == [(0, 100, 50), (200, 100, 50), *REACHED]


@BOTH
def test_a_way_home_that_ends_above_the_home_ends_with_a_landing_item(kind):
    bench, modes = FlightBench(kind).discover(), set()
    assert bench.run(lambda: bench.executor().telemetry.home is not None)
    bench.assign(landing('AB', 1))
    shrink(bench, 'AB', landing)

    def landed():
        modes.add(bench.state().mode)
        return bench.state().mode is UavMode.STANDBY

    assert bench.run(landed)
    assert commands(bench)[-1] == d.MAV_CMD_NAV_LAND
    assert d.MAV_CMD_NAV_RETURN_TO_LAUNCH not in commands(bench)
    assert modes >= {UavMode.RETURNING, UavMode.LANDING}
    assert bench.flown()[2:4] == [(0, 60, 57), (0, 10, 57)]
    assert bench.onboard().upload.uploads == 1
    bench.run(limit=5.0)
    assert not bench.vehicles[1].flight.armed
    assert bench.authority() is AuthorityState.NONE
    x, y, z = bench.vehicles[1].flight.body.position
    assert (abs(x), abs(y - 10.0), abs(z)) < (1.0, 1.0, 0.1)


@BOTH
@pytest.mark.parametrize('knows_home', [True, False], ids=['home', 'no home yet'])
def test_a_bridge_killed_on_the_way_down_lets_the_vehicle_land(kind, knows_home, monkeypatch):
    bench = FlightBench(kind).discover()
    bench.assign(landing('AB', 1))
    shrink(bench, 'AB', landing)
    assert bench.run(lambda: bench.state().mode is UavMode.LANDING)
    if not knows_home:
        monkeypatch.setattr(Telemetry, '_home', lambda self, message, now: None)
    bench.start()
    bench.discover()
    bench.assign(landing('', 3))
    assert bench.run(lambda: bench.state().mode is UavMode.STANDBY)
    assert bench.onboard().upload.uploads == 0
    bench.run(limit=5.0)
    assert bench.authority() is AuthorityState.NONE


@BOTH
def test_a_task_assigned_before_the_landing_is_flown_first(kind):
    bench = FlightBench(kind).discover()
    bench.assign(landing('A', 1))
    shrink(bench, 'A', landing)
    bench.run(limit=2.0)
    bench.assign(landing('C', 3))
    assert bench.run(lambda: bench.completed() == ['A', 'C'])
    assert bench.run(lambda: bench.state().mode is UavMode.STANDBY)
    assert commands(bench)[-1] == d.MAV_CMD_NAV_LAND


@BOTH
def test_a_way_home_that_ends_beside_the_home_ends_with_a_return(kind):
    bench = FlightBench(kind).discover()
    bench.assign(homeward('AB', 1))
    shrink(bench, 'A')
    assert commands(bench)[-1] == d.MAV_CMD_NAV_RETURN_TO_LAUNCH
