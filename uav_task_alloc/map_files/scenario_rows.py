# SPDX-License-Identifier: Apache-2.0
"""Turns elements of map files into the tasks, zones and UAVs of a scenario file."""
from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import yaml

from uav_task_alloc.errors import ScenarioError
from uav_task_alloc.geometry.frames import Origin
from uav_task_alloc.map_files.altitudes import Altitudes
from uav_task_alloc.map_files.elements import Element, MapFile, MapFileError, Place
from uav_task_alloc.map_files.property_values import number_in, property_value
from uav_task_alloc.map_files.scenario_ids import ScenarioIds
from uav_task_alloc.scenario.key_hints import SAME_MEANING
from uav_task_alloc.scenario.read import parse
from uav_task_alloc.scenario.schema import TASK, UAV, ZONE
from uav_task_alloc.work.values import MOST_CORNERS

_PLACE_KEYS = {'id', 'position', 'home', 'center', 'vertices', 'shape', 'latitude', 'longitude',
               'altitude'}
_WORK_KEYS = {'point': set[str](), 'line': {'divisible'},
              'area': {'strip_width', 'direction', 'divisible'},
              'orbit': {'radius', 'turns', 'direction'}}  # keys of one kind only
_OWN_KEYS = {'kind', 'path', 'holes'}.union(*_WORK_KEYS.values())
_KEYS = {'tasks': TASK.keys() - _PLACE_KEYS - _OWN_KEYS,
         'zones': (ZONE.keys() - _PLACE_KEYS) | {'shape'},
         'uavs': UAV.keys() - _PLACE_KEYS}
_KINDS = {'task': 'tasks', 'zone': 'zones', 'no_fly_zone': 'zones', 'uav': 'uavs',
          **dict.fromkeys(_WORK_KEYS, 'tasks'), 'fence_area': 'fence_area'}
_GEOMETRIES = {'point': 'point', 'orbit': 'point', 'line': 'line', 'area': 'polygon',
               'fence_area': 'polygon'}
_HINTED = {'value', 'service_time', 'latest'}  # keys for which a hint names other words
_RESULTS = 'route', 'track'  # written by map_files.write
_ROW = re.compile(r':\d+: (scenario\.(tasks|zones|uavs)\[(\d+)\].*)', re.DOTALL)
_ONE_PLACE = {'latitude': 2e-7, 'longitude': 2e-7, 'altitude': 0.02}  # [deg], [m]
_SHIFT = 5.0 / 111_000.0  # [deg] of latitude: UAVs without a place start 5 m apart


@dataclass(frozen=True, slots=True)
class ImportChoices:
    """What a file does not say.

    Args of the command `import`; see docs/map_files.md.
    """

    origin: Origin | None = None  # None: that of the fleet or the file
    height: float = 50.0  # [m] above the origin, of tasks without an altitude
    altitudes: str = ''  # what altitudes refer to where a file does not say: amsl, origin, ignore
    all_zones: bool = False  # every polygon is a zone
    vertices: bool = False  # a task at each vertex of a line
    strip_width: float = 0.0  # [m] of areas whose file does not say it; 0: they are left out
    uavs: int = 1  # where neither a file nor the fleet has any
    fleet: Mapping[str, Any] = field(default_factory=dict)  # a scenario, to which it is added


@dataclass(slots=True)
class ScenarioRows:
    """The text of a scenario, and what was said on the way."""

    text: str  # YAML
    counts: dict[str, int]  # of tasks, zones and UAVs
    origin: Origin
    notes: list[str]  # left out, closed, renamed


def to_scenario(files: Sequence[MapFile], choices: ImportChoices, name: str) -> ScenarioRows:
    """Make one scenario of the elements of files.

    Args:
        files: as the readers return them.
        choices: what files do not say.
        name: of the scenario.

    Returns:
        Its text, which `scenario.parse` has accepted.

    Raises:
        MapFileError: nothing can be planned, the origin or what an altitude refers to is not
            known, or a value is refused; the text names file and element.
    """
    document = {'name': name, **choices.fleet}
    origin = _origin(files, choices, document)
    document['origin'] = {'latitude': origin.latitude, 'longitude': origin.longitude,
                          'altitude_amsl': origin.altitude_amsl}
    rows = _Rows(origin, choices, document)
    for read in files:
        rows.notes += read.left_out
        for element in read.elements:
            rows.add(element)
    if not rows.added:
        raise MapFileError('; '.join(['nothing to import: expected points, lines, areas or zones',
                                      *rows.notes[:5]]))
    if not document.get('uavs'):
        document['uavs'] = [
            {'id': f'uav_{number + 1}', 'latitude': origin.latitude + number * _SHIFT,
             'longitude': origin.longitude, 'altitude': 0.0} for number in range(choices.uavs)]
    text = str(yaml.safe_dump(document, sort_keys=False, default_flow_style=None, width=99,
                              allow_unicode=True))
    _check(text, rows)
    return ScenarioRows(text, {kind: len(document.get(kind) or ()) for kind in _KEYS}, origin,
                        rows.all_notes())


def _origin(files: Iterable[MapFile], choices: ImportChoices, fleet: Mapping[str, Any]) -> Origin:
    if choices.origin is not None:
        return choices.origin
    if isinstance(fleet.get('origin'), Mapping):
        return Origin(**fleet['origin'])
    found = next((read.origin for read in files if read.origin is not None), None)
    if found is None:
        raise MapFileError('the origin is not known: expected --origin LAT,LON,ALT, the place of '
                           'the launch and its altitude AMSL, or --fleet with one')
    return found


def _check(text: str, rows: _Rows) -> None:
    """Parse the text; an error names the element that it comes from."""
    try:
        parse(text)
    except ScenarioError as error:
        match = _ROW.search(str(error))
        if match is None:
            raise MapFileError(str(error)) from None
        where = rows.places.get((match[2], int(match[3])))
        raise MapFileError(f'{where}: {match[1]}' if where else match[1]) from None


class _Rows:
    """The rows of the new scenario, beside those of its fleet."""

    def __init__(self, origin: Origin, choices: ImportChoices, document: dict[str, Any]) -> None:
        self.choices, self.document = choices, document
        self._altitudes = Altitudes(origin, choices.altitudes)
        self.places: dict[tuple[str, int], str] = {}  # (kind, index): file and element
        self.notes: list[str] = []
        self.added = 0
        self._unused: dict[tuple[str, str], str] = {}  # first element by property and our key
        for kind in _KEYS:
            document[kind] = list(document.get(kind) or ())
        self._ids = ScenarioIds({kind: [row.get('id') for row in document[kind]
                                        if isinstance(row, dict)] for kind in _KEYS})

    def add(self, element: Element) -> None:
        """Add what an element means, or a note of why it is left out."""
        kind = self._kind(element)
        if not kind:
            self.notes.append(f'{element.where}: a {element.properties["kind"]}, as plans and '
                              'flights are written')
        elif kind == 'zones':
            self._add_zone(element)
        elif kind == 'fence_area':
            self._set_area(element)
        elif kind == 'uavs' and element.geometry == 'point':
            self._add_point('uavs', element, element.places[0], element.name, 0.0)
        elif kind == 'tasks' and element.geometry == 'point':
            self._add_point('tasks', element, element.places[0], element.name,
                            self.choices.height)
        elif kind == 'tasks' and element.geometry == 'line' and self._as_vertices(element):
            for number, place in enumerate(element.places, 1):
                self._add_point('tasks', element, place, f'{element.name or "line"}_{number}',
                                self.choices.height)
        elif kind == 'tasks' and element.geometry == 'line':
            self._add_work('line', element, {})
        elif kind == 'tasks' and element.geometry == 'polygon' and self._strips(element):
            self._add_work('area', element, {'holes': [_corners(hole) for hole in element.holes],
                                             **self._strips(element)})
        elif kind == 'tasks':
            self.notes.append(f'{element.where}: a {element.geometry}, which is neither in a '
                              'folder of zones nor has kind: zone; --strip-width makes each an '
                              'area, --polygons zones a zone')
        else:
            raise MapFileError(f'{element.where}: a {element.geometry}: expected a point for a '
                               'UAV')

    def _as_vertices(self, element: Element) -> bool:
        return self.choices.vertices and _given_kind(element) != 'line'

    def _strips(self, element: Element) -> dict[str, Any]:
        """What says how wide the strips of an area are; nothing where it is not known."""
        if any(element.properties.get(key) for key in ('strip_width', 'camera')):
            return {'kind': 'area'}
        return {'strip_width': self.choices.strip_width} if self.choices.strip_width else {}

    def _add_work(self, kind: str, element: Element, row: dict[str, Any]) -> None:
        """Add a line or an area, of which points that repeat the one before are left out."""
        path = _without_repeats(
            {'latitude': place.latitude, 'longitude': place.longitude,
             'altitude': self._altitudes.height(element, place, self.choices.height)}
            for place in element.places)
        if not 1 < len(path) <= MOST_CORNERS:
            self.notes.append(f'{element.where}: a {element.geometry} of {len(path)} points: '
                              f'expected 2 to {MOST_CORNERS}')
        else:
            self._append('tasks', element, element.name or kind,
                         {'kind': kind, 'path': path, **row})

    def all_notes(self) -> list[str]:
        """What is left out or changed; of what recurs the first, and how many."""
        unused = [f'{where}: {key!r} is not used; {meant!r} is'
                  for (key, meant), where in self._unused.items()]
        return self.notes + unused + self._ids.notes()

    def _kind(self, element: Element) -> str:
        given = _given_kind(element)
        if given in _RESULTS:
            return ''
        if given and given not in _KINDS:
            raise MapFileError(f'{element.where}: kind = {given!r}: expected one of '
                               f'{", ".join(_KINDS)}')
        if _GEOMETRIES.get(given, element.geometry) != element.geometry:
            raise MapFileError(f'{element.where}: kind = {given!r} of a {element.geometry}: '
                               f'expected a {_GEOMETRIES[given]}')
        zone = element.zone or (element.geometry == 'polygon' and self.choices.all_zones)
        return _KINDS[given] if given else 'zones' if zone else 'tasks'

    def _add_point(self, kind: str, element: Element, place: Place, name: str,
                   without: float) -> None:
        orbit = {'kind': 'orbit'} if _given_kind(element) == 'orbit' else {}
        self._append(kind, element, name, {
            **orbit, 'latitude': place.latitude, 'longitude': place.longitude,
            'altitude': self._altitudes.height(element, place, without)})

    def _add_zone(self, element: Element) -> None:
        place = element.places[0]
        radius = number_in(element.properties.get('radius', element.radius))
        if element.geometry == 'polygon':
            if element.holes:
                self.notes.append(f'{element.where}: the holes of the zone are closed')
            row: dict[str, Any] = {'shape': 'polygon', 'vertices': _corners(element.places)}
        elif element.geometry == 'line' or radius is None or radius != radius:
            raise MapFileError(f'{element.where}: a zone that is a {element.geometry}: expected '
                               'a polygon, or a point with a radius')
        else:
            row = {'shape': 'cylinder', 'latitude': place.latitude,
                   'longitude': place.longitude, 'radius': radius}
            if element.properties.get('shape') == 'hemisphere':
                row['altitude'] = self._altitudes.height(element, place, 0.0)
        self._append('zones', element, element.name, row)

    def _set_area(self, element: Element) -> None:
        """The area that plans stay in: the first one, or that of the fleet."""
        if self.document.get('fence_area'):
            self.notes.append(f'{element.where}: a second fence_area: expected one')
            return
        if element.holes:
            self.notes.append(f'{element.where}: the holes of the fence_area are closed')
        self.document['fence_area'] = _corners(element.places)
        self.added += 1

    def _append(self, kind: str, element: Element, name: str, row: dict[str, Any]) -> None:
        used = _KEYS[kind] | (_WORK_KEYS[row.get('kind', 'point')] if kind == 'tasks' else set())
        properties = {key: property_value(key, value) for key, value in element.properties.items()
                      if key in used and value not in (None, '')}
        for meant in sorted(_HINTED & (_KEYS[kind] - properties.keys())):
            for key in sorted(element.properties.keys() & set(SAME_MEANING[meant].split())):
                self._unused.setdefault((key, meant), element.where)
        identifier = self._ids.take(kind, name, element.where)
        self.places[kind, len(self.document[kind])] = element.where
        self.document[kind].append({'id': identifier, **row, **properties})
        self.added += 1


def _corners(ring: Iterable[Place]) -> list[dict[str, float]]:
    return _without_repeats({'latitude': place.latitude, 'longitude': place.longitude}
                            for place in ring)


def _without_repeats(points: Iterable[dict[str, float]]) -> list[dict[str, float]]:
    """Points, of which those that repeat the one before are left out."""
    kept: list[dict[str, float]] = []
    for point in points:
        if not kept or any(abs(point[key] - kept[-1][key]) > _ONE_PLACE[key] for key in point):
            kept.append(point)
    return kept


def _given_kind(element: Element) -> str:
    """What the property `kind` says; '' for none."""
    return str(element.properties.get('kind', '')).strip().lower().replace('-', '_')
