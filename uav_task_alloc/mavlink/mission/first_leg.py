# SPDX-License-Identifier: Apache-2.0
"""The points that divide the first leg of a list, which starts at the vehicle's position.

They must not move while the list changes or the vehicle flies on, as each change is an upload. So
the start of a leg is kept for as long as the vehicle is on that leg.
"""
from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

from uav_task_alloc.geometry.polyline import nearest_on_segment, segment_fraction
from uav_task_alloc.mavlink.mission.items import TaskList
from uav_task_alloc.mavlink.mission.long_legs import (
    MAX_LEG_LENGTH,
    first_point,
    first_points,
    legs,
    points_between,
)
from uav_task_alloc.model import Point

_PASSED_MARGIN = 200.0  # [m] beyond a point before it is dropped: no vehicle flies back to it
_OFF_TRACK = 50.0  # [m] horizontally from a leg at which a vehicle is still on it
_OFF_TRACK_PLANE = 300.0  # [m] the same; planes turn wide
_OFF_ALTITUDE = 30.0  # [m] vertically; not in mission mode, where the autopilot sets the climb


class LegStart(NamedTuple):
    """Position and home of a vehicle, for a leg that starts there; ENU [m]."""

    point: Point  # [m] ENU
    home: Point  # [m] ENU
    on_mission: bool = False  # in mission mode


class FirstLeg:
    """Keeps the starts of a list's legs, and counts the points passed on the first one.

    Args:
        plane: whether the vehicle turns as wide as a plane.
        farthest: largest distance from home to the first item that the autopilot takes [m].
    """

    def __init__(self, plane: bool = False, farthest: float = math.inf) -> None:
        self.locate: Callable[[], LegStart | None] = lambda: None  # None: not known
        self.version = 0  # of the start of the first leg
        self._off_track, self._farthest = _OFF_TRACK_PLANE if plane else _OFF_TRACK, farthest
        self._starts: dict[Point, Point] = {}  # start of each leg, by its end
        self._target: Point | None = None
        self._points: tuple[Point, ...] = ()  # of the first leg
        self._ends: tuple[Point, Point] | None = None  # of the first leg
        self._passed = 0

    def begin(self, tasks: TaskList) -> None:
        """Begin a list at the present position of the vehicle."""
        self._target, self._passed = first_point(tasks), 0
        start, position = self._start(), self.locate()
        if self._target is not None and position is not None and (
                start is None or self._is_off(position, start, self._target)):
            start = position.point
        self._starts = {end: begin for begin, end in legs(tasks, start)}
        self.version += 1
        if start is None or self._target is None:
            self._points, self._ends = (), None
        elif self._ends != (start, self._target):  # else they stay, though home may have moved
            self._ends = start, self._target
            self._points = first_points(
                start, self._target, start if position is None else position.home, self._farthest)

    @property
    def is_off(self) -> bool:
        """Whether the vehicle is off the first leg, or its start became known: call `begin`."""
        end = self._target
        position = None if end is None else self.locate()
        if end is None or position is None:
            return False
        start = self._starts.get(end)
        return start is None or (not position.on_mission and self._is_off(position, start, end))

    @property
    def start_unknown(self) -> bool:
        """Whether the start is unknown of a leg that may be a long one: do not upload yet."""
        return (self._target is not None and self._start() is None
                and math.hypot(*self._target) > MAX_LEG_LENGTH)

    @property
    def passed(self) -> int:
        """Number of points of the first leg that the vehicle has passed."""
        if not self._points:
            self._passed = 0
            return 0
        position, start = self.locate(), self._start()
        if position is not None and start is not None and self._target is not None:
            rest = _metres_left(position.point, start, self._target)
            self._passed = sum(math.dist(point, self._target) > rest + _PASSED_MARGIN
                               for point in self._points)
        return self._passed

    def points_ahead(self, target: Point | None) -> tuple[Point, ...]:
        """The dividing points still to be flown of the leg to `target`, ENU [m]."""
        if target == self._target:
            return self._points[self.passed:]
        start = None if target is None else self._starts.get(target)
        return () if start is None or target is None else points_between(start, target)

    def _start(self) -> Point | None:
        return None if self._target is None else self._starts.get(self._target)

    def _is_off(self, position: LegStart, start: Point, end: Point) -> bool:
        nearest = nearest_on_segment(position.point, start, end)
        return math.dist(position.point[:2], nearest[:2]) > self._off_track or (
            not position.on_mission and abs(position.point[2] - nearest[2]) > _OFF_ALTITUDE)


def _metres_left(position: Point, start: Point, end: Point) -> float:
    """Remaining length of a leg [m]; more than its length for a position before its start."""
    return (1.0 - segment_fraction(position, start, end)) * math.dist(start, end)
