# SPDX-License-Identifier: Apache-2.0
"""Pieces of a new cut compared with those in force: flown, known by their ways, or new."""
from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

from uav_task_alloc.allocator.records import TaskRecord
from uav_task_alloc.geometry.polyline import polyline_length
from uav_task_alloc.model import Point, Task
from uav_task_alloc.work.recut import FlownWays, way_key

_IdsByWay = dict[tuple[Point, ...], list[str]]


@dataclass(frozen=True, slots=True)
class MatchedPiece:
    """A piece of a new cut, or a part of one that is not flown."""

    task: Task  # with its share of value and service time; its id is that of the new cut
    known: str = ''  # id of the piece in force with the same way; '': none has it
    flown: bool = False  # that piece is completed


def match_pieces(pieces: Sequence[Task], unflown: Iterable[TaskRecord],
                 flown: Iterable[TaskRecord]) -> list[MatchedPiece]:
    """Return what the pieces of a new cut are; a piece in force is at most one of them.

    Args:
        pieces: of the new cut.
        unflown: pieces in force that are not completed.
        flown: completed pieces, which count for the whole width of the new ones.

    Returns:
        In the order of `pieces`: each as a whole, or the parts of it that are not flown.
    """
    flown = list(flown)
    flown_by_way, by_way = _ids_by_way(flown), _ids_by_way(unflown)
    done = [_taken(flown_by_way, piece) for piece in pieces]
    # those that are a piece of the new cut as a whole count for no part of another one
    rest = FlownWays(record.task.path for record in flown if record.task.id not in done)
    matched = list[MatchedPiece]()
    for piece, whole in zip(pieces, done, strict=True):
        if whole:
            matched.append(MatchedPiece(piece, whole, flown=True))
        else:
            matched += [MatchedPiece(part, _taken(by_way, part)) for part in _parts(piece, rest)]
    return matched


def _ids_by_way(records: Iterable[TaskRecord]) -> _IdsByWay:
    """Ids of pieces by their ways."""
    found = _IdsByWay()
    for record in records:
        found.setdefault(way_key(record.task.path, record.task.reversible), []).append(
            record.task.id)
    return found


def _taken(by_way: _IdsByWay, piece: Task) -> str:
    """The id of a piece with the way of another one, taken out of `by_way`; '' for none."""
    alike = by_way.get(way_key(piece.path, piece.reversible))
    return alike.pop(0) if alike else ''


def _parts(piece: Task, flown: FlownWays) -> list[Task]:
    """A piece of a new cut, or what is not flown of it, with its share of the value."""
    ways = flown.unflown_parts(piece.path)
    if ways == [piece.path]:
        return [piece]
    length = piece.path_length
    return [replace(piece, position=way[0], path=way,
                    value=piece.value * polyline_length(way) / length,
                    service_time=piece.service_time * polyline_length(way) / length)
            for way in ways]
