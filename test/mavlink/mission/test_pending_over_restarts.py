# SPDX-License-Identifier: Apache-2.0
"""A task that was passed, and still to be judged, when its bridge or its mission was replaced."""
import pytest
from authority_bench import ARDUPILOT, BOTH, MODES, PX4, L, flying
from evidence_bench import Flight
from findings_bench import distance, drop_messages, flown_once_each, listed, truthful
from flight_bench import places
from mission_bench import task_list
from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.mavlink.autopilots import ModeFunction

AT_A = (0.0, 100.0, 50.0)


def passed_a(kind, names):
    """A vehicle that has just passed A, whose REACHED is lost, and may still be late."""
    bench = flying(kind, names)
    drop_messages(bench, 'down', 'MISSION_ITEM_REACHED', lambda m: True)
    assert bench.run(lambda: bench.onboard().progress.pending, 60.0)
    assert places(bench) == ['A']
    return bench


@ARDUPILOT
def test_a_task_seen_passed_is_known_after_a_kill_while_its_mission_is_replaced(kind):
    bench = passed_a(kind, 'ABC')
    drop_messages(bench, 'up', 'MISSION_ITEM_INT', lambda m: m.seq > 1)
    bench.assign(task_list('CA', 2))
    assert bench.run(lambda: len(bench.vehicles[1].flight.items) < 4, 4.0)
    bench.run(limit=0.5)
    assert bench.onboard().progress.pending == {'A'}
    bench.kill_and_restart(0.0)
    bench.line.tampers.clear()
    bench.assign(task_list('CAB', 3))
    assert bench.run(lambda: bench.completed() == ['A'], 3.0)
    bench.assign(task_list('CB', 4))
    flown_once_each(bench, 'ABC')


@ARDUPILOT
def test_a_task_passed_before_a_pilot_took_it_is_known_to_a_bridge_without_a_file(kind):
    bench = passed_a(kind, 'ABC')
    bench.kill_and_restart(0.0, store=False)
    drop_messages(bench, 'down', 'MISSION_COUNT', lambda m: True)
    bench.run(limit=1.0)
    bench.vehicles[1].rc_mode(MODES[kind].stick)
    bench.run(limit=2.0)
    bench.line.tampers.clear()
    bench.assign(task_list('ABC', 2))
    bench.run(limit=5.0)
    bench.hand_over()
    flown_once_each(bench, 'ABC')


@pytest.mark.parametrize(('start', 'x', 'known'), [
    (1, 100.0, True), (1, 60.0, False), (0, 100.0, False)])
def test_a_reached_of_the_last_item_of_a_mission_found_on_board_needs_no_later_current(
        start, x, known):
    flight, other = Flight(), Flight()
    other.begin(A=50.0, B=100.0)
    flight.table.begin(other.table.items, start, flight.now, read=True)
    flight.fly_to(x)
    flight.reached(1)
    flight.stay(1.0)
    assert ('B' in flight.table.completed) is known


@ARDUPILOT
@pytest.mark.parametrize('skipped', [False, True])
def test_a_task_flown_for_a_pilot_before_a_restarted_bridge_has_read_the_mission_is_known(
        kind, skipped):
    bench = flying(kind, 'ABC')
    assert bench.run(lambda: distance(bench, AT_A) < 15.0 + 10.0 * skipped, 60.0)
    bench.vehicles[1].rc_mode(MODES[kind].own)
    bench.run(limit=6.0)
    assert places(bench) == []
    assert bench.authority() is L
    bench.kill_and_restart(0.0)
    for message in ('MISSION_ITEM_REACHED', 'MISSION_COUNT'):
        drop_messages(bench, 'down', message, lambda m: True)
    bench.assign(task_list('ABC', 2))
    bench.vehicles[1].rc_mode(MODES[kind].mission)
    if skipped:
        bench.run(limit=0.6)
        bench.from_station(d.MAVLink_mission_set_current_message(1, 1, 2))
    assert skipped or bench.run(lambda: places(bench) == ['A'], 20.0)
    bench.run(limit=1.6)
    bench.line.tampers.clear()
    bench.run(limit=1.5)
    assert bench.completed() == ([] if skipped else ['A'])
    flown_once_each(bench, 'ABC')


@BOTH
def test_what_was_passed_before_the_mission_was_read_is_of_no_mission_that_replaced_it(kind):
    bench = flying(kind, 'ABCD')
    assert bench.run(lambda: distance(bench, AT_A) < 60.0, 60.0)
    bench.kill_and_restart(0.0)
    for message in ('GLOBAL_POSITION_INT', 'MISSION_COUNT'):
        drop_messages(bench, 'down', message, lambda m: True)
    bench.assign(task_list('ABCD', 2))
    assert bench.run(lambda: places(bench) == ['A', 'B'], 60.0)
    bench.run(limit=2.0)
    bench.line.tampers.clear()
    assert bench.run(lambda: bench.completed() == ['A', 'B'], 20.0)
    bench.assign(listed(3, P=(10.0, 97.0), Q=(90.0, 97.0), D=(300.0, 100.0)))
    assert bench.run(lambda: bench.onboard().revision == 3, 30.0)
    bench.vehicles[1].reboot(bench.now)
    bench.run(limit=20.0)
    assert bench.onboard().held
    assert bench.completed() == ['A', 'B']


@ARDUPILOT
def test_a_mission_stored_in_a_hold_is_not_flown_up_to_the_item_of_the_mission_before(kind):
    """The bridge is killed without a file between the upload and the set of the current item."""
    bench = flying(kind, 'ABC')
    assert bench.run(lambda: places(bench) == ['A', 'B'], 200.0)
    bench.run(limit=2.0)
    for message in ('COMMAND_LONG', 'MISSION_SET_CURRENT'):
        drop_messages(bench, 'up', message, lambda m: m.get_type() == 'MISSION_SET_CURRENT' or (
            m.command == d.MAV_CMD_DO_SET_MISSION_CURRENT))
    bench.assign(task_list('DEF', 2))
    assert bench.run(lambda: bench.onboard().item_to_set.seq is not None, 30.0)
    drop_messages(bench, 'down', 'MISSION_COUNT', lambda m: True)
    bench.kill_and_restart(0.0, store=False)
    bench.assign(task_list('DEF', 2))
    bench.run(limit=4.0)
    drop_messages(bench, 'up', 'COMMAND_LONG', lambda m: True)
    bench.vehicles[1].rc_mode(MODES[kind].mission)
    bench.run(limit=2.0)
    del bench.line.tampers[2]  # of MISSION_COUNT
    bench.run(limit=3.0)
    bench.line.tampers.clear()
    assert bench.completed() == []
    assert truthful(bench, lambda: sorted(bench.completed()) == ['D', 'E', 'F'])


@ARDUPILOT
@pytest.mark.parametrize('skipped', [False, True])
def test_a_task_flown_before_the_first_position_of_a_bridge_without_a_file_is_known(kind, skipped):
    bench = flying(kind, 'ABC')
    assert bench.run(lambda: distance(bench, AT_A) < 60.0, 60.0)
    for message in ('GLOBAL_POSITION_INT', 'MISSION_COUNT', 'MISSION_ITEM_REACHED'):
        drop_messages(bench, 'down', message, lambda m: True)
    bench.kill_and_restart(0.0, store=False)
    bench.assign(task_list('ABC', 2))
    bench.run(limit=2.0)
    if skipped:
        bench.from_station(d.MAVLink_mission_set_current_message(1, 1, 2))
    assert skipped or bench.run(lambda: places(bench) == ['A'], 20.0)
    bench.run(limit=6.0)
    bench.line.tampers.clear()
    assert bench.run(lambda: bench.onboard().resume.located, 20.0)
    bench.run(limit=0.2)
    assert ('A' in bench.completed()) is not skipped
    flown_once_each(bench, 'ABC')


@BOTH
def test_a_current_item_beyond_the_mission_that_is_read_after_a_restart_is_no_error(kind):
    bench = flying(kind, 'ABC')
    assert bench.run(lambda: distance(bench, AT_A) < 60.0, 60.0)
    for message in ('MISSION_CURRENT', 'MISSION_COUNT'):
        drop_messages(bench, 'down', message, lambda m: True)
    bench.kill_and_restart(0.0)
    bench.assign(task_list('ABC', 2))
    bench.run(limit=1.0)
    bench.from_vehicle(d.MAVLink_mission_current_message(9, 3, d.MISSION_STATE_ACTIVE, 1))
    bench.line.tampers.pop()
    assert bench.run(lambda: bench.onboard().resume.located, 20.0)
    bench.line.tampers.clear()
    flown_once_each(bench, 'ABC')
    assert not bench.ground_station.refusals.notes


@ARDUPILOT
def test_the_current_item_is_set_after_a_hold_once_it_was_reported(kind):
    """An item that was reached in the moment of the hold is not flown again."""
    bench = flying(kind, 'ABC')
    assert bench.run(lambda: distance(bench, AT_A) < 60.0, 60.0)
    bench.vehicles[1].rc_mode(MODES[kind].stick)
    bench.run(limit=3.0)
    drop_messages(bench, 'down', 'MISSION_CURRENT', lambda m: True)
    bench.hand_over()
    assert bench.run(lambda: bench.executor().telemetry.mode is ModeFunction.HOLD, 10.0)
    held_at = bench.now

    def sets():
        return [m for t, way, m in bench.line.log if t > held_at and way == 'up' and (
            m.get_type() == 'COMMAND_LONG' and m.command == d.MAV_CMD_DO_SET_MISSION_CURRENT)]
    bench.run(limit=1.4)
    assert not sets()
    bench.run(limit=1.6)  # it may not be reported at all
    assert sets()
    bench.line.tampers.clear()
    flown_once_each(bench, 'ABC')


@PX4
@pytest.mark.parametrize(('seq', 'state', 'completed'), [
    (1, d.MISSION_STATE_ACTIVE, ['A']), (0, d.MISSION_STATE_ACTIVE, []),
    (1, d.MISSION_STATE_NOT_STARTED, [])])
def test_the_next_item_reported_just_before_a_reboot_counts_where_it_comes_after_it(
        kind, seq, state, completed):
    bench = flying(kind, 'AB')
    assert bench.run(lambda: distance(bench, AT_A) < 15.0, 60.0)
    for lost in ('MISSION_ITEM_REACHED', 'MISSION_CURRENT'):
        drop_messages(bench, 'down', lost, lambda m: True)
    assert bench.run(lambda: places(bench) == ['A'])
    bench.vehicles[1].reboot(bench.now)
    bench.run(limit=2.0)
    bench.from_vehicle(d.MAVLink_mission_current_message(seq, 2, state, 1))
    bench.line.tampers.clear()
    bench.run(limit=2.0)
    assert bench.completed() == completed
