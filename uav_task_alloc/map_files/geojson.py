# SPDX-License-Identifier: Apache-2.0
"""Reader of GeoJSON (RFC 7946): features, collections and bare geometries."""
from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from uav_task_alloc.errors import shown
from uav_task_alloc.map_files.elements import (
    Element,
    MapFile,
    MapFileError,
    Place,
    check_place,
    named,
    open_ring,
)

_WGS84 = 'CRS84', '4326'  # ends of the names of a `crs`, which files before the RFC have
_Shape = tuple[str, tuple[Place, ...], tuple[tuple[Place, ...], ...]]
_PARTS = {'MultiPoint': 'Point', 'MultiLineString': 'LineString', 'MultiPolygon': 'Polygon'}


def read_geojson(document: Any, file: str) -> MapFile:
    """Read a GeoJSON document.

    Args:
        document: as `json.loads` returns it.
        file: its name, for messages.

    Raises:
        MapFileError: it is no GeoJSON, or has other coordinates than WGS84.
    """
    if not isinstance(document, dict):
        raise MapFileError(f'{file}: {shown(document)}: expected a GeoJSON object')
    _check_crs(document, file)
    read = MapFile()
    if document.get('type') == 'FeatureCollection':
        features = document.get('features')
        if not isinstance(features, list):
            raise MapFileError(f'{file}: features = {shown(features)}: expected a list')
    elif document.get('type') == 'Feature':
        features = [document]
    else:
        features = [{'type': 'Feature', 'geometry': document}]
    for number, feature in enumerate(features, 1):
        _read_feature(feature, number, file, read)
    return read


def _check_crs(document: dict[str, Any], file: str) -> None:
    crs = document.get('crs')
    properties = crs.get('properties') if isinstance(crs, dict) else None
    name = properties.get('name') if isinstance(properties, dict) else None
    if crs is not None and not str(name).endswith(_WGS84):
        raise MapFileError(f'{file}: crs = {shown(name)}: expected longitude and latitude of '
                           'WGS84: export it as EPSG:4326')


def _read_feature(feature: Any, number: int, file: str, read: MapFile) -> None:
    if not isinstance(feature, dict) or feature.get('type') != 'Feature':
        raise MapFileError(f'{file}: feature {number} = {shown(feature)}: expected a Feature')
    given = feature.get('properties')
    properties = {str(key).lower(): value for key, value in given.items()} if isinstance(
        given, dict) else {}
    name = str(properties.get('id') or properties.get('name') or feature.get('id') or '').strip()
    where = named(file, 'feature', name, number)
    geometry = feature.get('geometry')
    if geometry is None:
        read.left_out.append(f'{where}: it has no geometry')
        return
    read.elements += [Element(where, name, kind, places, properties=properties, holes=holes)
                      for kind, places, holes in _shapes(geometry, where)]


def _shapes(geometry: Any, where: str) -> Iterator[_Shape]:
    """Geometry, places and holes of each part."""
    open_parts = [geometry]
    while open_parts:
        part = open_parts.pop()
        kind = part.get('type') if isinstance(part, dict) else None
        if kind == 'GeometryCollection':
            open_parts += reversed(_list(part.get('geometries'), where))
        elif kind in _PARTS:
            open_parts += [{'type': _PARTS[str(kind)], 'coordinates': each}
                           for each in reversed(_list(part.get('coordinates'), where))]
        elif kind in _PARTS.values():
            yield _shape(str(kind), _list(part.get('coordinates'), where), where)
        else:
            raise MapFileError(f'{where}: geometry {shown(kind)}: expected Point, LineString, '
                               'Polygon, one of their Multi forms or a GeometryCollection')


def _shape(kind: str, coordinates: list[Any], where: str) -> _Shape:
    if kind == 'Point':
        return 'point', (check_place(where, coordinates),), ()
    if kind == 'LineString':
        return 'line', _places(coordinates, where), ()
    if not coordinates:
        raise MapFileError(f'{where}: a polygon without rings: expected one')
    outer, *holes = (open_ring(where, _places(_list(ring, where), where)) for ring in coordinates)
    return 'polygon', outer, tuple(holes)


def _places(coordinates: list[Any], where: str) -> tuple[Place, ...]:
    return tuple(check_place(where, _list(each, where)) for each in coordinates)


def _list(value: Any, where: str) -> list[Any]:
    if not isinstance(value, list):
        raise MapFileError(f'{where}: {shown(value)}: expected a list')
    return value
