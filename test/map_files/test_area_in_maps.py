# SPDX-License-Identifier: Apache-2.0
"""The `fence_area` in maps, .plan files and missions: written, and read again."""
import json

import pytest

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
