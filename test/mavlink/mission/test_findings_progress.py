# SPDX-License-Identifier: Apache-2.0
"""Findings 4-8, 16, 17: what no one flew is not COMPLETED, and is flown later."""
import math

import pytest
from findings_bench import (
    BOTH,
    FindingsBench,
    distance,
    drop_messages,
    flown_once_each,
    flying,
    happened,
    listed,
    set_current,
    truthful,
)
from flight_bench import FlightBench, places
from mission_bench import OURS, task_list
from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.mavlink.gcs.onboard_mission import MissionState
from uav_task_alloc.mavlink.mission.flown_path import FlownPath, PositionSample
from uav_task_alloc.mavlink.mission.upload_states import UploadState

C = (200.0, 100.0, 50.0)
MISSION = 3  # custom_mode of the copter


def appended(lost=(), **kwargs):
    """A copter that reaches its last item while more of them are in transfer."""
    bench = flying('ardupilot', 'ABC', **kwargs)
    assert truthful(bench, lambda: bench.completed() == ['A', 'B'])
    bench.run(lambda: distance(bench, C) < 40.0)
    drop_messages(bench, 'up', 'MISSION_ITEM_INT',
            lambda m: m.seq > 3 and not happened(bench, 'mission_end'))
    for message in lost:
        drop_messages(bench, 'down', message, lambda m: bench.now < lost_until[0])
    lost_until = [bench.now + 6.0]
    bench.assign(task_list('CDEF', 2))
    assert truthful(bench, lambda: happened(bench, 'mission_end'), 30.0)
    assert bench.onboard().latest_upload.is_open
    return bench


def test_finding_04_what_is_appended_while_the_last_item_ends_is_flown():
    flown_once_each(appended(), 'ABCDEF')


def test_finding_04_also_where_the_last_reached_is_lost():
    flown_once_each(appended(lost=['MISSION_ITEM_REACHED']), 'ABCDEF')


@pytest.mark.parametrize('delay', [0.1, 0.3, 0.6])
@pytest.mark.parametrize('before', [5.0, 20.0])
def test_an_append_near_the_end_of_the_mission_is_flown(delay, before):
    bench = flying('ardupilot', 'ABC', delay=(delay, delay))
    assert truthful(bench, lambda: bench.completed() == ['A', 'B'])
    bench.run(lambda: distance(bench, C) < before)
    bench.assign(task_list('CDEF', 2))
    flown_once_each(bench, 'ABCDEF')


@BOTH
@pytest.mark.parametrize('moment', [2.0, 6.0, 9.0])
@pytest.mark.parametrize('index', [2, 4])
def test_finding_05_what_another_station_skips_is_flown_later(kind, moment, index):
    bench = flying(kind, 'ABCDE')
    truthful(bench, lambda: False, moment)
    before = places(bench)
    set_current(bench, index)
    flown_once_each(bench, 'ABCDE')
    assert places(bench)[len(before)] == 'ABCDE'[index]
    assert bench.noted('A was skipped')


@BOTH
@pytest.mark.parametrize('lost', ['MISSION_ITEM_REACHED', 'GLOBAL_POSITION_INT'])
def test_finding_05_also_on_a_line_that_loses_the_evidence(kind, lost):
    bench = flying(kind, 'ABCDE')
    truthful(bench, lambda: False, 3.0)
    begin = bench.now
    drop_messages(bench, 'down', lost, lambda m: begin < bench.now < begin + 4.0)
    set_current(bench, 3)
    flown_once_each(bench, 'ABCDE')
    assert places(bench)[0] == 'D'


@BOTH
def test_finding_05_a_new_list_does_not_call_off_what_the_human_chose(kind):
    bench = flying(kind, 'ABCDE')
    truthful(bench, lambda: False, 2.0)
    set_current(bench, 3)
    truthful(bench, lambda: False, 8.0)  # it is seen, and judged
    bench.assign(task_list('EDCBAF', 2))
    flown_once_each(bench, 'ABCDEF')
    assert places(bench)[0] == 'D'


def swapped_beside(second, lost):
    """PX4 near a task that it has just reached, with another list: its first item is close by.

    REACHED of the task is repeated for 10 s; of these `lost` [s] are swallowed.
    """
    bench = FlightBench('px4', tick=0.05).discover()
    bench.assign(listed(1, P=(0.0, 100.0), Q=(0.0, 400.0)))
    drop_messages(bench, 'down', 'MISSION_ITEM_REACHED', lambda m: not reached or (
        bench.now < reached[0] + lost))
    reached = []
    assert bench.run(lambda: bench.flown())
    if lost:
        reached.append(bench.now)
    else:
        bench.line.tampers.clear()
    bench.assign(listed(2, S=second, Q=(0.0, 400.0)))
    return bench


@pytest.mark.parametrize('lost', [0.0, 2.5])
@pytest.mark.parametrize('second', [(20.0, 115.0), (40.0, 130.0), (0.0, 60.0)])
def test_finding_06_a_reached_of_the_list_before_completes_nothing_of_the_new(lost, second):
    bench = swapped_beside(second, lost)
    there = (*map(round, second), 50)

    def done():
        assert 'S' not in bench.completed() or there in bench.flown()
        return 'S' in bench.completed() and 'Q' in bench.completed()
    assert bench.run(done)
    assert bench.flown() == [(0, 100, 50), there, (0, 400, 50)]
    assert [t for t in bench.completed() if t != 'P'] == ['S', 'Q']


def test_finding_07_reached_of_a_new_list_is_not_credited_to_the_old_one():
    bench = FlightBench('px4', tick=0.05).discover()
    bench.assign(listed(1, P=(0.0, 200.0), Q=(0.0, 400.0)))
    assert bench.run(lambda: distance(bench, (0.0, 200.0, 50.0)) < 100.0)
    lost = [True]
    for message in ('MISSION_ACK', 'MISSION_COUNT'):
        drop_messages(bench, 'down', message, lambda m: lost[0])
    bench.assign(listed(2, S=(0.0, 170.0), P=(0.0, 200.0), Q=(0.0, 400.0)))

    def honest():
        assert 'P' not in bench.completed() or (0, 200, 50) in bench.flown()
        assert 'S' not in bench.completed() or (0, 170, 50) in bench.flown()
        return bench.flown()
    assert bench.run(honest)
    assert bench.flown() == [(0, 170, 50)]
    bench.run(honest, 0.5)
    lost[0] = False
    assert bench.run(lambda: honest() and len(bench.completed()) == 3)
    assert bench.completed() == ['S', 'P', 'Q']
    assert bench.flown() == [(0, y, 50) for y in (170, 200, 400)]


def test_finding_07_a_first_try_that_was_taken_is_not_forgotten_in_the_second():
    """The readback shows something else, and no MISSION_COUNT gets through after it."""
    bench = FlightBench('px4', tick=0.05).discover()
    bench.assign(listed(1, P=(0.0, 200.0), Q=(0.0, 400.0)))
    assert bench.run(lambda: distance(bench, (0.0, 200.0, 50.0)) < 100.0)
    lost = [True]

    def another(direction, m, now):
        if lost[0] and direction == 'down' and m.get_type() == 'MISSION_ITEM_INT':
            m.z += 1.0
        return None
    bench.line.tampers.append(another)
    drop_messages(bench, 'down', 'MISSION_ACK', lambda m: lost[0])
    drop_messages(bench, 'up', 'MISSION_COUNT', lambda m: (
        lost[0] and bench.onboard().upload.uploads > 2))
    bench.assign(listed(2, S=(0.0, 170.0), P=(0.0, 200.0), Q=(0.0, 400.0)))

    def honest():
        assert 'P' not in bench.completed() or (0, 200, 50) in bench.flown()
        assert 'S' not in bench.completed() or (0, 170, 50) in bench.flown()
        return bench.flown()
    assert bench.run(honest)
    assert bench.flown() == [(0, 170, 50)]
    bench.run(honest, 0.5)
    assert bench.onboard().upload.uploads > 2
    lost[0] = False
    assert bench.run(lambda: honest() and len(bench.completed()) == 3)
    assert bench.flown() == [(0, y, 50) for y in (170, 200, 400)]


def test_finding_07_a_try_that_was_taken_is_not_forgotten_for_a_newer_list():
    """The vehicle has stored a mission and sends ERROR; before the next try comes another list."""
    bench = FlightBench('px4', tick=0.05).discover()
    bench.assign(listed(1, P=(0.0, 200.0), Q=(0.0, 400.0)))
    assert bench.run(lambda: distance(bench, (0.0, 200.0, 50.0)) < 60.0)
    lost = [True]
    drop_messages(bench, 'down', 'MISSION_ACK', lambda m: lost[0] and m.type == 0)
    bench.assign(listed(2, S=(0.0, 170.0), P=(0.0, 200.0), Q=(0.0, 400.0)))
    assert bench.run(lambda: bench.onboard().upload.sent_all, 10.0)
    bench.from_vehicle(d.MAVLink_mission_ack_message(*OURS, d.MAV_MISSION_ERROR))
    assert bench.run(lambda: bench.onboard().upload.state is UploadState.BACKOFF, 10.0)
    bench.assign(listed(3, Q=(0.0, 400.0), S=(0.0, 170.0), P=(0.0, 200.0)))
    assert bench.run(lambda: bench.flown() == [(0, 170, 50)], 60.0)
    lost[0] = False
    assert bench.run(lambda: len(bench.completed()) == 3)
    assert bench.completed()[0] == 'S'
    assert sorted(bench.flown()) == [(0, y, 50) for y in (170, 200, 400)]


def test_finding_07_reached_of_the_old_list_is_not_credited_to_the_new_one():
    bench = FlightBench('px4', tick=0.05).discover()
    bench.assign(listed(1, P=(0.0, 200.0), Q=(0.0, 400.0)))
    assert bench.run(lambda: distance(bench, (0.0, 200.0, 50.0)) < 25.0)
    drop_messages(bench, 'up', 'MISSION_ITEM_INT', lambda m: m.seq == 2 and not bench.flown())
    bench.assign(listed(2, S=(20.0, 220.0), P=(0.0, 200.0), Q=(0.0, 400.0)))

    def done():
        assert 'S' not in bench.completed() or (20, 220, 50) in bench.flown()
        return len(bench.completed()) == 3
    assert bench.run(done)
    assert bench.completed() == ['P', 'S', 'Q']
    assert bench.flown() == [(0, 200, 50), (20, 220, 50), (0, 400, 50)]


def test_what_is_appended_and_reached_before_the_answer_is_completed_once():
    bench = flying('ardupilot', 'AB')
    assert truthful(bench, lambda: distance(bench, (100.0, 100.0, 50.0)) < 25.0)
    lost = [True]
    for message in ('MISSION_ACK', 'MISSION_COUNT'):
        drop_messages(bench, 'down', message, lambda m: lost[0])
    bench.assign(task_list('BCD', 2))
    assert truthful(bench, lambda: places(bench) == ['A', 'B', 'C'])
    lost[0] = False
    flown_once_each(bench, 'ABCD')


@pytest.mark.parametrize(('slow', 'lost'), [(3.0, False), (0.0, True), (3.0, True)])
def test_finding_08_the_end_of_the_old_mission_during_a_replacement_is_no_pilot(slow, lost):
    bench = flying('px4', 'C', tick=0.05)
    assert bench.run(lambda: distance(bench, C) < 30.0)
    ended = []

    def tamper(direction, m, now):
        kind = m.get_type()
        if happened(bench, 'mission_end') and not ended:
            ended.append(now)
        if direction == 'up' and kind == 'MISSION_ITEM_INT' and m.seq == 1 and not ended:
            return []
        if direction == 'down' and ended:
            if kind == 'MISSION_COUNT' and now < ended[0] + slow:
                return []
            if kind == 'MISSION_ITEM_REACHED' and lost and now < ended[0] + 3.0:
                return []
        return [] if kind == 'MISSION_ITEM_REACHED' and lost and not ended else None
    bench.line.tampers.append(tamper)
    bench.assign(task_list('DE', 2))
    flown_once_each(bench, 'CDE')


@BOTH
def test_finding_16_verified_is_not_published_for_a_list_that_came_during_set_current(kind):
    bench = FindingsBench(kind, delay=(0.2, 0.2)).discover()
    bench.assign(task_list('AB', via={'A': ((-150.0, 50.0, 50.0),)}))
    assert bench.run(lambda: bench.started() == ['A'])
    bench.run(limit=3.0)
    bench.assign(task_list('AB', 2))  # without the detour: it is on board, from an item on
    bench.run(limit=0.1)
    bench.assign(task_list('XY', 3))
    own, seen = bench.onboard().own, set()

    def all_completed():
        state, held = bench.state(), bench.vehicles[1].mission.items[own:]
        if state.mission_state is MissionState.VERIFIED:
            seen.add(state.list_revision)
        if state.list_revision == 3:
            assert len(held) == 2
        return bench.completed() == ['X', 'Y']
    assert bench.run(all_completed)
    assert 3 in seen
    assert places(bench) == ['X', 'Y']


@pytest.mark.parametrize('index', [1, 2])
def test_finding_17_a_late_current_completes_nothing_while_it_is_held(index):
    bench = flying('ardupilot', 'ABC')
    assert truthful(bench, lambda: bench.completed() == ['A'])
    held = [True]
    drop_messages(bench, 'up', 'COMMAND_LONG', lambda m: held[0] and (
        m.command == d.MAV_CMD_DO_SET_MODE and m.param2 == MISSION))
    bench.assign(task_list('XYZ', 2))
    assert bench.run(lambda: bench.line.sent('COMMAND_LONG')[-1].param2 == MISSION
                     and bench.vehicles[1].mode.name == 'GUIDED')
    bench.run(limit=3.5)
    for _ in range(3):
        bench.from_vehicle(d.MAVLink_mission_current_message(bench.onboard().own + index, 3, 4, 2))
    truthful(bench, lambda: False, 2.0)
    held[0] = False
    flown_once_each(bench, 'AXYZ')


@BOTH
def test_a_late_current_after_a_replacement_completes_nothing_in_flight(kind):
    bench = flying(kind, 'ABCDE')
    late = []

    def tamper(direction, m, now):
        if direction == 'down' and m.get_type() == 'MISSION_CURRENT' and late and now < late[0]:
            return [(0.0, m), (4.5, m)]
        return None
    bench.line.tampers.append(tamper)
    assert truthful(bench, lambda: bench.completed() == ['A', 'B'])
    late.append(bench.now + 3.0)
    bench.assign(task_list('XYC', 2))
    flown_once_each(bench, 'ABXYC')


def test_a_set_current_of_ours_that_a_link_delays_leads_back_to_no_completed_task():
    bench, sent = FlightBench('ardupilot').discover(), []
    bench.assign(listed(1, A=(0.0, 100.0), B=(0.0, 130.0), C=(150.0, 80.0)))
    assert bench.run(lambda: bench.started() and distance(bench, (0.0, 100.0, 50.0)) < 20.0)
    bench.line.tampers.append(lambda direction, m, now: sent.append(m) if m.get_type() in (
        'COMMAND_LONG', 'MISSION_SET_CURRENT') and direction == 'up' else None)
    bench.assign(listed(2, B=(0.0, 130.0), C=(150.0, 80.0)))
    assert bench.run(lambda: bench.completed() == ['B'])
    setting, = [m for m in sent if getattr(m, 'command', d.MAV_CMD_DO_SET_MISSION_CURRENT)
                == d.MAV_CMD_DO_SET_MISSION_CURRENT]
    bench.run(limit=1.0)
    bench.from_station(setting, system=OURS[0])
    assert bench.run(lambda: bench.completed() == ['B', 'C'])
    assert bench.flown() == [(0, 130, 50), (150, 80, 50)]


def test_no_upload_begins_while_a_repeated_command_of_mission_mode_may_still_arrive():
    bench, modes = FlightBench('ardupilot').discover(), []
    bench.assign(listed(1, A=(0.0, 400.0)))
    assert bench.run(lambda: bench.started() and distance(bench, (0.0, 0.0, 50.0)) > 60.0)

    def late(direction, m, now):
        if direction != 'up' or getattr(m, 'param2', 0) != MISSION or len(modes) == 2:
            return None
        modes.append(now)
        return [(1.2, m)] if len(modes) == 1 else [(0.7, m)]
    bench.line.tampers.append(late)
    bench.assign(listed(2, B=(100.0, 200.0), C=(100.0, 300.0)))
    assert bench.run(lambda: bench.started() == ['A', 'B'])
    bench.assign(listed(3, D=(-100.0, 200.0), B=(100.0, 200.0), C=(100.0, 300.0)))
    until = bench.now + 20.0
    drop_messages(bench, 'up', 'MISSION_ITEM_INT', lambda m: m.seq > 1 and bench.now < until)
    assert bench.run(lambda: len(bench.completed()) == 3)
    assert bench.completed() == ['D', 'B', 'C']
    assert bench.flown() == [(-100, 200, 50), (100, 200, 50), (100, 300, 50)]
    assert len(modes) == 2


@pytest.mark.parametrize(('x', 'speed', 'flown'), [
    (88.0, -0.1, False),  # set to the next item before it was there, it turns around
    (88.0, 3.0, False),
    (88.0, -3.0, True),
    (95.0, -0.1, True),  # it sets out
    (88.0, math.nan, True)])
def test_a_vehicle_at_rest_in_the_middle_of_a_leg_has_not_come_from_its_start(x, speed, flown):
    path = FlownPath()
    path.add(PositionSample(0.0, (-50.0, 0.0, 50.0), (15.0, 0.0, 0.0)))
    path.add(PositionSample(18.0, (x, 0.0, 50.0), (speed, 0.0, 0.0)))
    assert path.could_have_flown(
        [(100.0, 0.0, 50.0)], (0.0, 0.0, 50.0), 0.0, 0.0) is flown


@pytest.mark.parametrize(('x', 'speed', 'flown'), [
    (93.0, -0.4, False),  # it sets out there: set to the next item before it was at 100 m
    (90.0, -4.2, False),
    (93.0, -5.0, True),
    (96.5, -0.4, True)])
def test_a_vehicle_that_sets_out_near_the_start_of_a_leg_has_not_come_from_it(x, speed, flown):
    path = FlownPath()
    path.add(PositionSample(0.0, (-50.0, 0.0, 50.0), (15.0, 0.0, 0.0)))
    path.add(PositionSample(18.0, (x, 0.0, 50.0), (speed, 0.0, 0.0)))
    path.add(PositionSample(18.5, (x + 0.5 * speed, 0.0, 50.0), (speed - 1.5, 0.0, 0.0)))
    assert path.could_have_flown(
        [(100.0, 0.0, 50.0)], (0.0, 0.0, 50.0), 0.0, 0.0) is flown
