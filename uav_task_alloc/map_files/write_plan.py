# SPDX-License-Identifier: Apache-2.0
"""Writer of the tasks and zones of a scenario as a .plan file, as QGroundControl edits them.

Points are waypoints, areas surveys, level lines corridors and orbits structure scans; zones are
excluding fences. What QGroundControl has no key for is in `uav_task_alloc` of each item, so that
`import` makes the same tasks of it. The format:
https://docs.qgroundcontrol.com/master/en/qgc-dev-guide/file_formats/plan.html
"""
from __future__ import annotations

import math
from typing import Any

from uav_task_alloc.geometry.frames import Origin, to_geodetic
from uav_task_alloc.map_files.elements import OWN_KEY
from uav_task_alloc.model import Point, Shape
from uav_task_alloc.scenario.values import Scenario, TimedTask, TimedZone
from uav_task_alloc.scenario.write import scenario_task_row, scenario_zone_row
from uav_task_alloc.work.pieces import Work, pieces_of
from uav_task_alloc.work.values import Kind, Vertical

_RELATIVE, _TERRAIN = 1, 4  # QGroundControl's altitude modes
_FRAME = 3  # MAV_FRAME_GLOBAL_RELATIVE_ALT
_CORNERS = 24  # of the structure within an orbit
_FAR = 10.0  # [m] from its corners to the way of the camera, at most
_LEVEL = 0.05  # [m] between points of one height
_IN_ITEM = {  # keys of a scenario that items of QGroundControl have
    Kind.POINT: {'service_time'}, Kind.AREA: {'path', 'strip_width'},
    Kind.LINE: {'path'}, Kind.ORBIT: {'radius'}}
_PLACES = {'position', 'latitude', 'longitude', 'altitude', 'center', 'vertices', 'holes'}


def plan_document(scenario: Scenario) -> tuple[dict[str, Any], list[str]]:
    """The .plan of a scenario.

    Args:
        scenario: its tasks are not cut into pieces, or `work` says of what they are pieces.

    Returns:
        For `json.dumps`; and a line for each task and part of one that it cannot hold.
    """
    wholes = {timed.whole.task.id: timed for timed in scenario.tasks}
    origin, notes, items = scenario.origin, list[str](), list[dict[str, Any]]()
    for timed in wholes.values():
        work = timed.whole
        why = _why_not(work, origin)
        if why:
            notes.append(f'task {work.task.id}: {why}')
            continue
        if work.holes:
            notes.append(f'task {work.task.id}: a survey has no holes: they are not written')
        items.append({**_ITEMS[work.kind](work, origin, len(items) + 1), OWN_KEY: _own(timed)})
    fences = [_fence(timed, origin) for timed in scenario.zones]
    if scenario.fence_area:
        corners = tuple((x, y, 0.0) for x, y in scenario.fence_area)
        fences.append({'polygon': _ring(origin, corners), 'inclusion': True, 'version': 1})
    home = [origin.latitude, origin.longitude, origin.altitude_amsl]
    return {
        'fileType': 'Plan', 'version': 1, 'groundStation': 'QGroundControl',
        'geoFence': {'version': 2, 'circles': [each for each in fences if 'circle' in each],
                     'polygons': [each for each in fences if 'polygon' in each]},
        'mission': {'version': 2, 'firmwareType': 12, 'vehicleType': 2, 'cruiseSpeed': 15,
                    'hoverSpeed': 5, 'globalPlanAltitudeMode': _RELATIVE,
                    'plannedHomePosition': home, 'items': items},
        'rallyPoints': {'version': 2, 'points': []}}, notes


def _why_not(work: Work, origin: Origin) -> str:
    """Why QGroundControl has no item for work; '' if it has."""
    heights = [_height(work, origin, point) for point in work.path]
    if heights and max(heights) - min(heights) > _LEVEL:
        return 'its points have several heights, and a corridor has one'
    return ''


def _own(timed: TimedTask) -> dict[str, Any]:
    """What an item does not say otherwise, by key of a scenario."""
    kind = timed.whole.kind
    row = {key: value for key, value in scenario_task_row(timed).items()
           if key not in _PLACES | _IN_ITEM[kind] and value not in (None, [], math.inf, -math.inf)}
    return row | {'direction': timed.whole.direction} if kind is Kind.AREA else row


def _place(origin: Origin, point: Point) -> tuple[float, float, float]:
    """Latitude, longitude [deg], and height above the origin [m]."""
    latitude, longitude, amsl = to_geodetic(origin, point)
    return round(latitude, 9), round(longitude, 9), round(amsl - origin.altitude_amsl, 3)


def _ring(origin: Origin, points: tuple[Point, ...]) -> list[list[float]]:
    return [list(_place(origin, point)[:2]) for point in points]


def _height(work: Work, origin: Origin, point: Point) -> float:
    return round(point[2], 3) if work.vertical is Vertical.TERRAIN else _place(origin, point)[2]


def _waypoint(work: Work, origin: Origin, number: int) -> dict[str, Any]:
    point = work.task.position
    terrain = work.vertical is Vertical.TERRAIN
    latitude, longitude, _ = _place(origin, point)
    height = _height(work, origin, point)
    return {'type': 'SimpleItem', 'command': 16, 'autoContinue': True, 'doJumpId': number,
            'frame': _FRAME, 'Altitude': height, 'AMSLAltAboveTerrain': None,
            'AltitudeMode': _TERRAIN if terrain else _RELATIVE,
            'params': [work.task.service_time, 0, 0, None, latitude, longitude, height]}


def _style(work: Work, origin: Origin, side: float) -> dict[str, Any]:
    """What surveys and corridors share."""
    terrain = work.vertical is Vertical.TERRAIN
    photos = next((float(value) for action in work.task.actions if action.name == 'trigger'
                   for key, value in action.values if key == 'distance'), 0.0)
    return {'version': 2, 'CameraTriggerInTurnAround': False, 'FollowTerrain': terrain,
            'HoverAndCapture': False, 'Refly90Degrees': False, 'TurnAroundDistance': 0,
            'CameraCalc': {
                'version': 2, 'CameraName': 'Manual (no camera specs)',
                'AdjustedFootprintSide': side, 'AdjustedFootprintFrontal': photos,
                'DistanceMode': _TERRAIN if terrain else _RELATIVE,
                'DistanceToSurface': _height(work, origin, work.path[0])},
            'Items': [], 'VisualTransectPoints': []}


def _survey(work: Work, origin: Origin, _number: int) -> dict[str, Any]:
    piece = pieces_of(_flat(work))[0]
    (ax, ay, _), (bx, by, _) = piece.path[:2]
    angle = math.degrees(math.atan2(bx - ax, by - ay)) % 180.0  # clockwise from north
    return {'type': 'ComplexItem', 'complexItemType': 'survey', 'version': 5,
            'angle': round(angle, 6), 'entryLocation': 0, 'flyAlternateTransects': False,
            'splitConcavePolygons': False, 'polygon': _ring(origin, work.path),
            'TransectStyleComplexItem': _style(work, origin, work.strip_width)}


def _flat(work: Work) -> Work:
    """The same work above the origin: its directions do not depend on the ground."""
    return Work(work.task, work.kind, work.path, work.holes, work.strip_width, work.direction)


def _corridor(work: Work, origin: Origin, _number: int) -> dict[str, Any]:
    return {'type': 'ComplexItem', 'complexItemType': 'CorridorScan', 'version': 2,
            'CorridorWidth': 0, 'EntryPoint': 0, 'polyline': _ring(origin, work.path),
            'TransectStyleComplexItem': _style(work, origin, 1.0)}


def _structure(work: Work, origin: Origin, _number: int) -> dict[str, Any]:
    x, y, z = work.task.position
    far = min(_FAR, work.radius / 2.0)
    inner, step = work.radius - far, 2.0 * math.pi / _CORNERS
    height = _height(work, origin, (x, y, z))
    return {'type': 'ComplexItem', 'complexItemType': 'StructureScan', 'version': 3,
            'polygon': _ring(origin, tuple((x + inner * math.cos(step * k),
                                            y + inner * math.sin(step * k), z)
                                           for k in range(_CORNERS))),
            'Layers': 1, 'ScanBottomAlt': height - 1.0, 'StructureHeight': height + 1.0,
            'EntranceAltitude': height, 'GimbalPitch': 0, 'StartFromTop': False,
            'CameraCalc': {'version': 2, 'CameraName': 'Manual (no camera specs)',
                           'AdjustedFootprintSide': 2.0, 'AdjustedFootprintFrontal': 2.0,
                           'DistanceMode': _RELATIVE, 'DistanceToSurface': far}}


_ITEMS = {Kind.POINT: _waypoint, Kind.AREA: _survey, Kind.LINE: _corridor,
          Kind.ORBIT: _structure}


def _fence(timed: TimedZone, origin: Origin) -> dict[str, Any]:
    """An excluding fence with the limits of the zone, which QGroundControl does not know."""
    zone = timed.zone
    row = {key: value for key, value in scenario_zone_row(timed).items()
           if key not in _PLACES and value not in (None, math.inf, -math.inf)}
    if zone.shape is Shape.POLYGON:
        row.pop('shape')
        return {'polygon': _ring(origin, tuple((x, y, 0.0) for x, y in zone.vertices)),
                'inclusion': False, 'version': 1, OWN_KEY: row}
    height = zone.center[2] if zone.shape is Shape.HEMISPHERE else 0.0
    latitude, longitude, above = _place(origin, (*zone.center[:2], height))
    if zone.shape is Shape.HEMISPHERE:
        row['altitude'] = above
    row.pop('radius')
    return {'circle': {'center': [latitude, longitude], 'radius': zone.radius},
            'inclusion': False, 'version': 1, OWN_KEY: row}
