# SPDX-License-Identifier: Apache-2.0
"""Reader of surveys and corridor scans in .plan files of QGroundControl.

The format: https://docs.qgroundcontrol.com/master/en/qgc-dev-guide/file_formats/plan.html
"""
from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Any

from uav_task_alloc.errors import shown
from uav_task_alloc.map_files.elements import (
    ABOVE_ORIGIN,
    AMSL,
    Element,
    MapFile,
    MapFileError,
    Place,
    check_place,
    open_ring,
)

ALTITUDE_MODES = {1: ABOVE_ORIGIN, 2: AMSL}
ABOVE_TERRAIN = 3, 4  # calculated from terrain data, or by the frame
_DEGREE = 111_319.5  # [m] of latitude


def read_complex_item(item: dict[str, Any], where: str, read: MapFile) -> None:
    """Read a survey or a corridor; other complex items are left out with a word.

    Args:
        item: as JSON has it.
        where: file and item, for messages.
        read: to which it is added.

    Raises:
        MapFileError: a value is missing or out of range.
    """
    kind = item.get('complexItemType', item.get('type'))
    if kind not in ('survey', 'CorridorScan'):
        read.left_out.append(f'{where}: a {kind} is neither a survey nor a corridor')
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
        ring = open_ring(where, _places(item['polygon'], height, where))
        course = math.radians(float(item.get('angle') or 0.0))  # clockwise from north
        read.elements.append(Element(where, f'survey_{count}', 'polygon', ring, reference, {
            **properties, 'strip_width': side,
            'direction': round(math.remainder(math.pi / 2 - course, 2 * math.pi), 9)}))
        return
    line = _places(item['polyline'], height, where)
    passes = max(1, math.ceil(float(item.get('CorridorWidth') or 0.0) / side - 1e-9))
    for k in range(passes):
        shifted = _beside(line, (k - (passes - 1) / 2) * side)
        name = f'corridor_{count}' + f'_{k + 1}' * (passes > 1)
        read.elements.append(Element(where, name, 'line', shifted, reference, properties))


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
