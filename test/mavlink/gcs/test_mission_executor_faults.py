# SPDX-License-Identifier: Apache-2.0
"""Faults during a flight, on both simulated autopilots."""
import dataclasses
import math

import pytest
from flight_bench import FlightBench, flying, places
from mission_bench import ORIGIN, PROFILES, task_list
from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.mavlink.autopilots import ModeFunction
from uav_task_alloc.mavlink.gcs.onboard_mission import MissionState
from uav_task_alloc.mavlink.mission.items import MissionStop, TaskList, mission_items
from uav_task_alloc.mavlink.mission.task_progress import TaskProgress
from uav_task_alloc.model import Task

BOTH = pytest.mark.parametrize('kind', ['ardupilot', 'px4'])


@BOTH
def test_fault_11_two_systems_do_not_mix_up(kind):
    bench = FlightBench('ardupilot', 'px4', kind).discover()
    for n, names in ((1, 'ABC'), (2, 'DEF'), (3, 'GHI')):
        bench.assign(task_list(names), n)
    assert bench.run(lambda: all(len(bench.completed(n)) == 3 for n in (1, 2, 3)))
    for n, names in ((1, 'ABC'), (2, 'DEF'), (3, 'GHI')):
        assert places(bench, n) == bench.completed(n) == list(names)


@BOTH
def test_fault_17_a_reboot_during_an_upload_starts_over(kind):
    bench = FlightBench(kind, delay=(0.1, 0.1), takeoff=False).discover()
    bench.run(limit=10.0)
    bench.assign(task_list('ABCDE'))
    bench.run(limit=0.5)
    assert bench.onboard().state is MissionState.UPLOADING
    requests_before = len(bench.line.sent('COMMAND_LONG'))
    bench.vehicles[1].reboot(bench.now)
    assert bench.run(lambda: 'was restarted' in bench.notes, 30.0)
    assert bench.onboard().state is not MissionState.VERIFIED
    assert bench.run(lambda: bench.onboard().state is MissionState.VERIFIED, 60.0)
    requests = bench.line.sent('COMMAND_LONG')[requests_before:]
    assert {m.param1 for m in requests if m.command == d.MAV_CMD_SET_MESSAGE_INTERVAL} >= {
        d.MAVLINK_MSG_ID_GLOBAL_POSITION_INT, d.MAVLINK_MSG_ID_MISSION_CURRENT}


def test_fault_18_a_link_cut_during_an_upload_leaves_the_vehicle_held_and_mixed():
    bench = flying('ardupilot', 'ABC', delay=(0.1, 0.1))
    bench.assign(task_list('CDEFGH', 2))
    assert bench.run(lambda: len(bench.line.sent('MISSION_ITEM_INT')) == 7, 20.0)
    bench.line.cut = True
    bench.run(limit=40.0)
    assert bench.onboard().state is MissionState.MIXED
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
    assert bench.run(lambda: bench.onboard().latest_upload.is_open, 10.0)
    bench.executor().telemetry.position_at = -100.0
    bench.onboard().progress.positions.place = None
    bench.from_vehicle(d.MAVLink_mission_item_reached_message(first))
    assert bench.completed() == ['A']
    assert bench.run(lambda: len(bench.completed()) == 4)
    assert sorted(bench.completed()) == list('ABCD')


@BOTH
def test_fault_21_a_repeated_reached_completes_once(kind):
    bench = flying(kind, 'AB')
    assert bench.run(lambda: bench.completed() == ['A'])
    seq = 1 if kind == 'ardupilot' else 0
    for _ in range(11):
        bench.from_vehicle(d.MAVLink_mission_item_reached_message(seq))
    assert bench.completed() == ['A']


@BOTH
def test_fault_21_a_lost_reached_is_inferred_from_current_moving_on(kind):
    bench = flying(kind, 'ABC')
    bench.line.tampers.append(lambda direction, m, now: [] if (
        m.get_type() == 'MISSION_ITEM_REACHED') else None)
    assert bench.run(lambda: 'B' in bench.completed())
    assert bench.completed() == ['A', 'B']


@BOTH
def test_fault_21_tasks_skipped_by_set_current_are_not_completed(kind):
    bench = flying(kind, 'ABC')
    bench.assign(task_list('C', 2))
    assert bench.run(lambda: bench.completed())
    assert bench.completed() == ['C']
    assert places(bench) == ['C']


@BOTH
def test_fault_22_the_same_list_from_another_item_on_needs_set_current_only(kind):
    bench = FlightBench(kind, takeoff=False).discover()
    bench.assign(task_list('ABC'))
    assert bench.run(lambda: bench.onboard().revision == 1, 10.0)
    bench.from_station(d.MAVLink_mission_set_current_message(1, 1, bench.onboard().own + 2))
    bench.run(limit=5.0)
    bench.executor().policy = dataclasses.replace(bench.executor().policy, takeoff=True)
    bench.assign(task_list('ABC', 2))
    assert bench.run(lambda: bench.completed() == ['A', 'B', 'C'])
    assert bench.onboard().upload.uploads == 1
    assert places(bench) == ['A', 'B', 'C']


@BOTH
def test_fault_23_late_answers_of_before_an_upload_do_not_make_it_infeasible(kind):
    bench, late = FlightBench(kind).discover(), []

    def answer_late(direction, message, now):
        if direction == 'down' and message.get_type() == 'MISSION_COUNT' and len(late) < 3 and (
                bench.line.sent('MISSION_ITEM_INT')):
            late.append(now)
            message.count = 1 if kind == 'ardupilot' else 0
        return None
    bench.line.tampers.append(answer_late)
    bench.assign(task_list('AB'))
    assert bench.run(lambda: bench.completed() == ['A', 'B'])
    assert (len(late), bench.failed()) == (3, [])


def losing_missions(kind, times):
    """A vehicle that has no mission on board after the first acceptances."""
    bench, left = FlightBench(kind).discover(), [times]

    def vanish(direction, message, now):
        if direction == 'down' and message.get_type() == 'MISSION_ACK' and left[0]:
            left[0] -= 1
            del bench.vehicles[1].mission.items[1 if kind == 'ardupilot' else 0:]
        return None
    bench.line.tampers.append(vanish)
    bench.assign(task_list('AB'))
    return bench


@BOTH
def test_a_mission_that_another_station_clears_at_once_is_uploaded_again(kind):
    bench = losing_missions(kind, 1)
    assert bench.run(lambda: bench.completed() == ['A', 'B'])
    assert (bench.failed(), bench.onboard().upload.uploads) == ([], 2)


@BOTH
def test_fault_23_accepted_and_then_no_mission_is_infeasible(kind):
    bench = losing_missions(kind, 99)
    assert bench.run(lambda: len(bench.failed()) == 2, 60.0)
    reason = bench.events[-1][1].reason
    assert reason == 'accepted, but no mission is on board: infeasible'
    assert bench.onboard().upload.uploads == 2


@pytest.fixture
def refused():
    """A PX4 that has just refused a task as too far away."""
    bench = FlightBench('px4').discover()
    bench.assign(single('far', FAR))
    assert bench.run(lambda: bench.failed() == ['far'], 120.0)
    return bench


FAR = (0.0, 12000.0, 50.0)


def single(name, place, revision=1):
    return TaskList(revision, (MissionStop(Task(name, place)),))


def test_fault_23_a_mission_that_px4_will_not_fly_fails_with_its_own_words(refused):
    assert refused.events[-1][1].reason.startswith('infeasible: First waypoint too far')


@BOTH
def test_what_no_item_can_hold_fails_alone_and_by_its_own_name(kind):
    bench = FlightBench(kind).discover()
    long = Task('B1', (0.0, 200.0, 50.0), service_time=70000.0)
    bench.assign(TaskList(1, (MissionStop(long),)))
    bench.run(limit=5.0)
    assert bench.failed() == ['B1']
    tasks = task_list('BC', 2)
    bench.assign(TaskList(2, (tasks.stops[0], MissionStop(dataclasses.replace(long, id='B12')),
                              *tasks.stops[1:])))
    assert bench.run(lambda: bench.completed() == ['B', 'C'])
    assert [(e.task, e.revision) for _, e in bench.events if e.event == 'FAILED'] == [
        ('B1', 1), ('B12', 2)]


def refusing(name, before):
    """A PX4 that has flown a list and refuses the item of a task, whatever happens before."""
    bench = FlightBench('px4', delay=(0.2, 0.2)).discover()
    bench.assign(task_list('Z'))
    assert bench.run(lambda: bench.completed() == ['Z'])

    def refuse(direction, message, now):
        bad = (direction == 'up' and message.get_type() == 'MISSION_ITEM_INT'
               and message.x == item.x)
        if bad:
            before(bench)
            bench.from_vehicle(d.MAVLink_mission_ack_message(
                245, 190, d.MAV_MISSION_INVALID_PARAM5_X, 0))
        return [] if bad else None
    item = mission_items(task_list(name), PROFILES['px4'].rules, ORIGIN)[0]
    bench.line.tampers.append(refuse)
    bench.assign(task_list(name, 2))
    return bench


def test_a_refusal_counts_for_the_list_that_was_refused_and_not_for_a_changed_task():
    bench = refusing('A', lambda bench: bench.assign(single('A', (300.0, 300.0, 50.0), 3)))
    assert bench.run(lambda: 'A' in bench.completed())
    assert bench.failed() == []
    assert bench.flown()[-1] == (300, 300, 50)


def test_a_refusal_is_reported_with_the_revision_that_contained_the_task():
    bench = refusing('A', lambda bench: None)
    assert bench.run(bench.failed, 60.0)
    assert bench.events[-1][1].revision == 2


def test_a_list_that_still_contains_a_refused_task_is_refused_again(refused):
    first = refused.events[-1][1]
    refused.assign(single('far', FAR, 7))
    assert refused.run(lambda: refused.failed() == ['far', 'far'], 3.0)
    assert refused.events[-1][1] == dataclasses.replace(first, revision=7)
    assert refused.onboard().upload.uploads == 1


def test_a_refused_task_is_uploaded_again_after_a_change(refused):
    refused.assign(single('far', (0.0, 300.0, 50.0), 2))
    assert refused.run(lambda: refused.completed() == ['far'])
    assert refused.failed() == ['far']


@BOTH
def test_a_task_announced_again_at_another_position_is_flown_there(kind):
    bench = flying(kind, 'A')
    assert bench.run(lambda: bench.completed() == ['A'])
    bench.assign(single('A', (150.0, 100.0, 50.0), 2))
    assert bench.run(lambda: bench.completed() == ['A', 'A'])
    assert ('uav_1', TaskProgress('A', 'STARTED', 2)) in bench.events
    assert bench.flown()[-1] == (150, 100, 50)


@BOTH
def test_a_task_announced_again_unchanged_is_reported_and_not_flown(kind):
    bench = flying(kind, 'A')
    assert bench.run(lambda: bench.completed() == ['A'])
    bench.assign(task_list('A', 2))
    bench.run(limit=20.0)
    assert bench.completed() == ['A'] * 4  # after 2, 6, 14 seconds
    bench.assign(task_list('B', 3))
    bench.run(limit=40.0)
    assert bench.completed() == [*'AAAA', 'B']
    assert places(bench) == ['A', 'B']


@BOTH
def test_lists_that_change_all_the_time_do_not_delay_a_repeated_event(kind):
    bench = flying(kind, 'AZ')
    assert bench.run(lambda: bench.completed() == ['A'])
    for revision in range(2, 12):
        bench.assign(task_list('AZY' if revision % 2 else 'AYZ', revision))
        bench.run(limit=0.5)
    assert bench.completed() == ['A'] * 3


def upload_by_another(bench, n=1):
    """Upload a mission of one item as another ground station."""
    own = bench.onboard(n).own
    bench.from_station(d.MAVLink_mission_count_message(n, 1, 1 + own, 0), n)
    for seq in range(1 + own):
        x, y = 473990000, 85460000
        bench.from_station(d.MAVLink_mission_item_int_message(
            n, 1, seq, 5, 16, 0, 1, 0, 0, 0, 0, x, y, 540.0, 0), n)


@BOTH
def test_fault_24_a_foreign_mission_is_left_alone_where_the_policy_says_yield(kind):
    bench = flying(kind, 'ABC')
    bench.run(limit=4.0)
    upload_by_another(bench)
    assert bench.run(lambda: bench.onboard().state is MissionState.FOREIGN, 20.0)
    bench.run(limit=20.0)
    assert bench.onboard().state is MissionState.FOREIGN
    assert not bench.state().available
    assert bench.onboard().upload.uploads == 1


@BOTH
def test_fault_24_a_foreign_mission_is_replaced_where_the_policy_says_reassert(kind):
    bench = flying(kind, 'ABC', when_foreign='reassert')
    bench.run(limit=4.0)
    upload_by_another(bench)
    assert bench.run(lambda: len(bench.completed()) == 3)
    assert bench.onboard().upload.uploads == 2
    assert bench.onboard().state is MissionState.VERIFIED


@BOTH
@pytest.mark.parametrize(
    ('policy', 'mode'), [('hold', ModeFunction.HOLD), ('return', ModeFunction.RETURN)]
)
def test_fault_25_an_empty_list_holds_or_returns_and_never_clears(kind, policy, mode):
    bench = flying(kind, 'ABC', when_empty=policy)
    bench.assign(task_list('', 2))
    assert bench.run(lambda: bench.executor().telemetry.mode is mode, 5.0)
    bench.run(limit=10.0)
    assert bench.completed() == []
    assert bench.onboard().revision == 2
    assert not bench.line.sent('MISSION_CLEAR_ALL')
    assert all(m.count for m in bench.line.sent('MISSION_COUNT'))


@BOTH
@pytest.mark.parametrize('answer', ['none', 'unsupported'])
def test_fault_28_set_current_falls_back_to_the_message(kind, answer):
    bench = FlightBench(kind).discover()

    def refuse(direction, m, now):
        if m.get_type() != 'COMMAND_LONG' or m.command != d.MAV_CMD_DO_SET_MISSION_CURRENT:
            return None
        if answer == 'unsupported':
            bench.from_vehicle(d.MAVLink_command_ack_message(m.command, d.MAV_RESULT_UNSUPPORTED))
        return []
    bench.line.tampers.append(refuse)
    bench.assign(task_list('ABC'))
    assert bench.run(lambda: bench.completed() == ['A', 'B', 'C'])
    assert bool(bench.line.sent('MISSION_SET_CURRENT')) == (kind == 'ardupilot')


@BOTH
def test_fault_29_a_current_at_or_beyond_the_end_is_ignored(kind):
    bench = flying(kind, 'AB')
    bench.run(limit=4.0)
    count = len(bench.vehicles[1].mission.items)
    for seq in (count + 1, 65535):
        bench.from_vehicle(d.MAVLink_mission_current_message(seq, 65535, 0, 0))
    assert bench.completed() == []
    assert bench.run(lambda: bench.completed() == ['A', 'B'])


@pytest.mark.parametrize('distance', [47.0, 47.5, 48.0, 48.5, 49.0])
def test_the_current_item_is_set_before_the_readback_in_which_px4_ignores_it(distance):
    """A slow link: A is reached while the list that begins with it is sent."""
    bench = flying('px4', 'ABC')
    place = task_list('A').stops[0].task.position[:2]
    flight = bench.vehicles[1].flight
    assert bench.run(lambda: math.dist(flight.body.position[:2], place) < distance)
    bench.line.delay = (0.3, 0.3)
    bench.assign(task_list('ABCDEFGH', 2))
    assert bench.run(lambda: len(bench.completed()) == 8)
    assert bench.completed() == list('ABCDEFGH')
    assert bench.line.sent('MISSION_SET_CURRENT')
    assert not [m for m in bench.line.sent('STATUSTEXT', 'down') if 'Busy' in m.text]
