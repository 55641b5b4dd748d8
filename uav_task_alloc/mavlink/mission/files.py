# SPDX-License-Identifier: Apache-2.0
"""A plan as files that a person loads into a ground station: .plan and .waypoints for each UAV.

Formats: QGroundControl's plan file, version 1 (docs.qgroundcontrol.com, "Plan File Format"), and
the plain text that begins with `QGC WPL 110` (mavlink.io, "File Formats"), whose first item is
home. The items are those that the bridge uploads.
"""
from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any
from urllib.parse import quote

from uav_task_alloc.geometry.frames import Origin, to_geodetic, to_geodetic_batch
from uav_task_alloc.geometry.zones import way_is_clear
from uav_task_alloc.mavlink.autopilots import ARDUPILOT, OFF_GROUND, PX4, Profile
from uav_task_alloc.mavlink.mission.items import (
    GLOBAL,
    WAYPOINT,
    Item,
    MissionStop,
    TaskList,
    mission_items,
)
from uav_task_alloc.mavlink.mission.long_legs import first_point, first_points, with_points_between
from uav_task_alloc.model import Plan, Point, Route, Shape, Task, ThreatZone
from uav_task_alloc.scenario.values import Scenario, ScenarioUav

_AUTOPILOTS: Mapping[str, tuple[Profile, int]] = {  # and the MAV_AUTOPILOT
    'ardupilot': (ARDUPILOT, 3), 'px4': (PX4, 12)}
QUADROTOR = 2  # MAV_TYPE
_ALTITUDE_MODE_AMSL = 2  # QGroundControl's altitude mode: AMSL
_FILE_FRAME = {GLOBAL: 0}  # files hold degrees, so not the _INT frames
ALTITUDE_DIGITS = 4  # of metres: finer than what a message carries


@dataclass(frozen=True, slots=True)
class PlannedMission:
    """What one UAV flies, as a ground station wants to know it."""

    uav: ScenarioUav
    origin: Origin
    items: tuple[Item, ...]  # without home; none where it has no task
    fences: tuple[ThreatZone, ...]  # that its way keeps out of at any height
    unfenced: tuple[ThreatZone, ...]  # that it passes over or under: a fence has no height


def write_missions(read: Scenario, made: Plan, folder: str | Path) -> list[PlannedMission]:
    """Write ID.plan and ID.waypoints for each UAV of a scenario into a folder, which is made.

    A UAV without tasks gets empty missions, so that none of an earlier plan stays behind. Raises
    MissionError where a task cannot be a mission item, OSError.
    """
    missions = [planned_mission(read, uav, made.route(uav.id)) for uav in read.uavs]
    place = Path(folder)
    place.mkdir(parents=True, exist_ok=True)
    for mission in missions:
        name = file_name(mission.uav.id)
        place.joinpath(f'{name}.plan').write_text(
            json.dumps(plan_file(mission), indent=2, allow_nan=False) + '\n')
        place.joinpath(f'{name}.waypoints').write_text(waypoints_text(mission))
    return missions


def planned_mission(read: Scenario, uav: ScenarioUav, route: Route) -> PlannedMission:
    """The mission of one route; raise MissionError where a task cannot be a mission item."""
    profile, _ = _AUTOPILOTS[uav.autopilot]
    tasks = list_for_route(route, {timed.task.id: timed.task for timed in read.tasks})
    items = mission_items(_with_points_between(uav, profile, tasks), profile.rules, read.origin)
    fences, unfenced = _part(_way(uav, tasks), [timed.zone for timed in read.zones])
    return PlannedMission(uav, read.origin, items, fences, unfenced)


def list_for_route(route: Route, tasks: Mapping[str, Task]) -> TaskList:
    """The list that the bridge would be sent for a route."""
    home = route.legs[len(route.tasks):]
    return TaskList(1, tuple(MissionStop(tasks[name], leg.via) for name, leg in zip(
        route.tasks, route.legs, strict=False)), route.returns, home[0].via if home else ())


def _with_points_between(uav: ScenarioUav, profile: Profile, tasks: TaskList) -> TaskList:
    """Its long legs at the height of the plan; a first leg from the ground is flown level.

    The files have no take-off: straight up to its first point it would fly low for kilometres.
    """
    start, first = uav.position, first_point(tasks)
    if first is None:
        return tasks
    if start[2] - uav.home[2] < OFF_GROUND:
        start = start[0], start[1], max(start[2], first[2])
    return with_points_between(
        tasks, first_points(start, first, uav.home, profile.farthest_first))


def file_name(uav_id: str) -> str:
    """An id as a file's name in any file system: `team/uav 1` is team%2Fuav%201."""
    name = quote(uav_id, safe='')
    return '%2E' + name[1:] if name.startswith('.') else name


def plan_file(mission: PlannedMission) -> dict[str, Any]:
    """The contents of a .plan file; places in degrees, altitudes in metres AMSL."""
    uav = mission.uav
    return {
        'fileType': 'Plan', 'version': 1, 'groundStation': 'uav_task_alloc',
        'mission': {
            'version': 2, 'firmwareType': _AUTOPILOTS[uav.autopilot][1], 'vehicleType': QUADROTOR,
            'cruiseSpeed': uav.cruise_speed, 'hoverSpeed': uav.cruise_speed,
            'globalPlanAltitudeMode': _ALTITUDE_MODE_AMSL,
            'plannedHomePosition': _home(mission),
            'items': [_simple_item(number, item) for number, item in enumerate(mission.items, 1)],
        },
        'geoFence': {
            'version': 2,
            'circles': [_circle(zone, mission.origin) for zone in mission.fences
                        if zone.shape is not Shape.POLYGON],
            'polygons': [_polygon(zone, mission.origin) for zone in mission.fences
                         if zone.shape is Shape.POLYGON],
        },
        'rallyPoints': {'version': 2, 'points': []},
    }


def waypoints_text(mission: PlannedMission) -> str:
    """The contents of a .waypoints file: a line an item, home first, fields parted by tabs."""
    home = [0, 1, 0, WAYPOINT, 0, 0, 0, 0, *_degrees(*_home(mission)), 1]
    rows = [home] + [
        [seq, 0, _FILE_FRAME.get(item.frame, item.frame), item.command,
         *(f'{value:g}' for value in item.params), *_degrees(*_place(item)), 1]
        for seq, item in enumerate(mission.items, 1)]
    return '\n'.join(['QGC WPL 110', *('\t'.join(map(str, row)) for row in rows)]) + '\n'


def _simple_item(number: int, item: Item) -> dict[str, Any]:
    place = _place(item)
    altitude = {'AMSLAltAboveTerrain': None, 'Altitude': place[2], 'AltitudeMode': _ALTITUDE_MODE_AMSL}
    return {
        **(altitude if item.frame == GLOBAL else {}),
        'type': 'SimpleItem', 'doJumpId': number, 'command': item.command, 'autoContinue': True,
        'frame': _FILE_FRAME.get(item.frame, item.frame),
        'params': [None if math.isnan(value) else value for value in item.params] + place,
    }


def _place(item: Item) -> list[float]:
    return [item.x / 1e7, item.y / 1e7, round(item.z, ALTITUDE_DIGITS)]


def _home(mission: PlannedMission) -> list[float]:
    latitude, longitude, altitude = to_geodetic(mission.origin, mission.uav.home)
    return [round(latitude, 7), round(longitude, 7), round(altitude, ALTITUDE_DIGITS)]


def _degrees(latitude: float, longitude: float, altitude: float) -> list[str]:
    return [f'{latitude:.7f}', f'{longitude:.7f}', f'{altitude:.{ALTITUDE_DIGITS}f}']


def _way(uav: ScenarioUav, tasks: TaskList) -> list[Point]:
    """Where it passes, with the straight way home, as a return would break a fence on that."""
    way = [uav.position]
    for stop in tasks.stops:
        way += [*stop.via, stop.task.position]
    return [*way, *tasks.end_via, uav.home]


def _part(way: Sequence[Point], zones: Sequence[ThreatZone]) -> tuple[
        tuple[ThreatZone, ...], tuple[ThreatZone, ...]]:
    """The zones that a way keeps out of at any height, and the others."""
    clear = {zone.id: way_is_clear(way, [_column(zone)]) for zone in zones}
    return (tuple(zone for zone in zones if clear[zone.id]),
            tuple(zone for zone in zones if not clear[zone.id]))


def _column(zone: ThreatZone) -> ThreatZone:
    """What a fence makes of a zone: no floor, no ceiling, and no margin, which is for plans."""
    if zone.shape is Shape.POLYGON:
        return replace(zone, z_min=-math.inf, z_max=math.inf, margin=0.0)
    return ThreatZone.cylinder(zone.id, zone.center, zone.radius)


def _circle(zone: ThreatZone, origin: Origin) -> dict[str, Any]:
    latitude, longitude, _ = to_geodetic(origin, (zone.center[0], zone.center[1], 0.0))
    return {'version': 1, 'inclusion': False, 'circle': {
        'center': [round(latitude, 7), round(longitude, 7)], 'radius': zone.radius}}


def _polygon(zone: ThreatZone, origin: Origin) -> dict[str, Any]:
    corners = to_geodetic_batch(origin, [(x, y, 0.0) for x, y in zone.vertices])
    return {'version': 1, 'inclusion': False,
            'polygon': [[round(latitude, 7), round(longitude, 7)]
                        for latitude, longitude, _ in corners.tolist()]}
