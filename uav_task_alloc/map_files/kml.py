# SPDX-License-Identifier: Apache-2.0
"""Reader of KML and KMZ (OGC 07-147r2): placemarks with their folders, data and altitude modes."""
from __future__ import annotations

import io
import re
import zipfile
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree

from uav_task_alloc.map_files.elements import (
    ABOVE_ORIGIN,
    AMSL,
    LARGEST_FILE,
    UNSAID,
    Element,
    MapFile,
    MapFileError,
    Place,
    check_place,
    named,
    open_ring,
)

_ZONES = re.compile(r'\bzones?\b|\bno[ _-]?fly', re.IGNORECASE)  # names of folders
_LINE_OF_DATA = re.compile(r'^\s*([A-Za-z_]\w*)\s*[:=]\s*(\S.*?)\s*$')
_CONTAINERS = 'kml', 'Document', 'Folder'
_NOT_READ = {'NetworkLink': 'links are not followed', 'GroundOverlay': 'it is a picture',
             'ScreenOverlay': 'it is a picture', 'PhotoOverlay': 'it is a picture'}


def read_kmz(data: bytes, file: str) -> MapFile:
    """Read a KMZ file: the first .kml in its archive.

    Args:
        data: of the file.
        file: its name, for messages.

    Raises:
        MapFileError: it is damaged or has no KML.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            inner = next((info for info in archive.infolist()
                          if Path(info.filename).suffix.lower() == '.kml'), None)
            if inner is None:
                raise MapFileError(f'{file}: no .kml in the archive: expected one')
            if inner.file_size > LARGEST_FILE:
                raise MapFileError(f'{file}: {inner.filename} has {inner.file_size} bytes: '
                                   f'expected at most {LARGEST_FILE}')
            return read_kml(archive.read(inner), file)
    except (zipfile.BadZipFile, zipfile.LargeZipFile, NotImplementedError, RuntimeError,
            EOFError, OSError, zlib.error) as error:
        raise MapFileError(f'{file}: {error}: expected a KMZ archive') from None


def read_kml(data: bytes, file: str) -> MapFile:
    """Read a KML file of any version.

    Args:
        data: of the file.
        file: its name, for messages.

    Raises:
        MapFileError: it is no XML, no KML, or a coordinate is no number.
    """
    try:
        root = ElementTree.fromstring(data, ElementTree.XMLParser())
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        raise MapFileError(f'{file}: {error}: expected KML') from None
    if _tag(root) not in ('kml', 'Document', 'Folder', 'Placemark'):
        raise MapFileError(f'{file}: the document is <{_tag(root)}>: expected <kml>')
    read = MapFile()
    for number, (node, within) in enumerate(_placemarks(root, file, read), 1):
        _read_placemark(node, within, number, file, read)
    return read


def _tag(node: ElementTree.Element) -> str:
    return str(node.tag).rpartition('}')[2]


def _child(node: ElementTree.Element, tag: str) -> ElementTree.Element | None:
    return next((child for child in node if _tag(child) == tag), None)


def _text(node: ElementTree.Element, tag: str) -> str:
    child = _child(node, tag)
    return '' if child is None else ''.join(child.itertext()).strip()


class _Within(NamedTuple):
    """What the folders around a placemark say of it."""

    zone: bool = False  # one of them is called so
    mode: str = ''  # what heights of DJI Pilot 2 refer to
    height: str = ''  # [m] of its waypoints that have none of their own


def _within(folder: ElementTree.Element, outer: _Within) -> _Within:
    system = _child(folder, 'waylineCoordinateSysParam')
    mode = _text(folder, 'executeHeightMode') or (
        '' if system is None else _text(system, 'heightMode'))
    return _Within(outer.zone or bool(_ZONES.search(_text(folder, 'name'))), mode or outer.mode,
                   _text(folder, 'globalHeight') or outer.height)


def _placemarks(root: ElementTree.Element, file: str, read: MapFile
                ) -> Iterator[tuple[ElementTree.Element, _Within]]:
    """Placemarks in the order of the file, each with what its folders say."""
    open_nodes = [(root, _Within())]
    while open_nodes:
        node, outer = open_nodes.pop()
        tag = _tag(node)
        if tag == 'Placemark':
            yield node, outer
        elif tag in _CONTAINERS:
            within = _within(node, outer) if tag == 'Folder' else outer
            open_nodes += [(child, within) for child in reversed(node)]
        elif tag in _NOT_READ:
            read.left_out.append(f'{named(file, tag, _text(node, "name"), 1)}: {_NOT_READ[tag]}')


def _read_placemark(node: ElementTree.Element, within: _Within, number: int, file: str,
                    read: MapFile) -> None:
    name = _text(node, 'name')
    where = named(file, 'Placemark', name, number)
    data, before = {**_data(node), **_pilot_height(node, within, where)}, len(read.elements)
    open_nodes = list(reversed(node))
    while open_nodes:
        shape = open_nodes.pop()
        tag = _tag(shape)
        if tag == 'MultiGeometry':
            open_nodes += reversed(shape)
        elif tag in ('Track', 'MultiTrack', 'Model'):
            read.left_out.append(f'{where}: <{tag}> is no point, line or polygon')
        elif tag in ('Point', 'LineString') and not _text(shape, 'coordinates'):
            read.left_out.append(f'{where}: <{tag}> has no coordinates')
        elif tag in ('Point', 'LineString', 'LinearRing', 'Polygon'):
            geometry, places, holes = _shape(shape, tag, where)
            read.elements.append(Element(where, name, geometry, places, _reference(shape), data,
                                         holes=holes, zone=within.zone))
    if len(read.elements) == before and not (read.left_out
                                             and read.left_out[-1].startswith(where)):
        read.left_out.append(f'{where}: it has no geometry')


def _pilot_height(node: ElementTree.Element, within: _Within, where: str) -> dict[str, Any]:
    """The height of a waypoint of DJI Pilot 2 (WPML), which is no part of its coordinates.

    What heights refer to is said by the folder, see
    https://developer.dji.com/doc/cloud-api-tutorial/en/api-reference/dji-wpml/template-kml.html

    Raises:
        MapFileError: it is above the ellipsoid, or the file does not say above what.
    """
    if '/wpmz/' not in str(node.tag) and not any('/wpmz/' in str(child.tag) for child in node):
        return {}
    height = _text(node, 'executeHeight') or _text(node, 'height')
    if _text(node, 'useGlobalHeight') == '1':
        height = within.height or height
    if not height:
        return {}
    mode = _text(node, 'executeHeightMode') or _text(node, 'heightMode') or within.mode
    if mode == 'relativeToStartPoint':
        return {'altitude': height}
    if mode == 'EGM96':
        return {'altitude_amsl': height}
    if mode in ('aboveGroundLevel', 'realTimeFollowSurface'):
        return {'altitude': height, 'vertical': 'terrain'}
    raise MapFileError(f'{where}: height mode {mode or "unknown"}: expected relativeToStartPoint, '
                       'EGM96 or aboveGroundLevel in its folder')


def _shape(node: ElementTree.Element, tag: str, where: str) -> tuple[
        str, tuple[Place, ...], tuple[tuple[Place, ...], ...]]:
    """Geometry, places and holes."""
    if tag == 'Point':
        places = _coordinates(node, where)
        if len(places) != 1:
            raise MapFileError(f'{where}: a point with {len(places)} positions: expected one')
        return 'point', places, ()
    if tag != 'Polygon':
        return 'line', _coordinates(node, where), ()
    outer = _child(node, 'outerBoundaryIs')
    ring = None if outer is None else _child(outer, 'LinearRing')
    if ring is None:
        raise MapFileError(f'{where}: a polygon without outer boundary: expected one')
    holes = tuple(open_ring(where, _coordinates(inner, where)) for child in node
                  if _tag(child) == 'innerBoundaryIs' for inner in child
                  if _tag(inner) == 'LinearRing')
    return 'polygon', open_ring(where, _coordinates(ring, where)), holes


def _coordinates(node: ElementTree.Element, where: str) -> tuple[Place, ...]:
    words = _text(node, 'coordinates').split()
    if not words:
        raise MapFileError(f'{where}: <{_tag(node)}> has no coordinates: expected longitude,'
                           'latitude[,altitude]')
    return tuple(check_place(where, word.split(',')) for word in words)


def _reference(node: ElementTree.Element) -> str:
    """What altitudes of a geometry refer to; clampToGround, the default, has none."""
    return {'absolute': AMSL, 'relativeToGround': ABOVE_ORIGIN,
            'relativeToSeaFloor': UNSAID}.get(_text(node, 'altitudeMode'), '')


def _data(node: ElementTree.Element) -> dict[str, Any]:
    """ExtendedData, and lines `key: value` of the description."""
    found: dict[str, Any] = {}
    for line in re.split(r'\n|<br\s*/?>', _text(node, 'description')):
        if match := _LINE_OF_DATA.match(line):
            found[match[1].lower()] = match[2]
    for child in node.iter():
        name = str(child.get('name', '')).lower()
        if name and _tag(child) == 'Data':
            found[name] = _text(child, 'value')
        elif name and _tag(child) == 'SimpleData':
            found[name] = (child.text or '').strip()
    return found
