# SPDX-License-Identifier: Apache-2.0
"""Which autopilot is which, and what its mission store is given."""
import dataclasses
import math

import pytest
from mission_bench import ORIGIN, task_list
from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.mavlink import autopilots as profiles
from uav_task_alloc.mavlink.autopilots import ModeFunction, profile_of
from uav_task_alloc.mavlink.mission.item import alike
from uav_task_alloc.mavlink.mission.items import mission_items
from uav_task_alloc.mavlink.mission.peer import Peer
from uav_task_alloc.sim.stored_item import StoredItem, stored_by_ardupilot

ALL = pytest.mark.parametrize('profile', [
    profiles.ARDUPILOT, profiles.ARDUPLANE, profiles.PX4, profiles.PX4_PLANE, profiles.GENERIC])


def heartbeat(autopilot, kind=d.MAV_TYPE_QUADROTOR):
    return d.MAVLink_heartbeat_message(kind, autopilot, 0, 0, 4, 3)


@pytest.mark.parametrize(('autopilot', 'kind', 'profile'), [
    (d.MAV_AUTOPILOT_ARDUPILOTMEGA, d.MAV_TYPE_QUADROTOR, profiles.ARDUPILOT),
    (d.MAV_AUTOPILOT_ARDUPILOTMEGA, d.MAV_TYPE_FIXED_WING, profiles.ARDUPLANE),
    (d.MAV_AUTOPILOT_PX4, d.MAV_TYPE_HEXAROTOR, profiles.PX4),
    (d.MAV_AUTOPILOT_PX4, d.MAV_TYPE_FIXED_WING, profiles.PX4_PLANE),
    (d.MAV_AUTOPILOT_PX4, d.MAV_TYPE_VTOL_TILTROTOR, profiles.PX4_VTOL),
    (d.MAV_AUTOPILOT_GENERIC, d.MAV_TYPE_QUADROTOR, profiles.GENERIC)])
def test_the_profile_is_found_from_the_heartbeat(autopilot, kind, profile):
    assert profile_of(heartbeat(autopilot, kind)) is profile


def test_a_profile_that_is_set_wins_over_the_heartbeat():
    assert profile_of(heartbeat(d.MAV_AUTOPILOT_GENERIC), 'px4') is profiles.PX4


@ALL
@pytest.mark.parametrize('service', [0.0, 2.5])
def test_fault_26_no_nan_on_anything_but_the_yaw_of_a_waypoint(profile, service):
    for item in mission_items(task_list('ABC', service=service, returns=True), profile.rules,
                              ORIGIN):
        nans = [n for n, value in enumerate(item.params) if math.isnan(value)]
        assert not nans or (
            item.command == d.MAV_CMD_NAV_WAYPOINT and nans == [3] and profile.atomic)


@ALL
def test_a_service_is_a_hold_on_a_copter_and_a_loiter_on_a_plane(profile):
    item = mission_items(task_list('A', service=2.5), profile.rules, ORIGIN)[0]
    assert item.command == (
        d.MAV_CMD_NAV_LOITER_TIME if profile.rules.loiters else d.MAV_CMD_NAV_WAYPOINT)
    assert item.params[0] == (3.0 if profile.rules.whole_seconds else 2.5)


def test_a_plane_flies_through_a_task_without_service():
    item = mission_items(task_list('A'), profiles.ARDUPLANE.rules, ORIGIN)[0]
    assert (item.command, item.params[0]) == (d.MAV_CMD_NAV_WAYPOINT, 0.0)


@ALL
def test_the_return_is_sent_in_the_frame_that_the_store_takes(profile):
    items = mission_items(task_list('A', returns=True), profile.rules, ORIGIN)
    assert items[-1].command == d.MAV_CMD_NAV_RETURN_TO_LAUNCH
    assert items[-1].frame == (3 if profile.name == 'ardupilot' else 2)


@pytest.mark.parametrize('profile', [profiles.ARDUPILOT, profiles.ARDUPLANE])
def test_what_ardupilot_keeps_of_a_mission_is_alike(profile):
    tasks = dataclasses.replace(task_list('AB', service=2.5, returns=True),
                                end_via=((3.0, 4.0, 60.0),))
    for item in mission_items(tasks, profile.rules, ORIGIN, (3.0, 4.0, 1.0)):
        kept = stored_by_ardupilot(StoredItem(
            item.frame, item.command, *item.params, item.x, item.y, item.z))
        held = dataclasses.replace(item, frame=kept.frame, x=kept.x, y=kept.y, z=kept.z,
                                   params=(kept.p1, kept.p2, kept.p3, kept.p4))
        assert alike(item, held), item
        turned = dataclasses.replace(held, params=tuple(-value for value in held.params))
        assert item.command == d.MAV_CMD_NAV_RETURN_TO_LAUNCH or not any(
            held.params) or not alike(item, turned)


@pytest.mark.parametrize('profile', [
    profiles.ARDUPILOT, profiles.PX4, profiles.ARDUPLANE, profiles.PX4_PLANE, profiles.PX4_VTOL,
    profiles.GENERIC], ids=lambda each: f'{each.name}-{each.rules.loiters}')
def test_only_a_multicopter_lands_below_the_end_of_its_way_home(profile):
    tasks = dataclasses.replace(task_list('A', returns=True), end_via=((3.0, 4.0, 60.0),))
    lands = {name: mission_items(tasks, profile.rules, ORIGIN, home)[-1] for name, home in (
        ('below', (3.0, 4.0, 1.0)), ('beside', (3.0, 6.0, 1.0)), ('unknown', None))}
    land = lands['below']
    copter = profile in (profiles.ARDUPILOT, profiles.PX4)
    assert (land.command == d.MAV_CMD_NAV_LAND) is copter
    if copter:  # at the vehicle's own home height, in degrees of the point above
        above = mission_items(tasks, profile.rules, ORIGIN)[-2]
        assert (land.frame, land.z) == (d.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT, 0.0)
        assert (land.x, land.y) == (above.x, above.y)
    assert {lands['beside'].command, lands['unknown'].command} == {d.MAV_CMD_NAV_RETURN_TO_LAUNCH}


@ALL
@pytest.mark.parametrize('function', [
    ModeFunction.MISSION, ModeFunction.HOLD, ModeFunction.RETURN])
def test_every_profile_can_fly_its_mission_hold_and_return(profile, function):
    message = profile.mode_command(Peer(1), function)
    assert message.target_system == 1
    if function in profile.set_mode:
        assert message.command == d.MAV_CMD_DO_SET_MODE
        assert profile.mode_function(profile.set_mode[function]) is function


def test_a_px4_copter_gets_an_acceptance_radius_where_the_task_has_none():
    for profile, radius in ((profiles.PX4, 2.0), (profiles.PX4_PLANE, 0.0),
                            (profiles.ARDUPILOT, 0.0)):
        tasks = task_list('A', via={'A': [(50.0, 50.0, 50.0)]})
        items = mission_items(tasks, profile.rules, ORIGIN)
        assert [item.params[1] for item in items] == [radius, radius]
        assert [item.radius for item in items] == [radius, radius]
