# SPDX-License-Identifier: Apache-2.0
"""A MISSION_ITEM_REACHED received before the mission on board was read."""
from __future__ import annotations

import math
from dataclasses import dataclass

from uav_task_alloc.mavlink.mission.items import Item
from uav_task_alloc.model import Point


@dataclass(slots=True)
class UnreadReached:
    """A REACHED that was received before the mission was read."""

    seq: int  # index without home
    at: float  # [s] received
    frame: int  # its number
    place: Point | None  # [m] ENU of the vehicle; None: not known
    current_after: int | None = None  # the largest current item reported since
    flown_since: float = 0.0  # [m] that it may have flown from the item to `place`

    def place_later(self, place: Point, speed: float, now: float) -> None:
        """Take a position that came after the REACHED, as none had come before.

        Args:
            place: of the vehicle [m] ENU.
            speed: of the vehicle [m/s]; NaN: not known.
            now: steady time [s].
        """
        self.place = place
        self.flown_since = 0.0 if math.isnan(speed) else speed * (now - self.at)

    def may_be_of(self, held: tuple[Item, ...], repeats: bool) -> bool:
        """Whether the current item was past it then; a repetition of another mission may not.

        Args:
            held: the items on board, without home.
            repeats: REACHED is repeated (PX4), so that a current item has to show it.
        """
        after, last = self.current_after, len(held) - 1
        if after is None:
            return self.seq <= last and not repeats
        return self.seq <= last and (after > self.seq or self.seq == after == last)
