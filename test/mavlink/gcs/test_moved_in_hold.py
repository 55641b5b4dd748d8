# SPDX-License-Identifier: Apache-2.0
"""A vehicle that another station flies to a place while it holds is left to that station."""
import pytest
from flight_bench import flying
from mission_bench import task_list
from test_operator_hold import GO_ON, hold, is_held

from uav_task_alloc.mavlink.gcs.authority_state import AuthorityState
from uav_task_alloc.sim.dynamics import Track

BOTH = pytest.mark.parametrize('kind', ['ardupilot', 'px4'])


def go_to(bench, east, up=0.0):
    """What a vehicle does in HOLD by DO_REPOSITION of another station."""
    flight = bench.vehicles[1].flight
    x, y, z = flight.body.position
    flight.track = Track([(x + east, y, z + up)], 1.0)


def held(kind):
    bench = flying(kind, 'ABC')
    hold(bench)
    assert bench.run(lambda: is_held(bench), 30.0)
    bench.run(limit=2.0)
    return bench


@BOTH
def test_go_to_while_it_holds_takes_it_and_the_end_of_the_hold_sends_nothing(kind):
    bench = held(kind)
    go_to(bench, 60.0)
    assert bench.run(lambda: bench.authority() is AuthorityState.LOST, 20.0)
    assert 'not by the bridge: moved by ' in bench.executor().authority.why
    sent = len(bench.line.sent('COMMAND_LONG'))
    hold(bench, GO_ON)
    bench.assign(task_list('CAB', 2))
    bench.run(limit=30.0)
    assert len(bench.line.sent('COMMAND_LONG')) == sent
    assert bench.hand_over() == ''
    assert bench.run(lambda: sorted(bench.completed()) == ['A', 'B', 'C'])


@BOTH
def test_a_few_metres_and_a_climb_take_nothing(kind):
    bench = held(kind)
    go_to(bench, 10.0)
    bench.run(limit=10.0)
    go_to(bench, 0.0, up=40.0)
    bench.run(limit=20.0)
    assert bench.authority() is AuthorityState.HELD
    hold(bench, GO_ON)
    assert bench.run(lambda: bench.completed() == ['A', 'B', 'C'])
