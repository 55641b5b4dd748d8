# SPDX-License-Identifier: Apache-2.0
"""MISSION_ITEM_REACHED just after an upload: is it of this epoch, or of the one before?

PX4 repeats it for 10 s, also once another mission is on board.
"""
from __future__ import annotations

import math
from dataclasses import dataclass

from uav_task_alloc.mavlink.mission.items import Item
from uav_task_alloc.mavlink.mission.position_history import (
    LOOSE_RADIUS,
    MAX_MESSAGE_DELAY,
    PositionHistory,
)
from uav_task_alloc.model import Point

REPEAT_WINDOW = 15.0  # [s] in which a REACHED of the epoch before may come; PX4 repeats it for 10 s


@dataclass(frozen=True, slots=True)
class PreviousEpoch:
    """The epoch before: until when a REACHED may be of it."""

    items: tuple[Item, ...]
    since: float  # [s] of the vehicle's clock: its current item was flown
    end: float  # the same: until then
    may_end: bool  # at its last item
    until: float  # [s]


@dataclass(frozen=True, slots=True)
class CurrentEpoch:
    """This epoch, where a REACHED comes."""

    items: tuple[Item, ...]
    current: int | None  # the current item, as the vehicle said last
    since: float  # [s] of the vehicle's clock: the current item is flown
    begin: float  # the same: this epoch


_NO_EPOCH = PreviousEpoch((), -math.inf, -math.inf, False, -math.inf)


class ReachedEpoch:
    """The epoch before, and the REACHED that may be of either until something shows which."""

    def __init__(self, positions: PositionHistory, repeats: bool) -> None:
        self._positions, self._repeats = positions, repeats  # many times (PX4)
        self.before = _NO_EPOCH
        self.credited: int | None = None  # the seq of the last, once it has completed an item
        self.unproven: dict[int, float] = {}  # of this epoch or the one before; until [s]
        self._last: tuple[int, float] | None = None  # seq, when [s], of any epoch
        self._heard_first = False

    def begin(self, before: PreviousEpoch) -> None:
        """Another mission is on board."""
        self.before = before
        if before.items:
            self.unproven.clear()

    def clear(self) -> None:
        """Nothing is known of what is on board."""
        self.before = _NO_EPOCH
        self.unproven.clear()

    def note_reached(self, seq: int, now: float) -> bool:
        """One has come; returns whether it repeats the last one, which was credited (PX4)."""
        if not self._repeats:
            return False
        goes_on = self._last is not None and self._last[0] == seq and now - self._last[1] < MAX_MESSAGE_DELAY
        if not goes_on:  # heard to begin, after another one: no repetition of a mission before
            self.credited, self._heard_first = None, self._last is not None
        self._last = seq, now
        return self.credited == seq

    def note_repeated(self, seq: int, now: float) -> None:
        """The last REACHED has come again, also while nobody knew of which mission it was."""
        if self._last is not None and self._last[0] == seq:
            self._last = seq, now

    def reached_recently(self, begin: int, end: int, now: float) -> bool:
        """One of the items from `begin` up to `end` was told, of this mission or repeated."""
        return self._last is not None and begin <= self._last[0] < end and (
            now - self._last[1] < MAX_MESSAGE_DELAY)

    def may_have_ended(self, now: float) -> bool:
        """The epoch before was at its last item, and has just gone."""
        return self.before.may_end and now < self.before.until - REPEAT_WINDOW + MAX_MESSAGE_DELAY

    def is_of_current(self, seq: int, epoch: CurrentEpoch, now: float) -> bool:
        """Whether a REACHED that may be of the epoch before is of this one."""
        item, before, positions = epoch.items[seq], self.before, self._positions
        if not self._repeats:  # told once, where the vehicle is
            near = positions.can_have_reached(item, now) if not before.items else (
                positions.distance(item) <= LOOSE_RADIUS + item.radius)
            return near or positions.was_at(item, epoch.since)
        # a repetition goes on while the current item stays what it was
        if epoch.current is not None and epoch.current > seq:
            return positions.can_have_reached(item, now) if not before.items else (
                item.position is not None and positions.path.visited_at(
                    item.position, item.radius + LOOSE_RADIUS, epoch.begin) is not None)
        return seq == len(epoch.items) - 1 and epoch.current == seq and (
            positions.was_at(item, epoch.since) or (
                item.position is None and self._heard_first))

    def previous_item(self, seq: int, items: tuple[Item, ...], when: float) -> Item | None:
        """The item of the epoch before that a REACHED names, where the vehicle was at it.

        Args:
            seq: named by REACHED.
            items: of this epoch.
            when: [s] it came.

        Returns:
            None: not known yet, or of this epoch.
        """
        before, positions = self.before, self._positions
        if not 0 <= seq < len(before.items):
            return None
        item = before.items[seq]
        after = items[seq] if 0 <= seq < len(items) else None
        same = after is not None and (after.task, after.position) == (item.task, item.position)
        if after is not None and not same and positions.distance(after) <= LOOSE_RADIUS + after.radius:
            return None  # of this epoch, if what comes shows it
        since = max(before.since, positions.path.newest - REPEAT_WINDOW)
        if positions.was_at(item, since, before.end) or positions.near_one(
                item, None if same else after, when):
            return item
        return None

    def ends_previous(self, item: Item) -> bool:
        """An item is the last place of the epoch before, which had come to it."""
        return self.before.may_end and item.position == _last_place(self.before.items)


def _last_place(items: tuple[Item, ...]) -> Point | None:
    return next((item.position for item in reversed(items) if item.position is not None), None)
