# SPDX-License-Identifier: Apache-2.0
"""The allocation as markers: routes, tasks, zones, UAVs, and what the last re-plan changed."""
from __future__ import annotations

import heapq
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

from geometry_msgs.msg import Vector3
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from uav_task_alloc.allocator.records import TaskRecord, TaskState, UavList
from uav_task_alloc.allocator.state.fleet import UavRecord
from uav_task_alloc.model import Point, ThreatZone
from uav_task_alloc.nodes.conversions.messages import header, to_point
from uav_task_alloc.nodes.conversions.path_messages import way
from uav_task_alloc.nodes.rviz import zone_markers as zone_bodies

Colour = tuple[float, float, float]
# readable side by side on RViz's dark ground, also for the colour-blind
_COLOURS: tuple[Colour, ...] = (
    (0.0, 0.45, 0.7), (0.9, 0.6, 0.0), (0.0, 0.62, 0.45), (0.8, 0.4, 0.7), (0.35, 0.7, 0.9),
    (0.84, 0.37, 0.0))
_STATES: dict[TaskState, Colour] = {  # withdrawn and refused tasks are not drawn
    TaskState.PENDING: (0.7, 0.7, 0.7), TaskState.ASSIGNED: (0.35, 0.7, 0.9),
    TaskState.ACTIVE: (0.95, 0.9, 0.25), TaskState.UNASSIGNED: (0.8, 0.4, 0.7),
    TaskState.FAILED: (0.84, 0.37, 0.0), TaskState.COMPLETED: (0.0, 0.62, 0.45)}
DANGER, NEWS, LOST, WHITE = (0.8, 0.1, 0.1), (1.0, 0.2, 0.8), (0.45, 0.45, 0.45), (1.0, 1.0, 1.0)
SIZES = (0.7, 1.0, 1.4, 2.0)  # of a task by its value, in units
MOST_DONE = 500  # completed tasks drawn, the newest
MOST_STOPS = 200  # arrows and numbers in all: the next ones of each UAV
MOST_TEXTS = 200  # labels of tasks left out, and of zones
_LONGEST = 80  # letters of a label


@dataclass(frozen=True, slots=True)
class Picture:
    """What is drawn."""

    stamp: float  # [s]
    lists: Sequence[UavList] = ()
    tasks: Sequence[TaskRecord] = ()
    uavs: Mapping[str, UavRecord] | None = None
    zones: Sequence[ThreatZone] = ()
    changed: frozenset[str] = frozenset()  # task ids, by the last re-plan
    trigger: str = ''  # of the last re-plan


class Sheet:
    """Markers under one header; `unit` [m] is what sizes are counted in."""

    def __init__(self, stamp: float, unit: float) -> None:
        self.header, self.unit = header(stamp), unit
        # everything anew: nothing that is gone can stay, whatever message was missed
        self.made = [Marker(header=self.header, action=Marker.DELETEALL)]
        self.count: dict[str, int] = {}

    def add(self, space: str, kind: int, colour: Colour, size: float, *, alpha: float = 1.0,
            points: Iterable[Point] = (), at: Point | None = None, text: str = '') -> Marker:
        """One more marker in a namespace; `size` in units."""
        number = self.count[space] = self.count.get(space, -1) + 1
        red, green, blue = colour
        size *= self.unit
        marker = Marker(header=self.header, ns=space, id=number, type=kind, action=Marker.ADD,
                        color=ColorRGBA(r=red, g=green, b=blue, a=alpha),
                        scale=Vector3(x=size, y=size, z=size),
                        points=[to_point(point) for point in points], text=text[:_LONGEST])
        marker.pose.orientation.w = 1.0
        if at is not None:
            marker.pose.position = to_point(at)
        self.made.append(marker)
        return marker

    def label(self, space: str, text: str, at: Point, colour: Colour = WHITE,
              up: float = 2.5) -> None:
        """A text `up` units above a place."""
        self.add(space, Marker.TEXT_VIEW_FACING, colour, 2.2,
                 at=(at[0], at[1], at[2] + up * self.unit), text=text)


def markers(picture: Picture) -> MarkerArray:
    """Everything anew: the first marker deletes what was there.

    O(tasks + UAVs + zones); the number of markers does not grow with the number of tasks.
    """
    sheet = Sheet(picture.stamp, _unit(picture))
    for k, zone in enumerate(picture.zones):
        _zone(sheet, zone, labelled=k < MOST_TEXTS)
    _tasks(sheet, picture.tasks)
    lists = sorted(picture.lists, key=lambda each: each.uav)
    uavs = picture.uavs or {}
    stops = max(1, MOST_STOPS // max(1, sum(bool(each.stops) for each in lists)))
    colours = {uav_id: _COLOURS[k % len(_COLOURS)] for k, uav_id in enumerate(
        sorted({*uavs, *(each.uav for each in lists)}))}
    for each in lists:
        _route(sheet, each, uavs.get(each.uav), colours[each.uav], stops)
    for uav_id, record in uavs.items():
        _uav(sheet, uav_id, record, colours[uav_id])
    _detours(sheet, lists)
    _news(sheet, picture, lists)
    return MarkerArray(markers=sheet.made)


def _zone(sheet: Sheet, zone: ThreatZone, labelled: bool) -> None:
    zone_bodies.shape(sheet.add('zones', Marker.CYLINDER, DANGER, 1.0, alpha=0.3), zone)
    if labelled:
        sheet.label('zone_labels', zone.id,
                    (*zone_bodies.middle(zone), zone_bodies.height_span(zone)[1]), up=1.0)


def _tasks(sheet: Sheet, records: Sequence[TaskRecord]) -> None:
    """A list of balls for each state and size; a label for what is left out."""
    open_ones = [record for record in records if record.state is not TaskState.COMPLETED]
    done = heapq.nlargest(MOST_DONE, (record for record in records if record.state is
                                      TaskState.COMPLETED), key=lambda record: record.stamp)
    most = max((record.task.value for record in open_ones + done), default=1.0)
    groups: dict[tuple[TaskState, int], list[Point]] = {}
    for record in open_ones + done:
        size = min(len(SIZES) - 1, int(len(SIZES) * (record.task.value / most)))
        groups.setdefault((record.state, size), []).append(record.task.position)
    for (state, size), points in groups.items():
        if state in _STATES:
            sheet.add('tasks', Marker.SPHERE_LIST, _STATES[state], SIZES[size], points=points,
                      alpha=0.4 if state is TaskState.COMPLETED else 1.0)
    left = [record for record in open_ones if record.state is TaskState.UNASSIGNED]
    for record in left[:MOST_TEXTS]:
        sheet.label('left_out', f'{record.task.id}: {record.reason}', record.task.position,
                    _STATES[TaskState.UNASSIGNED])


def _route(sheet: Sheet, uav_list: UavList, uav: UavRecord | None, colour: Colour,
           most: int) -> None:
    """The way as a line; arrows and numbers at the next stops."""
    points = way(uav_list, uav)
    if len(points) > 1:
        sheet.add('routes', Marker.LINE_STRIP, colour, 0.3, alpha=0.9, points=points)
    last = points[0] if uav and points else None
    for order, stop in enumerate(uav_list.stops[:most], 1):
        goal = stop.task.position
        _arrow(sheet, 'arrows', stop.leg.via[-1] if stop.leg.via else last, goal, colour)
        sheet.label('order', f'{order}: {stop.task.id}', goal, colour)
        last = goal


def _arrow(sheet: Sheet, space: str, start: Point | None, goal: Point, colour: Colour) -> None:
    length = math.dist(start, goal) if start else 0.0
    if start and length > 1e-3 * sheet.unit:
        arrow = sheet.add(space, Marker.ARROW, colour, 0.5, points=(start, goal))
        arrow.scale.y = 1.5 * sheet.unit
        arrow.scale.z = min(3.0 * sheet.unit, 0.5 * length)


def _uav(sheet: Sheet, uav_id: str, record: UavRecord, colour: Colour) -> None:
    body = sheet.add('uavs', Marker.CYLINDER, colour if record.usable else LOST, 2.5,
                     at=record.report.position)
    body.scale.z = sheet.unit
    state = '' if record.usable else ' silent' if record.silent else ' not available'
    sheet.label('uav_labels', uav_id + state, record.report.position)


def _detours(sheet: Sheet, lists: Iterable[UavList]) -> None:
    points = [point for each in lists for points in (
        *(stop.leg.via for stop in each.stops), each.end_via) for point in points]
    if points:
        sheet.add('detour_points', Marker.CUBE_LIST, (0.95, 0.9, 0.25), 0.7, points=points)


def _news(sheet: Sheet, picture: Picture, lists: Iterable[UavList]) -> None:
    """A halo around each task that the last re-plan gave to another place, and the way there."""
    goals: list[Point] = []
    legs: list[Point] = []
    for each in lists:
        last: tuple[Point, ...] = ()
        for stop in each.stops:
            if stop.task.id in picture.changed:
                goals.append(stop.task.position)
                for pair in pairwise((*last, *stop.leg.via, stop.task.position)):
                    legs += pair
            last = (stop.task.position,)
    if goals:
        sheet.add('replan', Marker.SPHERE_LIST, NEWS, 3.0, alpha=0.35, points=goals)
        x, y, z = (sum(values) / len(goals) for values in zip(*goals, strict=True))
        sheet.label('replan_label', f'{picture.trigger or "re-plan"}: {len(goals)} changed',
                    (x, y, z), NEWS, up=8.0)
    if legs:
        sheet.add('replan', Marker.LINE_LIST, NEWS, 0.6, alpha=0.5, points=legs)


def _unit(picture: Picture) -> float:
    """What sizes are counted in [m]: 1, 2 or 5 times a power of ten, steady while things move."""
    places = [record.task.position for record in picture.tasks if record.open]
    places += [record.report.position for record in (picture.uavs or {}).values()]
    places += [zone_bodies.middle(zone) for zone in picture.zones]
    extent = max((max(values) - min(values) for values in zip(
        *(place[:2] for place in places), strict=True)), default=0.0)
    goal = min(max(extent / 100.0, 0.2), 1e6)
    power = 10.0 ** math.floor(math.log10(goal))
    return max(factor * power for factor in (1.0, 2.0, 5.0) if factor * power <= goal * 1.000001)
