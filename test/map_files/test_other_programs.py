# SPDX-License-Identifier: Apache-2.0
"""Files as other programs write them, also broken ones: imported, or refused with the reason."""
import io
import json
import math
import zipfile

import pytest

from uav_task_alloc.geometry.frames import Origin
from uav_task_alloc.map_files.elements import MapFileError
from uav_task_alloc.map_files.read import read_map_file
from uav_task_alloc.map_files.scenario_rows import ImportChoices, to_scenario
from uav_task_alloc.scenario import parse

ORIGIN = Origin(47.3977, 8.5456, 488.0)
HOME = [47.3977, 8.5456, 488.0]
CAMERA = {'AdjustedFootprintFrontal': 25, 'AdjustedFootprintSide': 40, 'DistanceMode': 1,
          'DistanceToSurface': 60}
SQUARE = [[47.400, 8.547], [47.400, 8.551], [47.402, 8.551], [47.402, 8.547]]
LONLAT = [[8.547, 47.400], [8.551, 47.400], [8.551, 47.402], [8.547, 47.400]]
TEXT = ' '.join(f'{x},{y},30' for x, y in LONLAT)
EARTH = ('<?xml version="1.0" encoding="UTF-8"?>\n<kml xmlns="http://www.opengis.net/kml/2.2" '
         'xmlns:gx="http://www.google.com/kml/ext/2.2"><Document><name>my places.kml</name>'
         '<StyleMap id="s"><Pair><key>normal</key></Pair></StyleMap>{}</Document></kml>')
POLYGON = ('<Placemark><name>Untitled Polygon</name><styleUrl>#s</styleUrl><Polygon>'
           '<tessellate>1</tessellate><outerBoundaryIs><LinearRing><coordinates>' + TEXT
           + '</coordinates></LinearRing></outerBoundaryIs></Polygon></Placemark>')
PATH = ('<Placemark><name>Path</name><LineString><altitudeMode>{}</altitudeMode><coordinates>'
        + TEXT + '</coordinates></LineString></Placemark>')
PIN = ('<Placemark><name>Pin</name><LookAt><longitude>8.5</longitude></LookAt><Point>'
       '<gx:drawOrder>1</gx:drawOrder><coordinates>{}</coordinates></Point></Placemark>')
TEMPLATE = """<?xml version="1.0" encoding="UTF-8"?>
<kml xmlns="http://www.opengis.net/kml/2.2" xmlns:wpml="http://www.dji.com/wpmz/1.0.2"><Document>
<wpml:missionConfig><wpml:flyToWaylineMode>safely</wpml:flyToWaylineMode></wpml:missionConfig>
<Folder><wpml:templateType>waypoint</wpml:templateType><wpml:templateId>0</wpml:templateId>
<wpml:waylineCoordinateSysParam><wpml:coordinateMode>WGS84</wpml:coordinateMode>
<wpml:heightMode>{}</wpml:heightMode></wpml:waylineCoordinateSysParam>
<wpml:globalHeight>90</wpml:globalHeight>
<Placemark><Point><coordinates>8.547,47.400</coordinates></Point><wpml:index>0</wpml:index>
<wpml:ellipsoidHeight>610</wpml:ellipsoidHeight><wpml:height>{}</wpml:height>
<wpml:useGlobalHeight>{}</wpml:useGlobalHeight></Placemark>
</Folder></Document></kml>"""
LITCHI = ('latitude,longitude,altitude(m),heading(deg),curvesize(m),rotationdir,gimbalmode,'
          'gimbalpitchangle,actiontype1,actionparam1,altitudemode,speed(m/s),poi_latitude\n'
          '47.400,8.547,35,90,0.2,0,0,0,1,0,{},5,0\n47.401,8.548,45,90,0.2,0,0,0,-1,0,{},5,0\n')
HEAD = 'QGC WPL 110\n0\t1\t0\t16\t0\t0\t0\t0\t47.3977\t8.5456\t488\t1\n'
ITEM = '{}\t0\t{}\t{}\t{}\t0\t0\t0\t47.400\t8.547\t{}\t1\n'


def kmz(name, text):
    out = io.BytesIO()
    with zipfile.ZipFile(out, 'w') as archive:
        archive.writestr(name, text)
    return out.getvalue()


def qgc(*items, **more):
    return json.dumps({'fileType': 'Plan', 'version': 1, 'groundStation': 'QGroundControl',
                       'mission': {'items': list(items), 'plannedHomePosition': HOME}, **more})


def simple(**more):
    return {'type': 'SimpleItem', 'command': 16, 'doJumpId': 1, 'frame': 3, 'AltitudeMode': 1,
            'params': [0, 0, 0, None, 47.4, 8.547, 50], **more}


def feature(kind, coordinates, **properties):
    return json.dumps({'type': 'FeatureCollection', 'features': [{
        'type': 'Feature', 'properties': properties,
        'geometry': {'type': kind, 'coordinates': coordinates}}]})


def survey(**more):
    return {'type': 'ComplexItem', 'complexItemType': 'survey', 'polygon': SQUARE, 'angle': 0,
            'TransectStyleComplexItem': {'CameraCalc': CAMERA}, **more}


# program and what it wrote: name, content, and the kinds and heights [m] of the tasks made
READ = {
    'Google Earth polygon': ('a.kml', EARTH.format(POLYGON), ['AREA 50']),
    'Google Earth path on the ground': ('a.kml', EARTH.format(PATH.format('clampToGround')),
                                        ['LINE 50']),
    'Google Earth pin': ('a.kml', EARTH.format(PIN.format('8.547,47.4,0')), ['POINT 50']),
    'Google Earth KMZ': ('a.kmz', kmz('doc.kml', EARTH.format(POLYGON)), ['AREA 50']),
    'UgCS route, absolute': ('a.kml', EARTH.format(PATH.format('absolute')).replace(
        ',30', ',530'), ['LINE 42']),
    'DJI Pilot, above the start': ('a.kml', EARTH.format(PATH.format('relativeToGround')),
                                   ['LINE 30']),
    'DJI Pilot 2, above the start': ('a.kmz', kmz('wpmz/template.kml', TEMPLATE.format(
        'relativeToStartPoint', 75, 0)), ['POINT 75']),
    'DJI Pilot 2, above mean sea level': ('a.kmz', kmz('wpmz/template.kml', TEMPLATE.format(
        'EGM96', 588, 0)), ['POINT 100']),
    'DJI Pilot 2, above ground': ('a.kmz', kmz('wpmz/template.kml', TEMPLATE.format(
        'aboveGroundLevel', 60, 0)), ['POINT 60 terrain']),
    'DJI Pilot 2, one height for all': ('a.kmz', kmz('wpmz/template.kml', TEMPLATE.format(
        'relativeToStartPoint', 75, 1)), ['POINT 90']),
    'Google My Maps, CDATA': ('a.kml', EARTH.format(PIN.format('8.547,47.4,0').replace(
        '<LookAt>', '<description><![CDATA[value: 3<br>latest: 900]]></description><LookAt>')),
        ['POINT 50']),
    'geojson.io polygon': ('a.geojson', feature('Polygon', [LONLAT]), ['AREA 50']),
    'geojson.io line and point': ('a.geojson', json.dumps({
        'type': 'FeatureCollection', 'features': [
            {'type': 'Feature', 'id': 0, 'properties': {}, 'geometry': {
                'type': 'LineString', 'coordinates': LONLAT[:3]}},
            {'type': 'Feature', 'id': 1, 'properties': {}, 'geometry': {
                'type': 'Point', 'coordinates': LONLAT[0]}}]}), ['LINE 50', 'POINT 50']),
    'QGIS, with crs': ('a.geojson', json.dumps({
        'type': 'FeatureCollection', 'name': 'layer', 'crs': {'type': 'name', 'properties': {
            'name': 'urn:ogc:def:crs:OGC:1.3:CRS84'}}, 'features': [{
                'type': 'Feature', 'properties': {'fid': 1}, 'geometry': {
                    'type': 'MultiPolygon', 'coordinates': [[LONLAT]]}}]}), ['AREA 50']),
    'QGIS, CSV with semicolons': ('a.csv', '\ufeffid;X;Y\nm1;8.547;47.400\n', ['POINT 50']),
    'QGroundControl waypoints': ('a.plan', qgc(
        simple(command=22), simple(), simple(command=20)), ['POINT 50']),
    'QGroundControl survey': ('a.plan', qgc(survey()), ['AREA 60']),
    'QGroundControl corridor': ('a.plan', qgc({
        'type': 'ComplexItem', 'complexItemType': 'CorridorScan', 'CorridorWidth': 40,
        'polyline': SQUARE[:3], 'TransectStyleComplexItem': {'CameraCalc': CAMERA}}),
        ['LINE 60']),
    'QGroundControl structure scan': ('a.plan', qgc({
        'type': 'ComplexItem', 'complexItemType': 'StructureScan', 'version': 3, 'Layers': 1,
        'ScanBottomAlt': 0, 'StructureHeight': 25, 'polygon': SQUARE, 'CameraCalc': CAMERA}),
        ['ORBIT 12']),
    'QGroundControl, above terrain': ('a.plan', qgc(simple(AltitudeMode=4)),
                                      ['POINT 50 terrain']),
    'QGroundControl fences': ('a.plan', qgc(simple(), geoFence={'circles': [{
        'inclusion': False, 'circle': {'center': SQUARE[2], 'radius': 30}}], 'polygons': [{
            'inclusion': False, 'polygon': SQUARE[:3]}]}), ['POINT 50']),
    'Mission Planner': ('a.waypoints', HEAD + ITEM.format(1, 3, 22, 0, 20) + ITEM.format(
        2, 3, 16, 5, 100) + ITEM.format(3, 3, 177, 0, 0), ['POINT 100']),
    'Mission Planner, absolute': ('a.waypoints', HEAD + ITEM.format(1, 0, 16, 0, 530),
                                  ['POINT 42']),
    'Mission Planner, terrain': ('a.waypoints', HEAD + ITEM.format(1, 10, 16, 0, 40),
                                 ['POINT 40 terrain']),
    'QGroundControl for PX4, no home': ('a.waypoints', HEAD.split('0\t1')[0] + ITEM.format(
        0, 3, 22, 0, 20) + ITEM.format(1, 3, 16, 0, 70), ['POINT 70']),
    'no home, a task first': ('a.waypoints', HEAD.split('0\t1')[0] + ITEM.format(
        0, 3, 16, 0, 60) + ITEM.format(1, 3, 16, 0, 70), ['POINT 60', 'POINT 70']),
    'MAVProxy wp save': ('way.txt', (HEAD + ITEM.format(1, 3, 82, 0, 60)).replace('\n', '\r\n'),
                         ['POINT 60']),
    'Litchi, above take-off': ('a.csv', LITCHI.format(0, 0), ['POINT 35', 'POINT 45']),
    'Litchi, above ground': ('a.csv', LITCHI.format(1, 0), ['POINT 35 terrain', 'POINT 45']),
}
# and what is refused, with words of the reason
REFUSED = {
    'KML cut off': ('a.kml', EARTH.format(POLYGON)[:500], 'a.kml: .*expected KML'),
    'KML with swapped axes': ('a.kml', EARTH.format(PIN.format('8.5,147.4')),
                              "Placemark 'Pin': longitude 8.5, latitude 147.4"),
    'KML with a decimal comma': ('a.kml', EARTH.format(PIN.format('8,547,47,4')),
                                 "Placemark 'Pin': "),
    'KML of a link only': ('a.kml', EARTH.format('<NetworkLink><name>l</name></NetworkLink>'),
                           "NetworkLink 'l': links are not followed"),
    'KML of a track only': ('a.kml', EARTH.format(
        '<Placemark><name>t</name><gx:Track/></Placemark>'), "'t': <Track> is no point"),
    'KMZ that is no archive': ('a.kmz', b'PK\x03\x04 nothing', 'expected a KMZ archive'),
    'DJI Pilot 2, above the ellipsoid': ('a.kmz', kmz('wpmz/template.kml', TEMPLATE.format(
        'WGS84', 75, 0)), 'Placemark 1: height mode WGS84: expected relativeToStartPoint'),
    'DJI Pilot 2 without a mode': ('a.kmz', kmz('wpmz/template.kml', TEMPLATE.format('', 75, 0)),
                                   'Placemark 1: height mode unknown'),
    'DJI Pilot 2 without KML': ('a.kmz', kmz('wpmz/waylines.wpml', TEMPLATE), 'no .kml in the'),
    'GeoJSON in metres': ('a.geojson', json.dumps({
        'type': 'FeatureCollection', 'features': [], 'crs': {'type': 'name', 'properties': {
            'name': 'urn:ogc:def:crs:EPSG::25832'}}}), 'export it as EPSG:4326'),
    'GeoJSON with heights': ('a.geojson', feature('Point', [8.547, 47.4, 530.0], name='p'),
                             "feature 'p': altitude 530, and the file does not say above what"),
    'TopoJSON': ('a.json', '{"type": "Topology", "objects": {}}', "geometry 'Topology'"),
    'UgCS route as JSON': ('a.json', '{"version": {"major": 4}, "route": {"name": "r"}}',
                           'a.json: feature 1: geometry None'),
    'QGroundControl .mission': ('a.plan', '{"fileType": "Mission", "items": []}',
                                "fileType = 'Mission': expected Plan"),
    'QGroundControl, later survey': ('a.plan', qgc(survey(
        TransectStyleComplexItem={'CameraCalc': {**CAMERA, 'DistanceMode': 9}})),
        'item 1: DistanceMode = 9'),
    'QGroundControl, early structure scan': ('a.plan', qgc({
        'type': 'ComplexItem', 'complexItemType': 'StructureScan', 'version': 2, 'Altitude': 50,
        'polygon': SQUARE, 'CameraCalc': CAMERA, 'Layers': 1}), 'item 1: a structure scan '),
    'QGroundControl landing pattern': ('a.plan', qgc({
        'type': 'ComplexItem', 'complexItemType': 'fwLandingPattern'}),
        'item 1: a fwLandingPattern is no survey'),
    'Mission Planner, ten columns': ('a.waypoints', HEAD + '1 0 3 16 0 0 0 0 47 8\n',
                                     'a.waypoints:3: .*expected 12 numbers'),
    'Mission Planner, body frame': ('a.waypoints', HEAD + ITEM.format(1, 8, 16, 0, 40),
                                    'a.waypoints:3: frame 8'),
    'a note in .txt': ('way.txt', 'bring the big battery', 'expected QGC WPL 110'),
    'Litchi with an unknown mode': ('a.csv', LITCHI.format(7, 0), "a.csv:2: altitudemode = '7'"),
    'Litchi in feet': ('a.csv', LITCHI.format(0, 0).replace('altitude(m)', 'altitude(ft)'),
                       r'altitude\(ft\): expected metres'),
    'GeoJSON with a number without end': ('a.geojson', feature(
        'Point', [10**400, 47.4]), 'feature 1: coordinates'),
    'GeoJSON with a number of thousands of digits': (
        'a.geojson', '{"type": "Point", "coordinates": [8, ' + '9' * 5000 + ']}', 'of digits'),
    'GeoJSON with an altitude without end': ('a.geojson', feature(
        'Point', [8.547, 47.4], altitude=10**400), 'altitude = 10{9}'),
    'QGroundControl, home without end': ('a.plan', qgc(simple()).replace('488.0', '1' + '0' * 400),
                                         'a.plan: OverflowError'),
    'QGroundControl, layers without end': ('a.plan', qgc({
        'type': 'ComplexItem', 'complexItemType': 'StructureScan', 'Layers': math.inf,
        'ScanBottomAlt': 0, 'polygon': SQUARE, 'CameraCalc': CAMERA}), 'OverflowError'),
    'QGroundControl, corridor of 300 km': ('a.plan', qgc({
        'type': 'ComplexItem', 'complexItemType': 'CorridorScan', 'CorridorWidth': 3e5,
        'polyline': SQUARE[:3], 'TransectStyleComplexItem': {'CameraCalc': CAMERA}}),
        'item 1: CorridorWidth = 300000.0: expected at most 1000 passes of 40 m'),
    'CSV with a quotation mark in its head': ('a.csv', '"a"b,lat,lon\n1,2,3\n',
                                              'a.csv:1: .*expected CSV'),
    'CSV without places': ('a.csv', 'name,height\nm1,5\n', 'expected one named latitude'),
    'a shapefile': ('a.shp', b'\x00\x00\x27\x0a', 'expected a name that ends with .kml'),
    'an empty file': ('a.geojson', '', 'a.geojson:1: .*expected JSON'),
}


def made(tmp_path, name, content):
    path = tmp_path / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return to_scenario([read_map_file(path)], ImportChoices(
        ORIGIN, strip_width=40.0), 'job')


@pytest.mark.parametrize('program', READ)
def test_a_file_of_another_program_is_read(tmp_path, program):
    name, content, expected = READ[program]
    found = []
    for timed in parse(made(tmp_path, name, content).text).tasks:
        whole = timed.whole
        terrain = ' terrain' * (whole.vertical.name == 'TERRAIN')
        found.append(f'{whole.kind.name} {whole.task.position[2]:.0f}{terrain}')
    assert found == expected


@pytest.mark.parametrize('program', REFUSED)
def test_a_file_that_cannot_be_read_is_refused_with_file_element_and_reason(tmp_path, program):
    name, content, why = REFUSED[program]
    with pytest.raises(MapFileError, match=why) as caught:
        made(tmp_path, name, content)
    assert name in str(caught.value)
