# SPDX-License-Identifier: Apache-2.0
"""Zones that come into the way of a vehicle that the bridge has sent home."""
import dataclasses

import pytest
from authority_bench import BOTH, COPTER, H, L, S, flying
from mission_bench import task_list

from uav_task_alloc.geometry.zones import inside
from uav_task_alloc.mavlink.autopilots import ModeFunction
from uav_task_alloc.model import ThreatZone

WAY = ThreatZone.cylinder('way', (120.0, 60.0), 25.0)
HOME = ThreatZone.cylinder('home', (0.0, 10.0), 25.0)
AROUND = ((240.0, 0.0, 50.0), (0.0, -40.0, 50.0))  # [m] ENU


def returning(kind, **policy):
    """On its way home, by a list without tasks."""
    bench = flying(kind, 'AEZ', **policy)
    body = bench.vehicles[1].flight.body
    assert bench.run(lambda: body.position[0] > 250.0, 100.0)
    bench.assign(task_list('', 2, returns=not policy))
    assert bench.run(lambda: bench.vehicles[1].mode.name == 'RETURN', 10.0)
    assert bench.run(lambda: body.position[0] < 230.0, 60.0)
    return bench


def holds_outside(bench, zone):
    body = bench.vehicles[1].flight.body
    assert not bench.run(lambda: inside(body.position, zone), 60.0)
    assert bench.executor().telemetry.mode is ModeFunction.HOLD
    assert bench.authority() is H
    assert f'zone {zone.id} has come into its way home: holds' in bench.notes


@BOTH
@pytest.mark.parametrize('zone', [WAY, HOME])
@pytest.mark.parametrize('policy', [{}, {'when_empty': 'return'}])
def test_a_return_is_ended_before_a_new_zone_and_goes_on_without_it(kind, zone, policy):
    bench = returning(kind, **policy)
    bench.set_policy(zones=(zone,), zones_known=True)
    holds_outside(bench, zone)
    assert any('waits for a path home: ' in note for note in bench.notes)
    bench.set_policy(zones=())
    assert bench.run(lambda: not bench.vehicles[1].flight.armed, 100.0)


@BOTH
def test_after_a_return_that_was_ended_a_way_around_the_zone_is_flown(kind):
    bench = returning(kind)
    body = bench.vehicles[1].flight.body
    bench.set_policy(zones=(WAY,), zones_known=True)
    bench.assign(dataclasses.replace(task_list('', 3, returns=True), end_via=AROUND))
    assert not bench.run(lambda: inside(body.position, WAY), 100.0)
    assert not bench.vehicles[1].flight.armed


@BOTH
def test_a_return_from_inside_of_a_new_zone_goes_on(kind):
    bench = returning(kind)
    x, y, _ = bench.vehicles[1].flight.body.position
    bench.set_policy(zones=(ThreatZone.cylinder('over', (x, y), 25.0),), zones_known=True)
    assert not bench.run(lambda: bench.vehicles[1].mode.name != 'RETURN', 10.0)


@BOTH
def test_a_landing_at_home_goes_on_below_a_new_zone(kind):
    bench = returning(kind)
    body = bench.vehicles[1].flight.body
    assert bench.run(lambda: body.position[0] < 1.0 and body.position[2] < 8.0, 100.0)
    above = dataclasses.replace(HOME, z_min=12.0, z_max=30.0)
    bench.set_policy(zones=(above,), zones_known=True)
    assert bench.run(lambda: not bench.vehicles[1].flight.armed, 30.0)
    assert not any('has come into its way home' in note for note in bench.notes)


@BOTH
@pytest.mark.parametrize('cause', ['battery', 'radio'])
def test_a_return_that_becomes_one_of_a_failsafe_is_not_ended_before_a_new_zone(kind, cause):
    bench = returning(kind)
    vehicle = bench.vehicles[1]
    vehicle.failsafe(cause, vehicle.flight.custom_mode)
    assert bench.run(lambda: bench.authority() is S, 3.0)
    bench.set_policy(zones=(WAY,), zones_known=True)
    sent = len(bench.sent)
    assert bench.run(lambda: not vehicle.flight.armed, 100.0)
    assert bench.commands(sent) == []


def test_the_return_of_a_pilot_is_not_ended_before_a_new_zone():
    bench = returning('ardupilot')
    bench.vehicles[1].rc_mode(COPTER.stick)
    assert bench.reaches(L)
    bench.vehicles[1].rc_mode(COPTER.rtl)
    bench.set_policy(zones=(WAY,), zones_known=True)
    sent = len(bench.sent)
    assert bench.run(lambda: not bench.vehicles[1].flight.armed, 100.0)
    assert bench.commands(sent) == []
