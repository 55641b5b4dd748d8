# SPDX-License-Identifier: Apache-2.0
"""Holds of an operator on both simulated autopilots: before transfers, kept, ended, refused."""
import dataclasses
import math

import pytest
from authority_bench import flying_with_pilot
from findings_bench import drop_messages, listed
from flight_bench import FlightBench, flying, places
from mission_bench import task_list
from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.mavlink.gcs.authority_state import AuthorityState
from uav_task_alloc.mavlink.gcs.hold_store import HoldFileStore
from uav_task_alloc.mavlink.gcs.operator_hold import HoldRequest
from uav_task_alloc.mavlink.gcs.status import UavMode
from uav_task_alloc.model import ThreatZone

BOTH = pytest.mark.parametrize('kind', ['ardupilot', 'px4'])
HOLD = HoldRequest('operator', True, 'order o1 of ann')
GO_ON = HoldRequest('operator', False)


def hold(bench, request=HOLD, n=1):
    bench.ground_station.hold(f'uav_{n}', request, bench.now)


def is_held(bench):
    return bench.state().mode is UavMode.HOLD and math.hypot(*bench.state().velocity) < 0.2


@BOTH
def test_a_vehicle_holds_says_where_and_flies_on_from_there(kind):
    bench = flying(kind, 'ABC')
    bench.run(limit=1.0)
    hold(bench)
    assert bench.run(lambda: is_held(bench), 30.0)
    place, done = bench.state().position, bench.completed()
    bench.run(limit=120.0)
    assert math.dist(bench.state().position, place) < 3.0
    assert bench.completed() == done
    note, = [note for note in bench.notes if note.startswith('holds at (')]
    assert note.endswith('m from where it was ordered (operator: order o1 of ann)')
    assert bench.authority() is AuthorityState.HELD
    hold(bench, GO_ON)
    assert bench.run(lambda: bench.completed() == ['A', 'B', 'C'])
    assert places(bench) == ['A', 'B', 'C']


@BOTH
@pytest.mark.parametrize('source', ['operator', 'separation', 'shared id'])
def test_a_command_of_mission_mode_that_was_lost_is_not_sent_again_in_a_hold(kind, source):
    bench, lost = flying(kind, 'ABC'), [True]
    bench.run(limit=1.0)
    hold(bench)
    assert bench.run(lambda: is_held(bench), 30.0)
    place = bench.state().position
    drop_messages(bench, 'up', 'COMMAND_LONG', lambda m: (
        lost[0] and m.command == d.MAV_CMD_DO_SET_MODE))
    hold(bench, GO_ON)
    assert bench.run(lambda: bench.executor().sender.waits_for == 'mode mission', 20.0)
    sent = len(bench.line.sent('COMMAND_LONG'))
    lost[0] = False
    hold(bench, HoldRequest(source, True, 'once more'))
    bench.run(limit=20.0)
    assert len(bench.line.sent('COMMAND_LONG')) == sent
    assert math.dist(bench.state().position, place) < 3.0
    hold(bench, HoldRequest(source, False))
    assert bench.run(lambda: bench.completed() == ['A', 'B', 'C'])


@BOTH
def test_the_hold_is_sent_before_the_transfer_of_a_new_list(kind):
    bench = flying(kind, 'ABC')
    hold(bench)
    bench.assign(task_list('CAB', 2))
    assert bench.run(lambda: is_held(bench), 30.0)
    bench.run(limit=30.0)
    assert bench.onboard().verified()
    assert is_held(bench)
    hold(bench, GO_ON)
    assert bench.run(lambda: bench.completed() == ['C', 'A', 'B'])


@BOTH
def test_a_hold_during_a_replacement_does_not_return_home_after_30_s(kind):
    bench = flying(kind, 'ABC', delay=(0.05, 0.05))
    bench.assign(task_list('CAB', 2))
    bench.run(limit=0.3)
    hold(bench)
    bench.run(limit=90.0)
    assert is_held(bench)


@BOTH
def test_a_held_vehicle_on_the_ground_does_not_take_off(kind):
    bench = FlightBench(kind).discover()
    hold(bench)
    bench.assign(task_list('AB'))
    bench.run(limit=60.0)
    assert bench.started() == []
    assert not bench.executor().telemetry.airborne
    hold(bench, GO_ON)
    assert bench.run(lambda: bench.completed() == ['A', 'B'])


@BOTH
def test_a_hold_in_the_climb_waits_for_its_end(kind):
    bench = FlightBench(kind).discover()
    bench.assign(task_list('AB'))
    assert bench.run(lambda: bench.executor().telemetry.airborne)
    hold(bench)
    assert bench.run(lambda: is_held(bench), 60.0)
    assert bench.completed() == []
    assert bench.state().position[2] > 10.0


@BOTH
def test_without_authority_nothing_is_sent_and_the_reason_is_logged(kind):
    bench = flying_with_pilot(kind)
    before = len(bench.line.sent('COMMAND_LONG'))
    hold(bench)
    bench.run(limit=20.0)
    assert len(bench.line.sent('COMMAND_LONG')) == before
    assert any(note.startswith('hold is not sent: authority is LOST') for note in bench.notes)


@BOTH
def test_a_hold_outlives_a_restart_of_the_bridge(kind, tmp_path):
    bench = flying(kind, 'ABC')
    bench.ground_station._hold_store = HoldFileStore(str(tmp_path), print)
    hold(bench)
    assert bench.run(lambda: is_held(bench), 30.0)
    bench.start()
    bench.ground_station._hold_store = HoldFileStore(str(tmp_path), print)
    bench.discover()
    bench.assign(task_list('ABC', 2))
    bench.run(limit=60.0)
    assert is_held(bench)
    assert bench.executor().holds.reason == 'operator: order o1 of ann'
    hold(bench, GO_ON)
    assert HoldFileStore(str(tmp_path), print).load_hold('uav_1') == ''
    assert bench.run(lambda: bench.completed() == ['A', 'B', 'C'])


@BOTH
def test_a_separation_hold_ends_and_that_of_the_operator_stays(kind):
    bench = flying(kind, 'ABC')
    hold(bench, HoldRequest('separation', True, 'uav_2 passes'))
    assert bench.run(lambda: is_held(bench), 19.0)
    hold(bench)
    hold(bench, HoldRequest('separation', False))
    bench.run(limit=60.0)
    assert is_held(bench)
    hold(bench, GO_ON)
    assert bench.run(lambda: bench.completed() == ['A', 'B', 'C'])


@BOTH
def test_an_empty_list_that_returns_waits_for_the_end_of_a_hold(kind):
    bench = flying(kind, 'ABC')
    hold(bench)
    assert bench.run(lambda: is_held(bench), 30.0)
    bench.assign(task_list('', 2, returns=True))
    bench.run(limit=20.0)
    assert is_held(bench)
    hold(bench, GO_ON)
    assert bench.run(lambda: bench.state().mode is UavMode.RETURNING, 20.0)


@BOTH
def test_a_uav_whose_hold_file_cannot_be_used_is_held_until_it_is_let_go_on(kind, tmp_path):
    reports = []
    store = HoldFileStore(str(tmp_path), reports.append)
    store.save_hold('uav_1', 'order o1 of ann')
    assert store.load_hold('uav_1') == 'order o1 of ann'
    for body in ('{"uav_id": 3', '{"uav_id": "uav_2", "reason": "x"}', '[' * 4000):
        store.path('uav_1').write_text(body)
        assert store.load_hold('uav_1') == 'its saved hold cannot be read; ~/resume_uav ends this'
    assert len(reports) == 3
    assert all('uav_1 is held until' in text for text in reports)
    bench = flying(kind, 'ABC')
    bench.start()
    bench.ground_station._hold_store = store
    bench.discover()
    bench.assign(task_list('ABC', 2))
    assert bench.run(lambda: is_held(bench), 60.0)
    hold(bench, GO_ON)
    assert store.load_hold('uav_1') == ''
    assert bench.run(lambda: bench.completed() == ['A', 'B', 'C'])


def least_distance(bench, zone):
    """Records how near [m] to the centre of a zone the vehicle comes, in plan view."""
    least, vehicle = [math.inf], bench.vehicles[1]
    step = vehicle.step

    def stepped(now):
        least[0] = min(least[0], math.dist(vehicle.flight.body.position[:2], zone.center[:2]))
        return step(now)
    vehicle.step = stepped
    return least


def announce(bench, zone):
    bench.executor().policy = dataclasses.replace(bench.executor().policy, zones=(zone,))


@BOTH
def test_a_vehicle_holds_before_a_new_zone_until_it_has_the_list_around_it(kind):
    bench, zone = FlightBench(kind).discover(), ThreatZone.cylinder('farm', (0.0, 250.0), 20.0)
    least = least_distance(bench, zone)
    bench.assign(listed(1, A=(0.0, 400.0)))
    assert bench.run(lambda: bench.state().position[1] > 60.0)
    stalled = [True]
    drop_messages(bench, 'up', 'MISSION_ITEM_INT', lambda m: stalled[0])
    announce(bench, zone)
    bench.assign(listed(2, B=(80.0, 250.0), A=(0.0, 400.0)))
    assert bench.run(lambda: is_held(bench), 60.0)
    bench.run(limit=20.0)
    assert is_held(bench)
    if kind == 'px4':  # ArduPilot holds for the upload at once
        assert bench.executor().holds.reason.startswith('zone: farm is ahead on the way')
    stalled[0] = False
    assert bench.run(lambda: bench.completed() == ['B', 'A'], 200.0)
    assert least[0] > zone.radius


@BOTH
def test_a_list_that_leads_through_a_zone_is_flown_once_it_is_on_board(kind):
    bench, zone = FlightBench(kind).discover(), ThreatZone.cylinder('farm', (0.0, 250.0), 20.0)
    announce(bench, zone)
    bench.assign(listed(1, A=(0.0, 400.0)))
    assert bench.run(lambda: bench.completed() == ['A'], 200.0)


def test_px4_does_not_take_a_list_to_whose_first_task_a_zone_is_now_between():
    bench, zone = FlightBench('px4').discover(), ThreatZone.cylinder('farm', (100.0, 150.0), 30.0)
    least = least_distance(bench, zone)
    bench.assign(listed(1, A=(300.0, 0.0)))
    announce(bench, zone)
    assert bench.run(lambda: bench.state().position[0] > 20.0)
    drop_messages(bench, 'up', 'MISSION_ITEM_INT',
                  lambda m: bench.vehicles[1].flight.body.position[0] < 180.0)
    bench.assign(listed(2, T=(0.0, 300.0), U=(0.0, 400.0)))
    assert bench.run(lambda: bench.completed() == ['T', 'U'], 200.0)
    assert least[0] > zone.radius


def refused_arming(kind):
    """A vehicle on the ground whose arming is refused, and what ends that."""
    bench = FlightBench(kind).discover()
    flight = bench.vehicles[1].flight
    arm, flight.arm = flight.arm, lambda force=False: False
    bench.assign(task_list('AB'))
    assert bench.run(lambda: bench.executor().sender.waits_for.startswith('arm'), 30.0)
    return bench, lambda: setattr(flight, 'arm', arm)


def stays_on_the_ground(bench):
    return not bench.run(lambda: bench.executor().telemetry.airborne or (
        bench.vehicles[1].flight.armed), 30.0) and bench.authority() is AuthorityState.HELD


@BOTH
@pytest.mark.parametrize('source', ['operator', 'separation'])
def test_one_whose_arming_is_refused_does_not_take_off_while_it_is_held(kind, source):
    bench, allow = refused_arming(kind)
    hold(bench, HoldRequest(source, True, 'order o1'))
    bench.run(limit=5.0)
    allow()
    assert stays_on_the_ground(bench)
    hold(bench, HoldRequest(source, False))
    assert bench.run(lambda: bench.completed() == ['A', 'B'])


@BOTH
def test_one_that_is_armed_but_has_not_taken_off_is_disarmed_by_a_hold(kind):
    bench, lost = FlightBench(kind).discover(), [True]
    drop_messages(bench, 'up', 'COMMAND_LONG', lambda m: lost[0] and (
        m.command == d.MAV_CMD_NAV_TAKEOFF))
    bench.assign(task_list('AB'))
    assert bench.run(lambda: bench.executor().telemetry.armed, 30.0)
    hold(bench)
    bench.run(limit=3.0)
    lost[0] = False
    assert stays_on_the_ground(bench)
    hold(bench, GO_ON)
    assert bench.run(lambda: bench.completed() == ['A', 'B'])


@BOTH
def test_one_whose_arming_is_refused_is_not_armed_under_a_new_zone(kind):
    bench, allow = refused_arming(kind)
    policy = bench.executor().policy
    bench.executor().policy = dataclasses.replace(policy, zones=(
        ThreatZone.cylinder('farm', (0.0, 10.0), 30.0),))
    bench.run(limit=5.0)
    allow()
    assert stays_on_the_ground(bench)
    assert bench.executor().sender.waits_for.startswith('zone farm to be removed')
    bench.executor().policy = policy
    assert bench.run(lambda: bench.completed() == ['A', 'B'])
