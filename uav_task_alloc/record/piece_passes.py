# SPDX-License-Identifier: Apache-2.0
"""Where vehicles truly flew along the ways of pieces, and at tasks: the judge of a run."""
from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise

from uav_task_alloc.geometry.polyline import point_at, polyline_length, segment_distance
from uav_task_alloc.model import Point
from uav_task_alloc.piece_ids import split_piece
from uav_task_alloc.record.ground_truth import GroundTruth, Reached, TrueSample, resampled, visits
from uav_task_alloc.record.run_state import RunState

_BESIDE = 5.0  # [m] from a way, within which a vehicle flies along it
_SHARE = 0.8  # of a way that a pass covers at least
_CORNER, _CORNER_SHARE = 6.0, 0.1  # [m] that a vehicle may cut at each end; of a short way
_ASIDE = 10.0  # [s] that it may be further off, for a corner or a list, within a part
_STEP = 2.0  # [m] between points of a way that are checked
_MOMENT = 3.0  # [s] before and after a pass in which items at its ends are reached


def served(state: RunState, truth: GroundTruth) -> dict[str, list[Reached]]:
    """Return when vehicles were at the tasks of a run.

    Args:
        state: what the nodes reported.
        truth: what was flown.

    Returns:
        By task id: of a point each visit; of work in pieces the end of the last pass, where
        vehicles flew along all its completed pieces, else none.
    """
    points = {name: state.lists.places.get(name, task.position)
              for name, task in state.tasks.items() if not task.work}
    owners = {name: status.uav for name, status in state.statuses.known().items()
              if status.state == 'COMPLETED'}
    found = visits(truth, points, state.lists.waited, owners)
    passes = piece_passes(state, truth)
    for name in state.tasks.keys() - points.keys():
        of_work = [rows for piece, rows in passes.items() if split_piece(piece)[0] == name]
        found[name] = [max((rows[0] for rows in of_work), key=lambda row: row.wall)
                       ] if of_work and all(of_work) else []
    return found


def piece_passes(state: RunState, truth: GroundTruth) -> dict[str, list[Reached]]:
    """Return the ends of all passes along each completed piece, in order of time.

    Args:
        state: with the ways of pieces.
        truth: with all tracks.

    Returns:
        By id of the piece. A pass comes within 5 m of four fifths of the way and near both ends,
        and is never further off for more than 10 s; or it is of parts without a gap that a
        vehicle flew one after the other, in any order. One that a lost vehicle did not finish is
        none. Of several, one without mission items at both ends leads elsewhere, and does not
        count.
    """
    tracks = {uav: [TrueSample(wall, point) for wall, point in resampled(track)]
              for uav, track in truth.tracks.items()}
    return {piece: _of_piece(tracks, truth, state.lists.ways[piece])
            for piece, status in state.statuses.known_pieces().items()
            if status.state == 'COMPLETED' and piece in state.lists.ways}


def _of_piece(tracks: Mapping[str, Sequence[TrueSample]], truth: GroundTruth,
              way: Sequence[Point]) -> list[Reached]:
    """The ends of passes along a way, in order of time."""
    def reaches(uav: str, end: Point, first: float, last: float) -> bool:
        return any(row.uav == uav and first - _MOMENT <= row.wall <= last + _MOMENT
                   and math.dist(row.point, end) <= _BESIDE for row in truth.reached)

    def finished(uav: str, first: float, last: float) -> bool:
        died = truth.died.get(uav)
        return died is None or died.wall > last + _MOMENT or reaches(
            uav, min(way[0], way[-1], key=lambda end: math.dist(end, died.point)), first, last)

    found = sorted(((uav, first, last) for uav, track in tracks.items()
                    for first, last in _passes(track, way) if finished(uav, first, last)),
                   key=lambda row: row[2])
    own = [(uav, first, last) for uav, first, last in found if all(
        reaches(uav, end, first, last) for end in (way[0], way[-1]))]
    return [Reached(uav, last, way[-1]) for uav, _, last in own or found]


def _passes(track: Sequence[TrueSample], way: Sequence[Point]) -> Iterator[tuple[float, float]]:
    """[unix s] at which passes along a way begin and end."""
    parts = list[TrueSample]()  # that are no pass yet
    for part in _parts(track, way):
        parts += part
        if _is_whole(part, way) or _is_whole(parts, way, _CORNER):
            # a vehicle that was lost on the way has cut no corner after it
            if part[-1].wall < track[-1].wall or min(
                    math.dist(part[-1].point, end) for end in (way[0], way[-1])) <= _BESIDE:
                yield parts[0].wall, parts[-1].wall
            parts.clear()


def _parts(track: Sequence[TrueSample], way: Sequence[Point]) -> Iterator[list[TrueSample]]:
    """Samples beside a way, together while they are not further off for more than _ASIDE.

    A vehicle that leaves a whole way begins another part.
    """
    low, high = ([pick(p[k] for p in way) + sign * _BESIDE for k in range(3)]
                 for pick, sign in ((min, -1.0), (max, 1.0)))
    part, left = list[TrueSample](), False
    for sample in track:
        inside = all(a <= v <= b for a, v, b in zip(low, sample.point, high, strict=True))
        if inside and _is_beside(sample.point, way):
            if part and sample.wall - part[-1].wall > _ASIDE:
                yield part
                part = []
            part.append(sample)
            left = False
        elif part and not left and _is_whole(part, way):
            yield part
            part = []
        else:
            left = True
    if part:
        yield part


def _is_whole(along: Sequence[TrueSample], way: Sequence[Point],
              most: float | None = None) -> bool:
    """Whether samples beside a way are a pass from one end to the other.

    most: [m] that they may miss away from the ends; None: what a pass in one part may.
    """
    length, missed = polyline_length(way), 0.0
    corner = _BESIDE + min(_CORNER, _CORNER_SHARE * length)
    if any(min(math.dist(each.point, end) for each in along) > corner
           for end in (way[0], way[-1])):
        return False
    reach = _BESIDE + (_STEP if most is None else 0.0)
    for a, b in pairwise(way):
        steps = max(1, math.ceil(math.dist(a, b) / _STEP))
        near = [each.point for each in along if segment_distance(each.point, a, b) <= _BESIDE]
        for k in range(steps):
            point = point_at(a, b, (k + 0.5) / steps)
            if most is not None and min(math.dist(point, end) for end in (
                    way[0], way[-1])) <= _BESIDE + _CORNER:
                continue
            if not any(math.dist(point, other) <= reach for other in near):
                missed += math.dist(a, b) / steps
    return missed <= (max((1.0 - _SHARE) * length, 2.0 * _CORNER) if most is None else most)


def _is_beside(point: Point, way: Sequence[Point]) -> bool:
    return any(segment_distance(point, a, b) <= _BESIDE for a, b in pairwise(way))
