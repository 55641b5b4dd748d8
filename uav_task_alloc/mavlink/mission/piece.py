# SPDX-License-Identifier: Apache-2.0
"""A way of the list of one vehicle: the part of it that is left, and how far that is flown."""
from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import accumulate, pairwise

from uav_task_alloc.geometry.polyline import nearest_on_segment, point_at, segment_fraction
from uav_task_alloc.mavlink.mission.flown_path import GAP, PositionSample
from uav_task_alloc.model import Point

_SAME = 1.0  # [m] between the ends of a closed way
LEAST_PART = 1.0  # [m] of a flown part or of a rest
POSITION_SLACK = 10.0  # [m] of positions that are not exact
SPEED_MARGIN = 1.2  # factor of a speed: how far a vehicle may have flown
_KEPT = 64  # positions: 13 s at 5 Hz
_COURSE_SPEED = 1.0  # [m/s] above which a vehicle has a course


@dataclass(slots=True)
class Piece:
    """A way of the list, in metres from the first point of its path."""

    path: tuple[Point, ...]
    place: Point
    at: list[float]  # [m] of each point
    low: float
    high: float
    reversed: bool = False
    flown: float = 0.0  # [m] of the part between `low` and `high`, in the direction of flight
    seen: float | None = None  # vehicle time [s] of the last position on it
    off: tuple[float, float] | None = None  # vehicle time [s], [m] to go back: seen off it since
    missed: bool = False  # seen off it while its item was current: silence proves nothing
    gone: bool = False  # another mission was taken, in which it is not flown on
    in_silence: bool = False  # its end can have been flown in silence, if it was passed
    way: list[Point] = field(default_factory=list)  # that part in the direction of flight
    way_at: list[float] = field(default_factory=list)  # [m] of each of its points
    # vehicle time [s] of the latest positions on it, and `flown` before each
    _followed: deque[tuple[float, float]] = field(default_factory=lambda: deque(maxlen=_KEPT))

    def measure(self) -> None:
        """Cut the part that is left out of the path."""
        inner = [p for p, at in zip(self.path, self.at, strict=True)
                 if self.low < at < self.high]
        self.way = [self.point(self.low), *inner, self.point(self.high)]
        if self.reversed:
            self.way.reverse()
        self.way_at = [0.0, *accumulate(math.dist(a, b) for a, b in pairwise(self.way))]

    def point(self, metres: float) -> Point:
        """The place at so many metres from the first point of its path."""
        n = min(max(bisect_right(self.at, metres) - 1, 0), len(self.path) - 2)
        length = self.at[n + 1] - self.at[n]
        if metres <= self.at[0] or metres >= self.at[-1] or length <= 0.0:
            return self.path[0 if metres <= self.at[0] else -1 if metres >= self.at[-1] else n]
        x, y, z = point_at(self.path[n], self.path[n + 1], (metres - self.at[n]) / length)
        return x, y, z

    def next_point(self) -> Point:
        """The end of the flown part."""
        return self.point(self.high - self.flown if self.reversed else self.low + self.flown)

    def passed_points(self) -> float:
        """Metres to the last point of the way that was passed: what is stored changes rarely."""
        return round(self.way_at[max(bisect_right(self.way_at, self.flown) - 1, 0)], 2)

    @property
    def left(self) -> float:
        """Metres of the way that are not flown."""
        return self.way_at[-1] - self.flown

    def restart(self) -> None:
        """Begin with the whole path again."""
        self.low, self.high, self.flown, self.seen = 0.0, self.at[-1], 0.0, None
        self.off, self.missed, self.gone, self.in_silence = None, False, False, False
        self._followed.clear()
        self.measure()

    def follow(self, sample: PositionSample, before: float, fastest: float, corridor: float,
               mission_known: bool) -> None:
        """Take a position of the vehicle, which may be on the way.

        Args:
            sample: the position.
            before: vehicle time [s] of the position before.
            fastest: [m/s] that it flies.
            corridor: [m] from the way at which it still follows it.
            mission_known: whether the mission on board is known.
        """
        if self.seen is None:
            self.seen = min(before, sample.t) if math.isfinite(before) else sample.t
        since, back = self.off or (self.seen, 0.0)
        silent = sample.t - before > GAP
        known = mission_known and not self.missed
        gap = max(sample.t - since, 0.0) if known or not silent else 0.0
        reach = max(SPEED_MARGIN * fastest * gap - back, 0.0) + POSITION_SLACK
        metres = self._metres(sample.position, reach, corridor)
        if metres is not None:
            self._followed.append((sample.t, self.flown))
            self.flown, self.seen, self.off = max(self.flown, metres), sample.t, None
            self.in_silence = False
            return
        if gap > GAP and silent and (
                self.left + math.dist(sample.position, self.way[-1]) <= reach):
            self.in_silence = True
        # what it flies now it does not fly of the way
        self.off = sample.t, math.dist(sample.position, self.next_point())

    def withdraw(self, until: float) -> None:
        """Take what it followed later than a vehicle time [s] as not flown."""
        self.flown = next((flown for t, flown in self._followed if t > until), self.flown)

    def continue_at(self, sample: PositionSample, corridor: float) -> bool:
        """Continue at a position on the leg after the points that were passed.

        Args:
            sample: the position.
            corridor: [m] from the way at which the vehicle still follows it.

        Returns:
            Whether it is there.
        """
        n = bisect_right(self.way_at, self.flown)
        end = self.way_at[min(n, len(self.way) - 1)]
        metres = self._metres(sample.position, end - self.flown + POSITION_SLACK, corridor)
        if metres is None or metres < self.flown:
            return False
        self.flown, self.seen = metres, sample.t
        return True

    def _metres(self, position: Point, reach: float, corridor: float) -> float | None:
        """Where on the way the vehicle is [m]; None where it does not follow it."""
        low, high = self.flown - POSITION_SLACK, self.flown + reach
        first = max(bisect_right(self.way_at, low) - 1, 0)
        last = min(bisect_left(self.way_at, high), len(self.way) - 1)
        best, found = corridor, None
        for n in range(first, last):
            a, b = self.way[n], self.way[n + 1]
            away = math.dist(position, nearest_on_segment(position, a, b))
            metres = self.way_at[n] + (self.way_at[n + 1] - self.way_at[n]) * (
                segment_fraction(position, a, b))
            if away <= best and metres <= high:
                best, found = away, metres
        return found

    def begun_by(self, sample: PositionSample, leg: int) -> float:
        """Return how far [m] from the beginning of a leg the vehicle was, by its course.

        Args:
            sample: of the vehicle.
            leg: index of the point of the way at which it begins.
        """
        start, speed = self.way[leg], math.hypot(*sample.velocity)
        away = math.dist(start, sample.position)
        if not speed > _COURSE_SPEED:
            return away
        x, y, z = (p - v / speed * away for p, v in zip(
            sample.position, sample.velocity, strict=True))
        return math.dist(start, (x, y, z))

    def is_turned(self, places: Sequence[Point]) -> bool:
        """Whether a mission flies it in the other direction.

        Args:
            places: of its items after the first point of the way [m] ENU; (): not known.
        """
        if not places:
            return False
        first, *_, last = self.way
        if math.dist(first, last) > _SAME:
            return math.dist(places[-1], first) < math.dist(places[-1], last)
        return math.dist(places[0], self.way[-2]) < math.dist(places[0], self.way[1])

    def turn(self, path: tuple[Point, ...], backwards: bool) -> None:
        """Take another direction of flight, or of the path.

        Args:
            path: the same points, perhaps from the other end.
            backwards: whether it is flown from the last point of that path.
        """
        self.commit()
        if self.path != path:
            length = self.at[-1]
            self.path, self.at = path, [length - at for at in reversed(self.at)]
            self.low, self.high = length - self.high, length - self.low
        self.reversed = backwards
        self.measure()

    def commit(self) -> bool:
        """Leave out the flown part from now on; whether there is one."""
        self._followed.clear()
        if self.flown < LEAST_PART:
            self.flown, self.seen, self.off = 0.0, None, None
            return False
        left = max(self.high - self.low - self.flown, LEAST_PART)
        if self.reversed:
            self.high = self.low + left
        else:
            self.low = self.high - left
        self.flown, self.seen, self.off = 0.0, None, None
        self.measure()
        return True
