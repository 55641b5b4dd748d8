# SPDX-License-Identifier: Apache-2.0
"""Fence stores of simulated vehicles: limits and refusals of each autopilot, and breaches."""
import struct

import pytest
from pymavlink.dialects.v20 import ardupilotmega as d
from vehicle_bench import ORIGIN, Bench, of

from uav_task_alloc.geometry.frames import to_geodetic
from uav_task_alloc.sim.config import FlightMode

BOTH = pytest.mark.parametrize('kind', ['ardupilot', 'px4'])
FENCE = d.MAV_MISSION_TYPE_FENCE
POLYGON = d.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_EXCLUSION
CIRCLE = d.MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION


def point(x, y, command=POLYGON, p1=3.0):
    latitude, longitude, _ = to_geodetic(ORIGIN, (x, y, 0.0))
    return d.MAVLink_mission_item_int_message(
        1, 1, 0, d.MAV_FRAME_GLOBAL, command, 0, 1, p1, 0.0, 0.0, 0.0, round(latitude * 1e7),
        round(longitude * 1e7), 0.0, FENCE)


def triangle(x, y, size=20.0):
    return [point(x, y), point(x + size, y), point(x, y + size)]


def circle(x, y, radius):
    return point(x, y, CIRCLE, radius)


def upload(bench, items):
    """The last answer to an upload of a fence."""
    answers = bench.send(d.MAVLink_mission_count_message(1, 1, len(items), FENCE))
    while answers and answers[-1].get_type().startswith('MISSION_REQUEST'):
        assert answers[-1].mission_type == FENCE
        item = items[answers[-1].seq]
        item.seq = answers[-1].seq
        answers = of(bench.send(item), 'MISSION_REQUEST', 'MISSION_REQUEST_INT', 'MISSION_ACK')
    return next(m for m in answers if m.get_type() == 'MISSION_ACK')


def stored(bench):
    return bench.vehicle.mission.stores[FENCE]


@BOTH
def test_a_fence_is_stored_enforced_and_read_back(kind):
    bench = Bench(kind)
    ack = upload(bench, [*triangle(100.0, 100.0), circle(300.0, 0.0, 25.5)])
    assert (ack.type, ack.mission_type) == (d.MAV_MISSION_ACCEPTED, FENCE)
    assert len(bench.vehicle.fence.shapes) == 2
    count, = of(bench.send(d.MAVLink_mission_request_list_message(1, 1, FENCE)), 'MISSION_COUNT')
    assert (count.count, count.mission_type) == (4, FENCE)
    items = [of(bench.send(d.MAVLink_mission_request_int_message(1, 1, seq, FENCE)),
                'MISSION_ITEM_INT')[0] for seq in range(4)]
    assert [(item.command, item.param1, item.mission_type) for item in items] == [
        (POLYGON, 3.0, FENCE)] * 3 + [(CIRCLE, 25.5, FENCE)]
    assert not bench.vehicle.mission.items


@BOTH
@pytest.mark.parametrize('capacity', [None, 5])
def test_a_fence_of_more_points_than_the_store_is_refused(kind, capacity):
    bench = Bench(kind, fence_capacity=capacity)
    limit = capacity or {'ardupilot': 70, 'px4': 64}[kind]
    assert upload(bench, [circle(100.0 * k, 100.0, 5.0) for k in range(limit + 1)]).type == (
        d.MAV_MISSION_NO_SPACE)
    texts = [m.text for m in of(bench.received, 'STATUSTEXT')]
    assert (f'Only {limit} items are supported' in texts) is (kind == 'ardupilot')
    assert upload(bench, [circle(100.0 * k, 100.0, 5.0) for k in range(limit)]).type == (
        d.MAV_MISSION_ACCEPTED)


@BOTH
def test_a_vehicle_without_a_fence_store_refuses_the_type(kind):
    bench = Bench(kind, fence_capacity=0)
    assert upload(bench, [circle(100.0, 0.0, 5.0)]).type == d.MAV_MISSION_UNSUPPORTED


def test_ardupilot_clears_a_fence_by_clear_all_only():
    bench = Bench('ardupilot')
    upload(bench, [circle(100.0, 0.0, 5.0)])
    bench.send(d.MAVLink_mission_count_message(1, 1, 0, FENCE))
    assert len(stored(bench)) == 1
    bench.send(d.MAVLink_mission_clear_all_message(1, 1, FENCE))
    assert not stored(bench)


def test_ardupilot_refuses_a_polygon_that_is_cut_off():
    bench = Bench('ardupilot')
    upload(bench, [circle(100.0, 0.0, 5.0)])
    assert upload(bench, triangle(50.0, 50.0)[:2]).type == d.MAV_MISSION_ERROR
    assert len(stored(bench)) == 1


def test_px4_has_one_transfer_at_a_time():
    bench = Bench('px4')
    bench.send(d.MAVLink_mission_count_message(1, 1, 3, FENCE))
    bench.send(triangle(100.0, 100.0)[0])
    ack, = of(bench.send(d.MAVLink_mission_count_message(1, 1, 2, 0)), 'MISSION_ACK')
    assert ack.type == d.MAV_MISSION_ERROR


def test_ardupilot_has_a_transfer_for_each_type():
    bench = Bench('ardupilot')
    bench.send(d.MAVLink_mission_count_message(1, 1, 3, FENCE))
    answer, = of(bench.send(d.MAVLink_mission_count_message(1, 1, 2, 0)), 'MISSION_REQUEST')
    assert answer.mission_type == 0


def test_px4_does_not_enforce_polygons_after_a_circle():
    bench = Bench('px4')
    upload(bench, [circle(300.0, 0.0, 20.0), *triangle(100.0, 100.0)])
    assert len(bench.vehicle.fence.shapes) == 1
    upload(bench, [*triangle(100.0, 100.0), circle(300.0, 0.0, 20.0)])
    assert len(bench.vehicle.fence.shapes) == 2


def test_px4_stores_a_fence_around_home_but_does_not_enforce_it():
    bench = Bench('px4')
    assert upload(bench, [circle(0.0, 0.0, 20.0)]).type == d.MAV_MISSION_ACCEPTED
    assert stored(bench)
    assert not bench.vehicle.fence.shapes
    bench.pass_time(0.1)
    assert any("doesn't contain Home" in m.text for m in of(bench.received, 'STATUSTEXT'))


@BOTH
@pytest.mark.parametrize('enabled', [True, False])
def test_a_breach_of_an_enabled_fence_is_a_failsafe(kind, enabled):
    parameters = {'ardupilot': (('FENCE_ENABLE', float(enabled)),),
                  'px4': (('GF_ACTION', 3.0 * enabled),)}[kind]
    bench = Bench(kind, parameters=parameters)
    upload(bench, [circle(60.0, 0.0, 20.0)])
    flight = bench.flight
    flight.set_mode(FlightMode.GUIDED if kind == 'ardupilot' else FlightMode.HOLD)
    assert flight.arm()
    flight.takeoff(30.0)
    bench.until(lambda: flight.body.position[2] > 29.0)
    flight.body.position = 55.0, 0.0, 30.0
    bench.pass_time(0.3)
    assert (flight.mode is FlightMode.RETURN) is enabled
    assert bench.vehicle.fence.breached is enabled


def test_px4_sends_whole_numbers_by_their_bytes_and_ardupilot_as_numbers():
    for kind, name, value in (('px4', b'GF_ACTION', 2), ('ardupilot', b'FENCE_TYPE', 7)):
        message, = of(Bench(kind).send(d.MAVLink_param_request_read_message(1, 1, name, -1)),
                      'PARAM_VALUE')
        raw = struct.pack('<f', message.param_value)
        assert (struct.unpack('<i', raw)[0] if kind == 'px4' else message.param_value) == value
