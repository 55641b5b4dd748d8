# SPDX-License-Identifier: Apache-2.0
"""Reader of surveys, corridor and structure scans in .plan files of QGroundControl.

The format: https://docs.qgroundcontrol.com/master/en/qgc-dev-guide/file_formats/plan.html
"""
from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Any

from uav_task_alloc.errors import shown
from uav_task_alloc.geometry.frames import Origin, to_enu
from uav_task_alloc.map_files.elements import (
    ABOVE_ORIGIN,
    AMSL,
    Element,
    MapFile,
    MapFileError,
    Place,
    check_place,
    open_ring,
    own_values,
)

ALTITUDE_MODES = {1: ABOVE_ORIGIN, 2: AMSL}
ABOVE_TERRAIN = 3, 4  # calculated from terrain data, or by the frame
_CROSSED = (': the passes across its strips (Refly90Degrees) are not imported: add an area with '
            'another direction for them')
_DEGREE = 111_319.5  # [m] of latitude
_MOST_LAYERS, _MOST_PASSES = 100, 1000  # of a structure scan; of a corridor


def read_complex_item(item: dict[str, Any], where: str, read: MapFile) -> None:
    """Read a survey, a corridor or a structure scan; other complex items are left out with a word.

    Args:
        item: as JSON has it.
        where: file and item, for messages.
        read: to which it is added.

    Raises:
        MapFileError: a value is missing or out of range.
    """
    kind = item.get('complexItemType', item.get('type'))
    if kind == 'StructureScan':
        _read_structure(item, where, read)
        return
    if kind not in ('survey', 'CorridorScan'):
        read.left_out.append(f'{where}: a {kind} is no survey, corridor or structure scan')
        return
    style = item['TransectStyleComplexItem']
    camera = style['CameraCalc']
    side, height = float(camera['AdjustedFootprintSide']), float(camera['DistanceToSurface'])
    if not (math.isfinite(side) and side > 0.0):
        raise MapFileError(f'{where}: AdjustedFootprintSide = {shown(side)}: expected more than 0')
    reference, terrain = _reference(camera, style, where)
    properties: dict[str, Any] = {'vertical': 'terrain'} if terrain else {}
    frontal = float(camera.get('AdjustedFootprintFrontal') or 0.0)
    if frontal > 0.0:
        properties['actions'] = [{'name': 'trigger', 'distance': frontal}]
    count = sum(element.name.startswith(('survey', 'corridor')) for element in read.elements) + 1
    if kind == 'survey':
        if style.get('Refly90Degrees'):
            read.left_out.append(where + _CROSSED)
        ring = open_ring(where, _places(item['polygon'], height, where))
        course = math.radians(float(item.get('angle') or 0.0))  # clockwise from north
        direction = round(math.remainder(math.pi / 2 - course, 2 * math.pi), 9)
        own = {'direction': direction, **own_values(where, item)}
        read.elements.append(Element(where, str(own.pop('id', f'survey_{count}')), 'polygon', ring,
                                     reference, {**properties, 'strip_width': side, **own}))
        return
    line = _places(item['polyline'], height, where)
    passes = max(1, math.ceil(float(item.get('CorridorWidth') or 0.0) / side - 1e-9))
    if passes > _MOST_PASSES:
        raise MapFileError(f'{where}: CorridorWidth = {shown(item["CorridorWidth"])}: expected at '
                           f'most {_MOST_PASSES} passes of {side:g} m')
    for k in range(passes):
        shifted = _beside(line, (k - (passes - 1) / 2) * side)
        own = own_values(where, item)
        name = str(own.pop('id', f'corridor_{count}')) + f'_{k + 1}' * (passes > 1)
        read.elements.append(Element(where, name, 'line', shifted, reference,
                                     {**properties, **own}))


def _read_structure(item: dict[str, Any], where: str, read: MapFile) -> None:
    """Read a structure scan as a circle for each of its layers, around all of its corners."""
    if 'ScanBottomAlt' not in item:
        read.left_out.append(f'{where}: a structure scan without ScanBottomAlt, of an early '
                             'version: expected one that a present QGroundControl has saved')
        return
    camera, ring = item['CameraCalc'], open_ring(where, _places(item['polygon'], 0.0, where))
    count = sum(element.name.startswith('structure') for element in read.elements) + 1
    frontal, distance = float(camera['AdjustedFootprintFrontal']), float(
        camera['DistanceToSurface'])
    bottom, layers = float(item['ScanBottomAlt']), int(item['Layers'])
    if not (frontal > 0.0 and distance >= 0.0 and 0 < layers <= _MOST_LAYERS
            and math.isfinite(frontal + distance + bottom)):
        raise MapFileError(f'{where}: Layers = {layers}, AdjustedFootprintFrontal = {frontal:g}, '
                           f'DistanceToSurface = {distance:g}: expected 1 to {_MOST_LAYERS} and '
                           'positive lengths')
    own = own_values(where, item)
    name = str(own.pop('id', f'structure_{count}'))
    centre, radius = _circle_around(ring)
    for k in range(layers):
        place = Place(centre.latitude, centre.longitude, bottom + (k + 0.5) * frontal)
        read.elements.append(Element(
            where, name + f'_{k + 1}' * (layers > 1), 'point', (place,), ABOVE_ORIGIN,
            {'kind': 'orbit', 'radius': round(radius + distance, 3), **own}))


def _circle_around(ring: Sequence[Place]) -> tuple[Place, float]:
    """The middle of the corners of a ring, and the distance of the farthest [m]."""
    latitude = math.fsum(each.latitude for each in ring) / len(ring)
    longitude = math.fsum(each.longitude for each in ring) / len(ring)
    middle = Origin(latitude, longitude, 0.0)
    return Place(latitude, longitude), max(math.hypot(*to_enu(
        middle, each.latitude, each.longitude, 0.0)[:2]) for each in ring)


def _reference(camera: dict[str, Any], style: dict[str, Any], where: str) -> tuple[str, bool]:
    """What its height refers to, and whether it is above terrain."""
    mode = camera.get('DistanceMode')
    if style.get('FollowTerrain') or mode in ABOVE_TERRAIN:
        return ABOVE_ORIGIN, True
    if mode is None:
        return (ABOVE_ORIGIN if camera.get('DistanceToSurfaceRelative', True) else AMSL), False
    if mode not in ALTITUDE_MODES:
        raise MapFileError(f'{where}: DistanceMode = {shown(mode)}: expected 1 (relative to '
                           'launch), 2 (AMSL) or 3, 4 (terrain)')
    return ALTITUDE_MODES[mode], False


def _places(given: Sequence[Sequence[Any]], height: float, where: str) -> tuple[Place, ...]:
    return tuple(check_place(where, (longitude, latitude, height))
                 for latitude, longitude in (each[:2] for each in given))


def _beside(line: tuple[Place, ...], metres: float) -> tuple[Place, ...]:
    """A line parallel to another one, to its left; its corners are where both sides meet."""
    if metres == 0.0 or len(line) < 2:
        return line
    first = line[0]
    wide = _DEGREE * math.cos(math.radians(first.latitude))
    flat = [((each.longitude - first.longitude) * wide, (each.latitude - first.latitude) * _DEGREE)
            for each in line]
    sides = []
    for a, b in pairwise(flat):
        length = math.dist(a, b) or 1.0
        sides.append((-(b[1] - a[1]) / length, (b[0] - a[0]) / length))
    moved = []
    for k, (x, y) in enumerate(flat):
        one, other = sides[max(0, k - 1)], sides[min(k, len(sides) - 1)]
        # at a sharp corner at most 4 times as far
        share = metres / max(0.25, 1.0 + one[0] * other[0] + one[1] * other[1])
        moved.append((x + share * (one[0] + other[0]), y + share * (one[1] + other[1])))
    return tuple(Place(first.latitude + y / _DEGREE, first.longitude + x / wide, each.altitude)
                 for (x, y), each in zip(moved, line, strict=True))
