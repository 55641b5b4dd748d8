# SPDX-License-Identifier: Apache-2.0
"""What a restarted bridge has to know of a way that is partly flown."""
from __future__ import annotations

from typing import NamedTuple

PART_FLOWN, PART_UNDER_WAY, PART_MISSED = 0, 1, 2  # states of a piece that is partly flown


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
    state: int = PART_UNDER_WAY  # whether it was being flown, or seen off it
