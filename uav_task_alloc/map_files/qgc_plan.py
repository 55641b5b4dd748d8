# SPDX-License-Identifier: Apache-2.0
"""Reader of .plan files of QGroundControl: waypoints, surveys, corridors, fences as zones, home.

The format: https://docs.qgroundcontrol.com/master/en/qgc-dev-guide/file_formats/plan.html
"""
from __future__ import annotations

import math
from typing import Any

from uav_task_alloc.errors import AllocError, damage, shown
from uav_task_alloc.geometry.fence_area import MOST_AREA_CORNERS
from uav_task_alloc.geometry.frames import Origin, to_geodetic_batch
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
from uav_task_alloc.map_files.qgc_complex import ABOVE_TERRAIN, ALTITUDE_MODES, read_complex_item

# MAVLink commands of items; no numbers of pymavlink, which is not loaded for the planner
TASK_COMMANDS = {16: 'waypoint', 19: 'loiter for a time', 82: 'spline waypoint'}  # param1: seconds
_NOT_TASKS = {20: 'return', 21: 'landing', 22: 'take-off'}  # the bridge makes its own
_WIDEST = 1e5  # [m] radius of a circle that includes
ITEM_FRAMES = {0: AMSL, 5: AMSL, 3: ABOVE_ORIGIN, 6: ABOVE_ORIGIN}  # MAV_FRAME


def read_plan(document: Any, file: str) -> MapFile:
    """Read a .plan file.

    Args:
        document: as `json.loads` returns it.
        file: its name, for messages.

    Returns:
        A point for each waypoint, a polygon for each survey, lines for each corridor, a zone for
        each excluding fence, an area for each including one, circles last; `origin` is the
        planned home.

    Raises:
        MapFileError: it is no .plan, or a value is of another kind.
    """
    try:
        if document['fileType'] != 'Plan':
            raise MapFileError(f'{file}: fileType = {shown(document["fileType"])}: expected Plan')
        read = MapFile(origin=_home(document['mission'].get('plannedHomePosition')))
        for number, item in enumerate(document['mission']['items'], 1):
            _read_item(item, f'{file}: item {number}', read)
        fence = document.get('geoFence') or {}
        circles = list(enumerate(fence.get('circles', ()), 1))
        for number, circle in circles:
            if not circle.get('inclusion'):
                _read_circle(circle, f'{file}: fence circle {number}', number, read)
        for number, polygon in enumerate(fence.get('polygons', ()), 1):
            _read_polygon(polygon, f'{file}: fence polygon {number}', number, read)
        for number, circle in circles:  # the area is a polygon that includes, where there is one
            if circle.get('inclusion'):
                _read_area(circle, f'{file}: fence circle {number}', read)
    except (AttributeError, LookupError, TypeError, ValueError, OverflowError) as error:
        if isinstance(error, AllocError):
            raise
        raise MapFileError(f'{file}: {damage(error)}: expected a .plan file of '
                           'QGroundControl') from None
    return read


def _home(given: Any) -> Origin | None:
    return None if given is None else Origin(*(float(value) for value in given[:3]))


def _read_item(item: dict[str, Any], where: str, read: MapFile) -> None:
    if item.get('type') != 'SimpleItem':
        read_complex_item(item, where, read)
        return
    command, params = item['command'], item['params']
    if command not in TASK_COMMANDS:
        read.left_out.append(f'{where}: {why_no_task(command)}')
        return
    terrain = item.get('AltitudeMode') in ABOVE_TERRAIN
    reference = ABOVE_ORIGIN if terrain else ALTITUDE_MODES.get(item.get('AltitudeMode', 0)) or (
        None if item.get('AltitudeMode') else ITEM_FRAMES.get(item.get('frame', 3)))
    if reference is None:
        raise MapFileError(f'{where}: AltitudeMode {shown(item.get("AltitudeMode"))}, frame '
                           f'{shown(item.get("frame"))}: expected an altitude relative to launch, '
                           'AMSL or above terrain')
    place = check_place(where, (params[5], params[4], params[6]))
    hold = float(params[0] or 0.0)
    own = own_values(where, item)
    name = own.pop('id', f'wp{item.get("doJumpId", len(read.elements) + 1)}')
    read.elements.append(Element(where, str(name), 'point', (place,), reference,
                                 {**({'service_time': hold} if hold > 0.0 else {}),
                                  **({'vertical': 'terrain'} if terrain else {}), **own}))


def why_no_task(command: int) -> str:
    """Return why an item is no task.

    Args:
        command: number of a MAVLink command that is not in TASK_COMMANDS.
    """
    if command in _NOT_TASKS:
        return f'a {_NOT_TASKS[command]}, which is no task: the bridge flies its own'
    return f'command {command} is none of {", ".join(map(str, TASK_COMMANDS))}'


def _read_circle(circle: dict[str, Any], where: str, number: int, read: MapFile) -> None:
    latitude, longitude = circle['circle']['center']
    own = own_values(where, circle)
    read.elements.append(Element(
        where, str(own.pop('id', f'circle_{number}')), 'circle',
        (check_place(where, (longitude, latitude)),), properties=own,
        radius=float(circle['circle']['radius']), zone=True))


def _read_area(circle: dict[str, Any], where: str, read: MapFile) -> None:
    """Read a circle that includes as a polygon inside of it."""
    latitude, longitude = circle['circle']['center']
    radius = float(circle['circle']['radius'])
    if not 0.0 < radius <= _WIDEST:
        raise MapFileError(f'{where}: radius {shown(radius)}: expected a number in (0, '
                           f'{_WIDEST:g}] m')
    middle = check_place(where, (longitude, latitude))
    angles = (math.tau * k / MOST_AREA_CORNERS for k in range(MOST_AREA_CORNERS))
    corners = to_geodetic_batch(Origin(middle.latitude, middle.longitude), [
        (radius * math.sin(angle), radius * math.cos(angle), 0.0) for angle in angles])
    read.elements.append(Element(
        where, '', 'polygon', tuple(check_place(where, (place[1], place[0]))
                                    for place in corners.tolist()),
        properties={'kind': 'fence_area'}, zone=True))


def _read_polygon(polygon: dict[str, Any], where: str, number: int, read: MapFile) -> None:
    ring: list[Place] = [check_place(where, (longitude, latitude))
                         for latitude, longitude in polygon['polygon']]
    own = {'kind': 'fence_area'} if polygon.get('inclusion') else own_values(where, polygon)
    read.elements.append(Element(where, str(own.pop('id', f'polygon_{number}')), 'polygon',
                                 open_ring(where, ring), properties=own, zone=True))
