# SPDX-License-Identifier: Apache-2.0
"""The allocation as RViz markers: routes, tasks, zones, UAVs, and what the last plan changed."""
from __future__ import annotations

import heapq
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

from geometry_msgs.msg import Vector3
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from uav_task_alloc import palette
from uav_task_alloc.allocator.list_records import UavList
from uav_task_alloc.allocator.records import TaskRecord, TaskState
from uav_task_alloc.allocator.state.fleet import UavRecord
from uav_task_alloc.model import Point, ThreatZone
from uav_task_alloc.nodes.conversions.messages import header, to_point
from uav_task_alloc.nodes.conversions.path_messages import remaining_path
from uav_task_alloc.nodes.rviz import zone_markers

_Colour = tuple[float, float, float]
_UAV_COLOURS = tuple(map(palette.rgb, palette.UAV_COLOURS_ON_DARK))
_STATE_COLOURS: dict[TaskState, _Colour] = {  # cancelled and rejected tasks are not drawn
    state: palette.rgb(colour) for state in TaskState
    if (colour := palette.STATE_COLOURS_ON_DARK.get(state.name))}
_ZONE, _CHANGED = (0.8, 0.1, 0.1), (1.0, 0.2, 0.8)
_UNAVAILABLE, _WHITE = (0.45, 0.45, 0.45), (1.0, 1.0, 1.0)
_TASK_SIZES = (0.7, 1.0, 1.4, 2.0)  # by value, in units
_MOST_COMPLETED = 500  # tasks, the latest
MOST_STOPS = 200  # with arrow and number, over all UAVs: the next of each
MOST_TEXTS = 200  # labels of unassigned tasks, and of zones
_LONGEST_LABEL = 80  # characters


@dataclass(frozen=True, slots=True)
class MarkerScene:
    """What is drawn: lists, tasks, UAVs and zones at one moment."""

    stamp: float  # [s] published clock
    lists: Sequence[UavList] = ()
    tasks: Sequence[TaskRecord] = ()
    uavs: Mapping[str, UavRecord] | None = None
    zones: Sequence[ThreatZone] = ()
    changed: frozenset[str] = frozenset()  # task ids, by the last plan
    trigger: str = ''  # of the last plan


class MarkerList:
    """Markers with one header; sizes are multiples of `unit` [m]."""

    def __init__(self, stamp: float, unit: float) -> None:
        self.header, self.unit = header(stamp), unit
        # nothing that was removed can stay, whichever message a subscriber missed
        self.markers = [Marker(header=self.header, action=Marker.DELETEALL)]
        self.count: dict[str, int] = {}

    def add(self, namespace: str, kind: int, colour: _Colour, size: float, *, alpha: float = 1.0,
            points: Iterable[Point] = (), position: Point | None = None, text: str = '') -> Marker:
        """Append a marker; `size` in units, points and position in [m] ENU."""
        number = self.count[namespace] = self.count.get(namespace, -1) + 1
        red, green, blue = colour
        size *= self.unit
        marker = Marker(header=self.header, ns=namespace, id=number, type=kind, action=Marker.ADD,
                        color=ColorRGBA(r=red, g=green, b=blue, a=alpha),
                        scale=Vector3(x=size, y=size, z=size),
                        points=[to_point(point) for point in points], text=text[:_LONGEST_LABEL])
        marker.pose.orientation.w = 1.0
        if position is not None:
            marker.pose.position = to_point(position)
        self.markers.append(marker)
        return marker

    def label(self, namespace: str, text: str, position: Point, colour: _Colour = _WHITE,
              up: float = 2.5) -> None:
        """Append a text `up` units above a position [m]."""
        self.add(namespace, Marker.TEXT_VIEW_FACING, colour, 2.2,
                 position=(position[0], position[1], position[2] + up * self.unit), text=text)


def markers(scene: MarkerScene) -> MarkerArray:
    """Draw everything; the first marker deletes what was drawn before.

    O(tasks + UAVs + zones); the number of markers is bounded.
    """
    out = MarkerList(scene.stamp, _unit(scene))
    for k, zone in enumerate(scene.zones):
        _zone(out, zone, labelled=k < MOST_TEXTS)
    _tasks(out, scene.tasks)
    lists = sorted(scene.lists, key=lambda uav_list: uav_list.uav)
    uavs = scene.uavs or {}
    stops = max(1, MOST_STOPS // max(1, sum(bool(uav_list.stops) for uav_list in lists)))
    colours = {uav_id: _UAV_COLOURS[k % len(_UAV_COLOURS)] for k, uav_id in enumerate(
        sorted({*uavs, *(uav_list.uav for uav_list in lists)}))}
    for uav_list in lists:
        _waiting_place(out, uav_list, colours[uav_list.uav])
        _route(out, uav_list, uavs.get(uav_list.uav), colours[uav_list.uav], stops)
    for uav_id, record in uavs.items():
        _uav(out, uav_id, record, colours[uav_id])
    _detours(out, lists)
    _changes(out, scene, lists)
    return MarkerArray(markers=out.markers)


def _zone(out: MarkerList, zone: ThreatZone, labelled: bool) -> None:
    zone_markers.set_volume(out.add('zones', Marker.CYLINDER, _ZONE, 1.0, alpha=0.3), zone)
    if labelled:
        _, top = zone_markers.height_span(zone)
        out.label('zone_labels', zone.id, (*zone_markers.label_position(zone), top), up=1.0)


def _tasks(out: MarkerList, records: Sequence[TaskRecord]) -> None:
    """Spheres, one marker for each state and size; a label for each unassigned task."""
    drawn = [record for record in records if record.state is not TaskState.COMPLETED]
    unassigned = [record for record in drawn if record.state is TaskState.UNASSIGNED]
    drawn += heapq.nlargest(
        _MOST_COMPLETED, (record for record in records if record.state is TaskState.COMPLETED),
        key=lambda record: record.stamp)
    most = max((record.task.value for record in drawn), default=1.0)
    groups: dict[tuple[TaskState, int], list[Point]] = {}
    for record in drawn:
        size = min(len(_TASK_SIZES) - 1, int(len(_TASK_SIZES) * (record.task.value / most)))
        groups.setdefault((record.state, size), []).append(record.task.position)
    _paths(out, drawn)
    for (state, size), points in groups.items():
        if state in _STATE_COLOURS:
            out.add('tasks', Marker.SPHERE_LIST, _STATE_COLOURS[state], _TASK_SIZES[size],
                    points=points, alpha=0.4 if state is TaskState.COMPLETED else 1.0)
    for record in unassigned[:MOST_TEXTS]:
        out.label('left_out', f'{record.task.id}: {record.reason}', record.task.position,
                  _STATE_COLOURS[TaskState.UNASSIGNED])


def _paths(out: MarkerList, records: Sequence[TaskRecord]) -> None:
    """The paths of pieces, one marker for each state: strips still to fly, and those flown."""
    lines: dict[TaskState, list[Point]] = {}
    for record in records:
        for pair in pairwise(record.task.path):
            lines.setdefault(record.state, []).extend(pair)
    for state, points in lines.items():
        if state in _STATE_COLOURS:
            out.add('paths', Marker.LINE_LIST, _STATE_COLOURS[state], 0.8, points=points,
                    alpha=0.25 if state is TaskState.COMPLETED else 0.6)


def _route(out: MarkerList, uav_list: UavList, uav: UavRecord | None, colour: _Colour,
           most: int) -> None:
    """The remaining path as a line; arrows and numbers at the next `most` stops."""
    points = remaining_path(uav_list, uav)
    if len(points) > 1:
        out.add('routes', Marker.LINE_STRIP, colour, 0.3, alpha=0.9, points=points)
    last = points[0] if uav and points else None
    for order, stop in enumerate(uav_list.stops[:most], 1):
        goal = stop.entry
        _arrow(out, stop.leg.via[-1] if stop.leg.via else last, goal, colour)
        out.label('order', f'{order}: {stop.task.id}', goal, colour)
        last = stop.exit


def _waiting_place(out: MarkerList, uav_list: UavList, colour: _Colour) -> None:
    """A flat disk where a UAV without tasks waits for one."""
    if uav_list.waiting_place is not None:
        disk = out.add('waiting_places', Marker.CYLINDER, colour, 6.0, alpha=0.35,
                       position=uav_list.waiting_place)
        disk.scale.z = 0.2 * out.unit
        out.label('waiting_labels', f'{uav_list.uav} waits here', uav_list.waiting_place, colour)


def _arrow(out: MarkerList, start: Point | None, goal: Point, colour: _Colour) -> None:
    length = math.dist(start, goal) if start else 0.0
    if start and length > 1e-3 * out.unit:
        arrow = out.add('arrows', Marker.ARROW, colour, 0.5, points=(start, goal))
        arrow.scale.y = 1.5 * out.unit
        arrow.scale.z = min(3.0 * out.unit, 0.5 * length)


def _uav(out: MarkerList, uav_id: str, record: UavRecord, colour: _Colour) -> None:
    body = out.add('uavs', Marker.CYLINDER, colour if record.usable else _UNAVAILABLE, 2.5,
                   position=record.report.position)
    body.scale.z = out.unit
    state = '' if record.usable else ' silent' if record.silent else ' not available'
    out.label('uav_labels', uav_id + state, record.report.position)


def _detours(out: MarkerList, lists: Iterable[UavList]) -> None:
    points = [point for uav_list in lists for points in (
        *(stop.leg.via for stop in uav_list.stops), uav_list.end_via) for point in points]
    if points:
        out.add('detour_points', Marker.CUBE_LIST, (0.95, 0.9, 0.25), 0.7, points=points)


def _changes(out: MarkerList, scene: MarkerScene, lists: Iterable[UavList]) -> None:
    """A halo around each task that the last plan moved, and the leg to it."""
    goals: list[Point] = []
    legs: list[Point] = []
    for uav_list in lists:
        last: tuple[Point, ...] = ()
        for stop in uav_list.stops:
            if stop.task.id in scene.changed:
                goals.append(stop.entry)
                for pair in pairwise((*last, *stop.line)):
                    legs += pair
            last = (stop.exit,)
    if goals:
        out.add('replan', Marker.SPHERE_LIST, _CHANGED, 3.0, alpha=0.35, points=goals)
        x, y, z = (sum(values) / len(goals) for values in zip(*goals, strict=True))
        out.label('replan_label', f'{scene.trigger or "re-plan"}: {len(goals)} changed',
                  (x, y, z), _CHANGED, up=8.0)
    if legs:
        out.add('replan', Marker.LINE_LIST, _CHANGED, 0.6, alpha=0.5, points=legs)


def _unit(scene: MarkerScene) -> float:
    """The unit of sizes [m]: 1, 2 or 5 times a power of ten, constant for small movements."""
    positions: list[Sequence[float]] = [
        record.task.position for record in scene.tasks if record.open]
    positions += [record.report.position for record in (scene.uavs or {}).values()]
    positions += [zone_markers.label_position(zone) for zone in scene.zones]
    extent = max((max(values) - min(values) for values in zip(
        *(position[:2] for position in positions), strict=True)), default=0.0)
    goal = min(max(extent / 100.0, 0.2), 1e6)
    power = 10.0 ** math.floor(math.log10(goal))
    return max(factor * power for factor in (1.0, 2.0, 5.0) if factor * power <= goal * 1.000001)
