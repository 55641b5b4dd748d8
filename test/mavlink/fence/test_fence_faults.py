# SPDX-License-Identifier: Apache-2.0
"""Fences on both simulated autopilots, one fault at a time."""
import math
import os
from dataclasses import replace

import pytest
from authority_bench import MODES
from fence_bench import ENABLED, FENCE, FIELD, TOWER, FenceBench, FenceState
from mission_bench import ack, task_list
from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.mavlink.fence.shapes import CIRCLES, FenceShape
from uav_task_alloc.mavlink.gcs.authority_state import AuthorityState
from uav_task_alloc.model import ThreatZone
from uav_task_alloc.sim.stored_item import StoredItem

BOTH = pytest.mark.parametrize('kind', ['ardupilot', 'px4'])


@BOTH
def test_zones_are_uploaded_as_exclusions_and_verified(kind):
    bench = FenceBench(kind).settle()
    assert len(bench.held) == bench.fence.fence.points
    assert {shape.zone for shape in bench.fence.fence.shapes} == {'tower', 'field'}
    assert len(bench.vehicle.fence.shapes) == 2
    assert not bench.both_busy


def hexagons(count):
    """Zones of 8 points each with their margin, away from all tasks."""
    return tuple(ThreatZone.polygon(f'z{k}', [
        (600.0 + 100.0 * k + 30.0 * math.cos(a), 600.0 + 30.0 * math.sin(a))
        for a in (math.pi / 3 * i for i in range(6))], margin=5.0) for k in range(count))


@BOTH
def test_fault_01_a_full_store_gets_simpler_polygons_then_says_what_it_leaves_out(kind):
    bench = FenceBench(kind, zones=hexagons(6), config={
        'fence_capacity': 20, 'parameters': ENABLED[kind]}).settle()
    assert len(bench.held) <= 20
    assert len(bench.fence.fence.shapes) + len(bench.fence.fence.no_space) == 6
    assert bool(bench.fence.fence.no_space) is ('no space on board' in bench.fence.left_out)
    assert len(bench.fence.fence.shapes) >= 4
    assert bench.fence.transfer.budget <= 20


@BOTH
def test_fault_02_half_an_upload_is_completed_and_is_no_foreign_fence(kind):
    bench = FenceBench(kind, delay=(0.2, 0.2)).discover()
    assert bench.run(lambda: len(bench.sent('MISSION_ITEM_INT')) == 3)
    bench.line.cut = True
    bench.run(limit=15.0)
    bench.line.cut = False
    bench.settle()
    assert not any('FOREIGN' in note for note in bench.notes)


def test_fault_02_a_store_that_holds_half_of_ours_is_ours():
    bench = FenceBench('ardupilot').settle()
    bench.store_by_another(*bench.held[:1])
    bench.vehicle.reboot(bench.now)
    assert bench.run(lambda: len(bench.held) == bench.fence.fence.points)
    bench.settle()


@BOTH
def test_fault_03_a_lost_ack_is_replaced_by_the_readback(kind):
    bench = FenceBench(kind).discover()
    bench.line.tampers.append(
        lambda direction, m, now: [] if m.get_type() == 'MISSION_ACK' and direction == 'down'
        and m.mission_type == FENCE else None)
    bench.settle()
    assert len(bench.sent('MISSION_COUNT')) == 1


@BOTH
def test_fault_04_of_two_vehicles_each_has_the_fence_of_its_own_plan(kind):
    bench = FenceBench(kind, kind).settle()
    assert bench.run(lambda: bench.executor(2).fence.verified)
    for n in (1, 2):
        held = bench.vehicles[n].mission.stores[FENCE]
        assert len(held) == bench.executor(n).fence.fence.points
        assert bench.vehicles[n].config.system_id == n


def test_fault_05_a_refusal_while_armed_is_reported_and_retried():
    bench = FenceBench('ardupilot', zones=()).settle()
    refuse = [True]

    def denied(direction, m, now):
        if m.get_type() == 'MISSION_COUNT' and direction == 'up' and (
                m.mission_type == FENCE and refuse[0]):
            bench.from_vehicle(ack(d.MAV_MISSION_DENIED, mission_type=FENCE))
            return []
        return None
    bench.line.tampers.append(denied)
    bench.set_zones(TOWER)
    bench.settle(FenceState.REFUSED)
    assert 'refuses' in bench.fence.warning
    refuse[0] = False
    bench.settle()


@BOTH
def test_fault_06_a_zone_that_moves_during_the_upload_ends_up_where_it_is(kind):
    bench = FenceBench(kind, delay=(0.2, 0.2)).discover()
    assert bench.run(lambda: len(bench.sent('MISSION_ITEM_INT')) == 3)
    moved = replace(TOWER, center=(300.0, 350.0, 0.0))
    bench.set_zones(moved, FIELD)
    assert bench.run(lambda: bench.fence.verified and any(
        shape.center == (300.0, 350.0) for shape in bench.fence.fence.shapes))
    assert bench.run(lambda: bench.fence.verified and any(
        math.dist(shape.corners[0], (300.0, 350.0)) < 0.1 for shape in bench.vehicle.fence.shapes))


@BOTH
def test_fault_07_a_zone_around_the_uav_waits_until_it_is_clear(kind):
    bench = FenceBench(kind, zones=()).settle()
    bench.assign(task_list('ABC'))
    assert bench.run(lambda: bench.started()[-1:] == ['B'])
    x, y, _ = bench.vehicle.flight.body.position
    here = ThreatZone.cylinder('here', (x, y), 20.0)
    bench.set_zones(here, FIELD)
    assert bench.run(lambda: 'here' in bench.fence.left_out)
    assert 'here' in bench.fence.warning
    assert bench.run(lambda: not bench.fence.left_out and bench.fence.verified)
    assert len(bench.vehicle.fence.shapes) == 2
    assert not any(e.name == 'failsafe' for e in bench.truth[1])


def test_fault_07_a_fence_that_px4_stores_but_does_not_enforce_is_not_verified():
    bench = FenceBench('px4').settle()
    bench.from_vehicle(d.MAVLink_statustext_message(
        2, b"Geofence invalid, doesn't contain current vehicle position"))
    assert bench.fence.state is FenceState.REFUSED
    assert "doesn't contain" in bench.fence.warning
    bench.vehicle.fence.shapes.clear()
    bench.settle()
    assert bench.sent('MISSION_CLEAR_ALL')
    assert len(bench.vehicle.fence.shapes) == 2


@BOTH
def test_fault_08_a_foreign_fence_is_never_replaced_nor_cleared(kind):
    theirs = StoredItem(0, d.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION, 5000.0, 0.0, 0.0, 0.0,
                        473977420, 85455940, 0.0)
    bench = FenceBench(kind)
    bench.store_by_another(theirs)
    bench.settle(FenceState.FOREIGN)
    assert 'another station' in bench.fence.warning
    bench.set_zones(TOWER)
    bench.run(limit=100.0)
    bench.set_zones()
    bench.run(limit=100.0)
    assert bench.held == [theirs]
    assert not bench.sent('MISSION_COUNT')
    assert not bench.sent('MISSION_CLEAR_ALL')
    bench.store_by_another()
    bench.set_zones(TOWER)
    bench.settle()


@BOTH
def test_fault_08_a_fence_that_another_station_puts_in_place_of_ours_is_detected(kind):
    bench = FenceBench(kind).settle()
    bench.store_by_another(StoredItem(0, d.MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION, 9.0, 0.0, 0.0,
                                      0.0, 473900000, 85400000, 0.0))
    bench.settle(FenceState.FOREIGN)


@BOTH
def test_fault_09_a_readback_that_differs_is_uploaded_again(kind):
    bench = FenceBench(kind).discover()
    altered = [2]

    def alter(direction, m, now):
        if direction == 'down' and m.get_type() == 'MISSION_ITEM_INT' and altered[0] and (
                m.command in CIRCLES):
            altered[0] -= 1
            m.param1 = math.floor(m.param1)  # a smaller circle
            return [(0.0, m)]
        return None
    bench.line.tampers.append(alter)
    bench.settle()
    assert not altered[0]
    assert len(bench.sent('MISSION_COUNT')) >= 2


@BOTH
def test_fault_10_a_mission_and_a_fence_are_never_transferred_at_once(kind):
    bench = FenceBench(kind, delay=(0.1, 0.1)).discover()
    for revision in range(1, 12):
        bench.set_zones(replace(TOWER, radius=20.0 + revision), FIELD)
        bench.assign(task_list('ABCDE'[revision % 3:], revision))
        bench.run(limit=3.0)
    assert bench.run(lambda: bench.fence.verified and bench.onboard().verified(), 200.0)
    assert not bench.both_busy


@BOTH
def test_fault_11_a_vehicle_without_fences_is_said_to_have_none(kind):
    bench = FenceBench(kind, config={'fence_capacity': 0})
    if kind == 'px4':  # it answers the list of an unknown type with no items
        bench.settle(FenceState.UNSUPPORTED)
    else:
        bench.settle(FenceState.UNSUPPORTED)
    assert 'UNSUPPORTED' in bench.fence.warning
    bench.assign(task_list('A'))
    assert bench.run(lambda: bench.completed() == ['A'])


@BOTH
def test_fault_12_after_a_reboot_the_fence_is_read_before_it_counts(kind):
    bench = FenceBench(kind).settle()
    counts = len(bench.sent('MISSION_COUNT'))
    bench.vehicle.reboot(bench.now)
    reads = len(bench.sent('MISSION_REQUEST_LIST'))
    assert bench.run(lambda: len(bench.sent('MISSION_REQUEST_LIST')) > reads)
    bench.settle()
    assert len(bench.sent('MISSION_COUNT')) == counts


@BOTH
def test_a_zone_that_is_removed_in_flight_leaves_the_store(kind):
    bench = FenceBench(kind).settle()
    bench.assign(task_list('ABC'))
    assert bench.run(lambda: bench.started() == ['A'])
    bench.set_zones(FIELD)
    assert bench.run(lambda: len(bench.vehicle.fence.shapes) == 1 and bench.fence.verified)
    bench.set_zones()
    assert bench.run(lambda: not bench.held and bench.fence.verified)
    assert bench.sent('MISSION_CLEAR_ALL')


@BOTH
def test_off_sends_nothing_about_fences(kind):
    bench = FenceBench(kind, fences='off').discover()
    bench.assign(task_list('A'))
    assert bench.run(lambda: bench.completed() == ['A'])
    assert bench.fence.state is FenceState.OFF
    assert not [m for _, way, m in bench.line.log if way == 'up' and (
        (m.get_type().startswith('PARAM') and not m.param_id.startswith('RTL_'))
        or getattr(m, 'mission_type', 0))]


def test_require_waits_for_a_verified_fence_that_is_enabled():
    bench = FenceBench('ardupilot', fences='require', config={'parameters': ()}).discover()
    bench.assign(task_list('A'))
    assert bench.run(lambda: 'enabled' in bench.executor().sender.waits_for)
    assert not bench.vehicle.flight.armed
    assert 'waits for its fence to be enabled: OFF' in bench.state().reason
    bench.from_station(d.MAVLink_param_set_message(1, 1, b'FENCE_ENABLE', 1.0,
                                                   d.MAV_PARAM_TYPE_INT8))
    assert bench.run(lambda: bench.completed() == ['A'])
    assert not [m for _, way, m in bench.line.log if way == 'up' and m.get_type() == 'PARAM_SET']


AREA = FenceShape('', corners=((-100.0, -100.0), (400.0, -100.0), (400.0, 60.0),
                               (-100.0, 60.0)), inclusion=True)


@BOTH
def test_require_takes_no_vehicle_off_whose_list_leaves_the_area_on_board(kind):
    bench = FenceBench(kind, zones=(), fences='require', fence_area=AREA).settle()
    bench.assign(task_list('A'))  # 40 m outside
    assert bench.run(lambda: 'fence_area' in bench.executor().sender.waits_for)
    bench.run(limit=30.0)
    assert not bench.vehicle.flight.armed
    assert 'will be breached: fence_area' in bench.fence.warning
    assert any('will be breached: fence_area' in note for note in bench.notes)


@BOTH
def test_a_list_that_leaves_the_area_on_board_in_flight_is_a_warning(kind):
    area = replace(AREA, corners=((-100.0, -100.0), (400.0, -100.0), (400.0, 150.0),
                                  (-100.0, 150.0)))
    bench = FenceBench(kind, zones=(), fence_area=area).settle()
    bench.assign(task_list('AB'))
    assert bench.run(lambda: bench.started() == ['A'])
    assert not bench.fence.warning
    bench.assign(task_list('ABF', revision=2))
    assert bench.run(lambda: 'will be breached: fence_area' in bench.fence.warning, 5.0)


@BOTH
def test_a_low_zone_that_the_plan_flies_over_is_left_out_and_said(kind):
    low = ThreatZone.cylinder('low', (0.0, 300.0), 20.0, z_max=20.0)
    high = ThreatZone.cylinder('high', (250.0, 50.0), 20.0, z_max=300.0)
    bench = FenceBench(kind, zones=(low, high)).settle()
    assert [shape.zone for shape in bench.fence.fence.shapes] == ['high']
    assert 'ends at 20 m' in bench.fence.left_out
    assert not bench.fence.warning


@BOTH
def test_a_list_through_a_fence_that_no_longer_counts_waits_for_its_change(kind):
    bench = FenceBench(kind, zones=(
        ThreatZone.cylinder('site', (0.0, 100.0), 40.0),), delay=(0.1, 0.1)).settle()
    bench.set_zones()
    bench.assign(task_list('A'))
    assert bench.run(lambda: bench.completed() == ['A'])
    assert not any(e.name == 'failsafe' for e in bench.truth[1])


def test_a_restarted_bridge_knows_its_own_fence_by_its_files(tmp_path):
    bench = FenceBench('px4', folder=str(tmp_path)).settle()
    bench.policy = replace(bench.policy, zones=(TOWER,))
    bench.start()
    bench.settle()
    assert len(bench.held) == 1
    next(tmp_path.glob('fence_*')).write_text('{')
    bench.policy = replace(bench.policy, zones=(FIELD,))
    bench.start()
    bench.settle(FenceState.FOREIGN)
    assert any('counts as that of another station' in note for note in bench.notes)


@pytest.mark.parametrize('text', [
    '{"uav_id": "uav_1", "items": [[5003, 3.5, 4e3977000, 85456001]]}', '[' * 60000,
    '{"uav_id": "uav_1", "items": [[1e999, 3.5, 1, 2]]}', 'pipe'])
def test_a_fence_file_that_cannot_be_used_is_reported_and_the_uav_is_bridged(tmp_path, text):
    bench = FenceBench('px4', folder=str(tmp_path)).settle()
    path = next(tmp_path.glob('fence_*'))
    if text == 'pipe':
        path.unlink()
        os.mkfifo(path)
    else:
        path.write_text(text)
    bench.start()
    bench.settle()
    assert any('counts as that of another station' in note for note in bench.notes)


@pytest.mark.parametrize('value', [math.nan, math.inf])
@pytest.mark.parametrize('name', ['FENCE_TYPE', 'FENCE_ACTION'])
def test_a_fence_parameter_that_is_no_number_is_not_known(name, value):
    bench = FenceBench('ardupilot', config={'parameters': (
        *ENABLED['ardupilot'], (name, value))}, fences='require').discover()
    bench.run(lambda: bench.fence.verified, 60.0)
    bench.assign(task_list('A'))
    bench.run(limit=60.0)
    assert not bench.ground_station.sessions[1].fault
    assert bench.fence.parameters.enabled is (None if name == 'FENCE_TYPE' else True)


# a flight of a pilot, which the bridge was not granted

def with_pilot(kind):
    """On the ground in a stick mode, with its fence; the bridge was never granted anything."""
    bench = FenceBench(kind, takeoff=False)
    bench.vehicle.rc_mode(MODES[kind].stick)
    return bench.settle()


def flown_by_pilot(bench):
    """A pilot arms and climbs by hand."""
    assert bench.vehicle.rc_arm(True)
    bench.vehicle.rc_stick((0.0, 0.0, 3.0))
    bench.run(limit=6.0)
    assert bench.executor().telemetry.airborne
    assert bench.authority() is AuthorityState.NONE


@BOTH
def test_a_new_zone_is_not_uploaded_while_a_pilot_flies_but_after_the_landing(kind):
    bench = with_pilot(kind)
    flown_by_pilot(bench)
    stored, start = list(bench.held), len(bench.sent('MISSION_COUNT'))
    bench.set_zones(TOWER)
    bench.run(limit=20.0)
    assert bench.held == stored
    assert len(bench.sent('MISSION_COUNT')) == start
    bench.vehicle.rc_stick((0.0, 0.0, -3.0))
    assert bench.run(lambda: bench.vehicle.flight.landed, 60.0)
    bench.vehicle.rc_stick(None)
    assert bench.run(lambda: len(bench.vehicle.fence.shapes) == 1, 60.0)


@BOTH
def test_an_upload_of_a_fence_ends_once_a_pilot_flies(kind):
    bench = with_pilot(kind)
    lost = [True]
    bench.line.tampers.append(lambda direction, m, now: [] if lost[0] and direction == 'up' and (
        m.get_type() == 'MISSION_ITEM_INT') and m.mission_type == FENCE else None)
    bench.set_zones(TOWER)
    assert bench.run(bench.state_is(FenceState.UPLOADING), 20.0)
    flown_by_pilot(bench)
    lost.clear()
    lost.append(False)
    start = len(bench.sent('MISSION_ITEM_INT'))
    bench.run(limit=20.0)
    assert len(bench.sent('MISSION_ITEM_INT')) == start
    assert bench.fence.state is not FenceState.UPLOADING
