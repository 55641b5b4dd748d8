# SPDX-License-Identifier: Apache-2.0
"""A plan as files that a person loads into a ground station: .plan and .waypoints for each UAV.

Formats: QGroundControl's plan file, version 1 (docs.qgroundcontrol.com, "Plan File Format"), and
the plain text that begins with `QGC WPL 110` (mavlink.io, "File Formats"), whose first item is
home. The items are those that the bridge uploads.
"""
from __future__ import annotations

import json
import math
from collections.abc import Container, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any
from urllib.parse import quote

from pymavlink.dialects.v20 import ardupilotmega as dialect

from uav_task_alloc.atomic_files import replacing
from uav_task_alloc.geometry.fence_area import AreaCorners, zones_outside
from uav_task_alloc.geometry.frames import Origin, to_geodetic, to_geodetic_batch
from uav_task_alloc.geometry.zones import path_is_clear
from uav_task_alloc.mavlink.autopilots import ARDUPILOT, OFF_GROUND, PX4, Profile
from uav_task_alloc.mavlink.mission.items import (
    Item,
    MissionStop,
    TaskList,
    mission_items,
)
from uav_task_alloc.mavlink.mission.long_legs import first_point, first_points, with_points_between
from uav_task_alloc.model import Plan, Point, Route, Shape, Task, ThreatZone
from uav_task_alloc.scenario.values import Scenario, ScenarioUav

_AUTOPILOTS: Mapping[str, tuple[Profile, int]] = {  # and the MAV_AUTOPILOT
    'ardupilot': (ARDUPILOT, dialect.MAV_AUTOPILOT_ARDUPILOTMEGA),
    'px4': (PX4, dialect.MAV_AUTOPILOT_PX4),
}
_ALTITUDE_MODE_AMSL = 2  # QGroundControl's altitude mode
_ALTITUDE_MODES = {dialect.MAV_FRAME_GLOBAL_INT: _ALTITUDE_MODE_AMSL,
                   dialect.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT: 1}  # above home
# files hold degrees, so not the _INT frames
_FILE_FRAME = {dialect.MAV_FRAME_GLOBAL_INT: dialect.MAV_FRAME_GLOBAL,
               dialect.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT: dialect.MAV_FRAME_GLOBAL_RELATIVE_ALT}
_ALTITUDE_DIGITS = 4  # of metres: finer than what a message carries


@dataclass(frozen=True, slots=True)
class PlannedMission:
    """The mission of one UAV, and the zones that its file can hold as fences."""

    uav: ScenarioUav
    origin: Origin
    items: tuple[Item, ...]  # without home; none where it has no task
    fences: tuple[ThreatZone, ...]  # that its path keeps out of at any height
    area: AreaCorners  # [m] that its path stays in
    unfenced: tuple[ThreatZone, ...]  # that it passes over or under: a fence has no height


def write_missions(scenario: Scenario, plan: Plan, folder: str | Path,
                   tasks: Iterable[Task] | None = None) -> list[PlannedMission]:
    """Write ID.plan and ID.waypoints for each UAV of a scenario.

    A UAV without tasks gets empty missions, which replace those of an earlier plan.

    Args:
        scenario: the UAVs, tasks and zones, and the origin of the ENU frame.
        plan: a plan for that scenario.
        folder: where to write; it is created.
        tasks: those of the plan, with the pieces of divided work; None: those of the scenario.

    Returns:
        The missions written, in the order of the scenario's UAVs.

    Raises:
        MissionError: a task cannot be a mission item.
        OSError: a file cannot be written.
    """
    by_id = None if tasks is None else {task.id: task for task in tasks}
    missions = [planned_mission(scenario, uav, plan.route(uav.id), by_id, plan.reversed)
                for uav in scenario.uavs]
    directory = Path(folder)
    directory.mkdir(parents=True, exist_ok=True)
    for mission in missions:
        name = file_name(mission.uav.id)
        for suffix, text in (
                ('plan', json.dumps(plan_file(mission), indent=2, allow_nan=False) + '\n'),
                ('waypoints', waypoints_text(mission))):
            with replacing(directory / f'{name}.{suffix}') as file:
                file.write_text(text)
    return missions


def planned_mission(scenario: Scenario, uav: ScenarioUav, route: Route,
                    tasks: Mapping[str, Task] | None = None,
                    reversed_ids: Container[str] = ()) -> PlannedMission:
    """The mission of one route.

    Args:
        scenario: with the origin and the zones.
        uav: that flies it.
        route: of the plan.
        tasks: by id; None: those of the scenario.
        reversed_ids: of tasks with a path that are flown from their last point.

    Raises:
        MissionError: a task cannot be a mission item.
    """
    profile, _ = _AUTOPILOTS[uav.autopilot]
    known = {timed.task.id: timed.task for timed in scenario.tasks} if tasks is None else tasks
    listed = list_for_route(route, known, reversed_ids)
    items = mission_items(_with_points_between(uav, profile, listed), profile.rules,
                          scenario.origin, uav.home, uav.cruise_speed)
    path = _path(uav, listed)
    fences, unfenced = _split_zones(path, [timed.zone for timed in scenario.zones])
    area = scenario.fence_area
    stays = path_is_clear(path, zones_outside(area))
    return PlannedMission(uav, scenario.origin, items, fences, area if stays else (), unfenced)


def list_for_route(route: Route, tasks: Mapping[str, Task],
                   reversed_ids: Container[str] = ()) -> TaskList:
    """The list that the allocator would publish for a route.

    Args:
        route: of a plan.
        tasks: by id.
        reversed_ids: of tasks with a path that are flown from their last point.
    """
    home = route.legs[len(route.tasks):]
    stops = tuple(MissionStop(tasks[name], leg.via, reversed=name in reversed_ids)
                  for name, leg in zip(route.tasks, route.legs, strict=False))
    return TaskList(1, stops, route.returns, home[0].via if home else ())


def _with_points_between(uav: ScenarioUav, profile: Profile, tasks: TaskList) -> TaskList:
    """Divide long legs, which so keep the plan's heights; a first leg from the ground is level.

    The files have no take-off item: a straight climb to its first point would be low for
    kilometres.
    """
    start, first = uav.position, first_point(tasks)
    if first is None:
        return tasks
    if start[2] - uav.home[2] < OFF_GROUND:
        start = start[0], start[1], max(start[2], first[2])
    return with_points_between(
        tasks, first_points(start, first, uav.home, profile.farthest_first))


def file_name(uav_id: str) -> str:
    """Quote an id as a file name for any file system: `team/uav 1` is team%2Fuav%201.

    Args:
        uav_id: any text.

    Returns:
        Percent-encoded UTF-8 without path separators or a leading dot.
    """
    name = quote(uav_id, safe='')
    return '%2E' + name[1:] if name.startswith('.') else name


def plan_file(mission: PlannedMission) -> dict[str, Any]:
    """The contents of a .plan file (JSON object); positions in degrees, altitudes in m AMSL."""
    uav = mission.uav
    return {
        'fileType': 'Plan', 'version': 1, 'groundStation': 'uav_task_alloc',
        'mission': {
            'version': 2, 'firmwareType': _AUTOPILOTS[uav.autopilot][1],
            'vehicleType': dialect.MAV_TYPE_QUADROTOR,
            'cruiseSpeed': uav.cruise_speed, 'hoverSpeed': uav.cruise_speed,
            'globalPlanAltitudeMode': _ALTITUDE_MODE_AMSL,
            'plannedHomePosition': _home(mission),
            'items': [_simple_item(number, item) for number, item in enumerate(mission.items, 1)],
        },
        'geoFence': {
            'version': 2,
            'circles': [_circle(zone, mission.origin) for zone in mission.fences
                        if zone.shape is not Shape.POLYGON],
            'polygons': [_polygon(mission.area, mission.origin, inclusion=True)
                         ] * bool(mission.area) + [
                _polygon(zone.vertices, mission.origin) for zone in mission.fences
                if zone.shape is Shape.POLYGON],
        },
        'rallyPoints': {'version': 2, 'points': []},
    }


def waypoints_text(mission: PlannedMission) -> str:
    """The contents of a .waypoints file: one line per item, home first, fields split by tabs."""
    home = [0, 1, 0, dialect.MAV_CMD_NAV_WAYPOINT, 0, 0, 0, 0, *_degrees(*_home(mission)), 1]
    rows = [home] + [
        [seq, 0, _FILE_FRAME.get(item.frame, item.frame), item.command,
         *(f'{value:.9g}' for value in item.params), *_degrees(*_position(item)), 1]
        for seq, item in enumerate(mission.items, 1)]
    return '\n'.join(['QGC WPL 110', *('\t'.join(map(str, row)) for row in rows)]) + '\n'


def _simple_item(number: int, item: Item) -> dict[str, Any]:
    position = _position(item)
    altitude = {'AMSLAltAboveTerrain': None, 'Altitude': position[2],
                'AltitudeMode': _ALTITUDE_MODES.get(item.frame, _ALTITUDE_MODE_AMSL)}
    return {
        **(altitude if item.frame in _ALTITUDE_MODES else {}),
        'type': 'SimpleItem', 'doJumpId': number, 'command': item.command, 'autoContinue': True,
        'frame': _FILE_FRAME.get(item.frame, item.frame),
        'params': [None if math.isnan(value) else value for value in item.params] + position,
    }


def _position(item: Item) -> list[float]:
    return [item.x / 1e7, item.y / 1e7, round(item.z, _ALTITUDE_DIGITS)]


def _home(mission: PlannedMission) -> list[float]:
    latitude, longitude, altitude = to_geodetic(mission.origin, mission.uav.home)
    return [round(latitude, 7), round(longitude, 7), round(altitude, _ALTITUDE_DIGITS)]


def _degrees(latitude: float, longitude: float, altitude: float) -> list[str]:
    return [f'{latitude:.7f}', f'{longitude:.7f}', f'{altitude:.{_ALTITUDE_DIGITS}f}']


def _path(uav: ScenarioUav, tasks: TaskList) -> list[Point]:
    """The path flown, with the straight leg home: a return would breach a fence on that."""
    path = [uav.position]
    for stop in tasks.stops:
        path += [*stop.via, *stop.way]
    return [*path, *tasks.end_via, uav.home]


def _split_zones(path: Sequence[Point], zones: Sequence[ThreatZone]) -> tuple[
        tuple[ThreatZone, ...], tuple[ThreatZone, ...]]:
    """The zones that a path keeps out of at any height, and the others."""
    clear = {zone.id: path_is_clear(path, [_column(zone)]) for zone in zones}
    return (tuple(zone for zone in zones if clear[zone.id]),
            tuple(zone for zone in zones if not clear[zone.id]))


def _column(zone: ThreatZone) -> ThreatZone:
    """A zone as a fence has it: no floor, no ceiling, and no margin, which is for plans."""
    if zone.shape is Shape.POLYGON:
        return replace(zone, z_min=-math.inf, z_max=math.inf, margin=0.0)
    return ThreatZone.cylinder(zone.id, zone.center, zone.radius)


def _circle(zone: ThreatZone, origin: Origin) -> dict[str, Any]:
    latitude, longitude, _ = to_geodetic(origin, (zone.center[0], zone.center[1], 0.0))
    return {'version': 1, 'inclusion': False, 'circle': {
        'center': [round(latitude, 7), round(longitude, 7)], 'radius': zone.radius}}


def _polygon(ring: AreaCorners, origin: Origin, inclusion: bool = False) -> dict[str, Any]:
    corners = to_geodetic_batch(origin, [(x, y, 0.0) for x, y in ring])
    return {'version': 1, 'inclusion': inclusion,
            'polygon': [[round(latitude, 7), round(longitude, 7)]
                        for latitude, longitude, _ in corners.tolist()]}
