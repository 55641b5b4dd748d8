# SPDX-License-Identifier: Apache-2.0
"""The strips and other pieces of a flight: UAV of the plan, UAV that flew, and coverage."""
from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from uav_task_alloc.flight_report.flight_history import FlightHistory
from uav_task_alloc.geometry.polyline import polyline_length
from uav_task_alloc.model import Point
from uav_task_alloc.piece_ids import split_piece

_BESIDE = 5.0  # [m] from a way, within which a vehicle flies along it
_STEP = 2.0  # [m] between the places of a way that are looked at
_CELLS = 160  # of the raster of an area, along its longer side at most
_Floats = NDArray[np.float64]
_Segment = tuple[_Floats, _Floats]


@dataclass(frozen=True, slots=True)
class FlownPiece:
    """What became of a piece of a line, area or orbit."""

    piece: str  # id
    state: str  # name of a TaskStatus constant, or CUT AGAIN
    planned: tuple[str, ...]  # UAVs in whose lists it was, in order
    flown_by: str  # UAV that completed it; '': none
    metres: float  # of its way
    share: float | None  # of its way along which a UAV flew; None: its way is not known
    interrupted: str  # the UAV that left it before its end, and when; ''
    way: tuple[Point, ...] = ()  # [m] ENU


def piece_rows(history: FlightHistory) -> list[FlownPiece]:
    """Return what became of each piece.

    Args:
        history: of a whole flight.

    Returns:
        In the order of tasks and numbers.
    """
    pieces = history.run.statuses.known_pieces()
    names = {name for name in (*history.listed, *pieces) if split_piece(name)[1]}
    tracks = _segments(history)
    rows = []
    for name in sorted(names, key=split_piece):
        status, way = pieces.get(name), history.run.lists.ways.get(name, ())
        state = status.state if status else 'CUT AGAIN'
        share = float(np.mean(_flown(way, tracks)[1])) if len(way) > 1 else None
        rows.append(FlownPiece(
            name, state, tuple(history.listed.get(name, ())),
            status.uav if status and state == 'COMPLETED' else '',
            polyline_length(way) if len(way) > 1 else 0.0, share, _interrupted(history, name),
            tuple(map(_point, way))))
    return rows


def _point(given: Sequence[float]) -> Point:
    x, y, z = given
    return x, y, z


def _interrupted(history: FlightHistory, piece: str) -> str:
    """The UAV that left a piece before its end, and when [s]."""
    spans = history.spans.get(piece, [])
    found = []
    for span, after in zip(spans, (*spans[1:], None), strict=True):
        if span.state == 'ACTIVE' and (after is None or after.state != 'COMPLETED'):
            when = history.clock(after.since if after else history.run.last)
            found.append(f'{span.uav} at {when:.0f} s')
    return ', '.join(found)


def _segments(history: FlightHistory) -> _Segment:
    """Begins and ends (n, 3) [m] of the parts of all tracks."""
    tracks = [np.array([sample.point for sample in track])
              for track in history.tracks.values() if len(track) > 1]
    if not tracks:
        return np.zeros((0, 3)), np.zeros((0, 3))
    return (np.concatenate([track[:-1] for track in tracks]),
            np.concatenate([track[1:] for track in tracks]))


def _flown(way: Sequence[Sequence[float]], tracks: _Segment) -> tuple[_Floats, NDArray[np.bool_]]:
    """Places (n, 3) along a way, at most 2 m apart, and which of them a track leads beside."""
    places = np.concatenate([np.linspace(a, b, max(2, math.ceil(math.dist(a, b) / _STEP) + 1))
                             for a, b in pairwise(way)])
    low, high = places.min(axis=0) - _BESIDE, places.max(axis=0) + _BESIDE
    a, b = tracks
    near = ((np.maximum(a, b) >= low) & (np.minimum(a, b) <= high)).all(axis=1)
    beside = np.zeros(len(places), bool)
    for p, q in zip(a[near], b[near], strict=True):
        beside |= _distances(places, p, q) <= _BESIDE
    return places, beside


def _distances(places: _Floats, a: _Floats, b: _Floats) -> _Floats:
    """From places (n, k) to a segment."""
    along = b - a
    share = np.clip((places - a) @ along / max(float(along @ along), 1e-12), 0.0, 1.0)
    found: _Floats = np.linalg.norm(places - a - share[:, None] * along, axis=1)
    return found


def covered_shares(history: FlightHistory, rows: Sequence[FlownPiece]) -> dict[str, float]:
    """Return which share of each area was inside a flown footprint.

    A footprint is as wide as the strips of the area, across the way of a piece, along the part of
    it that was flown. It is judged on a raster of the area without its holes.

    Args:
        history: of a whole flight.
        rows: as `piece_rows` returns them.

    Returns:
        [0..1] by task id; nothing for an area whose width of strips the record does not have.
    """
    tracks, found = _segments(history), {}
    for name, task in history.run.tasks.items():
        width = history.strip_widths.get(name, 0.0)
        if task.work != 'AREA' or width <= 0.0 or len(task.path) < 3:
            continue
        cells = _raster(task.path, task.holes)
        inside = np.zeros(len(cells), bool)
        for row in rows:
            if split_piece(row.piece)[0] == name and len(row.way) > 1:
                for a, b in _flown_parts(row.way, tracks):
                    inside |= _footprint(cells, a, b, width)
        found[name] = float(inside.mean()) if len(cells) else 1.0
    return found


def _flown_parts(way: Sequence[Point], tracks: _Segment) -> list[_Segment]:
    """The parts of a way that were flown, as segments."""
    parts = []
    for a, b in pairwise(way):
        places, beside = _flown((a, b), tracks)
        first = None
        for k, flown in enumerate((*beside, False)):
            if flown and first is None:
                first = k
            elif not flown and first is not None:
                parts.append((places[first], places[k - 1]))
                first = None
    return parts


def _footprint(cells: _Floats, a: _Floats, b: _Floats, width: float) -> NDArray[np.bool_]:
    """Which cells (n, 2) are beside a segment, at most half of a width from it."""
    along = (b - a)[:2]
    length = float(np.linalg.norm(along))
    if length < 1e-6:
        return np.zeros(len(cells), bool)
    ahead, off = along / length, cells - a[:2]
    forward, across = off @ ahead, off @ np.array([-ahead[1], ahead[0]])
    inside: NDArray[np.bool_] = ((forward >= -_STEP) & (forward <= length + _STEP)
                                 & (np.abs(across) <= 0.5 * width + 1e-6))
    return inside


def _raster(path: Sequence[Sequence[float]],
            holes: Sequence[Sequence[Sequence[float]]]) -> _Floats:
    """The middles (n, 2) of the cells of an area without its holes."""
    outline = np.array(path)[:, :2]
    low, high = outline.min(axis=0), outline.max(axis=0)
    step = max(float((high - low).max()) / _CELLS, 1e-3)
    x, y = (np.arange(low[k] + step / 2, high[k], step) for k in (0, 1))
    cells = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    inside = _within(cells, outline)
    for hole in holes:
        inside &= ~_within(cells, np.array(hole)[:, :2])
    found: _Floats = cells[inside]
    return found


def _within(cells: _Floats, ring: _Floats) -> NDArray[np.bool_]:
    """Which cells are inside a ring, by crossings of its edges."""
    inside = np.zeros(len(cells), bool)
    for (ax, ay), (bx, by) in zip(ring, np.roll(ring, -1, axis=0), strict=True):
        if ay == by:
            continue
        crosses = (cells[:, 1] < ay) != (cells[:, 1] < by)
        inside ^= crosses & (cells[:, 0] < ax + (cells[:, 1] - ay) / (by - ay) * (bx - ax))
    return inside
