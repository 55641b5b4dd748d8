# SPDX-License-Identifier: Apache-2.0
"""Areas whose strips lie elsewhere than those that are flown, as after an UPDATE."""
from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

from uav_task_alloc.geometry.polyline import polyline_length
from uav_task_alloc.model import Task
from uav_task_alloc.work.area import FlownStrips
from uav_task_alloc.work.pieces import Work
from uav_task_alloc.work.recut import FlownWays
from uav_task_alloc.work.values import Kind, Vertical

_SAVED = 0.05  # share of what is left to fly, at least


def pieces_around_flown(work: Work, pieces: Sequence[Task], flown: FlownStrips,
                        cut: Callable[[FlownStrips], Sequence[Task]]) -> Sequence[Task]:
    """Return the pieces of a new cut, or what flown ways have not covered where that is shorter.

    Where strips are as they were, the flown ways are along them, and their pieces stay. Those that
    are narrower than the strips count for what they have covered only.

    Args:
        work: with its latest values.
        pieces: of all of it.
        flown: its completed pieces.
        cut: cuts what flown strips have left.

    Returns:
        Pieces with their shares of value and service time.

    Raises:
        InvalidValue, TerrainError: as `cut`.
    """
    if work.kind is not Kind.AREA or work.vertical is Vertical.TERRAIN or not flown.ways:
        return pieces
    wide = [way for way, width in flown.ways if width >= work.strip_width]
    along = FlownWays(wide)
    left = math.fsum(polyline_length(part) for piece in pieces
                     for part in along.unflown_parts(piece.path))
    if len(wide) == len(flown.ways) and along.length_left() < work.strip_width:
        return pieces
    around = cut(flown)
    rest = math.fsum(piece.path_length for piece in around)
    if left - rest < max(work.strip_width, _SAVED * left):
        return pieces
    share = rest / math.fsum(piece.path_length for piece in pieces)
    return [replace(piece, value=piece.value * share, service_time=piece.service_time * share)
            for piece in around]
