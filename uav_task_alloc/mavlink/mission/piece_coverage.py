# SPDX-License-Identifier: Apache-2.0
"""How much of the ways of a list is flown, by the positions of the vehicle in mission mode.

A way is complete once it was followed to its last point; where it was left, the rest is flown.
"""
from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Container, Iterable, Sequence
from itertools import pairwise

from uav_task_alloc.mavlink.mission.flown_path import PositionSample
from uav_task_alloc.mavlink.mission.item import Item
from uav_task_alloc.mavlink.mission.listed_pieces import ListedPieces
from uav_task_alloc.mavlink.mission.piece import LEAST_PART, POSITION_SLACK, SPEED_MARGIN, Piece
from uav_task_alloc.mavlink.mission.piece_mark import (
    PART_FLOWN,
    PART_MISSED,
    PART_UNDER_WAY,
    PieceMark,
)
from uav_task_alloc.mavlink.mission.recent_positions import RecentPositions
from uav_task_alloc.mavlink.mission.task_list import MissionStop
from uav_task_alloc.model import Point

_CORRIDOR, _CORRIDOR_PLANE = 10.0, 150.0  # [m] from a way at which a vehicle still follows it
_KEPT = 64  # ways that were left
_UNSHOWN = 1.5  # [s] until a vehicle has shown its mode again, where no frame is lost


class PieceCoverage:
    """The ways of the list of one vehicle.

    Args:
        plane: whether the vehicle turns as wide as a plane.

    Attributes:
        pieces: the ways, and what is left of each.
        corridor: distance [m] from a way at which the vehicle still follows it.
        mission_known: whether the mission on board is known, so that what is flown in silence is.
        recorded: what was flown before this run of the bridge was stored.
    """

    def __init__(self, plane: bool = False) -> None:
        self.pieces, self.mission_known = ListedPieces(), True
        self.corridor = _CORRIDOR_PLANE if plane else _CORRIDOR
        self.left: deque[str] = deque(maxlen=_KEPT)  # ways that were left, to be taken
        self._under_way: str | None = None
        self._latest: str | None = None  # under way, or left without flying to another task
        self._ending: str | None = None  # passed in flight; it is not known how far it was flown
        self._sampled = -math.inf  # vehicle time [s] of the newest position
        self._restored: set[str] = set()  # under way when the previous run of the bridge ended
        self._restored_until = math.inf  # vehicle time [s]: another mode was shown in this run
        self.recorded = False  # what was flown before this run is known by its file
        self._recent = RecentPositions()
        self._fastest = 0.0  # [m/s]

    def set_listed(self, stops: Iterable[MissionStop]) -> None:
        """Take the ways of a list; what was flown of the same way stays flown."""
        self.pieces.set_listed(stops, flown=(self._under_way, self._ending))

    def rest(self, stop: MissionStop) -> MissionStop:
        """A stop with what is left of its way, in the direction of flight."""
        if stop.task.id == self._ending:
            self._leave(self._ending)
        return self.pieces.rest(stop)

    @property
    def latest(self) -> str | None:
        """The task whose way the vehicle is on, or has left without flying to another one."""
        return self._latest

    def must_begin(self, item: Item | None, place: Point) -> bool:
        """Whether what is left of a way has to be flown from its first point on.

        Args:
            item: that the vehicle would fly on to.
            place: of the vehicle [m] ENU.

        Returns:
            True where the item is of such a way, nothing of that is known to be flown, and the
            vehicle is not at its first point.
        """
        piece = self.pieces.get(item.task) if item is not None and item.along else None
        return piece is not None and piece.flown < LEAST_PART and (
            math.dist(place, piece.way[0]) > self.corridor + POSITION_SLACK)

    def is_followed(self, stop: MissionStop) -> bool:
        """Whether the vehicle is flying along the way of a stop, in the direction of the stop."""
        piece = self.pieces.get(stop.task.id)
        return stop.task.id == self._under_way and (
            piece is None or piece.reversed is stop.reversed)

    def note_active(self, item: Item | None, in_mission: bool,
                    vehicle_now: Callable[[], float] = lambda: -math.inf,
                    mission: Sequence[Item] = ()) -> None:
        """Note the item being flown; the way of another one is left where the vehicle was.

        Args:
            item: being flown; None: none, or not known.
            in_mission: whether the vehicle is in mission mode.
            vehicle_now: vehicle time [s].
            mission: all items on board, which show in which direction a way is flown.
        """
        task = item.task if item is not None and in_mission and item.along else None
        if not in_mission:
            self._recent.clear()
        elif task is not None or (item is not None and item.task != self._latest):
            self._latest = task
        piece = self.pieces.get(task)
        if task == self._under_way and not (piece is not None and piece.gone):
            return
        before, self._under_way = self._under_way, task
        if before is not None and before != task:
            self.left.append(before)
            self._leave(self._ending)
            self._ending = before
        if not in_mission or task == self._ending:
            self._leave(self._ending)
        if piece is not None:
            places = [each.position for each in mission
                      if each.task == task and each.along and each.position is not None]
            if piece.is_turned(places):  # a later list turned it
                self.pieces.turn(piece, piece.path, not piece.reversed)
            self._begin(piece, vehicle_now)
            self.pieces.note_begun(task or '')

    def note_left(self, shown_until: float) -> None:
        """Note that the vehicle is not in mission mode; it may have left that some time ago.

        Args:
            shown_until: vehicle time [s] until which a frame has shown mission mode: where some
                were lost since, what was followed later is flown again.
        """
        if _UNSHOWN < self._sampled - shown_until < math.inf:
            for name in (self._under_way, self._ending):
                piece = self.pieces.get(name)
                if piece is not None:
                    piece.withdraw(shown_until)
        self.note_active(None, False)

    def _begin(self, piece: Piece, vehicle_now: Callable[[], float]) -> None:
        """Begin to follow a way, on which the vehicle may be for some seconds."""
        if piece.gone:
            piece.gone, piece.seen, piece.off = False, None, None
        piece.in_silence = False
        if piece.seen is None:
            begin = piece.next_point()
            unseen, samples = self._recent.on_way_from(begin, self.corridor)
            if unseen is not None:
                piece.seen, piece.off = unseen.t, (unseen.t, math.dist(unseen.position, begin))
                self._follow(piece, samples[0], unseen.t)  # it came to it unseen
            for sample in samples:
                self._follow(piece, sample, sample.t)
            if piece.off is not None:  # it may have come to it since, or it cannot
                since, back = piece.off
                piece.missed = back > self.corridor + POSITION_SLACK + (
                    SPEED_MARGIN * self._fastest * max(vehicle_now() - since, 0.0))

    def note_replaced(self, item: Item | None) -> None:
        """Note another mission: what is flown from now on is not of a way left by it.

        Args:
            item: its first one.
        """
        self._recent.note_replaced()
        for name in (self._under_way, self._ending):
            piece = self.pieces.get(name)
            if piece is not None and not (
                    item is not None and item.along and item.task == name):
                piece.gone = True

    def _leave(self, name: str | None) -> None:
        """Fly the rest of a way from where it was left."""
        if name == self._ending:
            self._ending = None
        self.pieces.commit(name)

    def add_position(self, sample: PositionSample, fastest: float) -> None:
        """Take a position of the vehicle.

        Args:
            sample: newer than those before.
            fastest: [m/s] that it flies.
        """
        before, self._sampled, self._fastest = self._sampled, sample.t, fastest
        self._recent.add(sample, before)
        for name in {self._under_way, self._ending, *self._restored}:
            piece = self.pieces.get(name)
            if piece is not None and not piece.gone:
                self._follow(piece, sample, before)
                piece.missed = piece.off is not None
        if sample.t > self._restored_until:
            self._leave_restored()

    def note_other_mode(self, newest: float) -> None:
        """Note that a heartbeat shows another mode than that of missions.

        Ways that were under way when the previous run ended are followed up to the next position,
        which shows how far they were flown in between.

        Args:
            newest: vehicle time [s] of the newest position.
        """
        self._restored_until = min(self._restored_until, newest)

    def _leave_restored(self) -> None:
        """Fly the rest of the ways that were under way when the previous run ended."""
        for name in self._restored - {self._under_way, self._ending}:
            self._leave(name)
        self._restored.clear()

    def _follow(self, piece: Piece, sample: PositionSample, before: float) -> None:
        piece.follow(sample, before, self._fastest, self.corridor, self.mission_known)

    def covers(self, task: str, vehicle_now: float, fastest: float) -> bool:
        """Whether the whole way of a task was flown, as far as is known.

        Args:
            task: id.
            vehicle_now: vehicle time [s].
            fastest: [m/s] that it flies.
        """
        piece = self.pieces.get(task)
        if piece is None or math.isinf(self._sampled):
            return True
        left = piece.left
        if left <= self.corridor + POSITION_SLACK or piece.in_silence:
            return True
        # nothing was received since it was on its way
        blind = self.mission_known and piece.seen is not None and (
            self._sampled <= piece.seen and not piece.missed and not piece.gone)
        left += piece.off[1] if piece.off is not None else 0.0
        return blind and left <= POSITION_SLACK + self.corridor + SPEED_MARGIN * fastest * max(
            0.0, vehicle_now - (piece.seen or 0.0))

    def covered_before(self, task: str) -> bool:
        """Whether the whole way of a task was flown that ended while no bridge ran.

        Only one that was being flown when the previous run ended, by its file: where another
        station has set the current item, what is before that was not flown.

        Args:
            task: id.
        """
        piece = self.pieces.get(task)
        return piece is None or piece.in_silence or (
            piece.left <= self.corridor + POSITION_SLACK)

    def leave(self) -> None:
        """Note that the vehicle was restarted, or its mission is not known."""
        self.note_active(None, False)
        self._sampled, self._latest = -math.inf, None

    def marks(self, completed: Container[str]) -> tuple[PieceMark, ...]:
        """What a restarted bridge has to know of the pieces that are partly flown."""
        return self.pieces.marks(completed, self._state)

    def _state(self, name: str, piece: Piece) -> int:
        if name not in (self._under_way, self._ending) or piece.gone or not self.mission_known:
            return PART_FLOWN
        return PART_MISSED if piece.missed else PART_UNDER_WAY

    def restore(self, marks: Iterable[PieceMark], stops: Iterable[MissionStop],
                samples: Sequence[PositionSample], fastest: float) -> None:
        """Continue with what the previous run of the bridge has stored, for tasks of a list.

        Args:
            marks: as stored.
            stops: of the list, which was set.
            samples: positions, those that were stored first; (): there are none.
            fastest: [m/s] that it flies.
        """
        by_id = {stop.task.id: stop for stop in stops if stop.task.path}
        for mark in marks:
            stop = by_id.get(mark.task)
            piece = None if stop is None else self.pieces.restore(mark)
            if piece is None or stop is None:
                continue
            piece.missed = mark.state == PART_MISSED
            ended = False
            if mark.state == PART_UNDER_WAY:
                self._restored.add(mark.task)
            if mark.state == PART_UNDER_WAY and samples:
                self._continue(piece, samples[0])
                for before, sample in pairwise(samples):
                    if not ended:
                        piece.follow(sample, before.t, fastest, self.corridor,
                                     self.mission_known)
                    ended = ended or sample.t > self._restored_until
                self._sampled = max(self._sampled, samples[-1].t)
            if piece.reversed != stop.reversed:
                self.pieces.turn(piece, stop.task.path, stop.reversed)
        if samples and samples[-1].t > self._restored_until:
            self._leave_restored()

    def _continue(self, piece: Piece, sample: PositionSample) -> None:
        if piece.continue_at(sample, self.corridor):
            self._sampled = max(self._sampled, sample.t)

    def continue_at(self, item: Item | None, sample: PositionSample | None) -> None:
        """Take the points before the item being flown as passed, where nothing was stored.

        Args:
            item: found on board.
            sample: of the vehicle; None: not known.
        """
        piece = self.pieces.get(item.task) if item is not None and item.along else None
        if piece is None or item is None or self.recorded or piece.seen is not None or (
                piece.flown >= LEAST_PART or item.position is None):
            return
        place = item.position
        n = min(range(1, len(piece.way)), key=lambda k: math.dist(piece.way[k], place))
        piece.flown = piece.way_at[n - 1]
        # set by another station, it flies to the item from elsewhere
        if sample is not None and piece.begun_by(sample, n - 1) <= self.corridor:
            self._continue(piece, sample)
