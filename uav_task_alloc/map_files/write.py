# SPDX-License-Identifier: Apache-2.0
"""Writer of maps as GeoJSON (RFC 7946) and KML (OGC 07-147r2): routes, tracks, tasks, zones."""
from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from uav_task_alloc.atomic_files import replacing
from uav_task_alloc.geometry.frames import Origin, to_geodetic_batch
from uav_task_alloc.geometry.polygon import XY
from uav_task_alloc.model import Plan, Point, Shape, Task, ThreatZone
from uav_task_alloc.model.route_stops import route_points
from uav_task_alloc.palette import RED, STATE_COLOURS, uav_colour
from uav_task_alloc.record.ground_truth import TrueSample
from uav_task_alloc.record.run_state import RunState
from uav_task_alloc.scenario.values import Scenario, ScenarioUav

_CORNERS = 48  # of a circle; they are outside of it
_DIGITS = 9, 9, 3  # of degrees and metres
_FENCE = 'fence'  # the folder whose polygons are not filled


@dataclass(frozen=True, slots=True)
class MapShape:
    """A point, line or polygon of a map."""

    name: str
    folder: str  # tasks | fence | zones | routes | tracks
    geometry: str  # Point | LineString | Polygon
    points: tuple[Point, ...]  # [m] ENU; of a polygon its open outer ring
    properties: dict[str, Any] = field(default_factory=dict)
    colour: str = RED  # #rrggbb
    level: bool = True  # False: the file has no heights for it


def plan_shapes(scenario: Scenario, plan: Plan) -> list[MapShape]:
    """The map of a plan.

    Args:
        scenario: of the plan.
        plan: its routes are drawn with their detours.

    Returns:
        Tasks with UAV, number and arrival, or why they are left out; zones; routes.
    """
    numbers = {task: (uav, number) for uav, tasks in plan.routes.items()
               for number, task in enumerate(tasks, 1)}
    arrivals = plan.arrivals
    tasks = []
    for timed in scenario.tasks:
        task = timed.task
        uav, number = numbers.get(task.id, ('', 0))
        row: dict[str, Any] = {'planned_for': uav, 'number': number} if uav else {
            'unassigned': plan.unassigned.get(task.id, 'not planned')}
        if uav and math.isfinite(arrivals.get(task.id, math.inf)):
            row['arrival'] = round(arrivals[task.id], 1)
        way = task.path[::-1] if task.id in plan.reversed else task.path
        tasks.append(MapShape(
            task.id, 'tasks', 'LineString' if way else 'Point', way or (task.position,), {
                'kind': 'task', 'altitude': task.position[2], 'value': task.value,
                'service_time': task.service_time, **_limits(task), **row},
            _colours(scenario.uavs).get(uav, RED)))
    known = {timed.task.id: timed.task for timed in scenario.tasks}
    routes = [MapShape(uav.id, 'routes', 'LineString', tuple(points), {
        'kind': 'route', 'metres': round(plan.route(uav.id).distance, 1)},
        _colours(scenario.uavs)[uav.id])
        for uav in scenario.uavs if len(points := route_points(uav.uav, plan, known)) > 1]
    return [*tasks, *_area_shapes(scenario.fence_area),
            *(zone_shape(timed.zone) for timed in scenario.zones), *routes]


def _limits(task: Task) -> dict[str, Any]:
    """Window, release, payload and capabilities of a task, by the keys of a scenario, if any."""
    found = {'earliest': task.earliest, 'latest': task.latest, 'release': task.release or math.inf,
             'payload': task.payload or math.inf}
    names = ', '.join(sorted(task.required_capabilities))
    return {**{key: value for key, value in found.items() if math.isfinite(value)},
            **({'required_capabilities': names} if names else {})}


def _area_shapes(corners: Sequence[XY]) -> list[MapShape]:
    points = tuple((x, y, 0.0) for x, y in corners)
    return [MapShape('fence_area', _FENCE, 'Polygon', points, {'kind': 'fence_area'},
                     level=False)] if points else []


def _colours(uavs: Sequence[ScenarioUav]) -> dict[str, str]:
    return {uav.id: uav_colour(number) for number, uav in enumerate(uavs)}


def zone_shape(zone: ThreatZone) -> MapShape:
    """A zone without its margin; a hemisphere as the circle on its base plane.

    Args:
        zone: of any shape.
    """
    limits = {key: value for key, value in (('z_min', zone.z_min), ('z_max', zone.z_max))
              if math.isfinite(value)}
    if zone.shape is Shape.HEMISPHERE:
        limits = {'z_max': zone.center[2] + zone.radius}
    corners = zone.vertices if zone.shape is Shape.POLYGON else _circle(zone)
    return MapShape(zone.id, 'zones', 'Polygon', tuple((x, y, 0.0) for x, y in corners), {
        'kind': 'zone', 'margin': zone.margin, **limits}, level=False)


def _circle(zone: ThreatZone) -> tuple[tuple[float, float], ...]:
    far, step = zone.radius / math.cos(math.pi / _CORNERS), 2.0 * math.pi / _CORNERS
    return tuple((zone.center[0] + far * math.cos(step * i),
                  zone.center[1] + far * math.sin(step * i)) for i in range(_CORNERS))


def flight_shapes(run: RunState, tracks: Mapping[str, Sequence[TrueSample]]) -> list[MapShape]:
    """The map of a flight.

    Args:
        run: its record.
        tracks: of each UAV, in order of time; those of the simulator's log, or as reported.

    Returns:
        Tasks with their last state, every zone that was in force, and tracks.
    """
    tasks = []
    for name, task in run.tasks.items():
        status = run.statuses.last(name)
        row = {'state': status.state, 'flown_by': status.uav} if status else {'state': 'no status'}
        tasks.append(MapShape(name, 'tasks', 'Point', (task.position,), {
            'kind': 'task', 'altitude': task.position[2], **row},
            STATE_COLOURS.get(row['state'], RED)))
    zones = dict.fromkeys(interval.zone for interval in run.zones)
    return [*tasks, *_area_shapes(run.fence_area), *map(zone_shape, zones), *(
        MapShape(uav, 'tracks', 'LineString', tuple(sample.point for sample in track),
                 {'kind': 'track'}, uav_colour(number))
        for number, (uav, track) in enumerate(sorted(tracks.items())) if len(track) > 1)]


def write_map(path: Path, origin: Origin, shapes: Iterable[MapShape]) -> None:
    """Write a map; the end of its name says as what.

    Args:
        path: ends with .geojson or .kml.
        origin: of the ENU frame.
        shapes: in the order in which they are written.

    Raises:
        OSError: the file cannot be written.
    """
    rows = [(shape, _degrees(origin, shape)) for shape in shapes]
    text = _geojson(rows) if path.suffix.lower() == '.geojson' else _kml(path.stem, rows)
    with replacing(path) as file:
        file.write_text(text, encoding='utf-8')


def _degrees(origin: Origin, shape: MapShape) -> list[list[float]]:
    """Longitude, latitude and, unless it has none, altitude AMSL of each point."""
    order = (1, 0, 2) if shape.level else (1, 0)
    rows = [[round(float(place[i]), _DIGITS[i]) for i in order]
            for place in to_geodetic_batch(origin, shape.points)]
    return [*rows, rows[0]] if shape.geometry == 'Polygon' else rows


def _geojson(rows: Iterable[tuple[MapShape, list[list[float]]]]) -> str:
    features = []
    for shape, places in rows:
        coordinates: Any = {'Point': places[0], 'LineString': places, 'Polygon': [places]}[
            shape.geometry]
        features.append({
            'type': 'Feature', 'properties': {
                'name': shape.name, **shape.properties, 'stroke': shape.colour},
            'geometry': {'type': shape.geometry, 'coordinates': coordinates}})
    return json.dumps({'type': 'FeatureCollection', 'features': features}, indent=1,
                      allow_nan=False) + '\n'


def _kml(name: str, rows: Iterable[tuple[MapShape, list[list[float]]]]) -> str:
    kml = ElementTree.Element('kml', xmlns='http://www.opengis.net/kml/2.2')
    document = ElementTree.SubElement(kml, 'Document')
    ElementTree.SubElement(document, 'name').text = name
    folders: dict[str, ElementTree.Element] = {}
    for shape, places in rows:
        if shape.folder not in folders:
            folders[shape.folder] = ElementTree.SubElement(document, 'Folder')
            ElementTree.SubElement(folders[shape.folder], 'name').text = shape.folder
        _placemark(folders[shape.folder], shape, places)
    ElementTree.indent(kml)
    return ElementTree.tostring(kml, encoding='unicode', xml_declaration=True) + '\n'


def _placemark(folder: ElementTree.Element, shape: MapShape, places: list[list[float]]) -> None:
    mark = ElementTree.SubElement(folder, 'Placemark')
    ElementTree.SubElement(mark, 'name').text = shape.name
    style = ElementTree.SubElement(mark, 'Style')
    red, green, blue = shape.colour[1:3], shape.colour[3:5], shape.colour[5:7]
    for tag, opacity in (('IconStyle', 'ff'), ('LineStyle', 'ff'),
                         ('PolyStyle', '00' if shape.folder == _FENCE else '60')):
        colour = ElementTree.SubElement(ElementTree.SubElement(style, tag), 'color')
        colour.text = f'{opacity}{blue}{green}{red}'  # aabbggrr
    data = ElementTree.SubElement(mark, 'ExtendedData')
    for key, value in shape.properties.items():
        ElementTree.SubElement(ElementTree.SubElement(data, 'Data', name=key),
                               'value').text = str(value)
    node = geometry = ElementTree.SubElement(mark, shape.geometry)
    if shape.level:
        ElementTree.SubElement(geometry, 'altitudeMode').text = 'absolute'
    if shape.geometry == 'Polygon':
        node = ElementTree.SubElement(ElementTree.SubElement(geometry, 'outerBoundaryIs'),
                                      'LinearRing')
    ElementTree.SubElement(node, 'coordinates').text = ' '.join(
        ','.join(map(repr, place)) for place in places)
