# SPDX-License-Identifier: Apache-2.0
"""The judge of benchmarks/endurance/flights.py: what a bridge could know, and what it ignores."""
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
from pymavlink.dialects.v20 import ardupilotmega as d

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / 'benchmarks' / 'endurance'))

from flight_events import FlightEvents
from flight_judge import OURS, Judge
from flights import Flight

from uav_task_alloc.mavlink.gcs.authority_state import AuthorityState
from uav_task_alloc.mavlink.gcs.onboard_mission import OnboardMission
from uav_task_alloc.mavlink.mission.completed_tasks import CompletedTasks
from uav_task_alloc.mavlink.mission.progress import ProgressTable
from uav_task_alloc.sim.config import FlightMode, TruthEvent
from uav_task_alloc.sim.modes import px4_mode

PLACE, AWAY = (100.0, 0.0, 50.0), (160.0, 0.0, 50.0)


def heartbeat(armed, status=d.MAV_STATE_STANDBY):
    return d.MAVLink_heartbeat_message(
        d.MAV_TYPE_QUADROTOR, d.MAV_AUTOPILOT_PX4, d.MAV_MODE_FLAG_SAFETY_ARMED * armed, 0,
        status, 3)


def arm_command():
    return d.MAVLink_command_long_message(
        1, 1, d.MAV_CMD_COMPONENT_ARM_DISARM, 0, 1, 0, 0, 0, 0, 0, 0)


def judged(rows, hand_over_at=-1.0, late=0.0, kind='px4'):
    """The faults of a vehicle on the ground; rows: time, (event, cause, mode)s, frame, command.

    Events may be 'reboot' instead.

    The operator hands it over by the service at `hand_over_at` [s], and it takes off; frames that
    come after that were sent `late` [s] before.
    """
    flight = SimpleNamespace(
        body=SimpleNamespace(position=AWAY, velocity=(0.0, 0.0, 0.0)), custom_mode=0, seq=0,
        booted=0.0, mode=FlightMode.HOLD, items=[], landed=True, track=None, armed=False,
        boot=SimpleNamespace(booting=False))
    world = SimpleNamespace(now=0.0, vehicle=SimpleNamespace(flight=flight), events=[],
                            tasks=None, state=None, authority=AuthorityState.UNKNOWN)
    judge = Judge(world, kind, {'A': PLACE, 'B': AWAY})
    for now, events, frame, sent in rows:
        world.now = now
        if events == 'reboot':
            judge.rebooted()
            events = []
        world.truth = [TruthEvent(
            now, name, AWAY if cause == 'B' else PLACE, mode=mode, cause=cause, seq=0)
            for name, cause, mode in events]
        for name, _, _ in events:
            flight.armed = {'armed': True, 'disarmed': False}.get(name, flight.armed)
            flight.landed &= name != 'takeoff'
        if now == hand_over_at:
            judge.handed_back(by_service=True)
            flight.landed = False
        sent_at = now - late * (now > hand_over_at >= 0.0)
        world.delivered = [(sent_at, frame)] if frame else []
        world.arrivals = [sent_at] if frame and frame.get_type() == 'HEARTBEAT' else []
        world.sent = [(now, sent)] if sent else []
        judge.step()
    return judge.counts


BY_LAND = [('mode', 'pilot', px4_mode(4, 6)), ('disarmed', 'pilot', None), ('mode', 'pilot', 0)]


# a PX4 enters its mode of before, once it is disarmed
BY_LAND_OF_PX4 = [*BY_LAND[:2], ('mode', 'self', 0)]


@pytest.mark.parametrize('disarmed', [[('disarmed', 'pilot', None)], BY_LAND, BY_LAND_OF_PX4])
@pytest.mark.parametrize(('shown', 'overridden'), [
    (None, False), (heartbeat(True), True),
    (d.MAVLink_command_ack_message(d.MAV_CMD_COMPONENT_ARM_DISARM, d.MAV_RESULT_ACCEPTED), True)])
def test_a_disarming_is_no_news_where_no_frame_has_shown_it_armed(shown, overridden, disarmed):
    counts = judged([
        (1.0, [('armed', OURS, None)], shown, None), (1.1, disarmed, None, None),
        (2.0, [], heartbeat(False), None), (2.1, [], None, arm_command()),
        (2.2, [('armed', OURS, None)], None, None), (3.0, [], heartbeat(True), None),
        (3.1, [], None, arm_command())])
    assert bool(counts['overridden']) is overridden


@pytest.mark.parametrize(('seconds', 'overridden'), [(0.0, False), (0.2, True)])
def test_an_arming_that_the_bridge_commands_as_the_news_arrives_is_of_both(seconds, overridden):
    counts = judged([
        (1.0, [('armed', 'pilot', None)], None, None),
        (2.0, [], heartbeat(True), None if seconds else arm_command()),
        (2.0 + seconds, [], None, arm_command() if seconds else None),
        (3.0, [], heartbeat(True), arm_command())])
    assert bool(counts['overridden']) is overridden


@pytest.mark.parametrize('end', [BY_LAND, BY_LAND[:2]])
@pytest.mark.parametrize('shown', [None, heartbeat(True)])
def test_an_arming_by_a_pilot_that_no_frame_has_shown_and_that_is_undone_is_no_news(shown, end):
    counts = judged([
        (1.0, [('armed', 'pilot', None)], None, None), (1.5, [], shown, None),
        (5.0, end, None, None), (8.0, [], heartbeat(False), None), (8.1, [], None, arm_command())])
    assert bool(counts['overridden']) is (shown is not None or end is not BY_LAND)


@pytest.mark.parametrize(('seconds', 'overridden'), [(0.0, False), (0.3, True)])
def test_a_mode_that_ends_before_a_frame_can_show_it_is_no_news(seconds, overridden):
    counts = judged([
        (1.0, [('armed', OURS, None)], heartbeat(True), None),
        (1.5, BY_LAND[:1], None, None) if seconds else (1.5, [], None, None),
        (1.5 + seconds, [*([] if seconds else BY_LAND[:1]), BY_LAND[2]], None, None),
        (2.0, [], heartbeat(True), None), (2.1, [], None, arm_command())])
    assert bool(counts['overridden']) is overridden


@pytest.mark.parametrize(('status', 'overridden'), [
    (d.MAV_STATE_BOOT, False), (d.MAV_STATE_STANDBY, True)])
def test_a_mode_set_before_a_frame_showed_the_end_of_the_boot_may_be_of_the_boot(
        status, overridden):
    counts = judged([
        (1.0, [], heartbeat(False, status), None),
        (15.0, [('mode', 'pilot', px4_mode(2))], None, None),
        (16.0, [], heartbeat(False), None), (17.0, [], None, arm_command())])
    assert bool(counts['overridden']) is overridden


@pytest.mark.parametrize(('armed_at', 'overridden'), [(1.0, False), (4.0, True)])
def test_a_mode_set_in_a_boot_is_none_of_a_pilot_where_it_was_not_armed_since_the_grant(
        armed_at, overridden):
    rows = [(armed_at, [('armed', OURS, None)], heartbeat(True), None),
            (armed_at + 0.5, [('disarmed', 'self', None)], heartbeat(False), None),
            (3.0, [], heartbeat(False), None),
            (5.0, 'reboot', heartbeat(False), None),  # sent just before
            (5.6, [('mode', 'pilot', px4_mode(3))], None, None),
            (6.2, [], heartbeat(False), None), (20.0, [], None, arm_command())]
    counts = judged(sorted(rows, key=lambda row: row[0]), hand_over_at=3.0)
    assert bool(counts['overridden']) is overridden


@pytest.mark.parametrize(('kill', 'counted'), [
    (None, 'flown_twice'),
    (heartbeat(False, d.MAV_STATE_FLIGHT_TERMINATION), 'flown_again_killed')])
def test_what_a_pilot_lets_a_killed_vehicle_fly_again_is_counted_apart(kill, counted):
    shown = d.MAVLink_mission_item_reached_message(0)
    counts = judged([
        (1.0, [('armed', OURS, None), ('item_reached', 'A', None)], heartbeat(True), None),
        (1.1, [], shown, None), (2.0, [('item_reached', 'B', None)], kill, None),
        (3.0, [('mode', 'pilot', px4_mode(4, 4))], heartbeat(True), None),
        (4.0, [('item_reached', 'A', None)], None, arm_command())])
    assert counts[counted] == 1
    assert counts['flown_twice'] + counts['flown_again_killed'] == 1


@pytest.mark.parametrize(('failsafe', 'shown', 'commanded', 'counted'), [
    (False, True, False, 'flown_twice'),  # the bridge has it, and could have held it
    (False, False, False, 'flown_again_for_pilot'),  # the link was cut
    (True, True, False, 'flown_again_for_pilot'),
    (False, False, True, 'flown_twice'),
    (False, False, 'handed over', 'flown_twice')])
def test_a_complete_mission_that_a_pilot_begins_again_is_flown_for_him_until_it_is_held(
        failsafe, shown, commanded, counted):
    counts = judged([
        (1.0, [('armed', OURS, None), ('item_reached', 'A', None)], heartbeat(True), None),
        (1.1, [('mission_end', '', None)], d.MAVLink_mission_item_reached_message(0), None),
        (2.0, [('item_reached', 'B', None)], None, None),
        (3.0, [('mode', 'pilot', px4_mode(4, 4))], None, None),
        (3.5, [('failsafe', 'battery', None)] if failsafe else [], None, None),
        (4.0, [], heartbeat(True) if shown else None, None),
        (7.0, [('command', OURS, None)] if commanded is True else [], heartbeat(True), None),
        (9.0, [('item_reached', 'A', None)], None, None)],
        hand_over_at=7.0 if commanded == 'handed over' else -1.0)
    assert counts[counted] == 1
    assert counts['flown_twice'] + counts['flown_again_for_pilot'] == 1


@pytest.mark.parametrize(('cause', 'handed_over', 'counted'), [
    ('pilot', False, 'flown_again_for_pilot'), ('pilot', True, 'flown_twice'),
    (OURS, False, 'flown_twice')])
def test_a_mission_of_a_px4_that_an_arming_begins_again_is_flown_for_who_armed(
        cause, handed_over, counted):
    counts = judged([
        (1.0, [('armed', OURS, None), ('item_reached', 'A', None)], heartbeat(True), None),
        (1.1, [], d.MAVLink_mission_item_reached_message(0), None),
        (2.0, [('item_reached', 'B', None)], None, None),
        (3.0, [('armed', cause, None), ('mission_restart', cause, None), ('takeoff', '', None)],
         None, None),
        (4.0, [], heartbeat(True), None), (7.0, [], heartbeat(True), None),
        (9.0, [('item_reached', 'A', None)], None, None)],
        hand_over_at=7.0 if handed_over else -1.0)
    assert counts[counted] == 1
    assert counts['flown_twice'] + counts['flown_again_for_pilot'] == 1


@pytest.mark.parametrize(('late', 'overridden'), [(2.0, False), (0.5, True)])
def test_a_heartbeat_of_before_a_hand_over_by_the_service_shows_no_kill_after_it(late, overridden):
    killed = heartbeat(False, d.MAV_STATE_FLIGHT_TERMINATION)
    counts = judged([
        (1.0, [('armed', OURS, None)], heartbeat(True), None),
        (2.0, [('kill_switch', 'pilot', None)], killed, None), (3.0, [], None, None),
        (4.0, [], killed, None), (5.0, [('mode', 'pilot', px4_mode(4, 5))], None, None),
        (8.0, [('mode', 'pilot', px4_mode(4, 4))], heartbeat(True), None),
        (9.0, [], None, arm_command())],
        hand_over_at=3.0, late=late)
    assert bool(counts['overridden']) is overridden


@pytest.mark.parametrize(('mode', 'overridden'), [(3, False), (4, True)])
def test_a_late_command_of_the_bridge_that_ends_an_avoidance_hands_back(mode, overridden):
    avoids, auto, late = [('mode', 'failsafe', 19)], ('mode', OURS, 3), ('mode', OURS, mode)
    counts = judged([
        (1.0, [('armed', OURS, None), auto], heartbeat(True), None), (3.0, avoids, None, None),
        (4.0, [], heartbeat(True), None), (5.0, [late], None, None),
        (6.0, [], heartbeat(True), arm_command())], kind='ardupilot')
    assert bool(counts['overridden']) is overridden


def fly_random(monkeypatch, number, break_bridge):
    """A random flight without interventions, with a bridge that is broken in one way."""
    monkeypatch.setattr(FlightEvents, '_schedule', lambda self, new_list: None)
    flight = Flight(1, number, lossy=False)
    flight.events.later = [(when, flight.new_list) for when in (40.0, 55.0, 70.0)]
    break_bridge(monkeypatch)
    flight.fly()
    return flight.result()[0]


def ignore_evidence(monkeypatch):
    """Nothing is completed before 60 s: REACHED, current items and positions are ignored."""
    for owner, name in ((ProgressTable, 'note_current'), (ProgressTable, 'note_reached'),
                        (ProgressTable, 'note_mission_complete'), (OnboardMission, 'reached')):
        monkeypatch.setattr(owner, name, lambda *_, **__: None)


def complete_at_start(monkeypatch):
    """A task is completed when it starts."""
    def start(self, task):
        self.complete(task, None)
    monkeypatch.setattr(CompletedTasks, 'start', start)


@pytest.mark.parametrize(('break_bridge', 'fault'), [
    (ignore_evidence, 'flown_twice'), (complete_at_start, 'false_completed')])
def test_a_bridge_that_ignores_or_invents_evidence_is_caught(monkeypatch, break_bridge, fault):
    counts = fly_random(monkeypatch, 0, break_bridge)
    assert counts[fault] > 0
    assert counts['flown_again_unknowable'] == 0


def test_a_bridge_that_takes_its_evidence_is_not_blamed(monkeypatch):
    counts = fly_random(monkeypatch, 0, lambda _: None)
    assert counts['completed'] > 0
    assert counts['flown_twice'] == counts['false_completed'] == 0
    assert counts['flown_again_unknowable'] == 0


@pytest.mark.parametrize(('seed', 'number'), [
    (5503, 1227),  # REACHED of the mission before the last one, repeated into an upload
    (5503, 1005),  # a repetition, while it lands beside a stop not reached in its mission
    (5506, 382),  # lossy: a flown task is next on board, while an upload lasts
])
def test_a_random_flight_that_once_had_a_fault_has_none(seed, number):
    flight = Flight(seed, number, lossy=seed % 2 == 0)
    flight.fly()
    assert flight.result()[1] == []


def test_an_error_that_the_bridge_catches_is_reported(monkeypatch):
    def fail(monkeypatch):
        monkeypatch.setattr(ProgressTable, 'note_current', lambda *_, **__: 1 / 0)
    assert fly_random(monkeypatch, 0, fail)['errors'] > 0
