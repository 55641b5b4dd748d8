# SPDX-License-Identifier: Apache-2.0
"""The `fence_area` in maps, .plan files and missions: written, and read again."""
import json
import math

import pytest

from uav_task_alloc.geometry.frames import to_geodetic
from uav_task_alloc.map_files.elements import MapFileError
from uav_task_alloc.map_files.read import read_map_file
from uav_task_alloc.map_files.scenario_rows import ImportChoices, to_scenario
from uav_task_alloc.map_files.write import plan_shapes, write_map
from uav_task_alloc.map_files.write_plan import plan_document
from uav_task_alloc.mavlink.mission.files import plan_file, planned_mission
from uav_task_alloc.model import Leg, Plan
from uav_task_alloc.scenario.read import parse

# two arms, open to the north; t is in the western one
SCENARIO = parse("""
uavs: [{id: uav_1, position: [100, 900, 0]}, {id: uav_2, position: [900, 900, 0]}]
tasks: [{id: t, position: [100, 300, 50]}]
fence_area: [[0, 0], [1000, 0], [1000, 1000], [600, 1000], [600, 200], [400, 200], [400, 1000],
             [0, 1000]]
zones: [{id: z, shape: polygon, vertices: [[20, 20], [60, 20], [60, 50]]}]
""")
PLAN = Plan({'uav_1': ('t',), 'uav_2': ()}, legs={'uav_1': (Leg((), 600.0),), 'uav_2': ()})


@pytest.mark.parametrize('suffix', ['.geojson', '.kml', '.plan'])
def test_the_area_of_a_map_is_read_again(tmp_path, suffix):
    path = tmp_path / f'job{suffix}'
    if suffix == '.plan':
        path.write_text(json.dumps(plan_document(SCENARIO)[0]))
    else:
        write_map(path, SCENARIO.origin, plan_shapes(SCENARIO, PLAN))
    made = to_scenario([read_map_file(path)], ImportChoices(SCENARIO.origin), 'again')
    again = parse(made.text)
    assert [timed.zone.id for timed in again.zones] == ['z']
    assert [(round(x, 2), round(y, 2)) for x, y in again.fence_area] == [
        *SCENARIO.fence_area]


def test_of_two_areas_the_first_counts(tmp_path):
    path = tmp_path / 'job.plan'
    document = plan_document(SCENARIO)[0]
    document['geoFence']['polygons'] += [
        {'inclusion': True, 'polygon': [[47.3, 8.4], [47.3, 8.6], [47.5, 8.6]]}]
    path.write_text(json.dumps(document))
    made = to_scenario([read_map_file(path)], ImportChoices(), 'again')
    assert len(parse(made.text).fence_area) == 8
    assert made.notes == ['job.plan: fence polygon 3: a second fence_area: expected one']


def with_circle(tmp_path, radius, polygons=()):
    """A file with a circle around the task that includes, imported: the scenario, its notes."""
    path, document = tmp_path / 'job.plan', plan_document(SCENARIO)[0]
    middle = to_geodetic(SCENARIO.origin, (100.0, 300.0, 0.0))[:2]
    document['geoFence'] = {'version': 2, 'polygons': list(polygons), 'circles': [
        {'inclusion': True, 'circle': {'center': middle, 'radius': radius}, 'version': 1}]}
    path.write_text(json.dumps(document))
    made = to_scenario([read_map_file(path)], ImportChoices(SCENARIO.origin), 'again')
    return parse(made.text), made.notes


def test_a_circle_that_includes_is_an_area_inside_of_it(tmp_path):
    scenario, notes = with_circle(tmp_path, 300.0)
    area = scenario.fence_area
    assert (len(area), notes) == (20, [])
    assert [math.dist((100.0, 300.0), corner) for corner in area] == pytest.approx(
        [300.0] * 20, abs=0.05)
    edges = [math.dist((100.0, 300.0), ((a[0] + b[0]) / 2.0, (a[1] + b[1]) / 2.0))
             for a, b in zip(area, (*area[1:], area[0]), strict=True)]
    assert min(edges) > 0.987 * 300.0


def test_a_polygon_that_includes_comes_before_a_circle_that_does(tmp_path):
    scenario, notes = with_circle(tmp_path, 300.0, [
        {'inclusion': True, 'polygon': [[47.3, 8.4], [47.3, 8.6], [47.5, 8.6]]}])
    assert len(scenario.fence_area) == 3
    assert notes == ['job.plan: fence circle 1: a second fence_area: expected one']


@pytest.mark.parametrize('radius', [0.0, -5.0, math.nan, 2e5])
def test_the_radius_of_a_circle_that_includes_is_checked(tmp_path, radius):
    with pytest.raises(MapFileError, match=r'circle 1: radius .*: expected a number in \(0, 1'):
        with_circle(tmp_path, radius)


@pytest.mark.parametrize(('uav', 'stays'), [(0, True), (1, False)])
def test_a_mission_has_the_area_as_a_fence_unless_its_return_leaves_it(uav, stays):
    """The second one flies to the western arm around the corner, and returns straight."""
    legs = {'uav_1': (Leg((), 600.0),),
            'uav_2': (Leg(((590.0, 190.0, 50.0), (390.0, 190.0, 50.0)), 1200.0),)}
    flown = SCENARIO.uavs[uav]
    route = Plan({flown.id: ('t',)}, legs=legs).route(flown.id)
    mission = planned_mission(SCENARIO, flown, route)
    polygons = plan_file(mission)['geoFence']['polygons']
    assert [(each['inclusion'], len(each['polygon'])) for each in polygons] == [
        (True, 8)] * stays + [(False, 3)]
