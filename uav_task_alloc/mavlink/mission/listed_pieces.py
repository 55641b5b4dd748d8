# SPDX-License-Identifier: Apache-2.0
"""The ways of the list of one vehicle, and what is left of each; by whichever list it came."""
from __future__ import annotations

import math
from collections.abc import Callable, Container, Iterable
from dataclasses import replace
from itertools import accumulate, pairwise

from uav_task_alloc.mavlink.mission.piece import Piece
from uav_task_alloc.mavlink.mission.piece_mark import PieceMark
from uav_task_alloc.mavlink.mission.stop_items import place_of
from uav_task_alloc.mavlink.mission.task_list import MissionStop
from uav_task_alloc.model import Point

_KEPT = 64  # pieces that the list does not have


class ListedPieces:
    """Keeps each way by the id of its task.

    Attributes:
        version: changes with the ways that are left.

    Arguments of methods:
        name: id of a task; None: no task.
        stop: of the list, with a way or without.
    """

    def __init__(self) -> None:
        self.version = 0
        self._pieces: dict[str, Piece] = {}
        self._partly: dict[str, None] = {}  # those of which a part is flown

    def get(self, name: str | None) -> Piece | None:
        """The way of a task; None: it has none, or is not listed."""
        return self._pieces.get(name or '')

    def set_listed(self, stops: Iterable[MissionStop], flown: Container[str | None]) -> None:
        """Take the ways of a list; what was flown of the same way stays flown.

        Args:
            stops: of the list.
            flown: ids of those that are being flown, as the mission on board has them.
        """
        listed: set[str] = set()
        for stop in stops:
            if not stop.task.path:
                continue
            name, place = stop.task.id, place_of(stop.task)
            piece = self._pieces.pop(name, None)
            if piece is None or piece.place != place:
                self._partly.pop(name, None)
                at = [0.0, *accumulate(math.dist(a, b) for a, b in pairwise(stop.task.path))]
                piece = Piece(stop.task.path, place, at, 0.0, at[-1], stop.reversed)
                piece.measure()
                self.version += 1
            else:
                turned = piece.path != stop.task.path
                wanted = piece.reversed is not turned if name in flown else stop.reversed
                if turned or piece.reversed is not wanted:
                    self.turn(piece, stop.task.path, wanted)
            self._pieces[name] = piece
            listed.add(name)
        for name in [name for name in self._pieces if name not in listed][:-_KEPT]:
            del self._pieces[name]
            self._partly.pop(name, None)

    def turn(self, piece: Piece, path: tuple[Point, ...], backwards: bool) -> None:
        """Take another direction of flight, or of the path; see `Piece.turn`."""
        piece.turn(path, backwards)
        self.version += 1

    def commit(self, name: str | None) -> None:
        """Fly the rest of a way from where it was left."""
        piece = self.get(name)
        if piece is not None and piece.commit():
            self.version += 1

    def rest(self, stop: MissionStop) -> MissionStop:
        """A stop with what is left of its way, in the direction of flight."""
        piece = self.get(stop.task.id)
        if piece is None or not stop.task.path or (
                piece.high - piece.low >= piece.at[-1] - 1e-6):
            return stop
        way = piece.way if piece.reversed is stop.reversed else reversed(piece.way)
        return replace(stop, rest=tuple(way), begun=True)

    def begin_of_rest(self, stop: MissionStop) -> float:
        """Where on the way of a stop its rest begins [m], in the direction of flight."""
        piece = self.get(stop.task.id)
        if piece is None or not stop.task.path:
            return 0.0
        return piece.at[-1] - piece.high if stop.reversed else piece.low

    def forget(self, name: str) -> None:
        """Fly the whole way of a task again."""
        piece = self._pieces.get(name)
        self._partly.pop(name, None)
        if piece is not None:
            piece.restart()
            self.version += 1

    def note_begun(self, name: str) -> None:
        """Note that a part of a way is flown, as it is being followed."""
        self._partly[name] = None

    def marks(self, completed: Container[str],
              state: Callable[[str, Piece], int]) -> tuple[PieceMark, ...]:
        """What a restarted bridge has to know of the pieces that are partly flown.

        Args:
            completed: ids of completed tasks.
            state: returns that of such a piece by its task, see `PieceMark.state`.
        """
        if not self._partly:
            return ()
        for name in [name for name in self._partly if name in completed]:
            del self._partly[name]
        rows = ((name, self._pieces[name]) for name in self._partly)
        return tuple(PieceMark(
            name, *piece.path[0][:2], piece.place[2], round(piece.low, 2), round(piece.high, 2),
            piece.reversed, piece.passed_points(), state(name, piece))
            for name, piece in rows)

    def restore(self, mark: PieceMark) -> Piece | None:
        """Take what the previous run of the bridge has stored of a piece.

        Returns:
            The piece; None: there is none of that way.
        """
        piece = self._pieces.get(mark.task)
        if piece is None or (*piece.path[0][:2], piece.place[2]) != mark[1:4]:
            return None
        piece.low, piece.high, piece.reversed = mark.low, mark.high, mark.reversed
        piece.measure()
        piece.flown = mark.flown
        self._partly[mark.task] = None
        self.version += 1
        return piece
