# SPDX-License-Identifier: Apache-2.0
"""A UAV that another node reports, too, holds in flight, and flies no list meanwhile."""
import dataclasses

import pytest
from authority_bench import flying_with_pilot
from findings_bench import drop_messages
from flight_bench import FlightBench, flying, places
from mission_bench import task_list
from pymavlink.dialects.v20 import ardupilotmega as d
from test_operator_hold import is_held

from uav_task_alloc.mavlink.gcs.authority_state import AuthorityState
from uav_task_alloc.mavlink.gcs.shared_id import hold_where_shared
from uav_task_alloc.mavlink.gcs.status import UavMode
from uav_task_alloc.mavlink.mission.upload_states import UploadState

BOTH = pytest.mark.parametrize('kind', ['ardupilot', 'px4'])
SHARED = 'another node reports uav_1, too (states are published by /a and /b)'


def share(bench, shared=SHARED):
    hold_where_shared(bench.executor(), shared, bench.now)


def run_shared(bench, limit, until=lambda: False):
    """Run while its id is shared, as the node does."""
    return bench.run(lambda: share(bench) or until(), limit)


@BOTH
def test_in_flight_it_holds_until_its_id_is_its_own_again(kind):
    bench = flying(kind, 'ABC')
    assert run_shared(bench, 30.0, lambda: is_held(bench))
    run_shared(bench, 90.0)
    assert is_held(bench)
    assert bench.completed() == []
    assert bench.authority() is AuthorityState.HELD
    assert f'is to hold: shared id: {SHARED}' in bench.notes
    share(bench, '')
    assert bench.run(lambda: bench.completed() == ['A', 'B', 'C'])
    assert places(bench) == ['A', 'B', 'C']


def holds_without_transfer(bench):
    """While its id is shared a new list is not transferred; it is flown afterwards."""
    sent = len(bench.line.sent('MISSION_COUNT'))
    share(bench)
    bench.assign(task_list('CAB', 2))
    assert run_shared(bench, 60.0, lambda: is_held(bench))
    run_shared(bench, 60.0)
    assert is_held(bench)
    assert len(bench.line.sent('MISSION_COUNT')) == sent
    share(bench, '')
    assert bench.run(lambda: bench.completed() == ['C', 'A', 'B'])


@BOTH
def test_a_list_from_before_is_not_transferred(kind):
    holds_without_transfer(flying(kind, 'ABC'))


@BOTH
def test_a_list_from_before_is_not_transferred_in_the_climb(kind):
    bench = FlightBench(kind).discover()
    bench.assign(task_list('ABC'))
    assert bench.run(lambda: bench.executor().sender.climbing and bench.onboard().verified())
    holds_without_transfer(bench)


@BOTH
def test_an_upload_from_before_is_not_begun_again_until_its_id_is_its_own(kind):
    bench, stalled = flying(kind, 'ABC'), [True]
    drop_messages(bench, 'up', 'MISSION_ITEM_INT', lambda m: stalled[0])
    bench.run(limit=10.0)  # its link is good
    bench.assign(task_list('CAB', 2))
    assert bench.run(lambda: bench.onboard().upload.state is UploadState.SENDING, 30.0)
    sent = len(bench.line.sent('MISSION_COUNT'))
    run_shared(bench, 60.0)
    stalled[0] = False
    run_shared(bench, 60.0)
    assert is_held(bench)
    assert len(bench.line.sent('MISSION_COUNT')) == sent
    share(bench, '')
    assert bench.run(lambda: sorted(bench.completed()) == ['A', 'B', 'C'])


@BOTH
def test_one_that_a_pilot_has_is_left_to_him(kind):
    bench = flying_with_pilot(kind)
    sent = len(bench.line.sent('COMMAND_LONG'))
    run_shared(bench, 20.0)
    assert len(bench.line.sent('COMMAND_LONG')) == sent


@BOTH
def test_one_that_returns_lands(kind):
    bench = flying(kind, 'A')
    bench.assign(task_list('A', 2, returns=True))
    assert bench.run(lambda: bench.state().mode is UavMode.RETURNING)
    assert run_shared(bench, 200.0, lambda: bench.state().mode is UavMode.STANDBY)
    assert not bench.executor().holds.for_shared_id


@BOTH
def test_in_the_air_a_list_waits_at_the_start_until_others_would_be_found(kind):
    bench = flying(kind, 'AB')
    bench.start()
    bench.discover()
    executor = bench.executor()
    sent = len(bench.line.sent('MISSION_COUNT'))
    executor.policy = dataclasses.replace(bench.policy, settling='the search for other bridges')
    bench.assign(task_list('BA', 2))
    bench.run(lambda: executor.onboard.resume.located, 10.0)
    bench.run(limit=3.0)
    assert len(bench.line.sent('MISSION_COUNT')) == sent
    assert executor.sender.waits_for == 'the search for other bridges'
    executor.policy = bench.policy
    assert bench.run(lambda: sorted(bench.completed()) == ['A', 'B'])


@BOTH
def test_in_the_air_a_list_that_is_on_board_is_verified_at_once_after_a_restart(kind):
    bench = flying(kind, 'ABC')
    assert bench.run(lambda: bench.state().list_revision == 1, 20.0)
    bench.start()
    bench.discover()
    bench.executor().policy = dataclasses.replace(bench.policy, settling='the search')
    bench.assign(task_list('ABC'))
    sent = len(bench.line.sent('COMMAND_LONG')), len(bench.line.sent('MISSION_SET_CURRENT'))
    counts = len(bench.line.sent('MISSION_COUNT'))
    assert bench.run(lambda: bench.state().list_revision == 1, 7.0)
    assert bench.onboard().verified()
    bench.run(lambda: bench.state().mode is not UavMode.ON_MISSION, 5.0)
    assert len(bench.line.sent('MISSION_COUNT')) == counts
    assert len(bench.line.sent('MISSION_SET_CURRENT')) == sent[1]
    assert not [m for m in bench.line.sent('COMMAND_LONG')[sent[0]:]
                if m.command == d.MAV_CMD_DO_SET_MODE]
    bench.executor().policy = bench.policy
    assert bench.run(lambda: bench.completed() == ['A', 'B', 'C'])


def test_on_the_ground_a_list_is_transferred_at_the_start():
    bench = FlightBench('px4').discover()
    bench.executor().policy = dataclasses.replace(bench.policy, settling='the search')
    bench.assign(task_list('AB'))
    assert bench.run(lambda: bench.onboard().verified(), 20.0)
