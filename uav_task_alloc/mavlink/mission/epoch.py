# SPDX-License-Identifier: Apache-2.0
"""One epoch of a mission: the items of a verified upload, and the item being flown."""
from __future__ import annotations

import math
from dataclasses import dataclass

from pymavlink.dialects.v20 import ardupilotmega as dialect

from uav_task_alloc.mavlink.mission.items import ENDS_AT_HOME, Item


@dataclass(slots=True)
class Epoch:
    """The mission on board; each `seq` is an index without home, each time the vehicle's [s]."""

    number: int = 0
    items: tuple[Item, ...] = ()
    current: int | None = None  # len(items): flown to the end; None: not known
    since: float = -math.inf  # from which the current item is flown
    begin: float = -math.inf  # at which this epoch began
    taken: float = -math.inf  # before which it was not on board
    taken_frame: float = math.inf  # number of the last frame before it was on board
    started: str | None = None  # task of the item being flown in mission mode

    @property
    def active(self) -> Item | None:
        """The item being flown."""
        if self.current is None or self.current >= len(self.items):
            return None
        return self.items[self.current]

    @property
    def finished(self) -> bool:
        """Whether the mission is flown to its end."""
        return bool(self.items) and self.current == len(self.items)

    @property
    def returns(self) -> bool:
        """Whether the mission ends with NAV_RETURN_TO_LAUNCH, or with NAV_LAND."""
        return bool(self.items) and self.items[-1].command in ENDS_AT_HOME

    @property
    def last_flown(self) -> int:
        """The index of the last item with a position."""
        return len(self.items) - 1 - int(self.returns)

    @property
    def returning(self) -> bool:
        """Whether the item that returns or lands is next, is being flown, or is flown."""
        return self.returns and self.current is not None and self.current > self.last_flown

    @property
    def last_reached(self) -> int:
        """The index of the item at whose REACHED PX4 leaves the mission mode for Hold."""
        lands = bool(self.items) and self.items[-1].command == dialect.MAV_CMD_NAV_LAND
        return len(self.items) - 1 if lands else self.last_flown

    @property
    def at_end(self) -> bool:
        """Whether the last item with a position is being flown, or is passed."""
        return bool(self.items) and self.current is not None and self.current >= self.last_flown

    def replace(self, items: tuple[Item, ...], current: int | None, begin: float,
                taken: float = -math.inf, taken_frame: float = math.inf) -> None:
        """Begin the next epoch.

        Args:
            items: on board, without home.
            current: index of the one being flown; None: not known.
            begin: vehicle time [s] from which it may be flown.
            taken: vehicle time [s] before which the items were not on board; -inf: not known.
            taken_frame: number of the last frame before that; inf: not known.
        """
        self.number, self.items, self.current = self.number + 1, items, current
        self.since = self.begin = begin
        self.taken, self.taken_frame = taken, taken_frame

    def correct(self, items: tuple[Item, ...], current: int) -> None:
        """Begin the next epoch, with other items at the times of this one."""
        self.number, self.items, self.current = self.number + 1, items, current
        self.since = self.begin

    def extend(self, items: tuple[Item, ...]) -> None:
        """Begin the next epoch, whose first items are those of this one, as they are flown on."""
        self.number, self.items = self.number + 1, items

    def invalidate(self) -> None:
        """Forget the items: the mission on board is unknown."""
        self.items, self.current, self.started = (), None, None
        self.since = -math.inf

    def restart_clock(self) -> None:
        """Forget its times: they are of before a restart of the vehicle."""
        self.since = self.begin = self.taken = -math.inf
