# SPDX-License-Identifier: Apache-2.0
"""Tasks of scenario files that are lines, areas and orbits, with cameras and actions."""
import pytest

from uav_task_alloc.actions import Action
from uav_task_alloc.errors import ScenarioError
from uav_task_alloc.scenario import parse, timeline, to_yaml
from uav_task_alloc.work.pieces import pieces_of
from uav_task_alloc.work.values import Kind, Vertical

FLEET = 'uavs:\n  - {id: uav_1, position: [0, 0, 0]}\ntasks:\n  - '
FIELD = '{id: field, kind: area, altitude: 60, path: [[0, 0], [300, 0], [300, 200], [0, 200]]'


def read(row):
    return parse(FLEET + row).tasks[0]


def test_an_area_has_corners_at_the_height_of_the_task():
    timed = read(FIELD + ', strip_width: 40, holes: [[[50, 50], [90, 50], [90, 90]]], value: 3}')
    assert timed.work.kind is Kind.AREA
    assert timed.work.path == ((0, 0, 60), (300, 0, 60), (300, 200, 60), (0, 200, 60))
    assert timed.work.holes == (((50, 50, 0), (90, 50, 0), (90, 90, 0)),)
    assert timed.task == timed.work.task
    assert timed.task.position == (0, 0, 60)
    assert len(pieces_of(timed.work)) == 5


def test_a_camera_gives_strips_and_photos():
    timed = read(FIELD + ', camera: {sensor_width: 13.2, sensor_height: 8.8, focal_length: 8.8, '
                         'height: 100, side_overlap: 0.6, front_overlap: 0.8}}')
    assert timed.work.strip_width == pytest.approx(60.0)
    assert timed.task.actions[0].name == 'trigger'
    assert timed.task.actions[0]['distance'] == pytest.approx(20.0)


def test_a_line_in_degrees_has_its_heights_above_the_origin():
    timed = read('{id: l, kind: line, divisible: true, vertical: terrain, path: [{latitude: '
                 '47.398, longitude: 8.546, altitude: 30}, [200, 100, 40]]}')
    assert timed.work.divisible
    assert timed.work.vertical is Vertical.TERRAIN
    assert timed.work.path[0] == pytest.approx((30.6, 28.7, 30.0), abs=0.1)


@pytest.mark.parametrize('row', [
    '{id: p, latitude: 47.5, longitude: 8.546, altitude: 30, vertical: terrain}',
    '{id: o, kind: orbit, radius: 9, latitude: 47.5, longitude: 8.546, altitude: 30, '
    'vertical: terrain}',
    '{id: l, kind: line, vertical: terrain, path: [{latitude: 47.5, longitude: 8.546, '
    'altitude: 30}, {latitude: 47.5, longitude: 8.548, altitude: 30}]}',
    '{id: a, kind: area, vertical: terrain, altitude: 30, strip_width: 20, path: [{latitude: '
    '47.5, longitude: 8.546}, {latitude: 47.5, longitude: 8.548}, {latitude: 47.501, longitude: '
    '8.548}]}'])
def test_heights_above_the_ground_do_not_depend_on_the_distance_from_the_origin(row):
    timed = read(row)
    assert timed.task.position[2] == 30.0
    assert {point[2] for point in timed.whole.path} <= {30.0}


def test_an_orbit_and_a_point_have_positions():
    timed = read('{id: o, kind: orbit, position: [1, 2, 30], radius: 40, turns: -2}')
    assert (timed.work.radius, timed.work.turns, timed.task.position) == (40, -2, (1, 2, 30))
    point = read('{id: p, position: [1, 2, 30], heading: 1.5, actions: [{name: photo, count: 3}, '
                 '{name: gripper, release: 1}]}')
    assert point.work is None
    assert point.whole.kind is Kind.POINT
    assert point.task.heading == 1.5
    assert point.task.actions == (Action('photo', (('count', 3.0),)),
                                  Action('gripper', (('release', 1.0),)))


@pytest.mark.parametrize('row', [
    FIELD + ', strip_width: 40, direction: 0.5, holes: [[[50, 50], [90, 50], [90, 90]]]}',
    FIELD + ', camera: {ground_sample_distance: 0.02, image_width: 4000, image_height: 3000}}',
    '{id: l, kind: line, path: [[0, 0, 10], [9, 9, 30]], divisible: true, vertical: terrain}',
    '{id: o, kind: orbit, position: [1, 2, 30], radius: 40, turns: -2.5, '
    'actions: [{name: roi, x: 1, y: 2, z: 3}, {name: servo, channel: 3, pwm: 1500}]}',
    '{id: p, position: [1, 2, 30], heading: 1.5, vertical: terrain}',
])
def test_what_is_written_reads_back_as_the_same(row):
    scenario = parse(FLEET + row)
    again = parse(to_yaml(scenario))
    assert again.tasks == scenario.tasks
    assert timeline(again)[0].works == (scenario.tasks[0].whole,)


@pytest.mark.parametrize(('row', 'text'), [
    (FIELD + '}', r'scenario:4: scenario.tasks\[0\]: task field: strip_width = 0.0: expected'),
    (FIELD + ', strip_width: 40, position: [0, 0, 0]}', 'a path, which says where the area is'),
    ('{id: l, kind: line}', r'tasks\[0\].path is missing: expected the points of the line'),
    ('{id: l, kind: line, path: [[0, 0], [5, 5]]}', 'altitude is missing: expected the height'),
    ('{id: l, kind: line, path: [[0, 0, 1, 2]]}', 'two or three numbers'),
    ('{id: l, kind: corridor, path: []}', 'one of point, line, area, orbit'),
    ('{id: p, position: [0, 0, 9], radius: 4}', 'radius = 4.0: expected none for POINT'),
    ('{id: p, position: [0, 0, 9], camera: {}}', 'camera = a mapping: expected none'),
    (FIELD + ', strip_width: 4, camera: {}}', 'either a strip_width or a camera'),
    (FIELD + ', camera: {sensor_width: 13.2}}', 'camera: sensor_height = 0.0: expected it'),
    ('{id: p, position: [0, 0, 9], actions: [{name: photo, pwm: 1500}]}', 'action photo: key'),
    ('{id: p, position: [0, 0, 9], actions: [{name: dance}]}', 'one of photo, video'),
    ('{id: p, position: [0, 0, 9], heading: 90}', 'heading = 90'),
    ('{id: l, kind: line, path: [[0, 0, 1], [5, 5, 1]], divisible: 3}', 'true or false'),
])
def test_what_is_wrong_is_named(row, text):
    with pytest.raises(ScenarioError, match=text):
        read(row)
