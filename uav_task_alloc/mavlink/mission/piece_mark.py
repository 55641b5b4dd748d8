# SPDX-License-Identifier: Apache-2.0
"""What a restarted bridge has to know of a way that is partly flown."""
from __future__ import annotations

from typing import NamedTuple

LEFT, UNDER_WAY, MISSED = 0, 1, 2  # states of a piece


class PieceMark(NamedTuple):
    """A piece that is partly flown, as it is stored for a restarted bridge."""

    task: str  # id
    x: float  # [m] ENU, of the first point of its path
    y: float  # [m]
    checksum: float  # of its points, see `stop_items.place_of`
    low: float  # [m] from the first point of its path, where the rest begins
    high: float  # [m] where that ends
    reversed: bool  # it is flown from its last point
    flown: float  # [m] of that rest
    state: int = UNDER_WAY  # LEFT; UNDER_WAY: it was being flown; MISSED: it was seen off it
