# SPDX-License-Identifier: Apache-2.0
"""MISSION_ITEM_REACHED after an upload: is it of the current epoch, or of the previous one?

PX4 repeats it for 10 s, also once another mission is on board.
"""
from __future__ import annotations

import math
from dataclasses import dataclass

from pymavlink.dialects.v20 import ardupilotmega as dialect

from uav_task_alloc.mavlink.mission.items import Item
from uav_task_alloc.mavlink.mission.position_history import (
    LOOSE_RADIUS,
    MAX_MESSAGE_DELAY,
    PositionHistory,
)
from uav_task_alloc.mavlink.mission.reached_series import ReachedReport, ReachedSeries
from uav_task_alloc.model import Point

REPEAT_WINDOW = 15.0  # [s] after an upload in which a REACHED may be of the previous epoch


@dataclass(frozen=True, slots=True)
class PreviousEpoch:
    """The previous epoch, and until when a REACHED may be of it."""

    items: tuple[Item, ...]
    since: float  # vehicle time [s] from which its current item was flown
    end: float  # vehicle time [s] at which it ended
    may_end: bool  # it was at its last item
    until: float  # [s] until when a REACHED may be of it
    taken: float = -math.inf  # vehicle time [s] before which it was not on board
    returning: bool = False  # the item that returns was next, or was being flown
    reported: int | None = None  # the current item last reported


@dataclass(frozen=True, slots=True)
class CurrentEpoch:
    """The current epoch when a REACHED is received."""

    items: tuple[Item, ...]
    current: int | None  # the current item last reported
    since: float  # vehicle time [s] from which the current item is flown
    begin: float  # vehicle time [s] at which this epoch began
    taken: float = -math.inf  # vehicle time [s] before which it was not on board
    left: float = math.inf  # vehicle time [s] at which mission mode was left; inf: it is not


_NO_EPOCH = PreviousEpoch((), -math.inf, -math.inf, False, -math.inf)


class ReachedEpoch:
    """Assigns each REACHED to the current or the previous epoch, once the evidence allows it.

    Args:
        positions: of the vehicle.
        series: the REACHED received, which may be repetitions.
    """

    def __init__(self, positions: PositionHistory, series: ReachedSeries) -> None:
        self._positions, self.series = positions, series
        self.before = _NO_EPOCH
        # seq -> [s] until when evidence is awaited, and the last one
        self.unproven: dict[int, tuple[float, ReachedReport]] = {}

    def begin(self, before: PreviousEpoch) -> None:
        """Begin a new epoch; `before` is the one that it ends."""
        self.before = before
        if before.items:
            self.unproven.clear()

    def clear(self) -> None:
        """Drop the previous epoch: the mission on board is unknown."""
        self.before = _NO_EPOCH
        self.unproven.clear()

    def may_have_ended(self, now: float) -> bool:
        """Whether the previous epoch was at its last item, and has just ended."""
        return self.before.may_end and now < self.before.until - REPEAT_WINDOW + MAX_MESSAGE_DELAY

    def has_returned(self, now: float, reached: bool) -> bool:
        """Whether the previous epoch has ended a moment ago with the return of the vehicle.

        Args:
            now: steady time [s].
            reached: a REACHED shows that it came to its last item.
        """
        return self.may_have_ended(now) and (reached or self.before.returning) and (
            self.before.items[-1].command == dialect.MAV_CMD_NAV_RETURN_TO_LAUNCH)

    def is_of_current(self, reached: ReachedReport, epoch: CurrentEpoch, now: float) -> bool:
        """Whether a REACHED that may be of the previous epoch is of the current one.

        Args:
            reached: it.
            epoch: the current one.
            now: steady time [s].
        """
        seq, before, positions = reached.seq, self.before, self._positions
        item = epoch.items[seq]
        if self.series.first_sent(reached) < epoch.taken:  # a repetition, or hidden among such
            # a new one makes the next item current; the last item stays
            passed = epoch.current is not None and (
                epoch.current > seq or epoch.current == seq == len(epoch.items) - 1)
            return passed and positions.was_at(
                item, max(epoch.since, epoch.taken), epoch.left, close=0.0)
        if not self.series.repeats:  # sent once, where the vehicle is
            near = positions.can_have_reached(item, now) if not before.items else (
                positions.distance(item) <= LOOSE_RADIUS + item.radius)
            return near or positions.was_at(item, epoch.since)
        # a repetition continues while the current item stays the same
        if epoch.current is not None and epoch.current > seq:
            return positions.can_have_reached(item, now) if not before.items else (
                positions.invalid(now) or (item.position is not None
                and positions.path.visited_at(
                    item.position, item.radius + LOOSE_RADIUS, epoch.begin) is not None))
        return seq == len(epoch.items) - 1 and epoch.current == seq and (
            positions.was_at(item, epoch.since) or (
                item.position is None and self.series.is_whole(reached)))

    def previous_item(self, reached: ReachedReport, items: tuple[Item, ...]) -> Item | None:
        """The item of the previous epoch that a REACHED names, if the vehicle was at it.

        Args:
            reached: it.
            items: of the current epoch.

        Returns:
            None where its epoch is unknown, or is the current one.
        """
        before, positions, seq = self.before, self._positions, reached.seq
        when = self.series.first_at(reached)
        if not 0 <= seq < len(before.items) or self.series.first_sent(reached) < before.taken:
            return None
        item = before.items[seq]
        after = items[seq] if 0 <= seq < len(items) else None
        same = after is not None and (after.task, after.position) == (item.task, item.position)
        if after is not None and not same and (
                positions.distance(after) <= LOOSE_RADIUS + after.radius):
            return None  # perhaps of the current epoch
        since, until = max(before.since, positions.path.newest - REPEAT_WINDOW), before.end
        if before.reported is not None and before.reported < min(seq + 1, len(before.items) - 1):
            # not shown to be past it: a repetition of earlier is not of where it came since
            until = min(until, positions.vehicle_time(when))
        if positions.was_at(item, since, until) or positions.near_one(
                item, None if same else after, when, before.end):
            return item
        return None

    def ends_previous(self, item: Item) -> bool:
        """Whether an item is the last position of the previous epoch, which was at its end."""
        return self.before.may_end and item.position == _last_place(self.before.items)


def _last_place(items: tuple[Item, ...]) -> Point | None:
    return next((item.position for item in reversed(items) if item.position is not None), None)
