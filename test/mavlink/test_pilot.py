# SPDX-License-Identifier: Apache-2.0
"""The pilot on both simulated autopilots: lists replaced, progress, faults in flight."""
import dataclasses

import pytest
from mission_bench import ORIGIN, FlightBench, task_list
from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.geometry.frames import to_enu
from uav_task_alloc.mavlink.board import MissionState
from uav_task_alloc.mavlink.profiles import Flight
from uav_task_alloc.mavlink.status import Mode

BOTH = pytest.mark.parametrize('kind', ['ardupilot', 'px4'])


def flying(kind, names='ABC', **kwargs):
    """A vehicle on its way to the first of some tasks."""
    service = kwargs.pop('service', 0.0)
    bench = FlightBench(kind, **kwargs).found()
    bench.assign(task_list(names, service=service))
    assert bench.run(lambda: bench.started() == [names[0]])
    return bench


def places(bench, n=1):
    """Tasks by the places that were really reached, letters of the grid."""
    return [to_letter(p) for p in bench.flown(n)]


def to_letter(p):
    return 'ABCDEFGHIJKLMNOPQRSTUVWXYZ'[round(p[0] / 100.0) + 5 * (round(p[1] / 100.0) - 1)]


@BOTH
def test_a_list_is_flown_and_each_task_told_once(kind):
    bench = flying(kind)
    assert bench.run(lambda: len(bench.completed()) == 3)
    assert bench.completed() == bench.started() == ['A', 'B', 'C']
    bench.run(limit=15.0)
    assert bench.completed() == ['A', 'B', 'C']
    assert bench.state().mode is Mode.HOLD


@BOTH
def test_without_takeoff_the_bridge_waits_for_a_pilot_and_says_so_once(kind):
    bench = FlightBench(kind, takeoff=False).found()
    bench.assign(task_list('AB'))
    bench.run(limit=30.0)
    assert not bench.vehicles[1].flight.armed
    assert bench.board().state is MissionState.VERIFIED
    assert bench.notes == ['waits for a pilot to arm and take off (takeoff is false)']
    assert bench.state().available


@BOTH
def test_a_list_that_shrinks_as_tasks_complete_needs_no_upload(kind):
    bench = flying(kind, 'ABC')
    for revision, (done, rest) in enumerate([('A', 'BC'), ('B', 'C')], 2):
        assert bench.run(lambda done=done: done in bench.completed())
        bench.assign(task_list(rest, revision))
        assert bench.board().revision == revision
    assert bench.run(lambda: len(bench.completed()) == 3)
    assert bench.board().upload.uploads == 1


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
    bench = FlightBench(kind).found()
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
    bench.run(lambda: bench.board().revision == 2)
    modes = [m.param2 for m in bench.line.sent('COMMAND_LONG')
             if m.command == d.MAV_CMD_DO_SET_MODE]
    assert modes == [4, 3]  # to take off, to start: an append needs no hold
    bench.assign(task_list('AC', 3))
    assert bench.run(lambda: bench.board().revision == 3)
    bench.run(limit=1.0)
    modes = [m.param2 for m in bench.line.sent('COMMAND_LONG')
             if m.command == d.MAV_CMD_DO_SET_MODE]
    assert modes == [4, 3, 4, 3]


def test_px4_is_swapped_at_once_with_the_item_to_fly_flagged():
    bench = flying('px4', 'ABC')
    bench.assign(task_list('CA', 2))
    assert bench.run(lambda: bench.board().revision == 2)
    items = bench.line.sent('MISSION_ITEM_INT')[-2:]
    assert [m.current for m in items] == [1, 0]
    assert bench.vehicles[1].flight.mode.name == 'MISSION'


@BOTH
def test_a_swap_waits_for_the_end_of_a_service(kind):
    bench = flying(kind, 'AB', service=8.0)
    place = (0.0, 100.0, 50.0)
    assert bench.run(lambda: sum((a - b) ** 2 for a, b in zip(
        bench.pilot().telemetry.position, place, strict=True)) < 4.0)
    bench.assign(task_list('AC', 2, service=8.0))
    bench.run(limit=2.0)
    assert bench.board().upload.uploads == 1
    assert bench.run(lambda: bench.completed() == ['A', 'C'])
    assert places(bench) == ['A', 'C']


@BOTH
def test_fault_11_two_systems_do_not_mix_up(kind):
    bench = FlightBench('ardupilot', 'px4', kind).found()
    for n, names in ((1, 'ABC'), (2, 'DEF'), (3, 'GHI')):
        bench.assign(task_list(names), n)
    assert bench.run(lambda: all(len(bench.completed(n)) == 3 for n in (1, 2, 3)))
    for n, names in ((1, 'ABC'), (2, 'DEF'), (3, 'GHI')):
        assert places(bench, n) == bench.completed(n) == list(names)


@BOTH
def test_fault_17_a_reboot_in_mid_upload_starts_over(kind):
    bench = FlightBench(kind, delay=(0.1, 0.1), takeoff=False).found()
    bench.run(limit=10.0)
    bench.assign(task_list('ABCDE'))
    bench.run(limit=0.5)
    assert bench.board().state is MissionState.UPLOADING
    asked = len(bench.line.sent('COMMAND_LONG'))
    bench.vehicles[1].reboot(bench.now)
    assert bench.run(lambda: 'was restarted' in bench.notes, 30.0)
    assert bench.board().state is not MissionState.VERIFIED
    assert bench.run(lambda: bench.board().state is MissionState.VERIFIED, 60.0)
    again = bench.line.sent('COMMAND_LONG')[asked:]
    assert {m.param1 for m in again if m.command == d.MAV_CMD_SET_MESSAGE_INTERVAL} >= {33.0, 42.0}


def test_fault_18_a_link_cut_in_mid_upload_leaves_the_vehicle_held_and_says_mixed():
    bench = flying('ardupilot', 'ABC', delay=(0.1, 0.1))
    bench.assign(task_list('CDEFGH', 2))
    assert bench.run(lambda: len(bench.line.sent('MISSION_ITEM_INT')) == 7, 20.0)
    bench.line.cut = True
    bench.run(limit=40.0)
    assert bench.board().state is MissionState.MIXED
    assert not bench.state().available
    assert bench.vehicles[1].mode.name == 'GUIDED'
    bench.line.cut = False
    assert bench.run(lambda: len(bench.completed()) == 6, 400.0)
    assert places(bench) == list('CDEFGH')


@BOTH
def test_fault_20_reached_during_an_upload_belongs_to_the_old_list(kind):
    bench = flying(kind, 'ABC', delay=(0.02, 0.02), tick=0.02)
    first = 1 if kind == 'ardupilot' else 0
    names = 'ABCD' if kind == 'ardupilot' else 'ADCB'
    bench.assign(task_list(names, 2))
    assert bench.run(lambda: bench.board().open, 10.0)
    bench.pilot().telemetry.position_at = -100.0
    bench.board().progress._place = None
    bench.says(d.MAVLink_mission_item_reached_message(first))
    assert bench.completed() == ['A']
    assert bench.run(lambda: len(bench.completed()) == 4)
    assert sorted(bench.completed()) == list('ABCD')


@BOTH
def test_fault_21_a_repeated_reached_completes_once(kind):
    bench = flying(kind, 'AB')
    assert bench.run(lambda: bench.completed() == ['A'])
    seq = 1 if kind == 'ardupilot' else 0
    for _ in range(11):
        bench.says(d.MAVLink_mission_item_reached_message(seq))
    assert bench.completed() == ['A']


@BOTH
def test_fault_21_a_lost_reached_is_inferred_from_current_moving_on(kind):
    bench = flying(kind, 'ABC')
    bench.line.tampers.append(lambda way, m, now: [] if (
        m.get_type() == 'MISSION_ITEM_REACHED') else None)
    assert bench.run(lambda: 'B' in bench.completed())
    assert bench.completed() == ['A', 'B']


@BOTH
def test_fault_21_what_we_jump_over_is_not_completed(kind):
    bench = flying(kind, 'ABC')
    bench.assign(task_list('C', 2))
    assert bench.run(lambda: bench.completed())
    assert bench.completed() == ['C']
    assert places(bench) == ['C']


@BOTH
def test_fault_22_the_same_list_from_another_item_on_needs_set_current_only(kind):
    bench = FlightBench(kind, takeoff=False).found()
    bench.assign(task_list('ABC'))
    assert bench.run(lambda: bench.board().revision == 1, 10.0)
    bench.tells(d.MAVLink_mission_set_current_message(1, 1, bench.board().own + 2))
    bench.run(limit=5.0)
    bench.pilot().policy = dataclasses.replace(bench.pilot().policy, takeoff=True)
    bench.assign(task_list('ABC', 2))
    assert bench.run(lambda: bench.completed() == ['A', 'B', 'C'])
    assert bench.board().upload.uploads == 1
    assert places(bench) == ['A', 'B', 'C']


@BOTH
def test_fault_23_accepted_and_then_no_mission_is_infeasible(kind):
    bench = FlightBench(kind).found()

    def vanish(way, message, now):
        if way == 'down' and message.get_type() == 'MISSION_ACK':
            del bench.vehicles[1].mission.items[1 if kind == 'ardupilot' else 0:]
        return None
    bench.line.tampers.append(vanish)
    bench.assign(task_list('AB'))
    assert bench.run(lambda: len(bench.failed()) == 2, 60.0)
    reason = bench.events[-1][1].reason
    assert reason == 'accepted, and then no mission is on board: infeasible'
    assert bench.board().upload.uploads == 1


def test_fault_23_a_mission_that_px4_will_not_fly_fails_with_its_own_words():
    bench = FlightBench('px4').found()
    tasks = task_list('A')
    far = tasks.stops[0].task.__class__('far', (0.0, 12000.0, 50.0))
    bench.assign(tasks.__class__(1, (tasks.stops[0].__class__(far),)))
    assert bench.run(lambda: bench.failed() == ['far'], 120.0)
    assert bench.events[-1][1].reason.startswith('infeasible: First waypoint too far')


def upload_by_another(bench, n=1):
    """A human's ground station puts a mission of one item on board."""
    own = bench.board(n).own
    bench.tells(d.MAVLink_mission_count_message(n, 1, 1 + own, 0), n)
    for seq in range(1 + own):
        x, y = 473990000, 85460000
        bench.tells(d.MAVLink_mission_item_int_message(
            n, 1, seq, 5, 16, 0, 1, 0, 0, 0, 0, x, y, 540.0, 0), n)


@BOTH
def test_fault_24_a_foreign_mission_is_left_alone_where_the_policy_says_yield(kind):
    bench = flying(kind, 'ABC')
    bench.run(limit=4.0)
    upload_by_another(bench)
    assert bench.run(lambda: bench.board().state is MissionState.FOREIGN, 20.0)
    bench.run(limit=20.0)
    assert bench.board().state is MissionState.FOREIGN
    assert not bench.state().available
    assert bench.board().upload.uploads == 1


@BOTH
def test_fault_24_a_foreign_mission_is_replaced_where_the_policy_says_reassert(kind):
    bench = flying(kind, 'ABC', when_foreign='reassert')
    bench.run(limit=4.0)
    upload_by_another(bench)
    assert bench.run(lambda: len(bench.completed()) == 3)
    assert bench.board().upload.uploads == 2
    assert bench.board().state is MissionState.VERIFIED


@BOTH
@pytest.mark.parametrize(('policy', 'flight'), [('hold', Flight.HOLD), ('return', Flight.RETURN)])
def test_fault_25_an_empty_list_holds_or_returns_and_never_clears(kind, policy, flight):
    bench = flying(kind, 'ABC', when_empty=policy)
    bench.assign(task_list('', 2))
    assert bench.run(lambda: bench.pilot().telemetry.flight is flight, 5.0)
    bench.run(limit=10.0)
    assert bench.completed() == []
    assert bench.board().revision == 2
    assert not bench.line.sent('MISSION_CLEAR_ALL')
    assert all(m.count for m in bench.line.sent('MISSION_COUNT'))


@BOTH
def test_after_an_empty_list_a_new_one_is_flown(kind):
    bench = flying(kind, 'ABC')
    bench.assign(task_list('', 2))
    bench.run(limit=5.0)
    bench.assign(task_list('BD', 3))
    assert bench.run(lambda: bench.completed() == ['B', 'D'])


@BOTH
@pytest.mark.parametrize('answer', ['none', 'unsupported'])
def test_fault_28_set_current_falls_back_to_the_old_way(kind, answer):
    bench = FlightBench(kind).found()

    def refuse(way, m, now):
        if m.get_type() != 'COMMAND_LONG' or m.command != d.MAV_CMD_DO_SET_MISSION_CURRENT:
            return None
        if answer == 'unsupported':
            bench.says(d.MAVLink_command_ack_message(m.command, 3))
        return []
    bench.line.tampers.append(refuse)
    bench.assign(task_list('ABC'))
    assert bench.run(lambda: bench.completed() == ['A', 'B', 'C'])
    assert bool(bench.line.sent('MISSION_SET_CURRENT')) == (kind == 'ardupilot')


@BOTH
def test_fault_29_a_current_at_or_beyond_the_end_harms_nothing(kind):
    bench = flying(kind, 'AB')
    bench.run(limit=4.0)
    count = len(bench.vehicles[1].mission.items)
    for seq in (count + 1, 65535):
        bench.says(d.MAVLink_mission_current_message(seq, 65535, 0, 0))
    assert bench.completed() == []
    assert bench.run(lambda: bench.completed() == ['A', 'B'])


@BOTH
def test_no_space_flies_a_rolling_horizon(kind):
    bench = FlightBench(kind, configs={1: {'capacity': 5}}).found()
    bench.assign(task_list('ABCDEFGH'))
    assert bench.run(lambda: len(bench.completed()) == 8, 400.0)
    assert places(bench) == list('ABCDEFGH')
    assert any('no space on board' in note for note in bench.notes)
    assert bench.failed() == []


@BOTH
def test_a_pilot_who_takes_over_is_not_fought(kind):
    bench = flying(kind, 'ABC')
    bench.run(limit=5.0)
    mode = (5, 0) if kind == 'ardupilot' else (4, 3)
    bench.tells(d.MAVLink_command_long_message(1, 1, 176, 0, 1, *mode, 0, 0, 0, 0))
    bench.run(limit=10.0)
    bench.assign(task_list('CB', 2))
    bench.run(limit=20.0)
    assert bench.vehicles[1].mode.name == 'HOLD'
    assert 'waits for the pilot to give it back' in bench.notes
    mode = (3, 0) if kind == 'ardupilot' else (4, 4)
    bench.tells(d.MAVLink_command_long_message(1, 1, 176, 0, 1, *mode, 0, 0, 0, 0))
    assert bench.run(lambda: bench.completed() == ['C', 'B'])


@BOTH
def test_a_list_that_returns_ends_at_home_and_a_new_one_flies_again(kind):
    bench = FlightBench(kind).found()
    bench.assign(task_list('A', returns=True))
    assert bench.run(lambda: bench.completed() == ['A'])
    bench.assign(task_list('', 2, returns=True))
    assert bench.run(lambda: bench.state().mode is Mode.RETURNING, 10.0)
    assert bench.run(lambda: bench.state().mode is Mode.STANDBY)
    assert bench.board().upload.uploads == 1
    bench.assign(task_list('B', 3, returns=True))
    assert bench.run(lambda: bench.completed() == ['A', 'B'])


@BOTH
def test_a_way_home_around_a_zone_is_flown_where_the_tasks_are_withdrawn(kind):
    bench = flying(kind, 'ABC')
    way = ((-80.0, 60.0, 50.0), (-40.0, 20.0, 50.0))
    bench.assign(dataclasses.replace(task_list('', 2, returns=True), end_via=way))
    assert bench.run(lambda: bench.state().mode is Mode.RETURNING, 10.0)
    assert bench.run(lambda: bench.state().mode is Mode.STANDBY)
    assert bench.flown()[:2] == [(-80, 60, 50), (-40, 20, 50)]
    assert bench.completed() == []


@BOTH
def test_a_link_that_is_silent_is_stale_and_the_list_goes_on_later(kind):
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
def test_lists_replaced_over_a_bad_line_are_flown_once_each(kind, seed, loss):
    bench = FlightBench(kind, seed=seed, loss=loss, delay=(0.0, 0.3)).found()
    bench.assign(task_list('ABC'))
    bench.run(limit=40.0)
    bench.assign(task_list([t for t in 'DCBAE' if t not in bench.completed()], 2))
    assert bench.run(lambda: len(bench.completed()) == 5, 900.0)
    assert sorted(bench.completed()) == list('ABCDE')
    assert len(bench.completed()) == len(set(bench.completed()))


@BOTH
@pytest.mark.parametrize('moment', [0.5, 2.0, 6.0, 14.0, 22.0])
def test_a_killed_bridge_finds_what_each_vehicle_holds_and_flies_no_task_twice(kind, moment):
    bench = flying(kind, 'ABCDE')
    bench.run(limit=moment)
    before = bench.completed()
    counts = len(bench.line.sent('MISSION_COUNT'))
    bench.start()
    bench.run(limit=8.0)
    bench.found()
    rest = [t for t in 'ABCDE' if t not in before]
    bench.assign(task_list(rest, 5))
    assert bench.run(lambda: len(bench.completed()) == len(rest))
    assert before + bench.completed() == list('ABCDE') == places(bench)
    assert len(bench.line.sent('MISSION_COUNT')) == counts  # nothing differed


@BOTH
def test_a_task_flown_while_the_bridge_was_dead_is_completed_under_a_new_list(kind):
    bench = flying(kind, 'ABCDE')
    assert bench.run(lambda: bench.completed() == ['A'])
    bench.line.cut = True
    bench.run(lambda: len(bench.flown()) == 3)
    bench.line.cut = False
    bench.start()
    bench.found()
    bench.assign(task_list('EDCB', 2))
    assert bench.run(lambda: len(bench.completed()) == 4)
    assert bench.completed() == ['C', 'B', 'E', 'D']
    assert places(bench) == list('ABCED')


@BOTH
@pytest.mark.parametrize('moment', [0.2, 0.4, 0.8, 1.2])
def test_a_bridge_killed_in_mid_upload_brings_the_list_on_board(kind, moment):
    bench = flying(kind, 'ABC', delay=(0.05, 0.05), tick=0.05)
    bench.assign(task_list('CDEFAB', 2))
    bench.run(limit=moment)
    before = bench.completed()
    bench.start()
    bench.found()
    bench.assign(task_list('CDEFAB', 2))
    assert bench.run(lambda: len(bench.completed()) == 6)
    assert before + bench.completed() == list('CDEFAB') == places(bench)


def test_positions_are_exact_to_a_centimetre_at_five_kilometres():
    bench = FlightBench('px4', takeoff=False).found()
    tasks = task_list('A')
    task = tasks.stops[0].task.__class__('far', (3535.53, 3535.53, 60.0))
    bench.assign(tasks.__class__(1, (tasks.stops[0].__class__(task),)))
    assert bench.run(lambda: bench.board().revision == 1, 10.0)
    m = bench.vehicles[1].mission.items[0]
    place = to_enu(ORIGIN, m.x * 1e-7, m.y * 1e-7, m.z)
    assert max(abs(a - b) for a, b in zip(place, task.position, strict=True)) < 0.01
