# SPDX-License-Identifier: Apache-2.0
"""MISSION_ITEM_REACHED after an upload: is it of the current epoch, or of the previous one?

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
from uav_task_alloc.mavlink.transport.frame_log import FrameLog
from uav_task_alloc.model import Point

_MIN_PERIOD = 0.7  # [s] two repetitions are further apart (PX4: 1 s); an earlier one is new
_MAX_PERIOD = 2.0  # [s] the same, where no frame is lost
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


@dataclass(frozen=True, slots=True)
class CurrentEpoch:
    """The current epoch when a REACHED is received."""

    items: tuple[Item, ...]
    current: int | None  # the current item last reported
    since: float  # vehicle time [s] from which the current item is flown
    begin: float  # vehicle time [s] at which this epoch began
    taken: float = -math.inf  # vehicle time [s] before which it was not on board


_NO_EPOCH = PreviousEpoch((), -math.inf, -math.inf, False, -math.inf)


class ReachedEpoch:
    """Assigns each REACHED to the current or the previous epoch, once the evidence allows it.

    Args:
        positions: of the vehicle.
        repeats: whether the autopilot repeats REACHED (PX4).
        frames: numbers of the frames received.
    """

    def __init__(self, positions: PositionHistory, repeats: bool,
                 frames: FrameLog | None = None) -> None:
        self._positions, self._repeats = positions, repeats
        self._frames, self._last_frame = frames or FrameLog(), 0
        self._last_newest = -math.inf  # vehicle time [s] of the newest position at the last one
        self.before = _NO_EPOCH
        self.credited: int | None = None  # seq of the last REACHED, once it has completed an item
        # seq -> [s] until when evidence is awaited, [s] at which it was received first
        self.unproven: dict[int, tuple[float, float]] = {}
        self._last: tuple[int, float] | None = None  # seq, received at [s], of any epoch
        self._series_began = -math.inf  # [s] the first of the last series was received
        self._is_first = False  # the last series of repetitions was received from its start

    def begin(self, before: PreviousEpoch) -> None:
        """Begin a new epoch; `before` is the one that it ends."""
        self.before = before
        if before.items:
            self.unproven.clear()

    def clear(self) -> None:
        """Drop the previous epoch: the mission on board is unknown."""
        self.before = _NO_EPOCH
        self.unproven.clear()

    def note_reached(self, seq: int, now: float) -> bool:
        """Note a REACHED; returns whether it repeats the last one, which was credited (PX4)."""
        if not self._repeats:
            return False
        repetition, self._series_began = self._repeats_last(seq, now), self.first_at(seq, now)
        if not repetition:  # after another one: no repetition from an earlier mission
            self.credited, self._is_first = None, self._last is not None
        elif self._series_began == now:  # too early for a repetition
            self.credited = None
        self._last, self._last_frame = (seq, now), self._frames.newest
        self._last_newest = self._positions.path.newest
        return self.credited == seq

    def _repeats_last(self, seq: int, now: float) -> bool:
        if self._last is None or self._last[0] != seq or now - self._last[1] >= MAX_MESSAGE_DELAY:
            return False
        # a series with a pause has ended, unless frames were lost
        return self._vehicle_seconds() <= _MAX_PERIOD or not self._frames.whole(
            self._last_frame, self._frames.newest)

    def _vehicle_seconds(self) -> float:
        """Since the last one, by the vehicle's clock; a simulated one may be faster than ours."""
        return self._positions.path.newest - self._last_newest

    def first_at(self, seq: int, now: float) -> float:
        """When [s] the first of the series was received that a REACHED continues, of any epoch.

        Args:
            seq: index without home.
            now: steady time [s] at which it is received.
        """
        if self._last is None or not self._repeats or 0.0 < self._vehicle_seconds() < _MIN_PERIOD:
            return now
        return self._series_began if self._repeats_last(seq, now) else now

    def note_repeated(self, seq: int, now: float) -> None:
        """Note that the last REACHED was repeated, also while its epoch was unknown."""
        if self._last is not None and self._last[0] == seq and now > self._last[1]:
            self._last, self._last_frame = (seq, now), self._frames.newest
            self._last_newest = self._positions.path.newest

    def reached_recently(self, begin: int, end: int, now: float) -> bool:
        """Whether the last REACHED named an item in [begin, end), perhaps as a repetition."""
        return self._last is not None and begin <= self._last[0] < end and (
            now - self._last[1] < MAX_MESSAGE_DELAY)

    def may_have_ended(self, now: float) -> bool:
        """Whether the previous epoch was at its last item, and has just ended."""
        return self.before.may_end and now < self.before.until - REPEAT_WINDOW + MAX_MESSAGE_DELAY

    def is_of_current(self, seq: int, epoch: CurrentEpoch, now: float, when: float) -> bool:
        """Whether a REACHED that may be of the previous epoch is of the current one.

        Args:
            seq: named by REACHED.
            epoch: the current one.
            now: steady time [s].
            when: steady time [s] at which the first of its series was received.
        """
        item, before, positions = epoch.items[seq], self.before, self._positions
        if positions.vehicle_time(when) < epoch.taken:  # a repetition, or hidden among such
            return epoch.current is not None and epoch.current >= seq and positions.was_at(
                item, max(epoch.since, epoch.taken), close=0.0)
        if not self._repeats:  # sent once, where the vehicle is
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
                item.position is None and self._is_first))

    def previous_item(self, seq: int, items: tuple[Item, ...], when: float) -> Item | None:
        """The item of the previous epoch that a REACHED names, if the vehicle was at it.

        Args:
            seq: named by REACHED.
            items: of the current epoch.
            when: steady time [s] at which the first of its series was received.

        Returns:
            None where its epoch is unknown, or is the current one.
        """
        before, positions = self.before, self._positions
        if not 0 <= seq < len(before.items) or positions.vehicle_time(when) < before.taken:
            return None
        item = before.items[seq]
        after = items[seq] if 0 <= seq < len(items) else None
        same = after is not None and (after.task, after.position) == (item.task, item.position)
        if after is not None and not same and (
                positions.distance(after) <= LOOSE_RADIUS + after.radius):
            return None  # perhaps of the current epoch
        since = max(before.since, positions.path.newest - REPEAT_WINDOW)
        if positions.was_at(item, since, before.end) or positions.near_one(
                item, None if same else after, when):
            return item
        return None

    def ends_previous(self, item: Item) -> bool:
        """Whether an item is the last position of the previous epoch, which was at its end."""
        return self.before.may_end and item.position == _last_place(self.before.items)


def _last_place(items: tuple[Item, ...]) -> Point | None:
    return next((item.position for item in reversed(items) if item.position is not None), None)
