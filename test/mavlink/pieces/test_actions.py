# SPDX-License-Identifier: Apache-2.0
"""Each named action on both simulated autopilots: what is stored, done, and refused."""
import dataclasses
import math
from pathlib import Path

import pytest
from flight_bench import FlightBench
from mission_bench import ORIGIN, PROFILES
from piece_bench import list_of, payload, photos, piece, strip
from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.actions import ACTIONS, Action
from uav_task_alloc.errors import MissionError
from uav_task_alloc.mavlink.action_commands import action_table, compass
from uav_task_alloc.mavlink.autopilots import ARDUPLANE, PX4_PLANE
from uav_task_alloc.mavlink.mission.items import mission_items
from uav_task_alloc.model import Task

BOTH = pytest.mark.parametrize('kind', ['ardupilot', 'px4'])
HERE = (0.0, 80.0, 40.0)


def flown(kind, *tasks, **kwargs):
    bench = FlightBench(kind, **kwargs).discover()
    bench.assign(list_of(*tasks))
    assert bench.run(lambda: len(bench.completed()) + len(bench.failed()) == len(tasks), 300.0)
    bench.run(limit=3.0)
    return bench


def at_point(*actions, **fields):
    return Task('P', HERE, actions=actions, **fields)


@BOTH
@pytest.mark.parametrize(('action', 'done'), [
    (Action('gimbal', {'pitch': -math.pi / 2, 'yaw': math.pi / 4}), [('gimbal', '-90.0 45.0')]),
    (Action('roi', {'x': 50.0, 'y': 80.0, 'z': 0.0}),
     [('roi on', '50.0 80.0 0.0'), ('roi off', '')]),
    (Action('gripper', {'release': 1}), [('gripper', 'release')]),
    (Action('gripper', {'release': 0}), [('gripper', 'grab')]),
    (Action('video'), [('video on', ''), ('video off', '')]),
    (Action('trigger', {'distance': 500.0}), [('trigger', '500'), ('trigger', '0')]),
    (Action('speed', {'speed': 4.0}), [('speed', '4'), ('speed', '15')]),
])
def test_an_action_is_carried_out_once_and_ended(kind, action, done):
    bench = flown(kind, at_point(action))
    assert bench.completed() == ['P']
    assert [(name, text.replace('-0.0', '0.0')) for name, text in payload(bench)] == done
    assert bench.onboard().upload.uploads == 1


@BOTH
def test_photos_are_taken_at_the_point_in_their_number(kind):
    bench = flown(kind, at_point(Action('photo', {'count': 4, 'interval': 2.0})))
    assert len(photos(bench)) == 4
    assert all(math.dist(place, HERE) < 3.0 for place in photos(bench))


@BOTH
def test_a_wait_keeps_the_vehicle_at_the_point(kind):
    bench = flown(kind, at_point(Action('wait', {'seconds': 12.0})))
    at = [e.t for e in bench.truth[1] if e.name == 'item_reached']
    assert at[-1] - at[0] >= 12.0


@BOTH
def test_all_actions_of_a_strip_are_begun_and_those_that_last_are_ended(kind):
    actions = [Action('gimbal', {'pitch': -1.0}), Action('video'),
               Action('trigger', {'distance': 30.0}), Action('speed', {'speed': 8.0})]
    bench = flown(kind, strip(0, actions, length=95.0))
    names = [name for name, _ in payload(bench)]
    assert names == ['gimbal', 'video on', 'trigger', 'speed', 'speed', 'trigger', 'video off']
    assert payload(bench)[4] == ('speed', '15')
    assert len(photos(bench)) == 4


@BOTH
def test_a_short_way_leaves_no_action_out(kind):
    way = piece('S', (0, 80), (0.5, 80), (1, 80), actions=[
        Action('gimbal', {'pitch': -1.0}), Action('video'), Action('gripper', {'release': 1}),
        Action('trigger', {'distance': 30.0})])
    bench = flown(kind, way)
    assert [name for name, _ in payload(bench)] == [
        'gimbal', 'video on', 'gripper', 'trigger', 'trigger', 'video off']


def test_a_servo_is_set_by_ardupilot_and_refused_for_px4():
    servo = at_point(Action('servo', {'channel': 9, 'pwm': 1750}))
    assert payload(flown('ardupilot', servo)) == [('servo', '9 1750')]
    bench = flown('px4', servo)
    assert bench.failed() == ['P']
    reason = next(e.reason for _, e in bench.events if e.event == 'FAILED')
    assert reason == 'task P: action servo: PX4 takes no DO_SET_SERVO in missions'
    assert payload(bench) == []


@BOTH
def test_a_refused_action_leaves_the_other_tasks(kind):
    other = Task('Q', (50.0, 80.0, 40.0))
    servo = at_point(Action('servo', {'channel': 9, 'pwm': 1750}))
    bench = flown(kind, servo, other)
    assert bench.completed() == (['P', 'Q'] if kind == 'ardupilot' else ['Q'])


@BOTH
def test_the_heading_is_kept_along_a_way(kind):
    way = dataclasses.replace(piece('S', (0, 80), (60, 80), (60, 140)), heading=math.pi / 2)
    bench = FlightBench(kind).discover()
    bench.assign(list_of(way))
    headings = []
    body = bench.vehicles[1].flight.body

    def note():
        if 5.0 < body.position[0] < 55.0 and abs(body.position[1] - 80.0) < 2.0:
            headings.append(body.heading)
        return bench.completed() == ['S']
    assert bench.run(note, 200.0)
    assert headings
    assert all(abs(each - math.pi / 2) < 1e-3 for each in headings)


def test_a_speed_is_refused_where_the_own_speed_is_not_known():
    bench = FlightBench('ardupilot').discover()
    del bench.vehicles[1].parameters.values['WPNAV_SPEED']
    bench.assign(list_of(at_point(Action('speed', {'speed': 4.0}))))
    assert bench.run(lambda: bench.failed() == ['P'], 120.0)
    reason = next(e.reason for _, e in bench.events if e.event == 'FAILED')
    assert 'the cruise speed of the vehicle is not known' in reason


def test_a_fixed_wing_refuses_a_heading():
    for profile in (ARDUPLANE, PX4_PLANE):
        with pytest.raises(MissionError, match='heading: a fixed wing cannot keep one'):
            mission_items(list_of(at_point(heading=1.0)), profile.rules, ORIGIN)


@pytest.mark.parametrize('rules', [p.rules for p in (*PROFILES.values(), ARDUPLANE, PX4_PLANE)])
def test_every_named_action_has_a_row(rules):
    assert rules.actions.keys() == ACTIONS.keys()


def test_compass_degrees_are_clockwise_from_north():
    assert [compass(math.radians(deg)) for deg in (0, 90, 180, 270, 360, 91)] == [
        90.0, 0.0, 270.0, 180.0, 90.0, 359.0]


@BOTH
def test_an_action_altered_on_the_way_back_is_noticed(kind):
    bench = FlightBench(kind).discover()

    def alter(direction, message, now):
        if direction == 'down' and message.get_type() == 'MISSION_ITEM_INT' and (
                message.command == d.MAV_CMD_DO_SET_CAM_TRIGG_DIST and message.param1 == 20.0):
            message.param1 = 0.0
            return [(0.0, message)]
        return None
    bench.line.tampers.append(alter)
    bench.assign(list_of(strip(0)))
    bench.run(limit=40.0)
    assert bench.onboard().revision == 0
    assert not bench.vehicles[1].flight.armed


def test_the_page_has_the_table_of_the_code():
    page = Path(__file__).parents[3] / 'docs' / 'mavlink.md'
    assert action_table() in page.read_text()
