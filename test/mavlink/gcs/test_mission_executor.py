# SPDX-License-Identifier: Apache-2.0
"""The mission executor on both simulated autopilots: lists flown, replaced, emptied."""
import dataclasses

import pytest
from flight_bench import FlightBench, flying, places
from mission_bench import ORIGIN, task_list
from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.geometry.frames import to_enu
from uav_task_alloc.mavlink.gcs.onboard_mission import MissionState
from uav_task_alloc.mavlink.gcs.status import UavMode

BOTH = pytest.mark.parametrize('kind', ['ardupilot', 'px4'])


@BOTH
def test_a_list_is_flown_and_each_task_reported_once(kind):
    bench = flying(kind)
    assert bench.run(lambda: len(bench.completed()) == 3)
    assert bench.completed() == bench.started() == ['A', 'B', 'C']
    bench.run(limit=15.0)
    assert bench.completed() == ['A', 'B', 'C']
    assert bench.state().mode is UavMode.HOLD


@BOTH
def test_without_takeoff_the_bridge_waits_for_a_pilot_and_logs_it_once(kind):
    bench = FlightBench(kind, takeoff=False).discover()
    bench.assign(task_list('AB'))
    bench.run(limit=30.0)
    assert not bench.vehicles[1].flight.armed
    assert bench.onboard().state is MissionState.VERIFIED
    assert bench.notes == ['waits for a pilot to arm and take off (takeoff is false)']
    assert bench.state().available


@BOTH
@pytest.mark.parametrize(('field', 'logged'), [('settling', []), ('grounded', ['waits for x'])])
def test_a_list_waits_on_the_ground_for_what_its_policy_names(kind, field, logged):
    bench = FlightBench(kind).discover()
    executor = bench.executor()
    executor.policy = dataclasses.replace(executor.policy, **{field: 'x'})
    bench.assign(task_list('AB'))
    bench.run(limit=30.0)
    assert not bench.vehicles[1].flight.armed
    assert [note for note in bench.notes if 'waits' in note] == logged
    assert executor.sender.waits_for == 'x'
    executor.policy = dataclasses.replace(executor.policy, **{field: ''})
    assert bench.run(lambda: bench.completed() == ['A', 'B'])


@BOTH
def test_a_list_that_shrinks_as_tasks_complete_needs_no_upload(kind):
    bench = flying(kind, 'ABC')
    for revision, (done, rest) in enumerate([('A', 'BC'), ('B', 'C')], 2):
        assert bench.run(lambda done=done: done in bench.completed())
        bench.assign(task_list(rest, revision))
        assert bench.onboard().revision == revision
    assert bench.run(lambda: len(bench.completed()) == 3)
    assert bench.onboard().upload.uploads == 1


@BOTH
@pytest.mark.parametrize('after', ['AXY', 'ACB', 'CBA', 'BC', 'C', 'ABCD', 'XY', 'BAC'])
def test_a_list_replaced_in_flight_is_what_is_flown(kind, after):
    bench = flying(kind, 'ABC')
    bench.run(limit=2.0)
    bench.assign(task_list(after, 2))
    assert bench.run(lambda: len(bench.completed()) == len(after))
    assert bench.completed() == list(after)
    assert places(bench) == list(after)


@BOTH
def test_via_points_that_were_passed_are_not_flown_again(kind):
    via = {'A': ((-50.0, 50.0, 50.0), (-50.0, 100.0, 50.0))}
    bench = FlightBench(kind).discover()
    bench.assign(task_list('AB', via=via))
    assert bench.run(lambda: len(bench.flown()) == 1)
    bench.assign(task_list('AC', 2, via=via))
    assert bench.run(lambda: bench.completed() == ['A', 'C'])
    assert bench.flown() == [(-50, 50, 50), (-50, 100, 50), (0, 100, 50), (200, 100, 50)]


@BOTH
def test_a_new_via_before_the_task_being_flown_is_flown(kind):
    bench = flying(kind, 'AB')
    bench.assign(task_list('AB', 2, via={'A': ((-60.0, 60.0, 50.0),)}))
    assert bench.run(lambda: bench.completed() == ['A', 'B'])
    assert bench.flown() == [(-60, 60, 50), (0, 100, 50), (100, 100, 50)]


def test_ardupilot_is_held_while_its_mission_is_mixed_and_appended_hot():
    bench = flying('ardupilot', 'AB')
    bench.assign(task_list('ABC', 2))
    bench.run(lambda: bench.onboard().revision == 2)
    modes = [m.param2 for m in bench.line.sent('COMMAND_LONG')
             if m.command == d.MAV_CMD_DO_SET_MODE]
    assert modes == [4, 3]  # to take off, to start: an append needs no hold
    bench.assign(task_list('AC', 3))
    assert bench.run(lambda: bench.onboard().revision == 3)
    bench.run(limit=1.0)
    modes = [m.param2 for m in bench.line.sent('COMMAND_LONG')
             if m.command == d.MAV_CMD_DO_SET_MODE]
    assert modes == [4, 3, 4, 3]


def test_a_px4_mission_is_replaced_at_once_with_the_current_item_flagged():
    bench = flying('px4', 'ABC')
    bench.assign(task_list('CA', 2))
    assert bench.run(lambda: bench.onboard().revision == 2)
    items = bench.line.sent('MISSION_ITEM_INT')[-2:]
    assert [m.current for m in items] == [1, 0]
    assert bench.vehicles[1].flight.mode.name == 'MISSION'


@pytest.mark.parametrize('third', ['BC', 'ZBC'])
def test_a_task_of_a_list_that_is_taken_and_not_verified_is_reported_with_its_revision(
        third):
    bench = flying('px4', 'ABC')
    taken = []

    def unread(direction, message, _):
        taken.extend([message] * (message.get_type() == 'MISSION_ACK' and direction == 'down'))
        return [] if taken and message.get_type() == 'MISSION_COUNT' else None

    bench.line.tampers.append(unread)
    bench.assign(task_list('ZBC', 2))
    assert bench.run(lambda: taken)
    bench.assign(task_list(third, 3))
    assert bench.run(lambda: 'Z' in bench.completed(), 60.0)
    assert bench.onboard().revision == 1
    assert [e.revision for _, e in bench.events if e.task == 'Z'] == [2]


@BOTH
def test_a_replacement_waits_for_the_end_of_a_service(kind):
    bench = flying(kind, 'AB', service=8.0)
    place = (0.0, 100.0, 50.0)
    assert bench.run(lambda: sum((a - b) ** 2 for a, b in zip(
        bench.executor().telemetry.position, place, strict=True)) < 4.0)
    bench.assign(task_list('AC', 2, service=8.0))
    bench.run(limit=2.0)
    assert bench.onboard().upload.uploads == 1
    assert bench.run(lambda: bench.completed() == ['A', 'C'])
    assert places(bench) == ['A', 'C']


@BOTH
def test_after_an_empty_list_a_new_one_is_flown(kind):
    bench = flying(kind, 'ABC')
    bench.assign(task_list('', 2))
    bench.run(limit=5.0)
    bench.assign(task_list('BD', 3))
    assert bench.run(lambda: bench.completed() == ['B', 'D'])


@BOTH
def test_no_space_flies_a_rolling_horizon(kind):
    bench = FlightBench(kind, configs={1: {'capacity': 5}}).discover()
    bench.assign(task_list('ABCDEFGH'))
    assert bench.run(lambda: len(bench.completed()) == 8, 400.0)
    assert places(bench) == list('ABCDEFGH')
    assert any('no space on board' in note for note in bench.notes)
    assert bench.failed() == []


@BOTH
def test_a_pilot_who_takes_over_is_not_fought(kind):
    bench = flying(kind, 'ABC')
    bench.run(limit=5.0)
    bench.vehicles[1].rc_stick(None)  # without a radio control an ArduCopter sinks in LOITER
    mode = (5, 0) if kind == 'ardupilot' else (4, 3)
    bench.from_station(d.MAVLink_command_long_message(
        1, 1, d.MAV_CMD_DO_SET_MODE, 0, 1, *mode, 0, 0, 0, 0))
    bench.run(limit=10.0)
    bench.assign(task_list('CB', 2))
    bench.run(limit=20.0)
    assert bench.vehicles[1].mode.name == 'HOLD'
    assert 'waits for the pilot to give it back' in bench.notes
    mode = (3, 0) if kind == 'ardupilot' else (4, 4)
    bench.from_station(d.MAVLink_command_long_message(
        1, 1, d.MAV_CMD_DO_SET_MODE, 0, 1, *mode, 0, 0, 0, 0))
    assert bench.run(lambda: bench.completed() == ['C', 'B'])


@BOTH
def test_a_vehicle_that_holds_after_its_last_task_returns_by_a_later_list(kind):
    bench = flying(kind, 'AB')
    assert bench.run(lambda: bench.completed() == ['A', 'B'])
    bench.assign(task_list('', 2))
    bench.run(limit=10.0)
    assert (bench.state().mode, bench.state().active_task) == (UavMode.HOLD, '')
    bench.assign(task_list('', 3, returns=True))
    assert bench.run(lambda: not bench.vehicles[1].flight.armed)


@BOTH
def test_a_list_that_returns_ends_at_home_and_a_new_one_flies_again(kind):
    bench = FlightBench(kind, relaunch='automatic').discover()
    bench.assign(task_list('A', returns=True))
    assert bench.run(lambda: bench.completed() == ['A'])
    bench.assign(task_list('', 2, returns=True))
    assert bench.run(lambda: bench.state().mode is UavMode.RETURNING, 10.0)
    assert bench.run(lambda: bench.state().mode is UavMode.STANDBY)
    assert bench.onboard().upload.uploads == 1
    bench.assign(task_list('B', 3, returns=True))
    assert bench.run(lambda: bench.completed() == ['A', 'B'])


@BOTH
def test_a_path_home_around_a_zone_is_flown_when_the_tasks_are_withdrawn(kind):
    bench = flying(kind, 'ABC')
    path = ((-80.0, 60.0, 50.0), (-40.0, 20.0, 50.0))
    bench.assign(dataclasses.replace(task_list('', 2, returns=True), end_via=path))
    assert bench.run(lambda: bench.state().mode is UavMode.RETURNING, 10.0)
    assert bench.run(lambda: bench.state().mode is UavMode.STANDBY)
    assert bench.flown()[:2] == [(-80, 60, 50), (-40, 20, 50)]
    assert bench.completed() == []


@BOTH
def test_a_silent_link_is_stale_and_the_list_continues_later(kind):
    bench = flying(kind, 'ABC')
    bench.line.cut = True
    bench.run(limit=4.0)
    assert not bench.state().available
    bench.run(limit=20.0)
    bench.line.cut = False
    assert bench.run(lambda: len(bench.completed()) == 3)
    assert places(bench) == ['A', 'B', 'C']


@BOTH
@pytest.mark.parametrize('loss', [0.2])
@pytest.mark.parametrize('seed', range(5))
def test_lists_replaced_over_a_lossy_line_are_flown_once_each(kind, seed, loss):
    bench = FlightBench(kind, seed=seed, loss=loss, delay=(0.0, 0.3)).discover()
    bench.assign(task_list('ABC'))
    bench.run(limit=40.0)
    bench.assign(task_list([t for t in 'DCBAE' if t not in bench.completed()], 2))
    assert bench.run(lambda: len(bench.completed()) == 5, 900.0)
    assert sorted(bench.completed()) == list('ABCDE')
    assert len(bench.completed()) == len(set(bench.completed()))


def test_positions_are_exact_to_a_centimetre_at_five_kilometres():
    bench = FlightBench('px4', takeoff=False).discover()
    tasks = task_list('A')
    task = tasks.stops[0].task.__class__('far', (3535.53, 3535.53, 60.0))
    bench.assign(tasks.__class__(1, (tasks.stops[0].__class__(task),)))
    assert bench.run(lambda: bench.onboard().revision == 1, 10.0)
    m = bench.vehicles[1].mission.items[0]
    place = to_enu(ORIGIN, m.x * 1e-7, m.y * 1e-7, m.z)
    assert max(abs(a - b) for a, b in zip(place, task.position, strict=True)) < 0.01
