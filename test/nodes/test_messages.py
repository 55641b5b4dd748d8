# SPDX-License-Identifier: Apache-2.0
"""Messages become model values and back; a bad field is refused by its name."""
import dataclasses
import math

import pytest
from builtin_interfaces.msg import Time
from uav_task_alloc_msgs import msg as m

from uav_task_alloc.allocator.list_records import ListStop, UavList
from uav_task_alloc.allocator.records import Proposal, TaskState
from uav_task_alloc.allocator.status import TaskStatus
from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.geometry.frames import Origin
from uav_task_alloc.model import Leg, Task, ThreatZone
from uav_task_alloc.nodes.conversions import (
    allocation_messages,
    bridge_messages,
    messages,
    orders,
)
from uav_task_alloc.record import message_records
from uav_task_alloc.separation.monitor import AlertAction, SeparationAlert, SeparationHold
from uav_task_alloc.zone_codec import decode_zone_message

ORIGIN = Origin(47.397742, 8.545594, 488.0)


def task_message(**changed):
    base = messages.from_task(Task('t1', (10.0, 20.0, 30.0), value=2.0, service_time=3.5))
    for name, value in changed.items():
        setattr(base, name, value)
    return base


def test_a_task_survives_its_message():
    task = Task('t1', (10.0, 20.0, 30.0), 2.0, 3.5, frozenset({'camera'}), frozenset({'u1'}), 4.0)
    assert messages.to_task(messages.from_task(task), ORIGIN) == task


@pytest.mark.parametrize('epoch', [0.0, 1_800_000_000.0])
def test_windows_release_and_payload_survive_a_message(epoch):
    task = Task('t1', (1.0, 2.0, 3.0), earliest=epoch + 60.5, latest=epoch + 90.25,
                release=epoch + 30.0, payload=1.5)
    assert messages.to_task(messages.from_task(task), ORIGIN) == task
    open_ended = Task('t1', (1.0, 2.0, 3.0), latest=epoch + 90.25)
    assert messages.to_task(messages.from_task(open_ended), ORIGIN) == open_ended


def test_zero_times_and_an_unknown_payload_are_none():
    task = messages.to_task(task_message(payload=math.nan), ORIGIN)
    assert (task.earliest, task.latest, task.release, task.payload) == (
        -math.inf, math.inf, 0.0, 0.0)


def time(seconds):
    return messages.to_stamp(seconds)


def test_nan_acceptance_radius_is_unknown():
    assert messages.to_task(task_message(acceptance_radius=math.nan), ORIGIN
                            ).acceptance_radius is None


def test_a_wgs84_task_is_placed_by_the_origin():
    there = task_message(frame=m.Task.WGS84, latitude=47.397742, longitude=8.545594,
                         altitude=50.0)
    assert messages.to_task(there, ORIGIN).position == pytest.approx((0.0, 0.0, 50.0), abs=1e-6)
    north = task_message(frame=m.Task.WGS84, latitude=47.406742, longitude=8.545594,
                         altitude=50.0)
    x, y, _ = messages.to_task(north, ORIGIN).position
    assert (x, y) == pytest.approx((0.0, 1000.8), abs=1.0)


@pytest.mark.parametrize(('changed', 'text'), [
    ({'task_id': 'a b'}, "task_id = 'a b': expected a ROS name"),
    ({'task_id': ''}, "task_id = '': expected a ROS name"),
    ({'task_id': '7up'}, "task_id = '7up': expected a ROS name"),
    ({'task_id': 'a__b'}, "task_id = 'a__b': expected a ROS name .letters, digits, single _ and"),
    ({'task_id': 'a' * 201}, 'no digit first; at most 200 characters'),
    ({'allowed_uavs': ['no body']}, "task t1: allowed_uavs = 'no body': expected a ROS name"),
    ({'required_capabilities': ['']}, 'task t1: required_capabilities'),
    ({'value': -1.0}, 'task t1: value = -1.0'),
    ({'frame': 9}, r'task t1: frame = 9: expected LOCAL \(0\) or WGS84 \(1\)'),
    ({'frame': 1, 'latitude': math.nan}, 'task t1: latitude = nan'),
    ({'frame': 1, 'longitude': 200.0}, 'task t1: longitude = 200.0'),
    ({'acceptance_radius': -2.0}, 'task t1: acceptance_radius = -2.0'),
    ({'service_time': messages.to_duration(-2.0)}, 'task t1: service_time = -2.0'),
    ({'earliest': time(60.0), 'latest': time(59.5)},
     "task t1: latest = '59.5 s': expected at least earliest = 60.0 s"),
    ({'earliest': time(1.8e9), 'latest': time(1.8e9 - 90.0)},
     "task t1: latest = '2027-01-15 07:58:30 UTC': expected at least earliest = "
     '2027-01-15 08:00:00 UTC'),
    ({'release': time(60.0), 'latest': time(50.0)},
     "task t1: latest = '50.0 s': expected at least release = 60.0 s"),
    ({'earliest': time(-1.0)}, "task t1: earliest = '-1 s and 0 ns': expected a time"),
    ({'payload': -1.0}, r'task t1: payload = -1.0: expected a number in \[0, 1e\+06\]'),
    ({'payload': math.inf}, 'task t1: payload = inf'),
])
def test_a_bad_task_is_refused_by_the_name_of_its_field(changed, text):
    with pytest.raises(InvalidValue, match=text):
        messages.to_task(task_message(**changed), ORIGIN)


@pytest.mark.parametrize(('changed', 'text'), [
    ({'uav_id': 'a b'}, "uav_id = 'a b': expected a ROS name"),
    ({'battery': -1.0}, 'uav u1: battery = -1.0'),
    ({'mode': 99}, 'uav u1: mode = 99'),
    ({'mission_state': 77}, 'uav u1: mission_state = 77'),
    ({'authority': 99}, 'uav u1: authority = 99'),
    ({'range_remaining': -5.0}, 'uav u1: range'),
    ({'cruise_speed': -5.0}, 'uav u1: cruise_speed'),
    ({'endurance': -5.0}, 'uav u1: endurance = -5.0'),
    ({'payload_capacity': 2e6}, 'uav u1: payload_capacity = 2000000.0'),
    ({'turnaround': -1.0}, 'uav u1: turnaround = -1.0'),
    ({'cruise_speed': 1e-40}, 'uav u1: cruise_speed = 1e-40: expected a number in'),
    ({'list_revision': 2**32 - 1}, 'uav u1: list_revision = 4294967295'),
    ({'list_revision': 2**31}, 'uav u1: list_revision = 2147483648'),
])
def test_a_bad_state_is_refused_by_the_name_of_its_field(changed, text):
    state = m.UavState(uav_id='u1', battery=math.nan, range_remaining=math.nan,
                       cruise_speed=math.nan, available=True)
    assert messages.to_report(state).range is None
    for name, value in changed.items():
        setattr(state, name, value)
    with pytest.raises(InvalidValue, match=text):
        messages.to_report(state)


def test_zero_and_nan_limits_of_a_uav_are_unknown_and_others_are_taken():
    report = messages.to_report(m.UavState(uav_id='u1', endurance=600.0, climb_speed=math.nan,
                                           full_range=5000.0, turnaround=60.0))
    assert (report.endurance, report.climb_speed, report.descent_speed, report.payload_capacity,
            report.full_range, report.turnaround) == (600.0, None, None, None, 5000.0, 60.0)


def test_an_expected_start_later_than_a_message_can_hold_is_not_known():
    for seconds, sec in ((1e42, 0), (2.0**31, 0), (2.0**31 - 1.0, 2**31 - 1), (0.0, 0)):
        status = TaskStatus('t1', TaskState.ASSIGNED, 'u1', '', 1.0, seconds)
        assert allocation_messages.from_task_status(status).expected.sec == sec


def test_the_last_time_of_a_message_survives():
    last = m.Task(task_id='t1', value=1.0, earliest=Time(sec=2**31 - 1, nanosec=999_999_999))
    assert messages.from_task(messages.to_task(last, ORIGIN)).earliest == last.earliest


@pytest.mark.parametrize('zone', [
    ThreatZone.hemisphere('z1', (1.0, 2.0, 3.0), 80.0, margin=5.0),
    ThreatZone.cylinder('z1', (1.0, 2.0), 80.0, 0.0, 120.0),
    ThreatZone.cylinder('z1', (1.0, 2.0), 80.0),
    ThreatZone.polygon('z1', [(0.0, 0.0), (10.0, 0.0), (0.0, 10.0)], 0.0, 50.0, margin=2.0),
])
def test_a_zone_survives_its_message(zone):
    assert decode_zone_message(messages.from_zone(zone)) == zone


def test_a_bad_zone_is_refused_by_the_name_of_its_field():
    bad = messages.from_zone(ThreatZone.hemisphere('z1', (0.0, 0.0, 0.0), 80.0))
    bad.shape = 7
    with pytest.raises(InvalidValue, match='zone z1: shape = 7'):
        decode_zone_message(bad)
    bad.shape, bad.radius = 0, math.nan
    with pytest.raises(InvalidValue, match='zone z1: radius = nan'):
        decode_zone_message(bad)


@pytest.mark.parametrize('seconds', [0.0, 1.5, -1.5, 1_800_000_000.123456, 0.9999999999])
def test_times_survive_a_message(seconds):
    assert messages.from_stamp(messages.to_stamp(seconds)) == pytest.approx(seconds, abs=1e-6)
    assert messages.from_stamp(messages.to_duration(min(seconds, 1e6))) == pytest.approx(
        min(seconds, 1e6), abs=1e-6)


def test_a_planned_task_contains_its_leg():
    msg = messages.planned_task(ListStop(Task('t1', (1.0, 2.0, 3.0)),
                                         Leg(((0.5, 0.5, 0.5),), 4.0), 2.5))
    assert (msg.leg_distance, msg.via[0].x, msg.eta.sec, msg.eta.nanosec) == (
        4.0, 0.5, 2, 500_000_000)
    served = messages.planned_task(ListStop(
        Task('t1', (1.0, 2.0, 3.0), service_time=4.0), Leg((), 4.0), 2.5, wait=1.5))
    assert (served.wait.sec, served.finish.sec, served.trip) == (1, 8, 0)


def test_a_task_without_a_radius_gets_that_of_the_parameter():
    own = Task('t1', (1.0, 2.0, 3.0), acceptance_radius=7.0)
    tasks = [messages.planned_task(ListStop(t, Leg((), 1.0), 0.0))
             for t in (own, Task('t2', (1.0, 2.0, 3.0)))]
    for default, expected in ((0.0, [7.0, None]), (4.0, [7.0, 4.0])):
        made = bridge_messages.to_list(m.TaskList(uav_id='u1', tasks=tasks), 'u1', ORIGIN, default)
        assert [stop.task.acceptance_radius for stop in made.stops] == expected


def test_a_bad_zone_of_a_message_stays_as_it_was_and_the_others_are_taken():
    a, b = (ThreatZone.cylinder(name, (0.0, 0.0), 10.0) for name in 'ab')
    first, trouble = bridge_messages.to_zones(messages.from_zones([a], 0.0), ())
    assert (first, trouble) == ((a,), '')
    array = messages.from_zones([a, b], 0.0)
    array.zones[0].radius = -1.0
    zones, trouble = bridge_messages.to_zones(array, first)
    assert set(zones) == {a, b}
    assert 'zone a: radius = -1.0' in trouble
    assert bridge_messages.to_zones(messages.from_zones([], 0.0), zones) == ((), '')
    with pytest.raises(InvalidValue, match='zones: number'):
        bridge_messages.to_zones(m.ThreatZoneArray(zones=[m.ThreatZone()] * 1001), zones)


def test_a_uav_in_standby_is_on_the_ground():
    assert [messages.to_report(m.UavState(uav_id='a', mode=mode)).standby for mode in
            (m.UavState.STANDBY, m.UavState.UNKNOWN, m.UavState.HOLD)] == [True, False, False]


def test_an_alert_and_a_hold_of_the_monitor_become_messages():
    alert = SeparationAlert(('u1', 'u2'), 3.0, 1.5, 7.25, AlertAction.HOLD, 'u1', 'why', 100.5)
    msg = orders.from_separation_alert(alert)
    assert (list(msg.uavs), msg.horizontal, msg.vertical) == (['u1', 'u2'], 3.0, 1.5)
    assert (msg.action, msg.holder, msg.reason) == (m.SeparationAlert.HOLD, 'u1', 'why')
    assert message_records.separation_record(msg)['until'] == 7.25
    over = orders.from_separation_alert(dataclasses.replace(
        alert, horizontal=math.inf, vertical=math.inf, action=AlertAction.RELEASE))
    assert message_records.separation_record(over)['horizontal'] is None
    hold = orders.from_separation_hold(SeparationHold('u1', True, 100.5, 160.5, 'why'))
    assert (hold.source, orders.hold_expiry(hold, 101.0)) == (m.UavHold.SEPARATION, 160.5)
    assert orders.to_hold_request(hold, 'u1').source == 'separation'


def test_the_lists_of_a_proposal_count_from_its_stamp():
    task = Task('t1', (10.0, 0.0, 50.0), value=2.0)
    # a list that was never published has no stamp, a changed one that of the list in force
    new = UavList('u1', 0, (ListStop(task, Leg((), 10.0), 3.0),), distance=10.0)
    message = orders.from_proposal(Proposal(4, 3, (new,), 'ADD t1', 90.0, 120.0, False, ()))
    assert message.plan.header.stamp == Time(sec=90)
    assert [each.header.stamp for each in message.plan.lists] == [Time(sec=90)]
    assert (message.plan.revision, message.plan.value, message.plan.distance) == (4, 2.0, 10.0)


def test_modes_and_authority_are_known_by_their_names():
    state = m.UavState(uav_id='u1', mode=m.UavState.LANDING, authority=m.UavState.LOST,
                       mission_state=m.UavState.FOREIGN, hold_radius=math.nan,
                       return_height=15.0, takeoff_height=math.nan)
    report = messages.to_report(state)
    assert (report.mode, report.authority, report.foreign) == ('LANDING', 'LOST', True)
    assert report.hold_radius == 0.0
    assert (report.return_height, report.takeoff_height) == (15.0, None)
    state.hold_radius = -1.0
    with pytest.raises(InvalidValue, match='hold_radius = -1'):
        messages.to_report(state)
