# SPDX-License-Identifier: Apache-2.0
"""Rally points: chosen so that returns cross no zone, and kept on board like a fence."""
from dataclasses import replace

import pytest
from authority_bench import MODES
from fence_bench import FenceBench, FenceState
from mission_bench import ORIGIN, task_list
from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.mavlink.fence.rally import choose_rally
from uav_task_alloc.mavlink.fence.shapes import FenceShape
from uav_task_alloc.mavlink.gcs.authority_state import AuthorityState
from uav_task_alloc.model import ThreatZone
from uav_task_alloc.nodes.conversions.bridge_parameters import to_rally_points
from uav_task_alloc.sim.config import FlightMode
from uav_task_alloc.sim.stored_item import StoredItem

BOTH = pytest.mark.parametrize('kind', ['ardupilot', 'px4'])
RALLY = d.MAV_MISSION_TYPE_RALLY
EAST, NORTH = to_rally_points(['47.397742,8.5509', '47.4022,8.545594,40'], ORIGIN, 30.0)


def crosses_wall(a, b):
    """A wall at x = 250 m for y > -100 m."""
    return (a[0] - 250.0) * (b[0] - 250.0) <= 0.0 and max(a[1], b[1]) > -100.0


def test_entries_are_places_with_a_height_of_their_own_or_the_default():
    assert (EAST.height, NORTH.height) == (30.0, 40.0)
    assert EAST.position[0] == pytest.approx(400.0, abs=2.0)
    for entry in ('47.4', '47.4,8.5,1,2', 'a,b', '91,0', '47,8,-3', '47,8,x'):
        with pytest.raises(InvalidValue, match='rally_points'):
            to_rally_points([entry], ORIGIN, 30.0)
    with pytest.raises(InvalidValue, match='each place once'):
        to_rally_points(['47.4,8.5', '47.4,8.5,20'], ORIGIN, 30.0)


def test_a_point_whose_straight_ways_cross_a_zone_is_left_out():
    path = [(0.0, 0.0, 50.0), (240.0, 0.0, 50.0), (240.0, 300.0, 50.0)]
    assert choose_rally([EAST, NORTH], path, (0.0, 0.0, 0.0), crosses_wall) == (NORTH,)
    assert choose_rally([EAST, NORTH], path, (0.0, 0.0, 0.0), lambda a, b: False) == (EAST, NORTH)
    assert choose_rally([EAST], path, (0.0, 0.0, 0.0), lambda a, b: True) == ()


def rally_bench(kind, **kwargs):
    return FenceBench(kind, fences='off', rally=(EAST, NORTH), **kwargs)


@BOTH
def test_rally_points_are_verified_on_board_and_a_failsafe_returns_to_the_nearest(kind):
    bench = rally_bench(kind, zones=()).discover()
    bench.assign(task_list('E'))
    assert bench.run(lambda: bench.fence.rally.transfer.state is FenceState.VERIFIED)
    held = bench.vehicle.mission.stores[RALLY]
    assert [(item.x, item.y, item.z) for item in held] == [
        (473977420, 85509000, 30.0), (474022000, 85455940, 40.0)]
    assert not bench.sent('MISSION_COUNT')
    flight = bench.vehicle.flight
    assert bench.run(lambda: flight.body.position[0] > 320.0)
    bench.vehicle.failsafe('battery', flight.custom_modes[FlightMode.RETURN])
    assert bench.run(lambda: flight.landed)
    assert abs(flight.body.position[0] - EAST.position[0]) < 3.0


@BOTH
def test_a_rally_point_in_a_zone_is_taken_from_the_vehicle(kind):
    bench = rally_bench(kind, zones=()).discover()
    state = bench.fence.rally
    assert bench.run(lambda: state.transfer.state is FenceState.VERIFIED)
    bench.set_zones(ThreatZone.cylinder('z', EAST.position, 30.0))
    assert bench.run(lambda: len(bench.vehicle.mission.stores[RALLY]) == 1
                     and state.transfer.state is FenceState.VERIFIED)
    assert EAST.text in bench.fence.rally_text


@BOTH
def test_a_rally_point_outside_of_the_fence_area_is_not_used(kind):
    area = FenceShape('', corners=((-100.0, -100.0), (300.0, -100.0), (300.0, 600.0),
                                   (-100.0, 600.0)), inclusion=True)
    bench = FenceBench(kind, zones=(), rally=(EAST, NORTH), fence_area=area).settle()
    assert bench.run(lambda: bench.fence.rally.transfer.state is FenceState.VERIFIED)
    assert bench.fence.rally.chosen == (NORTH,)
    assert f'not used: {EAST.text}' in bench.fence.rally_text
    assert len(bench.vehicle.mission.stores[RALLY]) == 1


@BOTH
def test_rally_points_of_another_station_stay(kind):
    theirs = StoredItem(3, d.MAV_CMD_NAV_RALLY_POINT, 0.0, 0.0, 0.0, 0.0, 473900000, 85400000,
                        50.0)
    bench = rally_bench(kind)
    bench.vehicle.mission.stores[RALLY][:] = [theirs]
    bench.discover()
    assert bench.run(lambda: bench.fence.rally.transfer.state is FenceState.FOREIGN)
    bench.run(limit=70.0)
    assert bench.vehicle.mission.stores[RALLY] == [theirs]


@BOTH
def test_fence_and_rally_points_follow_each_other(kind):
    bench = rally_bench(kind)
    bench.policy = replace(bench.policy, fences='warn')
    bench.start()
    bench.settle()
    assert bench.run(lambda: bench.fence.rally.transfer.state is FenceState.VERIFIED)
    assert bench.fence.verified
    assert not bench.both_busy


@BOTH
def test_rally_points_are_not_uploaded_while_a_pilot_flies(kind):
    bench = rally_bench(kind, zones=(), takeoff=False)
    bench.vehicle.rc_mode(MODES[kind].stick)
    bench.discover()
    assert bench.run(lambda: bench.fence.rally.transfer.state is FenceState.VERIFIED, 60.0)
    assert bench.vehicle.rc_arm(True)
    bench.vehicle.rc_stick((0.0, 0.0, 3.0))
    bench.run(limit=6.0)
    assert bench.executor().telemetry.airborne
    assert bench.authority() is AuthorityState.NONE
    stored = list(bench.vehicle.mission.stores[RALLY])
    bench.executor().policy = replace(bench.executor().policy, rally=(EAST,))
    bench.run(limit=20.0)
    assert bench.vehicle.mission.stores[RALLY] == stored
