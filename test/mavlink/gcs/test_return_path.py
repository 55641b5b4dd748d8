# SPDX-License-Identifier: Apache-2.0
"""The return path around zones: flown point by point, after the last task, after a restart."""
import dataclasses

import pytest
from flight_bench import FlightBench
from mission_bench import task_list

from uav_task_alloc.mavlink.gcs.status import UavMode

BOTH = pytest.mark.parametrize('kind', ['ardupilot', 'px4'])
RETURN_PATH = ((-80.0, 60.0, 50.0), (-40.0, 20.0, 50.0))  # [m] ENU
REACHED = [(-80, 60, 50), (-40, 20, 50)]


def homeward(names, revision):
    """A list that ends at home by the return path."""
    return dataclasses.replace(task_list(names, revision, returns=True), end_via=RETURN_PATH)


def shrink(bench, names):
    """The allocator takes each task off the list once it is completed."""
    for revision in range(2, 2 + len(names)):
        done = len(bench.completed()) + 1
        assert bench.run(lambda done=done: len(bench.completed()) == done)
        bench.assign(homeward([n for n in names if n not in bench.completed()], revision))


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
