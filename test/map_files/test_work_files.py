# SPDX-License-Identifier: Apache-2.0
"""Lines, polygons, surveys and corridors of map files become lines and areas."""
import json
import math

import pytest

from uav_task_alloc.geometry.frames import Origin
from uav_task_alloc.map_files.elements import MapFileError
from uav_task_alloc.map_files.read import read_map_file
from uav_task_alloc.map_files.scenario_rows import ImportChoices, to_scenario
from uav_task_alloc.scenario import parse
from uav_task_alloc.work.pieces import pieces_of
from uav_task_alloc.work.values import Kind, Vertical

ORIGIN = Origin(47.3977, 8.5456, 488.0)
RING = '8.5470,47.4000 8.5510,47.4000 8.5510,47.4020 8.5470,47.4020 8.5470,47.4000'
HOLE = '8.5480,47.4005 8.5490,47.4005 8.5490,47.4010 8.5480,47.4005'
KML = f"""<kml><Document>
<Placemark><name>Cable 3</name><ExtendedData><Data name="divisible"><value>true</value></Data>
<Data name="value"><value>7</value></Data></ExtendedData><LineString><coordinates>
8.5470,47.4000 8.5470,47.4000 8.5490,47.4010 8.5500,47.4010</coordinates></LineString></Placemark>
<Placemark><name>field</name><Polygon>
<outerBoundaryIs><LinearRing><coordinates>{RING}</coordinates></LinearRing></outerBoundaryIs>
<innerBoundaryIs><LinearRing><coordinates>{HOLE}</coordinates></LinearRing></innerBoundaryIs>
</Polygon></Placemark></Document></kml>"""
STYLE = {'CameraCalc': {'AdjustedFootprintFrontal': 25, 'AdjustedFootprintSide': 40,
                        'DistanceMode': 1, 'DistanceToSurface': 60, 'version': 2}}
SURVEY = {'type': 'ComplexItem', 'complexItemType': 'survey', 'version': 5, 'angle': 30,
          'polygon': [[47.400, 8.547], [47.400, 8.551], [47.402, 8.551], [47.402, 8.547]],
          'TransectStyleComplexItem': STYLE}
CORRIDOR = {'type': 'ComplexItem', 'complexItemType': 'CorridorScan', 'CorridorWidth': 70,
            'polyline': [[47.400, 8.547], [47.402, 8.547], [47.402, 8.550]],
            'TransectStyleComplexItem': STYLE}


def imported(tmp_path, name, text, **choices):
    (tmp_path / name).write_text(text)
    made = to_scenario([read_map_file(tmp_path / name)],
                       ImportChoices(**{'origin': ORIGIN, **choices}), 'job')
    return parse(made.text), made.notes


def qgc(*items):
    return json.dumps({'fileType': 'Plan', 'version': 1, 'mission': {
        'items': items, 'plannedHomePosition': [47.3977, 8.5456, 488]}})


def test_lines_and_polygons_of_kml(tmp_path):
    scenario, notes = imported(tmp_path, 'job.kml', KML, strip_width=40.0)
    line, area = (timed.work for timed in scenario.tasks)
    assert (line.task.id, line.kind, line.divisible, line.task.value) == (
        'Cable_3', Kind.LINE, True, 7.0)
    assert len(line.path) == 3
    assert (area.kind, area.strip_width, len(area.path), len(area.holes[0])) == (
        Kind.AREA, 40.0, 4, 3)
    assert {round(z) for _, _, z in line.path + area.path} == {50}
    assert notes == ["job.kml: Placemark 'Cable 3': its id is Cable_3"]


def test_a_polygon_without_a_width_is_named(tmp_path):
    scenario, notes = imported(tmp_path, 'job.kml', KML)
    assert [timed.task.id for timed in scenario.tasks] == ['Cable_3']
    assert notes[0].startswith("job.kml: Placemark 'field': a polygon, which is neither in a")


def test_properties_of_geojson_say_how_a_polygon_is_flown(tmp_path):
    ring = [[float(part) for part in word.split(',')] for word in RING.split()]
    scenario, _ = imported(tmp_path, 'job.geojson', json.dumps({
        'type': 'Feature', 'geometry': {'type': 'Polygon', 'coordinates': [ring]}, 'properties': {
            'name': 'a', 'direction': 0.5, 'latest': 900, 'camera': {
                'ground_sample_distance': 0.02, 'image_width': 5000, 'image_height': 4000,
                'side_overlap': 0.5, 'front_overlap': 0.75}}}))
    work = scenario.tasks[0].work
    assert (work.strip_width, work.direction, work.task.latest) == (50.0, 0.5, 900.0)
    assert work.task.actions[0]['distance'] == pytest.approx(20.0)


def test_corners_that_repeat_the_one_before_are_left_out(tmp_path):
    ring, hole = ([[float(part) for part in word.split(',')] for word in text.split()
                   for _ in 'ab'] for text in (RING, HOLE))
    scenario, _ = imported(tmp_path, 'job.geojson', json.dumps({
        'type': 'FeatureCollection', 'features': [
            {'type': 'Feature', 'properties': {'name': 'a', 'strip_width': 40},
             'geometry': {'type': 'Polygon', 'coordinates': [ring, hole]}},
            {'type': 'Feature', 'properties': {'name': 'b', 'kind': 'zone'},
             'geometry': {'type': 'Polygon', 'coordinates': [ring]}}]}))
    work = scenario.tasks[0].work
    assert (len(work.path), len(work.holes[0])) == (4, 3)
    assert len(scenario.zones[0].zone.vertices) == 4


def test_a_point_of_geojson_can_be_an_orbit(tmp_path):
    scenario, _ = imported(tmp_path, 'job.geojson', json.dumps({
        'type': 'Feature', 'geometry': {'type': 'Point', 'coordinates': [8.547, 47.4]},
        'properties': {'name': 'mast', 'kind': 'orbit', 'radius': 30, 'turns': 2}}))
    assert (scenario.tasks[0].work.kind, scenario.tasks[0].work.radius) == (Kind.ORBIT, 30.0)


def test_a_survey_keeps_its_angle_width_and_photos(tmp_path):
    scenario, notes = imported(tmp_path, 'job.plan', qgc(SURVEY), origin=None)
    work = scenario.tasks[0].work
    assert (work.kind, work.strip_width, work.task.id) == (Kind.AREA, 40.0, 'survey_1')
    assert work.task.actions[0]['distance'] == 25.0
    assert {round(z) for _, _, z in work.path} == {60}
    for piece in pieces_of(work):  # the angle is clockwise from north
        (x0, y0, _), (x1, y1, _) = piece.path
        assert math.tan(math.radians(30.0)) == pytest.approx((x1 - x0) / (y1 - y0), abs=1e-6)
    assert notes == []


def test_passes_across_that_are_not_imported_are_named(tmp_path):
    crossed = {**SURVEY, 'TransectStyleComplexItem': {**STYLE, 'Refly90Degrees': True}}
    for item in (crossed, SURVEY):
        _, notes = imported(tmp_path, 'job.plan', qgc(item))
        assert [note.partition(' are not')[0] for note in notes] == [
            'job.plan: item 1: the passes across its strips (Refly90Degrees)'] * (item is crossed)


def test_a_corridor_is_lines_side_by_side(tmp_path):
    scenario, _ = imported(tmp_path, 'job.plan', qgc(CORRIDOR), origin=None)
    one, other = (timed.work for timed in scenario.tasks)
    assert (one.kind, one.task.id, other.task.id) == (Kind.LINE, 'corridor_1_1', 'corridor_1_2')
    for a, b in zip(one.path, other.path, strict=True):
        assert math.dist(a, b) == pytest.approx(40.0 if a[:2] != one.path[1][:2]
                                                else 40.0 * math.sqrt(2.0), rel=0.01)


def test_a_survey_above_terrain_and_one_above_sea_level(tmp_path):
    camera = STYLE['CameraCalc']
    above = {**SURVEY, 'TransectStyleComplexItem': {**STYLE, 'FollowTerrain': True}}
    amsl = {**SURVEY, 'TransectStyleComplexItem': {'CameraCalc': {
        **camera, 'DistanceMode': 2, 'DistanceToSurface': 548}}}
    scenario, _ = imported(tmp_path, 'job.plan', qgc(above, amsl), origin=None)
    one, two = (timed.work for timed in scenario.tasks)
    assert (one.vertical, two.vertical) == (Vertical.TERRAIN, Vertical.ORIGIN)
    assert round(one.path[0][2]) == round(two.path[0][2]) == 60


@pytest.mark.parametrize(('change', 'text'), [
    ({'polygon': [[47.4, 8.5]]}, 'item 1: a ring with 1 vertices'),
    ({'TransectStyleComplexItem': {}}, 'expected a .plan file'),
    ({'TransectStyleComplexItem': {'CameraCalc': {**STYLE['CameraCalc'],
                                                  'AdjustedFootprintSide': 0}}},
     'item 1: AdjustedFootprintSide = 0'),
    ({'TransectStyleComplexItem': {'CameraCalc': {**STYLE['CameraCalc'], 'DistanceMode': 7}}},
     'item 1: DistanceMode = 7'),
    ({'polygon': [[47.4, 8.547], [47.402, 8.551], [47.402, 8.547], [47.4, 8.551]]},
     'item 1: scenario.tasks.0.: task survey_1: path = .*expected edges that do not cross'),
])
def test_what_is_wrong_with_a_survey_is_named(tmp_path, change, text):
    with pytest.raises(MapFileError, match=text):
        imported(tmp_path, 'job.plan', qgc({**SURVEY, **change}), origin=None)


def test_a_long_track_is_left_out(tmp_path):
    track = [[8.5 + k * 1e-5, 47.4] for k in range(1500)]
    with pytest.raises(MapFileError, match='a line of 1500 points: expected 2 to 1000'):
        imported(tmp_path, 'job.geojson', json.dumps({'type': 'LineString', 'coordinates': track}))
