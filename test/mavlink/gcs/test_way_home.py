# SPDX-License-Identifier: Apache-2.0
"""A list that returns home while a zone is in the way of the vehicle's own return."""
import dataclasses

import pytest
from findings_bench import BOTH, MODES, FindingsBench
from mission_bench import task_list

from uav_task_alloc.geometry.zones import inside
from uav_task_alloc.mavlink.fence.shapes import FenceShape
from uav_task_alloc.mavlink.gcs.vehicle_diagnostics import diagnostics_of
from uav_task_alloc.mavlink.mission.items import MissionStop, TaskList
from uav_task_alloc.model import Task, ThreatZone

OUT = (300.0, 0.0, 40.0)  # [m] of the only task
HOME = (0.0, 10.0, 0.0)  # [m]
HEIGHT = {'ardupilot': (('RTL_ALT', 8000.0),), 'px4': (('RTL_RETURN_ALT', 80.0),)}
WALL = ThreatZone.polygon('Wall', [(140, -80), (160, -80), (160, 80), (140, 80)])
ABOVE = ThreatZone.polygon('Above', [(140, -80), (160, -80), (160, 80), (140, 80)], z_min=60.0)
BELOW = ThreatZone.polygon('Below', [(140, -80), (160, -80), (160, 80), (140, 80)], z_max=60.0)
DOME = ThreatZone.hemisphere('Dome', (150.0, 0.0, 0.0), 70.0)


def made(kind, *zones, **policy):
    bench = FindingsBench(kind, configs={1: {'parameters': HEIGHT[kind]}}, cruise_altitude=40.0,
                          zones=zones, zones_known=True, **policy).discover()
    bench.run(limit=5.0)
    return bench


def around():
    return (150.0, 120.0, 40.0)


def listed(*end_via, revision=1):
    """Out around the zone, and home by the vehicle's own return after `end_via`."""
    return TaskList(revision, (MissionStop(Task('t', OUT), (around(),)),), True, tuple(end_via))


def fly(bench, limit=200.0):
    """Fly until it has landed, or for a time; returns the zones it was inside of."""
    body, zones = bench.vehicles[1].flight.body, bench.executor().policy.zones
    entered = set()

    def over():
        entered.update(zone.id for zone in zones if inside(body.position, zone))
        return bool(bench.completed()) and bench.vehicles[1].flight.landed

    bench.run(over, limit)
    return entered


def place(bench):
    return tuple(round(value, -1) for value in bench.vehicles[1].flight.body.position)


@BOTH
@pytest.mark.parametrize('zones', [(ABOVE,), (WALL,)])
def test_a_list_that_returns_through_a_zone_ends_otherwise(kind, zones):
    bench = made(kind, *zones)
    bench.assign(listed())
    assert fly(bench) == set()
    assert bench.completed() == ['t']
    assert MODES[kind]['RTL'] not in [event.mode for event in bench.truth[1]]
    if zones == (ABOVE,):  # the height of the task is free
        assert bench.vehicles[1].flight.landed
        assert place(bench) == HOME
    else:
        assert place(bench) == OUT
        row = diagnostics_of(bench.ground_station.sessions[1], bench.now)
        assert row.level > 0
        assert 'Wall' in row.summary


@BOTH
def test_a_return_above_a_zone_stays_the_vehicles_own(kind):
    bench = made(kind, BELOW)
    bench.assign(listed())
    assert fly(bench) == set()
    assert bench.vehicles[1].flight.landed
    assert bench.vehicles[1].flight.body.position[:2] == pytest.approx(HOME[:2], abs=3.0)


@BOTH
def test_a_return_at_a_height_where_a_dome_is_narrow_stays_the_vehicles_own(kind):
    narrow = dataclasses.replace(DOME, center=(150.0, 40.0, 0.0), radius=85.0)
    bench = made(kind, narrow)  # 29 m wide at 80 m, 75 m at 40 m
    bench.assign(listed(revision=1))
    bench.executor().onboard.list.remaining()
    assert bench.executor().onboard.remaining().returns
    assert bench.executor().onboard.remaining().end_via == ()


@BOTH
def test_after_a_detour_the_last_way_home_counts(kind):
    bench = made(kind, ABOVE)
    bench.assign(listed(around()))  # from there the way home is clear
    assert bench.executor().onboard.remaining().end_via == (around(),)
    assert fly(bench) == set()
    assert bench.vehicles[1].flight.landed


@BOTH
def test_a_zone_that_appears_in_flight_changes_the_end_of_the_list(kind):
    bench = made(kind)
    bench.assign(listed())
    assert bench.run(lambda: bench.vehicles[1].flight.body.position[0] > 100.0)
    bench.executor().policy = dataclasses.replace(bench.executor().policy, zones=(ABOVE,))
    assert fly(bench) == set()
    assert bench.vehicles[1].flight.landed
    assert bench.completed() == ['t']


@BOTH
def test_an_empty_list_that_returns_goes_home_below_the_zone(kind):
    bench = made(kind, ABOVE)
    bench.assign(listed())
    assert bench.run(lambda: bench.vehicles[1].flight.body.position[0] > 280.0)
    bench.assign(task_list('', 2, returns=True))
    assert fly(bench) == set()
    assert bench.run(lambda: bench.vehicles[1].flight.landed)
    assert place(bench) == HOME


@BOTH
def test_the_next_list_without_tasks_does_not_stop_the_way_home(kind):
    bench = made(kind, ABOVE)
    bench.assign(listed())
    assert bench.run(lambda: bench.completed() == ['t'])
    assert bench.run(lambda: bench.vehicles[1].flight.body.position[0] < 250.0)
    bench.assign(task_list('', 2, returns=True))
    assert fly(bench) == set()
    bench.run(lambda: bench.vehicles[1].flight.landed)
    assert place(bench) == HOME


@BOTH
def test_without_zones_nothing_is_changed(kind):
    bench = made(kind)
    bench.assign(listed())
    assert bench.executor().onboard.remaining().end_via == ()
    assert bench.executor().onboard.list.way_home.blocked == ''


def test_a_vehicle_that_flies_around_its_fence_returns_by_itself():
    bench = FindingsBench('ardupilot', configs={1: {'parameters': (
        *HEIGHT['ardupilot'], ('OA_TYPE', 2.0), ('FENCE_ENABLE', 1.0))}}, zones=(WALL,),
        zones_known=True, fences='warn').discover()
    assert bench.run(lambda: bench.executor().fence.parameters.plans_around)
    bench.assign(listed())
    assert not bench.executor().onboard.remaining().returns  # nothing is on board yet
    assert bench.run(lambda: bench.executor().fence.verified)
    bench.run(limit=5.0)
    assert bench.executor().onboard.remaining().returns
    assert bench.executor().onboard.remaining().end_via == ()


def area(*corners):
    """A `fence_area` of the bridge; corners [m], counter-clockwise."""
    return FenceShape('', corners=corners, inclusion=True)


# the return from OUT crosses the notch, the detour by `around()` does not
NOTCHED = area((-50.0, -90.0), (130.0, -90.0), (130.0, 90.0), (170.0, 90.0), (170.0, -90.0),
               (400.0, -90.0), (400.0, 200.0), (-50.0, 200.0))


@BOTH
@pytest.mark.parametrize('fences', ['off', 'warn'])
def test_no_way_of_the_bridge_leaves_the_fence_area(kind, fences):
    bench = made(kind, fence_area=NOTCHED, fences=fences)
    bench.assign(listed())
    outside = bench.executor().policy.no_fly_zones
    positions = []
    bench.run(lambda: positions.append(bench.vehicles[1].flight.body.position), 200.0)
    assert bench.completed() == ['t']
    assert [p for p in positions if any(inside(p, zone) for zone in outside)] == []
    assert place(bench) == OUT
    row = diagnostics_of(bench.ground_station.sessions[1], bench.now)
    assert 'zone outside of fence_area' in row.summary


@BOTH
def test_a_vehicle_whose_home_is_outside_of_the_fence_area_does_not_take_off(kind):
    bench = made(kind, fence_area=area((50.0, -90.0), (400.0, -90.0), (400.0, 200.0),
                                       (50.0, 200.0)))
    bench.assign(listed())
    bench.run(limit=60.0)
    assert not bench.vehicles[1].flight.armed
    assert bench.executor().sender.waits_for == (
        'another fence_area: the home is outside of it')
