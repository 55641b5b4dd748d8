# SPDX-License-Identifier: Apache-2.0
"""A mission that another station has put on board, also while no bridge ran, is never taken."""
import pytest
from authority_bench import (
    ARDUPILOT,
    BOTH,
    MODES,
    H,
    L,
    S,
    flying,
    set_mode,
    status_is,
)
from findings_bench import drop_messages
from flight_bench import FlightBench
from mission_bench import OURS, make_vehicle, task_list
from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.mavlink.gcs.onboard_mission import MissionState
from uav_task_alloc.mavlink.gcs.operator_hold import HoldRequest
from uav_task_alloc.mavlink.gcs.two_vehicles import TwoVehicles
from uav_task_alloc.mavlink.mission.items import MissionStop, TaskList
from uav_task_alloc.mavlink.transport.codec import Codec
from uav_task_alloc.model import Task, ThreatZone


def put_on_board(bench, count):
    """Another station puts waypoints on board; the first is home on ArduPilot."""
    bench.from_station(d.MAVLink_mission_count_message(1, 1, count, 0))
    for seq in range(count):
        bench.from_station(d.MAVLink_mission_item_int_message(
            1, 1, seq, d.MAV_FRAME_GLOBAL_INT, d.MAV_CMD_NAV_WAYPOINT, 0, 1, 0, 0, 0, 0,
            473990000 + 9000 * seq, 85460000, 540.0, 0))


@BOTH
@pytest.mark.parametrize('meanwhile', ['landed', 'air'])
def test_a_mission_that_a_pilot_flies_since_the_bridge_was_down_is_left(kind, meanwhile):
    bench = flying(kind)
    vehicle, modes = bench.vehicles[1], MODES[kind]
    bench.run(limit=10.0)
    bench.kill()
    if meanwhile == 'landed':
        vehicle.rc_mode(modes.land)
        assert bench.run(lambda: not vehicle.flight.armed, 120.0)
        bench.run(limit=5.0)
        vehicle.reboot(bench.now)
        bench.run(limit=60.0)
    vehicle.rc_mode(modes.stick)
    bench.run(limit=3.0)
    put_on_board(bench, 9)
    bench.run(limit=2.0)
    if meanwhile == 'landed':
        assert vehicle.rc_arm(True)
        vehicle.rc_stick((0.0, 0.0, 3.0))
        bench.run(limit=15.0)
        vehicle.rc_stick(None)
    assert vehicle.rc_mode(modes.mission)
    bench.run(limit=5.0)
    stored = list(vehicle.mission.items)
    bench.start()
    bench.discover()
    start = len(bench.sent)
    bench.assign(task_list('XYZ', 7))
    bench.run(limit=40.0)
    if meanwhile == 'landed':
        assert bench.authority() in (L, S)
    else:
        assert status_is(bench, S, 'somebody else changed the mission')
    assert {action for _, action, _ in bench.sent[start:]} <= {'read'}
    assert vehicle.mission.items == stored


@BOTH
@pytest.mark.parametrize('mode', ['mission', 'hold'])
def test_a_vehicle_that_was_rebooted_since_the_record_is_left_to_its_pilot(kind, mode):
    bench = flying(kind)
    if mode == 'hold':
        bench.assign(task_list('', 2))
        assert bench.run(lambda: bench.executor().watch.mode == MODES[kind].hold, 10.0)
    vehicle, modes = bench.vehicles[1], MODES[kind]
    bench.run(limit=60.0)
    bench.kill()
    vehicle.rc_mode(modes.land)
    assert bench.run(lambda: not vehicle.flight.armed, 120.0)
    vehicle.reboot(bench.now)
    bench.run(limit=10.0)
    vehicle.rc_mode(modes.stick)
    assert vehicle.rc_arm(True)
    vehicle.rc_stick((0.0, 0.0, 3.0))
    bench.run(limit=12.0)
    vehicle.rc_stick(None)
    bench.from_station(set_mode(getattr(modes, mode), kind))  # our mission is still on board
    bench.run(limit=2.0)
    bench.start()
    bench.discover()
    start = len(bench.sent)
    bench.assign(task_list('XYZ', 7))
    bench.run(limit=20.0)
    if (kind, mode) == ('ardupilot', 'mission'):  # it sends no clock since, and flies our mission
        assert bench.authority() is H
    else:
        assert bench.authority() is L
        assert bench.commands(start) == []


@BOTH
def test_a_bridge_that_is_restarted_in_flight_goes_on_with_its_own_mission(kind):
    bench = flying(kind, 'ABCDE')
    bench.kill_and_restart(2.0)
    bench.assign(task_list('ABCDE'))
    assert bench.run(lambda: bench.completed()[-1:] == ['E'], 200.0)
    assert not any('somebody else' in note for note in bench.notes)


def shifted(bench, metres, up):
    """Another station replaces the mission by one with as many items at other places."""
    items = list(bench.vehicles[1].flight.items)
    bench.from_station(d.MAVLink_mission_count_message(1, 1, len(items), 0))
    for seq, item in enumerate(items):
        x = item.x + round(metres / 111132.0 * 1e7) * (seq > 0)
        bench.from_station(d.MAVLink_mission_item_int_message(
            1, 1, seq, item.frame, item.command, 0, 1, item.p1, 0, 0, 0, x, item.y,
            item.z + up, 0))


@ARDUPILOT
@pytest.mark.parametrize(('metres', 'up'), [(45.0, 0.0), (0.0, -35.0)])
def test_a_mission_of_as_many_items_is_found_at_once(kind, metres, up):
    bench = flying(kind, 'ABCDE')
    bench.run(limit=5.0)
    shifted(bench, metres, up)
    assert bench.run(lambda: bench.onboard().state is MissionState.FOREIGN, 5.0)
    bench.run(limit=60.0)
    assert bench.completed() == []


@ARDUPILOT
def test_a_mission_that_others_start_is_read_before_it_is_taken(kind):
    bench = flying(kind, 'ABCDE')
    bench.vehicles[1].rc_mode(MODES[kind].stick)
    assert bench.reaches(L)
    bench.run(limit=40.0)
    shifted(bench, 45.0, 0.0)
    bench.from_station(set_mode(MODES[kind].mission, kind))
    bench.run(limit=60.0)
    assert status_is(bench, S, 'somebody else changed the mission')
    assert bench.completed() == []


@ARDUPILOT
@pytest.mark.parametrize('shared', [True, False])
def test_a_mission_replaced_in_our_hold_is_not_reported_as_flown(kind, shared):
    bench = flying(kind, 'ABCDE')
    bench.run(limit=2.0)
    bench.ground_station.hold('uav_1', HoldRequest('operator', True, 'look'), bench.now)
    assert bench.run(lambda: bench.executor().watch.mode == MODES[kind].hold, 10.0)
    bench.run(limit=5.0)
    down = bench._down
    if not shared:  # the other station has a link of its own
        bench._down = lambda n, messages: down(
            n, [m for m in messages if getattr(m, 'target_system', OURS[0]) in (0, OURS[0])])
    shifted(bench, 400.0, 0.0)
    bench.run(limit=2.0)
    bench.ground_station.hold('uav_1', HoldRequest('operator', False), bench.now)
    assert bench.run(lambda: bench.onboard().state is MissionState.FOREIGN, 40.0)
    assert shared is (bench.executor().watch.mode == MODES[kind].hold)
    bench.run(limit=40.0)
    assert bench.completed() == []
    assert status_is(bench, S, 'somebody else changed the mission')


# tasks of others at the same place

@BOTH
@pytest.mark.parametrize('allowed', [None, frozenset({'uav_2'})])
def test_what_one_uav_flew_while_the_bridge_was_down_completes_no_task_of_another_id(
        kind, allowed):
    bench = FlightBench(kind, kind, tick=0.2).discover()
    place = 100.0, 100.0, 50.0

    def tasks(revision, *stops):
        return TaskList(revision, tuple(map(MissionStop, stops)))

    def assign(revision):
        bench.assign(tasks(revision, Task('cam', place), Task('q', (400.0, 100.0, 50.0)),
                           Task('r', (400.0, 400.0, 50.0))), 1)
        bench.assign(tasks(revision, Task('far', (-600.0, 0.0, 50.0)),
                           Task('lidar', place, allowed_uavs=allowed)), 2)

    assign(1)
    assert bench.run(lambda: 'cam' in bench.started(1))
    bench.run(limit=2.0)
    bench.ground_station = type('Dead', (), {
        'sessions': {}, 'step': lambda self, now: [], 'receive': lambda self, *a: []})()
    assert bench.run(lambda: bench.flown(1))
    bench.run(limit=3.0)
    bench.start()
    bench.discover()
    assign(2)
    bench.run(limit=15.0)
    assert bench.completed(1) == ['cam']
    assert bench.completed(2) == []
    assert bench.run(lambda: 'lidar' in bench.completed(2), 300.0)


# a zone over the place where it stands

@BOTH
def test_it_does_not_take_off_into_a_zone_in_which_it_stands(kind):
    zone = ThreatZone.hemisphere('Z', center=(300.0, 0.0, 0.0), radius=60.0)
    bench = FlightBench(kind, tick=0.2, zones=(zone,), zones_known=True, configs={
        1: {'position': (300.0, 0.0, 0.0), 'home': (0.0, 0.0, 0.0)}}).discover()
    bench.assign(task_list('Z'))
    bench.run(limit=30.0)
    assert not bench.vehicles[1].flight.armed
    assert 'waits for zone Z to be removed: it covers its place' in bench.notes


# two vehicles with one system id at one address

@BOTH
@pytest.mark.parametrize(('place', 'ahead', 'lag'), [
    ((-400.0, -300.0, 0.0), 0, 0), ((-400.0, -300.0, 0.0), 0, 20),
    ((0.0, 15.0, 0.0), 50_000, 0), ((0.0, 15.0, 0.0), 50_000, 20)],
    ids=['far', 'far, frames late', 'near', 'near, frames late'])
def test_of_two_vehicles_with_one_system_id_none_is_armed(kind, place, ahead, lag):
    bench = FlightBench(kind)
    first, other = bench.vehicles[1], make_vehicle(kind, 1, position=place)
    codec, step, receive = Codec(1, 1), first.step, first.receive
    for _ in range(256 - lag):
        codec.pack(d.MAVLink_mission_item_reached_message(0))  # in a link before

    def down(messages):
        for m in messages:
            if hasattr(m, 'time_boot_ms'):
                m.time_boot_ms += ahead
            bench.line.send('down', 1, codec, m, bench.now)

    def step_both(now):
        down(other.step(now))
        return step(now)

    def receive_both(message, now):
        down(other.receive(message, now))
        return receive(message, now)

    first.step, first.receive = step_both, receive_both
    bench.discover()
    bench.run(limit=10.0)
    bench.assign(task_list('ABC'))
    bench.run(limit=60.0)
    assert not first.flight.armed
    assert not other.flight.armed
    assert bench.state().reason.startswith('it waits for a system id of its own')


def test_positions_of_a_fast_simulator_or_after_one_reset_are_of_one_vehicle():
    found = TwoVehicles()
    for n in range(100):
        found.receive((1500.0 * n, 0.0, 50.0), 100.0 * n, 0.2 * n)
    found.receive((0.0, 0.0, 50.0), 10_000.0, 20.0)
    found.receive((1.0, 0.0, 50.0), 10_000.2, 20.2)
    assert not found.found(20.2)
    for n in range(25):  # late messages of before a reboot
        found.receive((500.0 * (n % 2), 0.0, 50.0), 3.0 + 0.1 * n, 30.0 + 0.2 * n)
    assert not found.found(35.0)


def test_late_positions_are_of_one_vehicle():
    found = TwoVehicles()
    for n in range(200):  # of 2 s before, as on a second and slower way
        found.receive((20.0 * n, 0.0, 50.0), 1.0 * n, 1.0 * n)
        found.receive((20.0 * n - 40.0, 0.0, 50.0), n - 2.0, 1.0 * n, late=True)
        assert not found.found(1.0 * n)


def test_a_mission_of_px4_that_another_has_cleared_leads_to_its_hold_not_to_an_end_of_ours():
    """What it reports then is no refusal of an upload that was verified long before."""
    bench = flying('px4', configs={1: {'reports_mission_state': True}})
    bench.run(limit=8.0)
    for kind in ('HEARTBEAT', 'MISSION_ACK', 'MISSION_COUNT'):
        drop_messages(bench, 'down', kind, lambda m: hidden[0])
    hidden = [True]
    bench.from_station(d.MAVLink_mission_clear_all_message(1, 1))
    mission = bench.executor().telemetry.mission
    assert bench.run(lambda: mission.state == d.MISSION_STATE_NO_MISSION, 3.0)
    hidden[0] = False
    assert bench.run(lambda: bench.vehicles[1].flight.custom_mode == bench.executor().watch.mode,
                     3.0)
    assert status_is(bench, L)
