# SPDX-License-Identifier: Apache-2.0
"""The leg to the first point of a list, which begins where the vehicle is: its points in between.

They must stay where they are on board while the list changes or the vehicle flies on, as each
change is an upload. So the start of a leg is kept for as long as the vehicle is on that leg.
"""
from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from uav_task_alloc.geometry.polyline import segment_fraction
from uav_task_alloc.mavlink.mission.items import TaskList
from uav_task_alloc.mavlink.mission.long_legs import (
    MAX_LEG_LENGTH,
    first_point,
    first_points,
    legs,
    points_between,
)
from uav_task_alloc.model import Point

_PASSED_MARGIN = 200.0  # [m] by which a point is passed before it is left out: it is not flown back to
_OFF_TRACK, _OFF_TRACK_PLANE = 50.0, 300.0  # [m] from its leg a vehicle is still on it; planes turn wide
_OFF_ALTITUDE = 30.0  # [m] the same; while it flies its mission its autopilot climbs as it likes


@dataclass(frozen=True, slots=True)
class LegStart:
    """Where a vehicle is, so that a leg begins there. ENU [m]."""

    point: Point
    home: Point
    on_mission: bool = False  # it flies one


class FirstLeg:
    """Where the legs of the list begin that is flown, and what of the first one lies ahead."""

    def __init__(self, plane: bool = False, farthest: float = math.inf) -> None:
        self.locate: Callable[[], LegStart | None] = lambda: None  # None: not known
        self.version = 0  # of the start of the first leg
        self._beside, self._farthest = _OFF_TRACK_PLANE if plane else _OFF_TRACK, farthest
        self._starts: dict[Point, Point] = {}  # of the legs, by their ends
        self._target: Point | None = None
        self._points: tuple[Point, ...] = ()  # of the first leg
        self._of: tuple[Point, Point] | None = None  # its ends
        self._behind = 0

    def begin(self, tasks: TaskList) -> None:
        """This is flown from here on."""
        self._target, self._behind = first_point(tasks), 0
        start, place = self._start(), self.locate()
        if self._target is not None and place is not None and (
                start is None or self._is_off(place, start, self._target)):
            start = place.point
        self._starts = {end: begin for begin, end in legs(tasks, start)}
        self.version += 1
        if start is None or self._target is None:
            self._points, self._of = (), None
        elif self._of != (start, self._target):  # else they stay, though home may have moved
            self._of = start, self._target
            self._points = first_points(
                start, self._target, start if place is None else place.home, self._farthest)

    @property
    def is_off(self) -> bool:
        """The vehicle is elsewhere, or it is known only now where it is: `begin` again."""
        place, start = self.locate(), self._start()
        if self._target is None or place is None:
            return False
        return start is None or (not place.on_mission and self._is_off(place, start, self._target))

    @property
    def start_unknown(self) -> bool:
        """Nobody knows where it begins, and it may be a long one: to upload it is too early."""
        return (self._target is not None and self._start() is None
                and math.hypot(*self._target) > MAX_LEG_LENGTH)

    @property
    def passed(self) -> int:
        """How many points of the first leg the vehicle has passed."""
        place, start = self.locate(), self._start()
        if place is not None and start is not None and self._target is not None:
            rest = _metres_left(place.point, start, self._target)
            self._behind = sum(math.dist(point, self._target) > rest + _PASSED_MARGIN
                               for point in self._points)
        return self._behind

    def points_ahead(self, target: Point | None) -> tuple[Point, ...]:
        """Points in between that are still to be flown on the way to `target`."""
        if target == self._target:
            return self._points[self.passed:]
        start = None if target is None else self._starts.get(target)
        return () if start is None or target is None else points_between(start, target)

    def _start(self) -> Point | None:
        return None if self._target is None else self._starts.get(self._target)

    def _is_off(self, place: LegStart, start: Point, end: Point) -> bool:
        share = min(1.0, max(0.0, segment_fraction(place.point, start, end)))
        on = tuple(a + (b - a) * share for a, b in zip(start, end, strict=True))
        return math.dist(place.point[:2], on[:2]) > self._beside or (
            not place.on_mission and abs(place.point[2] - on[2]) > _OFF_ALTITUDE)


def _metres_left(place: Point, start: Point, end: Point) -> float:
    """How much of a leg is still ahead [m]; more than its length before its start."""
    return (1.0 - segment_fraction(place, start, end)) * math.dist(start, end)
