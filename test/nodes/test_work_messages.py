# SPDX-License-Identifier: Apache-2.0
"""Lines, areas, orbits, pieces and actions survive messages; a bad field is refused by name."""
import math
from dataclasses import replace

import pytest
from geometry_msgs.msg import Point
from uav_task_alloc_msgs import msg as m

from uav_task_alloc.actions import Action
from uav_task_alloc.allocator.list_records import ListStop
from uav_task_alloc.allocator.records import TaskState
from uav_task_alloc.allocator.status import TaskStatus
from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.geometry.frames import Origin, to_enu
from uav_task_alloc.mavlink.mission.task_progress import TaskProgress
from uav_task_alloc.model import Leg, Task
from uav_task_alloc.nodes.conversions import bridge_messages, messages
from uav_task_alloc.nodes.conversions.allocation_messages import from_task_status
from uav_task_alloc.nodes.conversions.announcements import to_work
from uav_task_alloc.work.pieces import Work, pieces_of
from uav_task_alloc.work.values import Kind

ORIGIN = Origin(47.397742, 8.545594, 488.0)
SQUARE = tuple((x, y, 40.0) for x, y in ((0.0, 0.0), (200.0, 0.0), (200.0, 100.0), (0.0, 100.0)))
HOLE = tuple((x, y, 0.0) for x, y in ((50.0, 20.0), (60.0, 20.0), (55.0, 40.0)))
TRIGGER = Action('trigger', (('distance', 5.0),))
WORKS = {
    'line': Work(Task('w', SQUARE[0], heading=1.5, actions=(TRIGGER, Action('video'))), Kind.LINE,
                 SQUARE[:3], divisible=True),
    'area': Work(Task('w', SQUARE[0], 3.0, actions=(TRIGGER,)), Kind.AREA, SQUARE, (HOLE,), 20.0),
    'directed': Work(Task('w', SQUARE[0]), Kind.AREA, SQUARE, (), 20.0, 0.5),
    'orbit': Work(Task('w', (10.0, 20.0, 30.0)), Kind.ORBIT, radius=25.0, turns=2.0),
}


@pytest.mark.parametrize('name', WORKS)
def test_work_survives_its_message(name):
    work = WORKS[name]
    assert to_work(messages.from_work(work), ORIGIN) == work


def test_a_point_with_actions_is_a_task():
    task = Task('t1', (1.0, 2.0, 3.0), heading=0.5, actions=(
        Action('photo', (('count', 3.0), ('interval', 2.0))), Action('wait', (('seconds', 4.0),))))
    made = to_work(messages.from_work(task), ORIGIN)
    assert made == task
    assert isinstance(made, Task)


def test_angles_of_zero_or_nan_are_none_and_a_turn_is_east():
    msg = messages.from_work(WORKS['area'])
    for value in (0.0, math.nan):
        msg.direction = msg.heading = value
        made = to_work(msg, ORIGIN)
        assert made.direction is None
        assert made.task.heading is None
    msg.heading = 2.0 * math.pi
    assert to_work(msg, ORIGIN).task.heading == pytest.approx(0.0, abs=1e-6)
    east = replace(WORKS['directed'], direction=0.0)
    turned = to_work(messages.from_work(east), ORIGIN).direction
    assert math.sin(turned) == pytest.approx(0.0, abs=1e-6)


def test_points_in_wgs84_are_longitude_latitude_and_height_above_the_origin():
    msg = messages.from_work(WORKS['line'])
    msg.frame = m.Task.WGS84
    degrees = [(8.5456, 47.3978, 40.0), (8.5466, 47.3978, 40.0), (8.5466, 47.3988, 40.0)]
    msg.path = [Point(x=x, y=y, z=z) for x, y, z in degrees]
    assert to_work(msg, ORIGIN).path == tuple(
        pytest.approx(to_enu(ORIGIN, y, x, ORIGIN.altitude_amsl + z)) for x, y, z in degrees)
    msg.path[1].y = 91.0
    with pytest.raises(InvalidValue, match=r'task w: path\[1\].y \(latitude\) = 91.0'):
        to_work(msg, ORIGIN)


@pytest.mark.parametrize(('name', 'changed', 'text'), [
    ('line', {'kind': 9}, r'task w: kind = 9: expected POINT \(0\), LINE \(1\), AREA'),
    ('line', {'task_id': 'w#1'}, "task_id = 'w#1': expected a ROS name"),
    ('line', {'path': []}, r'task w: path = \(\): expected at least 2 points'),
    ('line', {'path': [Point(x=math.nan), Point()]}, r'task w: path\[0\]'),
    ('line', {'path': [Point(x=float(k)) for k in range(1001)]}, 'task w: path'),
    ('line', {'vertical': 2}, r'task w: vertical = 2: expected ORIGIN \(0\) or TERRAIN \(1\)'),
    ('line', {'payload': 2.0}, 'task w: payload'),
    ('line', {'heading': 7.0}, 'task w: heading = 7.0'),
    ('line', {'heading': math.inf}, 'task w: heading = inf'),
    ('area', {'strip_width': math.nan}, 'task w: strip_width = 0.0'),
    ('area', {'strip_width': -1.0}, 'task w: strip_width = -1.0'),
    ('area', {'holes': [m.Ring()] * 101}, 'task w: holes'),
    ('area', {'radius': 3.0}, 'task w: radius = 3.0: expected none for AREA'),
    ('orbit', {'radius': 0.0}, 'task w: radius'),
    ('line', {'actions': [m.Action(name='dance')]}, r"task w: actions\[0\]: action = 'dance'"),
    ('line', {'actions': [m.Action(name='trigger')]}, r'task w: actions\[0\]: action trigger: di'),
    ('line', {'actions': [m.Action(name='wait', keys=['seconds'])]},
     r'task w: actions\[0\].values = 0: expected as many as keys, 1'),
    ('line', {'actions': [m.Action(name='wait', keys=['seconds'], values=[math.nan])]},
     r'task w: actions\[0\]: action wait: seconds = nan'),
    ('line', {'actions': [m.Action(name='video')] * 21}, 'task w: actions'),
    ('line', {'actions': [m.Action(name='wait', keys=['x'] * 11)]}, r'task w: actions\[0\].keys'),
])
def test_bad_work_is_refused_by_the_name_of_its_field(name, changed, text):
    msg = messages.from_work(WORKS[name])
    for field, value in changed.items():
        setattr(msg, field, value)
    with pytest.raises(InvalidValue, match=text):
        to_work(msg, ORIGIN)


def test_a_piece_of_a_list_has_the_id_of_the_whole_and_its_own_path():
    piece = pieces_of(WORKS['area'])[2]
    msg = messages.planned_task(ListStop(piece, Leg((), 5.0), 1.0, reversed=True, path_time=9.0))
    assert (msg.task.task_id, msg.piece, msg.reversed, msg.task.kind) == (
        'w', 3, True, m.Task.LINE)
    assert [(p.x, p.y, p.z) for p in msg.task.path] == list(piece.path)
    assert msg.finish.sec == 10
    made = bridge_messages.to_list(m.TaskList(uav_id='u1', tasks=[msg]), 'u1', ORIGIN, 0.0)
    task = made.stops[0].task
    assert (task.id, task.path, task.actions) == ('w#3', piece.path, piece.actions)
    assert made.stops[0].reversed


@pytest.mark.parametrize(('changed', 'text'), [
    ({'kind': 2}, r'task w#1: kind = 2: expected POINT \(0\) or LINE \(1\) in a list'),
    ({'path': [Point()]}, 'task w#1: path = 1: expected at least 2 points of a LINE')])
def test_a_list_has_points_and_pieces_only(changed, text):
    msg = messages.planned_task(ListStop(pieces_of(WORKS['line'])[0], Leg((), 5.0), 1.0))
    for field, value in changed.items():
        setattr(msg.task, field, value)
    with pytest.raises(InvalidValue, match=text):
        bridge_messages.to_list(m.TaskList(uav_id='u1', tasks=[msg]), 'u1', ORIGIN, 0.0)


def test_events_states_and_statuses_have_the_piece_beside_the_id():
    sent = bridge_messages.from_progress('u1', TaskProgress('w#3', 'COMPLETED', 7), 1.0)
    assert (sent.task_id, sent.piece) == ('w', 3)
    assert messages.to_event(sent).task_id == 'w#3'
    report = m.UavState(uav_id='u1', active_task_id='w', active_piece=2, battery=math.nan,
                        range_remaining=math.nan, cruise_speed=math.nan)
    assert messages.to_report(report).active_task == 'w#2'
    status = from_task_status(TaskStatus('w', TaskState.ACTIVE, '', '', 1.0, 0.0, 7, 12))
    assert (status.task_id, status.piece, status.pieces_done, status.pieces) == ('w', 0, 7, 12)
    assert from_task_status(TaskStatus('w#4', TaskState.ACTIVE, 'u1', '', 1.0)).piece == 4
