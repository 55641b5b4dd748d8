# SPDX-License-Identifier: Apache-2.0
import io
import json
import zipfile
from pathlib import Path

import pytest

from uav_task_alloc.__main__ import main
from uav_task_alloc.geometry.frames import Origin, to_geodetic
from uav_task_alloc.map_files.elements import MapFileError
from uav_task_alloc.map_files.read import read_map_file
from uav_task_alloc.map_files.scenario_rows import ImportChoices, to_scenario
from uav_task_alloc.scenario.read import load, parse

ORIGIN = Origin(47.3977, 8.5456, 488.0)
KML = """<?xml version="1.0" encoding="UTF-8"?>
<kml xmlns="http://www.opengis.net/kml/2.2" xmlns:gx="http://www.google.com/kml/ext/2.2">
<Document><name>job</name>{}</Document></kml>"""
MAST = """<Placemark><name>Mast 7</name><description>{data}</description><Point>{mode}
<coordinates>
  8.5470,47.4000,{alt}
</coordinates></Point></Placemark>"""
RING = '8.54,47.40,0 8.55,47.40,0 8.55,47.41,0 8.54,47.40,0'
POLYGON = ('<Placemark><name>{}</name><Polygon><outerBoundaryIs><LinearRing><coordinates>' + RING
           + '</coordinates></LinearRing></outerBoundaryIs>{}</Polygon></Placemark>')
LINE = ('<Placemark><name>wire</name><LineString><coordinates>8.54,47.40 8.55,47.40 8.56,47.41'
        '</coordinates></LineString></Placemark>')


def written(tmp_path, name, content):
    path = tmp_path / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


def imported(tmp_path, name, content, **choices):
    """(scenario, notes) of one file."""
    made = to_scenario([read_map_file(written(tmp_path, name, content))],
                       ImportChoices(**{'origin': ORIGIN, **choices}), 'job')
    return parse(made.text), made.notes


def geojson(*features):
    return json.dumps({'type': 'FeatureCollection', 'features': [
        {'type': 'Feature', 'properties': properties, 'geometry': geometry}
        for geometry, properties in features]})


def point(*coordinates):
    return {'type': 'Point', 'coordinates': list(coordinates)}


def the_task(scenario):
    timed, = scenario.tasks
    return timed.task


@pytest.mark.parametrize(('mode', 'alt', 'expected'), [
    ('<altitudeMode>absolute</altitudeMode>', 530, 42.0),
    ('<altitudeMode>relativeToGround</altitudeMode>', 35, 35.0),
    ('<altitudeMode>clampToGround</altitudeMode>', 999, 50.0),
    ('', 999, 50.0),
])
def test_a_placemark_is_a_task_at_its_place_and_height(tmp_path, mode, alt, expected):
    scenario, notes = imported(tmp_path, 'job.kml', KML.format(
        MAST.format(mode=mode, alt=alt, data='checked in May\nvalue: 3\nlatest = 600')))
    task = the_task(scenario)
    latitude, longitude, altitude = to_geodetic(ORIGIN, task.position)
    assert (latitude, longitude) == pytest.approx((47.4, 8.547), abs=1e-9)
    assert altitude == pytest.approx(488.0 + expected, abs=0.05)  # the earth curves
    assert (task.id, task.value, task.latest) == ('Mast_7', 3.0, 600.0)
    assert notes == ["job.kml: Placemark 'Mast 7': its id is Mast_7"]
    assert [uav.id for uav in scenario.uavs] == ['uav_1']


def test_extended_data_in_both_forms_are_values_of_the_task(tmp_path):
    data = ('<ExtendedData><Data name="value"><value>2.5</value></Data><SchemaData>'
            '<SimpleData name="service_time">12</SimpleData>'
            '<SimpleData name="required_capabilities">camera, lidar</SimpleData>'
            '</SchemaData></ExtendedData>')
    text = KML.format(MAST.format(mode='', alt=0, data='').replace('<Point>', data + '<Point>'))
    task = the_task(imported(tmp_path, 'job.kml', text)[0])
    assert (task.value, task.service_time) == (2.5, 12.0)
    assert task.required_capabilities == {'camera', 'lidar'}


@pytest.mark.parametrize('folder', ['No-fly zones', 'zones', 'no fly', 'Zone'])
def test_polygons_in_a_folder_of_zones_are_zones(tmp_path, folder):
    hole = ('<innerBoundaryIs><LinearRing><coordinates>8.545,47.401 8.546,47.401 8.546,47.402'
            '</coordinates></LinearRing></innerBoundaryIs>')
    scenario, notes = imported(tmp_path, 'job.kml', KML.format(
        f'<Folder><name>{folder}</name>{POLYGON.format("school", hole)}</Folder>'))
    timed, = scenario.zones
    assert (timed.zone.id, len(timed.zone.vertices)) == ('school', 3)
    assert notes == ["job.kml: Placemark 'school': the holes of the zone are closed"]


def test_what_is_not_imported_is_named(tmp_path):
    text = KML.format(MAST.format(mode='', alt=0, data='') + LINE + POLYGON.format('field', '')
                      + '<NetworkLink><name>more</name></NetworkLink>'
                      + '<Placemark><name>empty</name></Placemark>')
    scenario, notes = imported(tmp_path, 'job.kml', text)
    assert [timed.task.id for timed in scenario.tasks] == ['Mast_7', 'wire']
    assert sorted(notes) == [
        "job.kml: NetworkLink 'more': links are not followed",
        "job.kml: Placemark 'Mast 7': its id is Mast_7",
        "job.kml: Placemark 'empty': it has no geometry",
        "job.kml: Placemark 'field': a polygon, which is neither in a folder of zones nor has "
        'kind: zone; --strip-width makes each an area, --polygons zones a zone']


def test_many_changed_names_are_one_note(tmp_path):
    marks = [(point(8.547, 47.4), {'name': f' a__b {n} ', 'prio': n}) for n in range(1, 4)]
    scenario, notes = imported(tmp_path, 'job.geojson', geojson(*marks))
    assert [timed.task.id for timed in scenario.tasks] == ['a_b_1', 'a_b_2', 'a_b_3']
    assert notes == ["job.geojson: feature 'a__b 1': 'prio' is not used; 'value' is",
                     "job.geojson: feature 'a__b 1': its id is a_b_1; 2 more names are changed"]


def test_a_point_without_coordinates_is_left_out(tmp_path):
    text = KML.format(MAST.format(mode='', alt=0, data='')
                      + '<Placemark><name>by post</name><address>Bern</address><Point/>'
                        '</Placemark>')
    scenario, notes = imported(tmp_path, 'job.kml', text)
    assert len(scenario.tasks) == 1
    assert notes[0] == "job.kml: Placemark 'by post': <Point> has no coordinates"


def test_lines_and_polygons_become_what_the_user_chooses(tmp_path):
    text = KML.format('<Placemark><name>all</name><MultiGeometry>'
                      + LINE.partition('</name>')[2].removesuffix('</Placemark>')
                      + POLYGON.format('', '').partition('</name>')[2].removesuffix('</Placemark>')
                      + '</MultiGeometry></Placemark>')
    scenario, notes = imported(tmp_path, 'job.kml', text, all_zones=True, vertices=True)
    assert [timed.task.id for timed in scenario.tasks] == ['all_1', 'all_2', 'all_3']
    assert [timed.zone.id for timed in scenario.zones] == ['all']
    assert notes == []


def test_a_kmz_is_its_kml(tmp_path):
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, 'w', zipfile.ZIP_DEFLATED) as archive:
        archive.writestr('images/a.png', b'')
        archive.writestr('doc.kml', KML.format(MAST.format(mode='', alt=0, data='')))
    assert the_task(imported(tmp_path, 'job.kmz', packed.getvalue())[0]).id == 'Mast_7'


def test_a_damaged_kmz_is_refused(tmp_path):
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, 'w', zipfile.ZIP_DEFLATED) as archive:
        archive.writestr('doc.kml', KML.format(MAST.format(mode='', alt=0, data='')))
    damaged = bytearray(packed.getvalue())
    damaged[38:42] = b'\xff\xff\xff\xff'  # within the compressed data
    with pytest.raises(MapFileError, match='expected a KMZ archive'):
        imported(tmp_path, 'damaged.kmz', bytes(damaged))


def test_geojson_has_tasks_zones_and_uavs(tmp_path):
    ring = [[8.54, 47.40], [8.55, 47.40], [8.55, 47.41], [8.54, 47.40]]
    scenario, notes = imported(tmp_path, 'job.geojson', geojson(
        (point(8.547, 47.4), {'name': 'a', 'value': 2, 'altitude': 60, 'colour': 'red'}),
        ({'type': 'MultiPoint', 'coordinates': [[8.548, 47.4], [8.549, 47.4]]}, {'name': 'b'}),
        ({'type': 'Polygon', 'coordinates': [ring]}, {'kind': 'zone', 'name': 'z', 'z_max': 80,
                                                      'margin': '5'}),
        (point(8.5, 47.4), {'kind': 'no-fly zone'.replace(' ', '_'), 'radius': 40}),
        (point(8.5456, 47.3977), {'kind': 'uav', 'id': 'alpha', 'range': 4000}),
        (None, {'name': 'nothing'})))
    assert [timed.task.id for timed in scenario.tasks] == ['a', 'b', 'b_2']
    assert scenario.tasks[0].task.position[2] == pytest.approx(60.0, abs=0.05)
    z, circle = (timed.zone for timed in scenario.zones)
    assert (z.z_max, z.margin, circle.radius) == (80.0, 5.0, 40.0)
    uav, = scenario.uavs
    assert (uav.id, uav.range) == ('alpha', 4000.0)
    assert uav.position == pytest.approx((0.0, 0.0, 0.0), abs=1e-6)
    assert notes == ["job.geojson: feature 'nothing': it has no geometry",
                     "job.geojson: feature 'b': its id is b_2"]


def test_words_of_other_programs_are_answered(tmp_path):
    _, notes = imported(tmp_path, 'job.geojson', geojson(
        (point(8.547, 47.4), {'name': 'a', 'priority': 2})))
    assert notes == ["job.geojson: feature 'a': 'priority' is not used; 'value' is"]


@pytest.mark.parametrize(('altitudes', 'expected'), [('amsl', 42.0), ('origin', 530.0),
                                                     ('ignore', 50.0)])
def test_altitudes_of_geojson_mean_what_the_user_says(tmp_path, altitudes, expected):
    text = geojson((point(8.547, 47.4, 530), {'name': 'a'}))
    with pytest.raises(MapFileError, match="feature 'a': altitude 530, and the file does not say "
                                           'above what: expected --altitudes'):
        imported(tmp_path, 'job.geojson', text)
    task = the_task(imported(tmp_path, 'job.geojson', text, altitudes=altitudes)[0])
    assert task.position[2] == pytest.approx(expected, abs=0.05)


@pytest.mark.parametrize('separator', [',', ';', '\t'])
def test_a_table_has_a_point_a_line(tmp_path, separator):
    text = '\ufeffName,Lat,Lon,altitude,value,required_capabilities\n' \
           'p1,47.400,8.547,40,2,\n"p 2",47.401,8.548,,,camera\n'
    scenario, notes = imported(tmp_path, 'job.csv', text.replace(',', separator))
    one, two = (timed.task for timed in scenario.tasks)
    assert (one.id, one.value, two.id, two.value) == ('p1', 2.0, 'p_2', 1.0)
    assert two.required_capabilities == {'camera'}
    assert [round(task.position[2]) for task in (one, two)] == [40, 50]
    assert notes == ['job.csv:3: its id is p_2']


def plan_text(items, fence=None):
    return json.dumps({
        'fileType': 'Plan', 'version': 1, 'groundStation': 'QGroundControl',
        'geoFence': fence or {'circles': [], 'polygons': [], 'version': 2},
        'mission': {'items': items, 'plannedHomePosition': [47.3977, 8.5456, 488], 'version': 2},
        'rallyPoints': {'points': [], 'version': 2}})


def simple(command, latitude, longitude, altitude, mode=1, hold=0, number=1):
    return {'type': 'SimpleItem', 'command': command, 'AltitudeMode': mode, 'doJumpId': number,
            'frame': 3, 'autoContinue': True,
            'params': [hold, 0, 0, None, latitude, longitude, altitude]}


def test_a_plan_of_qgroundcontrol(tmp_path):
    scenario, notes = imported(tmp_path, 'job.plan', plan_text(
        [simple(22, 0, 0, 20), simple(16, 47.4, 8.547, 30, hold=7, number=2),
         simple(16, 47.401, 8.547, 530, mode=2, number=3), simple(206, 0, 0, 0),
         {'type': 'ComplexItem', 'complexItemType': 'fwLandingPattern'}, simple(20, 0, 0, 0)],
        {'circles': [{'circle': {'center': [47.402, 8.547], 'radius': 30}, 'inclusion': False}],
         'polygons': [
             {'inclusion': False, 'polygon': [[47.40, 8.54], [47.40, 8.55], [47.41, 8.55]]},
             {'inclusion': True, 'polygon': [[47.3, 8.4], [47.3, 8.6], [47.5, 8.6]]}]}),
        origin=None)
    one, two = (timed.task for timed in scenario.tasks)
    assert (one.id, one.service_time, round(one.position[2])) == ('wp2', 7.0, 30)
    assert (two.id, round(two.position[2])) == ('wp3', 42)
    assert scenario.origin == ORIGIN
    assert [timed.zone.id for timed in scenario.zones] == ['circle_1', 'polygon_1']
    assert notes == [
        'job.plan: item 1: a take-off, which is no task: the bridge flies its own',
        'job.plan: item 4: command 206 is none of 16, 19, 82',
        'job.plan: item 5: a fwLandingPattern is no survey, corridor or structure scan',
        'job.plan: item 6: a return, which is no task: the bridge flies its own']
    assert len(scenario.fence_area) == 3


BROKEN = {
    'no.xml.kml': ('hello', 'syntax error: line 1, column 0: expected KML'),
    'cut.kml': (KML.format('')[:-9], 'expected KML'),
    'other.kml': ('<gpx/>', 'the document is <gpx>: expected <kml>'),
    'text.kml': (KML.format(MAST.format(mode='', alt='high', data='')),
                 "Placemark 'Mast 7': coordinates ['8.5470', '47.4000', 'high']: expected longi"),
    'spaces.kml': (KML.format(MAST.format(mode='', alt=0, data='').replace(',', ', ')),
                   "Placemark 'Mast 7': coordinates ['8.5470', '']"),
    'two.kml': (KML.format(MAST.format(mode='', alt='0 8.5,47.4', data='')),
                'a point with 2 positions: expected one'),
    'swapped.kml': (KML.format(MAST.format(mode='', alt=0, data='').replace('8.5470', '147')
                               .replace('47.4000', '98')),
                    "Placemark 'Mast 7': longitude 147, latitude 98: expected degrees"),
    'empty_ring.kml': (KML.format(POLYGON.format('f', '').replace(RING, '8,47 9,47')),
                       "Placemark 'f': a ring with 2 vertices: expected at least 3"),
    'bomb.kml': ('<!DOCTYPE k [<!ENTITY a "aaaaaaaaaa">' + ''.join(
        f'<!ENTITY {chr(98 + n)} "{"&" + chr(97 + n) + ";" * 1}{("&" + chr(97 + n) + ";") * 40}">'
        for n in range(9)) + ']><kml>&j;</kml>', 'expected KML'),
    'external.kml': ('<!DOCTYPE k [<!ENTITY x SYSTEM "file:///etc/passwd">]><kml>&x;</kml>',
                     'undefined entity'),
    'no_archive.kmz': ('PK', 'expected a KMZ archive'),
    'list.geojson': ('[]', 'expected a GeoJSON object'),
    'cut.geojson': ('{"type": ', 'cut.geojson:1: Expecting value: expected JSON'),
    'topology.geojson': ('{"type": "Topology"}', "geometry 'Topology': expected Point"),
    'crs.geojson': ('{"type": "FeatureCollection", "features": [], "crs": {"type": "name", '
                    '"properties": {"name": "urn:ogc:def:crs:EPSG::2056"}}}',
                    "crs = 'urn:ogc:def:crs:EPSG::2056': expected longitude and latitude"),
    'metres.geojson': (geojson((point(2600000, 1200000), {})), 'feature 1: longitude 2.6e+06'),
    'nan.geojson': (geojson((point(8.5, float('nan')), {})), 'feature 1: coordinates [8.5, nan]'),
    'true.geojson': (geojson((point(True, 4), {})), 'feature 1: coordinates [True, 4]'),
    'nothing.geojson': (geojson(), 'nothing to import: expected points, lines, areas'),
    'value.geojson': (geojson((point(8.547, 47.4), {'name': 'a', 'value': -1})),
                      "feature 'a': scenario.tasks[0].value = -1: expected a number in (0, inf)"),
    'kind.geojson': (geojson((point(8.547, 47.4), {'kind': 'house'})),
                     "feature 1: kind = 'house': expected one of task, zone, no_fly_zone, uav, p"),
    'far.geojson': (geojson((point(100.0, 47.4), {})), 'a place within 500 km of the origin'),
    'radius.geojson': (geojson((point(8.547, 47.4), {'kind': 'zone'})),
                       'a zone that is a point: expected a polygon, or a point with a radius'),
    'deep.geojson': ('[' * 100_000, 'nested too deep'),
    'latin.geojson': ('{"type": "é"}'.encode('latin-1'), 'byte 0xe9 at 10: expected UTF-8 text'),
    'list.plan': ('[1]', 'expected a .plan file of QGroundControl'),
    'other.plan': ('{"fileType": "Map"}', "fileType = 'Map': expected Plan"),
    'short.plan': (plan_text([{'type': 'SimpleItem', 'command': 16, 'params': [0]}]),
                   'short.plan: a list is too short: expected a .plan file'),
    'key.plan': ('{"fileType": "Plan"}', "key.plan: 'mission' is missing: expected a .plan file"),
    'kind.plan': ('{"fileType": "Plan", "mission": {"items": 7}}',
                  'kind.plan: a value is of another kind'),
    'line.csv': ('lat,lon,kind\n47.4,8.547,line\n',
                 "line.csv:2: kind = 'line' of a point: expected a line"),
    'area.geojson': (geojson((point(8.547, 47.4), {'kind': 'Area'})),
                     "feature 1: kind = 'area' of a point: expected a polygon"),
    'twice.csv': ('lat,lon,lat\n47.4,8.547,47.5\n',
                  'twice.csv:1: two columns lat: expected each name once'),
    'heights.csv': ('lat,lon,altitude,altitude_amsl\n47.4,8.547,50,500\n',
                    'columns altitude and altitude_amsl: expected one of them'),
    'heights.geojson': (geojson((point(8.547, 47.4), {'altitude': 50, 'altitude_amsl': 500})),
                        'feature 1: altitude and altitude_amsl: expected one of them'),
    'mode.plan': (plan_text([simple(16, 47.4, 8.5, 30, mode=9)]),
                  'item 1: AltitudeMode 9, frame 3: expected an altitude relative to launch'),
    'empty.csv': ('', "columns '': expected one named latitude"),
    'column.csv': ('name,lat\na,3\n', "columns 'name, lat': expected one named longitude"),
    'short.csv': ('name,lat,lon\na,47\n', 'short.csv:2: expected 3 columns: name, lat, lon'),
    'comma.csv': ('name;lat;lon\na;47,4;8,5\n', "comma.csv:2: coordinates ['8,5', '47,4']"),
    'quote.csv': ('name,lat,lon\n"a,47,8\n', 'unexpected end of data: expected CSV'),
    'job.shp': ('', 'expected a name that ends with .kml, .kmz'),
}


@pytest.mark.parametrize('name', BROKEN)
def test_a_broken_file_is_refused_with_file_element_and_reason(tmp_path, name):
    content, reason = BROKEN[name]
    with pytest.raises(MapFileError) as refused:
        imported(tmp_path, name, content)
    assert reason in str(refused.value)
    assert name in str(refused.value) or 'nothing to import' in reason
    assert '\n' not in str(refused.value)


def test_a_kind_is_read_without_regard_to_case(tmp_path):
    read, _ = imported(tmp_path, 'a.csv', 'lat,lon,kind,radius\n47.4,8.547,Orbit,30\n')
    assert [(task.task.id, task.work.kind.name, task.work.radius) for task in read.tasks] == [
        ('task', 'ORBIT', 30.0)]


def test_rows_without_any_value_are_ignored(tmp_path):
    read, _ = imported(tmp_path, 'a.csv', 'lat,lon,name\n47.4,8.547,m\n,,\n , ,\n')
    assert [task.task.id for task in read.tasks] == ['m']


def test_without_an_origin_the_file_is_refused(tmp_path):
    with pytest.raises(MapFileError, match='the origin is not known: expected --origin'):
        imported(tmp_path, 'a.geojson', geojson((point(8.5, 47.4), {})), origin=None)


def test_the_command_adds_to_a_fleet_and_replaces_no_file(tmp_path, capsys):
    fleet = written(tmp_path, 'fleet.yaml', """
origin: {latitude: 47.3977, longitude: 8.5456, altitude_amsl: 488}
separation: {horizontal: 10}
uavs: [{id: u1, position: [0, 0, 0], range: 5000}, {id: u2, position: [9, 0, 0]}]
tasks: [{id: Mast_7, position: [1, 2, 3]}]
""")
    kml = written(tmp_path, 'job.kml', KML.format(MAST.format(mode='', alt=0, data='')))
    assert main(['import', str(kml), '--fleet', str(fleet)]) == 0
    said = capsys.readouterr()
    assert said.out == f'{tmp_path}/job.yaml: 2 tasks, 0 zones, 2 UAVs; ' \
                       'origin 47.397700, 8.545600, 488 m AMSL\n'
    assert "job.kml: Placemark 'Mast 7': its id is Mast_7_2" in said.err
    scenario = load(tmp_path / 'job.yaml')
    assert [timed.task.id for timed in scenario.tasks] == ['Mast_7', 'Mast_7_2']
    assert (scenario.uavs[0].range, scenario.separation.horizontal) == (5000.0, 10.0)
    before = Path(tmp_path / 'job.yaml').read_bytes()
    assert main(['import', str(kml), '--fleet', str(fleet)]) == 1
    assert 'expected a file that does not exist yet' in capsys.readouterr().err
    assert Path(tmp_path / 'job.yaml').read_bytes() == before


@pytest.mark.parametrize(('arguments', 'reason'), [
    (['--origin', '47,8'], "--origin = '47,8': expected LAT,LON,ALT as 47.397742,8.545594,488"),
    (['--origin', '97,8,0'], 'origin latitude = 97.0: expected a number in [-90, 90]'),
    (['--polygons', 'tasks'], "--polygons = 'tasks': expected one of zones"),
])
def test_an_option_that_cannot_be_used_says_why(tmp_path, capsys, arguments, reason):
    with pytest.raises(SystemExit):
        main(['import', str(tmp_path / 'a.kml'), *arguments])
    assert reason in capsys.readouterr().err
