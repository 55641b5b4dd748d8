# SPDX-License-Identifier: Apache-2.0
"""A scenario written as a .plan and read again is the same; so is a .plan of QGroundControl."""
import json
from dataclasses import replace

import numpy as np
import pytest

from uav_task_alloc.geometry.frames import Origin
from uav_task_alloc.map_files.elements import MapFileError
from uav_task_alloc.map_files.read import read_map_file
from uav_task_alloc.map_files.scenario_rows import ImportChoices, to_scenario
from uav_task_alloc.map_files.write_plan import plan_document
from uav_task_alloc.scenario import parse
from uav_task_alloc.work.values import Kind

ORIGIN = Origin(47.3977, 8.5456, 488.0)
SCENARIO = """
origin: {latitude: 47.3977, longitude: 8.5456, altitude_amsl: 488}
uavs: [{id: uav_1, position: [0, 0, 0]}]
tasks:
  - {id: mast, position: [300, 200, 40], value: 3, service_time: 12, latest: 900}
  - {id: low, position: [50, 20, 25], vertical: terrain, required_capabilities: [camera]}
  - {id: field, kind: area, altitude: 60, strip_width: 40, value: 7, divisible: true,
     path: [[0, 20], [300, 20], [350, 200], [0, 200]], at: 30,
     actions: [{name: trigger, distance: 25}]}
  - {id: slope, kind: area, altitude: 80, strip_width: 25, direction: 0.5, vertical: terrain,
     path: [[-300, 20], [-50, 20], [-50, 200]]}
  - {id: cable, kind: line, altitude: 40, divisible: true,
     path: [[0, -50], [300, -50], [300, -90]]}
  - {id: tower, kind: orbit, position: [-100, 100, 40], radius: 30, turns: 2}
zones:
  - {id: dome, shape: hemisphere, center: [500, 0, 10], radius: 80, margin: 5}
  - {id: pole, shape: cylinder, center: [500, 300], radius: 40, z_max: 120, appears: 60}
  - {id: town, shape: polygon, vertices: [[600, 0], [700, 0], [700, 90]], z_min: 20}
"""
CAMERA = {'version': 2, 'CameraName': 'Manual (no camera specs)', 'AdjustedFootprintFrontal': 25,
          'AdjustedFootprintSide': 40, 'DistanceMode': 1, 'DistanceToSurface': 60}
RING = [[47.400, 8.547], [47.400, 8.551], [47.402, 8.551], [47.402, 8.547]]
QGC = {'fileType': 'Plan', 'version': 1, 'groundStation': 'QGroundControl', 'mission': {
    'plannedHomePosition': [47.3977, 8.5456, 488.0], 'items': [
        {'type': 'ComplexItem', 'complexItemType': 'survey', 'version': 5, 'angle': 30,
         'polygon': RING, 'TransectStyleComplexItem': {'version': 2, 'CameraCalc': CAMERA}},
        {'type': 'ComplexItem', 'complexItemType': 'CorridorScan', 'version': 2,
         'CorridorWidth': 70, 'polyline': RING[:3],
         'TransectStyleComplexItem': {'version': 2, 'CameraCalc': CAMERA}},
        {'type': 'ComplexItem', 'complexItemType': 'StructureScan', 'version': 3, 'Layers': 2,
         'ScanBottomAlt': 5, 'StructureHeight': 55, 'EntranceAltitude': 70, 'polygon': RING,
         'StartFromTop': False, 'GimbalPitch': 0,
         'CameraCalc': {**CAMERA, 'DistanceToSurface': 10}},
        {'type': 'SimpleItem', 'command': 16, 'doJumpId': 4, 'frame': 3, 'AltitudeMode': 1,
         'Altitude': 50, 'params': [5, 0, 0, None, 47.401, 8.549, 50]}]},
    'geoFence': {'version': 2, 'circles': [
        {'inclusion': False, 'circle': {'center': [47.405, 8.549], 'radius': 60}}],
        'polygons': [{'inclusion': False, 'polygon': [[47.41, 8.54], [47.41, 8.55],
                                                      [47.42, 8.55]]}]},
    'rallyPoints': {'points': [], 'version': 2}}


def imported(tmp_path, document):
    path = tmp_path / 'job.plan'
    path.write_text(json.dumps(document, allow_nan=False))
    made = to_scenario([read_map_file(path)], ImportChoices(), 'job')
    return parse(made.text), made.notes


def content(scenario):
    """Everything of tasks and zones: values, and places [m]."""
    rows = {}
    for timed in scenario.tasks:
        whole = timed.whole
        rows[whole.task.id] = ((
            timed.at, whole.kind, whole.vertical, whole.divisible, whole.strip_width, whole.turns,
            None if whole.direction is None else round(whole.direction, 6),
            replace(whole.task, position=(0.0, 0.0, 0.0))), np.array(
                [*whole.path, whole.task.position, (whole.radius, 0.0, 0.0)]))
    for timed in scenario.zones:
        zone = timed.zone
        rows[zone.id] = ((timed.appears, timed.vanishes, zone.shape, zone.margin), np.array(
            [(*place[:2], 0.0) for place in zone.vertices]
            + [(zone.radius, min(zone.z_max, 9e9), max(zone.z_min, -9e9))]
            + ([zone.center] if zone.center else [])))
    return rows


def check_same(one, other):
    """The same values, and places to 3 cm: heights of files are above the curved earth."""
    first, second = content(one), content(other)
    assert first.keys() == second.keys()
    for name, (values, places) in first.items():
        assert values == second[name][0], name
        assert places == pytest.approx(second[name][1], abs=0.03), name


def test_a_scenario_is_the_same_after_a_plan_of_qgroundcontrol(tmp_path):
    given = parse(SCENARIO)
    document, notes = plan_document(given)
    assert notes == []
    kinds = [item.get('complexItemType', 'waypoint') for item in document['mission']['items']]
    assert kinds == ['waypoint', 'waypoint', 'survey', 'CorridorScan', 'StructureScan', 'survey']
    again, notes = imported(tmp_path, document)
    assert notes == []
    check_same(again, given)


def test_a_plan_in_and_out_and_in_again_is_the_same(tmp_path):
    first, notes = imported(tmp_path, QGC)
    assert notes == []
    kinds = [timed.whole.kind for timed in first.tasks]
    assert kinds == [Kind.AREA, Kind.LINE, Kind.LINE, Kind.ORBIT, Kind.ORBIT, Kind.POINT]
    document, notes = plan_document(first)
    assert notes == []
    survey = document['mission']['items'][0]
    assert survey['angle'] == pytest.approx(30.0, abs=1e-4)
    assert survey['polygon'] == [pytest.approx(place, abs=1e-8) for place in RING]
    camera = dict(survey['TransectStyleComplexItem']['CameraCalc'])
    assert camera.pop('DistanceToSurface') == pytest.approx(60.0, abs=0.01)
    assert camera == {key: CAMERA[key] for key in camera}
    again, _ = imported(tmp_path, document)
    check_same(again, first)


def test_a_structure_scan_is_a_circle_around_all_corners_for_each_layer(tmp_path):
    scenario, _ = imported(tmp_path, QGC)
    one, two = (timed.whole for timed in scenario.tasks if timed.whole.kind is Kind.ORBIT)
    assert (one.task.id, two.task.id) == ('structure_1_1', 'structure_1_2')
    assert one.radius == two.radius == pytest.approx(10.0 + 187.4, abs=1.0)
    assert [round(each.task.position[2], 1) for each in (one, two)] == [17.5, 42.5]


def test_what_a_plan_cannot_hold_is_named():
    given = parse(SCENARIO.replace('[300, -50], [300, -90]]', '[300, -50, 70], [300, -90, 40]]')
                  .replace('at: 30,', 'holes: [[[50, 50], [80, 50], [80, 80]]],'))
    document, notes = plan_document(given)
    assert notes == ['task field: a survey has no holes: they are not written',
                     'task cable: its points have several heights, and a corridor has one']
    assert len(document['mission']['items']) == 5


@pytest.mark.parametrize(('change', 'why'), [
    ({'Layers': 0}, 'item 1: Layers = 0'), ({'polygon': RING[:2]}, 'item 1: a ring with 2'),
    ({'CameraCalc': {}}, 'expected a .plan file'), ({'ScanBottomAlt': 'x'}, 'expected a .plan'),
    ({'uav_task_alloc': 3}, 'uav_task_alloc = 3: expected an object')])
def test_what_is_wrong_with_a_structure_scan_is_named(tmp_path, change, why):
    item = {**QGC['mission']['items'][2], **change}
    with pytest.raises(MapFileError, match=why):
        imported(tmp_path, {**QGC, 'mission': {'items': [item], 'plannedHomePosition': [
            47.3977, 8.5456, 488.0]}})
