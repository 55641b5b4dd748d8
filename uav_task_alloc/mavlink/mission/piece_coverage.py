# SPDX-License-Identifier: Apache-2.0
"""How much of the ways of a list is flown, by the positions of the vehicle in mission mode.

A way is flown from one end without a break. It is complete once the vehicle has followed it to its
last point; where it left it in between, the rest is flown from there.
"""
from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from collections import deque
from collections.abc import Container, Iterable
from dataclasses import dataclass, field, replace
from itertools import accumulate, pairwise

from uav_task_alloc.geometry.polyline import nearest_on_segment, point_at, segment_fraction
from uav_task_alloc.mavlink.mission.flown_path import GAP, PositionSample
from uav_task_alloc.mavlink.mission.item import Item
from uav_task_alloc.mavlink.mission.piece_mark import PieceMark
from uav_task_alloc.mavlink.mission.stop_items import place_of
from uav_task_alloc.mavlink.mission.task_list import MissionStop
from uav_task_alloc.model import Point

_CORRIDOR, _CORRIDOR_PLANE = 15.0, 150.0  # [m] from a way at which a vehicle still follows it
_SLACK = 10.0  # [m] of positions that are not exact
_RECENT = 32  # positions: six seconds, by which the report of the current item may be late
_MARGIN = 1.2  # of a speed
_SHORTEST = 1.0  # [m] of a flown part or of a rest
_KEPT = 64  # pieces


@dataclass(slots=True)
class _Piece:
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
    way: list[Point] = field(default_factory=list)  # that part in the direction of flight
    way_at: list[float] = field(default_factory=list)  # [m] of each of its points

    def measure(self) -> None:
        """Cut the part that is left out of the path."""
        inner = [p for p, at in zip(self.path, self.at, strict=True)
                 if self.low < at < self.high]
        self.way = [self.point(self.low), *inner, self.point(self.high)]
        if self.reversed:
            self.way.reverse()
        self.way_at = [0.0, *accumulate(math.dist(a, b) for a, b in pairwise(self.way))]

    def point(self, metres: float) -> Point:
        n = min(max(bisect_right(self.at, metres) - 1, 0), len(self.path) - 2)
        length = self.at[n + 1] - self.at[n]
        if metres <= self.at[0] or metres >= self.at[-1] or length <= 0.0:
            return self.path[0 if metres <= self.at[0] else -1 if metres >= self.at[-1] else n]
        x, y, z = point_at(self.path[n], self.path[n + 1], (metres - self.at[n]) / length)
        return x, y, z

    def next_point(self) -> Point:
        """The end of the flown part."""
        return self.point(self.high - self.flown if self.reversed else self.low + self.flown)

    def commit(self) -> bool:
        """Leave out the flown part from now on; whether there is one."""
        if self.flown < _SHORTEST:
            self.flown, self.seen, self.off = 0.0, None, None
            return False
        left = max(self.high - self.low - self.flown, _SHORTEST)
        if self.reversed:
            self.high = self.low + left
        else:
            self.low = self.high - left
        self.flown, self.seen, self.off = 0.0, None, None
        self.measure()
        return True


class PieceCoverage:
    """The ways of the list of one vehicle.

    Args:
        plane: whether the vehicle turns as wide as a plane.

    Attributes:
        version: changes with the ways that are left.
        mission_known: whether the mission on board is known, so that what is flown in silence is.
    """

    def __init__(self, plane: bool = False) -> None:
        self.version, self.mission_known = 0, True
        self._corridor = _CORRIDOR_PLANE if plane else _CORRIDOR
        self._pieces: dict[str, _Piece] = {}
        self.left: deque[str] = deque(maxlen=_KEPT)  # ways that were left, to be taken
        self._partly: dict[str, None] = {}  # those of which a part is flown
        self._under_way: str | None = None
        self._ending: str | None = None  # passed in flight; it is not known how far it was flown
        self._sampled = -math.inf  # vehicle time [s] of the newest position
        self._recent: deque[PositionSample] = deque(maxlen=_RECENT)  # in mission mode, without gap
        self._fastest = 0.0  # [m/s]

    def set_listed(self, stops: Iterable[MissionStop]) -> None:
        """Take the ways of a list; what was flown of the same way stays flown."""
        listed: set[str] = set()
        for stop in stops:
            if not stop.task.path:
                continue
            name, place = stop.task.id, place_of(stop.task)
            piece = self._pieces.pop(name, None)
            if piece is None or piece.place != place:
                self._partly.pop(name, None)
                at = [0.0, *accumulate(math.dist(a, b) for a, b in pairwise(stop.task.path))]
                piece = _Piece(stop.task.path, place, at, 0.0, at[-1], stop.reversed)
                piece.measure()
                self.version += 1
            elif piece.path != stop.task.path or piece.reversed != stop.reversed:
                self._turn(piece, stop)
            self._pieces[name] = piece
            listed.add(name)
        for name in [name for name in self._pieces if name not in listed][:-_KEPT]:
            del self._pieces[name]
            self._partly.pop(name, None)

    def _turn(self, piece: _Piece, stop: MissionStop) -> None:
        """Take another direction of flight, or of the path."""
        piece.commit()
        if piece.path != stop.task.path:  # the same points from the other end
            length = piece.at[-1]
            piece.path, piece.at = stop.task.path, [length - at for at in reversed(piece.at)]
            piece.low, piece.high = length - piece.high, length - piece.low
        piece.reversed = stop.reversed
        piece.measure()
        self.version += 1

    def rest(self, stop: MissionStop) -> MissionStop:
        """A stop with what is left of its way, in the direction of flight."""
        if stop.task.id == self._ending:
            self._leave(self._ending)
        piece = self._pieces.get(stop.task.id)
        if piece is None or not stop.task.path or (
                piece.high - piece.low >= piece.at[-1] - 1e-6):
            return stop
        return replace(stop, rest=tuple(piece.way), begun=True)

    def is_under_way(self, task: str) -> bool:
        """Whether the vehicle is flying along the way of a task."""
        return task == self._under_way

    def note_active(self, item: Item | None, in_mission: bool) -> None:
        """Note the item being flown; the way of another one is left where the vehicle was."""
        task = item.task if item is not None and in_mission and item.along else None
        if not in_mission:
            self._recent.clear()
        if task == self._under_way:
            return
        before, self._under_way = self._under_way, task
        if before is not None:
            self.left.append(before)
            self._leave(self._ending)
            self._ending = before
        if not in_mission or task == self._ending:
            self._leave(self._ending)
        piece = self._pieces.get(task or '')
        if piece is not None and piece.seen is None:  # it may be on it for some seconds
            for sample in self._recent:
                self._follow(piece, sample, sample.t, self._fastest)

    def _leave(self, name: str | None) -> None:
        """Fly the rest of a way from where it was left."""
        piece = self._pieces.get(name or '')
        if name == self._ending:
            self._ending = None
        if piece is not None and piece.commit():
            self.version += 1

    def add_position(self, sample: PositionSample, fastest: float) -> None:
        """Take a position of the vehicle.

        Args:
            sample: newer than those before.
            fastest: [m/s] that it flies.
        """
        before, self._sampled, self._fastest = self._sampled, sample.t, fastest
        if not 0.0 <= sample.t - before <= GAP:
            self._recent.clear()
        self._recent.append(sample)
        for name in (self._under_way, self._ending):
            piece = self._pieces.get(name or '')
            if name is not None and piece is not None:
                self._follow(piece, sample, before, fastest)
                if piece.flown >= _SHORTEST:
                    self._partly[name] = None

    def _follow(self, piece: _Piece, sample: PositionSample, before: float,
                fastest: float) -> None:
        if piece.seen is None:
            piece.seen = min(before, sample.t) if math.isfinite(before) else sample.t
        since, back = piece.off or (piece.seen, 0.0)
        silent = sample.t - before > GAP
        gap = max(sample.t - since, 0.0) if self.mission_known or not silent else 0.0
        reach = max(_MARGIN * fastest * gap - back, 0.0) + _SLACK
        metres = self._metres(piece, sample.position, reach)
        if metres is not None:
            piece.flown, piece.seen, piece.off = max(piece.flown, metres), sample.t, None
        elif gap > GAP and silent and (
                piece.way_at[-1] - piece.flown + math.dist(sample.position, piece.way[-1])
                <= reach):
            piece.flown, piece.seen, piece.off = piece.way_at[-1], sample.t, None
        else:  # what it flies now it does not fly of the way
            piece.off = sample.t, math.dist(sample.position, piece.next_point())

    def _metres(self, piece: _Piece, position: Point, reach: float) -> float | None:
        """Where on its way the vehicle is [m]; None where it does not follow it."""
        low, high = piece.flown - _SLACK, piece.flown + reach
        first = max(bisect_right(piece.way_at, low) - 1, 0)
        last = min(bisect_left(piece.way_at, high), len(piece.way) - 1)
        best, found = self._corridor, None
        for n in range(first, last):
            a, b = piece.way[n], piece.way[n + 1]
            away = math.dist(position, nearest_on_segment(position, a, b))
            metres = piece.way_at[n] + (piece.way_at[n + 1] - piece.way_at[n]) * (
                segment_fraction(position, a, b))
            if away <= best and metres <= high:
                best, found = away, metres
        return found

    def covers(self, task: str, vehicle_now: float, fastest: float) -> bool:
        """Whether the whole way of a task was flown, as far as is known.

        Args:
            task: id.
            vehicle_now: vehicle time [s].
            fastest: [m/s] that it flies.
        """
        piece = self._pieces.get(task)
        if piece is None or math.isinf(self._sampled):
            return True
        left = piece.way_at[-1] - piece.flown
        if left <= self._corridor + _SLACK:
            return True
        # nothing was received since it was on its way
        blind = self.mission_known and piece.seen is not None and self._sampled <= piece.seen
        return blind and left <= _SLACK + self._corridor + _MARGIN * fastest * max(
            0.0, vehicle_now - (piece.seen or 0.0))

    def forget(self, task: str) -> None:
        """Fly the whole way of a task again."""
        piece = self._pieces.get(task)
        self._partly.pop(task, None)
        if piece is not None:
            piece.low, piece.high, piece.flown, piece.seen = 0.0, piece.at[-1], 0.0, None
            piece.off = None
            piece.measure()
            self.version += 1

    def leave(self) -> None:
        """Note that the vehicle was restarted, or its mission is not known."""
        self.note_active(None, False)
        self._sampled = -math.inf

    def marks(self, completed: Container[str]) -> tuple[PieceMark, ...]:
        """What a restarted bridge has to know of the pieces that are partly flown."""
        if not self._partly:
            return ()
        for name in [name for name in self._partly if name in completed]:
            del self._partly[name]
        rows = ((name, self._pieces[name]) for name in self._partly)
        return tuple(PieceMark(
            name, *piece.path[0][:2], piece.place[2], round(piece.low, 2), round(piece.high, 2),
            piece.reversed, _passed_points(piece)) for name, piece in rows)

    def restore(self, marks: Iterable[PieceMark], stops: Iterable[MissionStop],
                last: PositionSample | None) -> None:
        """Continue with what the previous run of the bridge has stored, for tasks of a list.

        Args:
            marks: as stored.
            stops: of the list, which was set.
            last: the last position that was stored; None: there is none.
        """
        by_id = {stop.task.id: stop for stop in stops if stop.task.path}
        for mark in marks:
            piece = self._pieces.get(mark.task)
            stop = by_id.get(mark.task)
            if piece is None or stop is None or (
                    *piece.path[0][:2], piece.place[2]) != mark[1:4]:
                continue
            piece.low, piece.high, piece.reversed = mark.low, mark.high, mark.reversed
            piece.measure()
            piece.flown = mark.flown
            self._partly[mark.task] = None
            if last is not None:
                self._place(piece, last.position, last.t)
            if piece.reversed != stop.reversed:
                self._turn(piece, stop)
            self.version += 1

    def _place(self, piece: _Piece, position: Point, t: float) -> None:
        """Continue at a position on the leg after the points that were passed."""
        n = bisect_right(piece.way_at, piece.flown)
        end = piece.way_at[min(n, len(piece.way) - 1)]
        metres = self._metres(piece, position, end - piece.flown + _SLACK)
        if metres is not None and metres >= piece.flown:
            piece.flown, piece.seen = metres, t
            self._sampled = max(self._sampled, t)

    def continue_at(self, item: Item | None, sample: PositionSample | None) -> None:
        """Take the points before the item being flown as passed, where nothing was stored.

        Args:
            item: found on board.
            sample: of the vehicle; None: not known.
        """
        piece = self._pieces.get(item.task) if item is not None and item.along else None
        if piece is None or item is None or piece.seen is not None or (
                piece.flown >= _SHORTEST or item.position is None):
            return
        place = item.position
        n = min(range(1, len(piece.way)), key=lambda k: math.dist(piece.way[k], place))
        piece.flown = piece.way_at[n - 1]
        if sample is not None:
            self._place(piece, sample.position, sample.t)


def _passed_points(piece: _Piece) -> float:
    """Metres to the last point of the way that was passed: what is stored changes rarely."""
    return round(piece.way_at[max(bisect_right(piece.way_at, piece.flown) - 1, 0)], 2)
