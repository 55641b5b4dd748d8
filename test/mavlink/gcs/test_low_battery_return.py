# SPDX-License-Identifier: Apache-2.0
"""A UAV that holds for a shared id returns on a low battery, where its way home is clear."""
import dataclasses
import math

import pytest
from authority_bench import flying_with_pilot
from flight_bench import FlightBench, flying
from mission_bench import drop, task_list
from test_battery_reports import battery
from test_operator_hold import is_held
from test_shared_id import SHARED, run_shared, share

from uav_task_alloc.mavlink.gcs.authority_state import AuthorityState
from uav_task_alloc.mavlink.gcs.energy_estimate import NominalEnergy
from uav_task_alloc.mavlink.gcs.operator_hold import HoldRequest
from uav_task_alloc.mavlink.gcs.status import UavMode
from uav_task_alloc.model import ThreatZone

BOTH = pytest.mark.parametrize('kind', ['ardupilot', 'px4'])


def set_battery(bench, value):
    bench.vehicles[1].flight.body.battery = value


def held_for_shared_id(kind, names='ABC'):
    """A UAV at rest some way from its home, while another node reports it."""
    bench = flying(kind, names)
    bench.run(limit=12.0)
    assert run_shared(bench, 60.0, lambda: is_held(bench))
    run_shared(bench, 5.0)
    return bench


def returns(bench):
    return bench.state().mode in (UavMode.RETURNING, UavMode.LANDING)


def is_left_alone(bench):
    sent = len(bench.line.sent('COMMAND_LONG'))
    run_shared(bench, 20.0)
    assert len(bench.line.sent('COMMAND_LONG')) == sent


@BOTH
def test_it_returns_on_a_low_battery_and_lands(kind):
    bench = held_for_shared_id(kind)
    run_shared(bench, 20.0)
    assert is_held(bench)
    set_battery(bench, 0.195)
    assert run_shared(bench, 10.0, lambda: returns(bench))
    assert run_shared(bench, 200.0, lambda: bench.state().mode is UavMode.STANDBY)
    assert math.dist(bench.state().position, bench.state().home) < 3.0
    assert [note for note in bench.notes if note.startswith('returns on a low battery')] == [
        f'returns on a low battery (19%), as it gets no list: shared id: {SHARED}']
    run_shared(bench, 30.0)
    assert bench.state().mode is UavMode.STANDBY


@BOTH
def test_a_refused_return_is_tried_again_and_logged_once(kind):
    bench = held_for_shared_id(kind)
    bench.line.tampers.append(lambda direction, m, now: [] if direction == 'up' and (
        m.get_type() == 'COMMAND_LONG' and now < end) else None)
    end = bench.now + 60.0
    set_battery(bench, 0.195)
    assert run_shared(bench, 120.0, lambda: returns(bench))
    assert bench.now > end
    assert len([note for note in bench.notes if note.startswith('returns on a low')]) == 1


@BOTH
def test_it_lands_where_its_id_is_its_own_again_on_the_way_home(kind):
    bench = held_for_shared_id(kind)
    set_battery(bench, 0.15)
    assert run_shared(bench, 10.0, lambda: returns(bench))
    share(bench, '')
    done = bench.completed()
    assert bench.run(lambda: bench.state().mode is UavMode.STANDBY, 200.0)
    bench.run(limit=30.0)
    assert bench.state().mode is UavMode.STANDBY
    assert bench.completed() == done


@BOTH
def test_it_returns_where_the_battery_has_only_the_way_home_above_what_is_kept(kind):
    bench = held_for_shared_id(kind)
    set_battery(bench, 0.5)
    way = math.dist(bench.state().position, bench.state().home)
    executor = bench.executor()
    executor.energy.nominal = NominalEnergy(full_range=4.0 * way)  # 1.2 ways above what is kept
    run_shared(bench, 10.0)
    assert is_held(bench)
    executor.energy.nominal = NominalEnergy(full_range=3.0 * way)  # 0.9 ways
    assert run_shared(bench, 10.0, lambda: returns(bench))


@BOTH
def test_it_stays_and_says_so_while_a_zone_is_across_its_way_home(kind):
    bench = held_for_shared_id(kind)
    x, y, _ = bench.state().position
    zone = ThreatZone.cylinder('z', (x / 2.0, y / 2.0), 10.0, 0.0, 200.0)
    executor = bench.executor()
    executor.policy = dataclasses.replace(bench.policy, zones=(zone,))
    set_battery(bench, 0.125)
    run_shared(bench, 20.0)
    assert is_held(bench)
    alarm = ('holds on a low battery, and zone z is across its path home: stays; expected a '
             'return by radio control')
    assert bench.state().reason == alarm
    assert [note for note in bench.notes if note.startswith('holds on a low')] == [
        f'{alarm} (12%)']
    executor.policy = bench.policy
    assert run_shared(bench, 10.0, lambda: returns(bench))
    assert executor.alarm == ''


@BOTH
def test_a_zone_that_comes_into_its_way_home_stops_it(kind):
    bench = held_for_shared_id(kind)
    set_battery(bench, 0.1)
    assert run_shared(bench, 10.0, lambda: returns(bench))
    x, y, _ = bench.state().position
    zone = ThreatZone.cylinder('z', (x / 2.0, y / 2.0), 10.0, 0.0, 200.0)
    bench.executor().policy = dataclasses.replace(bench.policy, zones=(zone,))
    assert run_shared(bench, 20.0, lambda: is_held(bench))
    run_shared(bench, 10.0)
    assert is_held(bench)


@BOTH
def test_one_that_an_operator_holds_too_stays_for_him(kind):
    bench = held_for_shared_id(kind)
    bench.executor().holds.request(HoldRequest('operator', True, 'wait'), bench.now)
    set_battery(bench, 0.1)
    run_shared(bench, 20.0)
    assert is_held(bench)
    assert 'it is held by operator: stays' in bench.state().reason


@BOTH
def test_a_hold_of_an_operator_alone_is_no_reason_to_return(kind):
    bench = flying(kind, 'ABC')
    bench.executor().holds.request(HoldRequest('operator', True, 'wait'), bench.now)
    set_battery(bench, 0.1)
    assert bench.run(lambda: is_held(bench), 60.0)
    bench.run(limit=20.0)
    assert is_held(bench)
    assert bench.executor().alarm == ''


@BOTH
def test_a_pilot_is_left_alone_on_a_low_battery(kind):
    bench = flying_with_pilot(kind)
    set_battery(bench, 0.1)
    is_left_alone(bench)


@BOTH
def test_a_pilot_who_takes_it_on_its_way_home_has_it(kind):
    bench = held_for_shared_id(kind)
    set_battery(bench, 0.1)
    assert run_shared(bench, 10.0, lambda: returns(bench))
    bench.vehicles[1].rc_mode({'ardupilot': 5, 'px4': 3 << 16}[kind])
    assert run_shared(bench, 10.0, lambda: bench.authority() is AuthorityState.LOST)
    is_left_alone(bench)


@BOTH
def test_a_charge_of_0_from_the_start_is_unknown(kind):
    bench = FlightBench(kind)
    bench.line.tampers.append(drop({'BATTERY_STATUS', 'SYS_STATUS'}, 10**6, 'down'))
    bench.discover()
    bench.assign(task_list('ABC'))
    assert bench.run(lambda: bench.started() == ['A'])
    bench.executor().telemetry.receive(battery(remaining=0), bench.now)
    assert bench.state().battery == 0.0
    run_shared(bench, 40.0)
    assert is_held(bench)
