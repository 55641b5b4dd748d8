# SPDX-License-Identifier: Apache-2.0
"""The positions of one vehicle against the items of its mission: where it was, and when."""
from __future__ import annotations

import math
from bisect import bisect_right
from collections import deque

from uav_task_alloc.mavlink.mission.flown_path import (
    CLOSE,
    GAP,
    FlownPath,
    PositionSample,
    Visit,
)
from uav_task_alloc.mavlink.mission.items import Item
from uav_task_alloc.model import Point

REACH = 60.0  # [m] beyond its radius from which an item can be reached between two positions
_FRESH = 3.0  # [s] for which a position is the present one
_JUMP_RECOVERY = 60.0  # [s] of the vehicle, after a jump of its estimate; a second one ends it
_SETTLING = 10.0  # [s] after a jump on the ground, in which it may jump once more in flight
_AT_ONCE = 2.0  # [s] in which a vehicle does not fly two legs
_FRAME_TIME = 0.2  # [s] accuracy of a frame's time from its place among other frames
_CLOCKS = 600  # changes of the clock: 6 s of a clock 20 times as fast as ours
_STAMPS = 150  # positions: half a minute at 5 Hz
MAX_MESSAGE_DELAY = 6.0  # [s] in which messages sent before an event may still arrive
LOOSE_RADIUS = 10.0  # [m] at which an autopilot may count an item as reached and turn


class PositionHistory:
    """The path flown, the newest position, and the offset of the vehicle's clock to ours."""

    def __init__(self) -> None:
        self.path = FlownPath()
        self.place: tuple[Point, float] | None = None  # newest, received at [s]
        # vehicle time [s] of the newest jump of the estimate, and until which it is in doubt
        self._doubt = -math.inf, -math.inf
        self._settling_until = -math.inf  # vehicle time [s]: it has jumped on the ground
        self._stamps: deque[tuple[int, float]] = deque(maxlen=_STAMPS)  # frame, vehicle time
        self._in_order = 0  # how many of the last of them rise in both
        self._recorded_at: float | None = None  # vehicle time [s] of one of the previous run
        # item and since [s] of the last `was_inside`, the newest position then, how many had come
        # late when it was searched, and its result
        self._inside: tuple[tuple[Item, float] | None, float, int, bool] = (
            None, -math.inf, 0, False)
        # since when [s], vehicle time less ours [s], by the fastest message until then
        self._clocks: list[tuple[float, float]] = []

    def add(
        self, sample: PositionSample, newest: bool, now: float, frame: int | None = None
    ) -> bool:
        """Add a position.

        Args:
            sample: position, velocity and vehicle time.
            newest: whether it did not arrive late.
            now: steady time [s].
            frame: number of its frame; None: not known.

        Returns:
            Whether the vehicle was restarted while no bridge ran: the path begins here.
        """
        begins = self._recorded_at is not None and not self.continues_recorded and (
            sample.t < self._recorded_at - MAX_MESSAGE_DELAY)
        if begins:
            self.clear()
        if not self._clocks and sample.t < self._doubt[0]:  # restarted
            self._doubt, self._settling_until = (-math.inf, -math.inf), -math.inf
        if not self._clocks or sample.t - now > self._clocks[-1][1]:
            self._clocks.append((now, sample.t - now))
            del self._clocks[:-_CLOCKS]
        if frame is not None:
            last, at = self._stamps[-1] if self._stamps else (frame, math.inf)
            self._in_order = self._in_order + 1 if frame > last and sample.t >= at else 1
            self._stamps.append((frame, sample.t))
        if newest:
            if self.path.jumps(sample):
                returns = sample.t < max(self._doubt[1], self._settling_until)
                self._doubt = sample.t, sample.t + (_FRESH if returns else _JUMP_RECOVERY)
            self.place = sample.position, now
        self.path.add(sample)
        return begins

    def add_recorded(self, sample: PositionSample) -> None:
        """Add the last position that the previous run of the bridge has received.

        Args:
            sample: position, velocity and vehicle time.
        """
        self.path.add(sample)
        self._recorded_at = sample.t

    @property
    def continues_recorded(self) -> bool:
        """Whether the path begins with a position of the previous run of the bridge."""
        return self._recorded_at is not None and self.path.newest > self._recorded_at

    def clear(self) -> None:
        """Drop the path: the vehicle's clock has restarted."""
        self.path.clear()
        self._recorded_at = None
        self._inside = None, -math.inf, 0, False
        self._clocks.clear()
        self._stamps.clear()

    def vehicle_time(self, now: float) -> float:
        """Return the time of the vehicle's clock; a simulated one may be faster than ours.

        Args:
            now: steady time [s].

        Returns:
            Vehicle time [s].
        """
        if not self._clocks:
            return -math.inf
        at = bisect_right(self._clocks, now, key=lambda one: one[0])
        return now + self._clocks[max(0, at - 1)][1]

    def recent(self, since: float, now: float) -> float:
        """Vehicle time [s], `since` or later, from which positions may be newer than a message.

        Args:
            since: vehicle time [s].
            now: steady time [s] at which the message was received.
        """
        return max(since, min(self.path.newest, self.vehicle_time(now)) - MAX_MESSAGE_DELAY)

    def was_at(self, item: Item, since: float, until: float = math.inf,
               close: float = CLOSE) -> bool:
        """Whether the positions show that the vehicle has reached an item.

        Args:
            item: with a position, else it was not reached.
            since: vehicle time [s].
            until: vehicle time [s].
            close: [m] tolerance beyond the acceptance radius.
        """
        return item.position is not None and self.path.was_at(
            item.position, item.radius, item.params[0], since, until, close)

    def was_inside(self, item: Item, since: float) -> bool:
        """Whether it was within the radius of an item, for however short a time.

        Called for the same item again, only the positions since then are searched.
        """
        known, until, late, inside = self._inside
        if known is not None and known[0] is item and known[1] == since and (
                until == self.path.newest):
            return inside  # as at the messages since the newest position
        if known != (item, since):
            until, late, inside = since, self.path.late, False
        if not inside and self.path.newest > until and item.position is not None:
            back = MAX_MESSAGE_DELAY if self.path.late > late else 0.0
            inside, late = self.path.was_at(
                item.position, item.radius, 0.0, max(since, until - back),
                close=0.0), self.path.late
        self._inside = (item, since), self.path.newest, late, inside
        return inside

    def not_seen_at(self, item: Item, since: float) -> bool:
        """Whether it was not seen at an item, but not seen elsewhere all the time either."""
        return item.position is not None and self.path.visited(
            item.position, item.radius, item.params[0], since) is Visit.UNOBSERVED

    def near_one(self, item: Item, other: Item | None, when: float,
                 end: float = math.inf) -> bool:
        """Whether it was near one item, but not another, just before a message at `when` [s].

        PX4 may count an item as reached up to 10 m from it (LOOSE_RADIUS).

        Args:
            item: reached, perhaps.
            other: reached otherwise; None: none.
            when: steady time [s] of the message.
            end: vehicle time [s] from which `item` was not flown any more.
        """
        until = self.vehicle_time(when)
        return self._came_near(item, min(until, end)) and not (
            other is not None and self._came_near(other, until))

    def _came_near(self, item: Item, until: float) -> bool:
        return item.position is not None and self.path.visited_at(
            item.position, item.radius + LOOSE_RADIUS,
            until - MAX_MESSAGE_DELAY, until) is not None

    def invalid(self, now: float) -> bool:
        """Whether the estimate has jumped, so that the positions prove nothing."""
        return self.vehicle_time(now) < self._doubt[1]

    def end_doubt(self) -> None:
        """Note that a vehicle on the ground has jumped: its estimate settles, nothing is flown."""
        if self._doubt[1] > -math.inf:
            self._settling_until = self._doubt[0] + _SETTLING
            self._doubt = self._doubt[0], -math.inf

    def can_have_reached(self, item: Item, now: float, reach: float = REACH) -> bool:
        """Whether the newest position allows that an item was reached, or is not usable.

        Args:
            item: of a mission.
            now: steady time [s].
            reach: [m] beyond its radius.
        """
        if self.place is None or now - self.place[1] > _FRESH or self.invalid(now):
            return True
        distance = self.distance(item)
        return math.isinf(distance) or distance <= item.radius + reach

    def distance(self, item: Item) -> float:
        """Return the distance from an item to the newest position.

        Args:
            item: of the mission.

        Returns:
            Metres; inf where either position is unknown.
        """
        if item.position is None or self.place is None:
            return math.inf
        return math.dist(item.position, self.place[0])

    def at_once(self, first: int | None, second: int | None) -> bool:
        """Whether two frames were sent within _AT_ONCE, by their order among the positions.

        Args:
            first: number of the one; None: not known.
            second: number of the other; None: not known.
        """
        if second is None or first is None:
            return False
        if not any(f <= first for f, _ in self._stamps):
            return False
        return self._sent_at(second) - self._sent_at(first) < _AT_ONCE

    def _sent_at(self, frame: int) -> float:
        """Vehicle time [s] at which a frame was sent.

        It is that of the position before it; where frames are missing since, at their mean rate.
        """
        before, at = max(stamp for stamp in self._stamps if stamp[0] <= frame)
        (first, begin), (last, end) = min(self._stamps), max(self._stamps)
        rate = (end - begin) / (last - first) if last > first else 0.0
        missing = (frame - before) * rate
        return at + (missing if missing > GAP else 0.0)

    def sent_between(self, frame: int) -> tuple[float, float]:
        """Vehicle times [s] between which a frame was sent, by its order among the positions."""
        if self._in_order >= len(self._stamps) > 0 and frame > self._stamps[-1][0]:
            return self._stamps[-1][1], math.inf  # as of most frames that were just received
        before, after = -math.inf, math.inf
        for number, t in self._stamps:
            if number < frame:
                if t > before:
                    before = t
            elif number > frame and t < after:
                after = t
        return (before, after) if before <= after else (-math.inf, math.inf)

    def sent_before(self, frame: int, otherwise: float, earliest: bool) -> float:
        """Latest time at which a frame was sent, by its order among the positions.

        Args:
            frame: its number.
            otherwise: vehicle time [s] to return where no position came after it.
            earliest: return the time of the position before it, unless a gap follows that.

        Returns:
            Vehicle time [s].
        """
        after = min(((f, t) for f, t in self._stamps if f > frame), default=None)
        before = max(((f, t) for f, t in self._stamps if f < frame), default=None)
        if after is None or (before is not None and after[1] < before[1]):  # of a restart
            return otherwise
        if before is None:
            return after[1]
        gap = after[1] - before[1]
        if earliest and gap <= GAP:
            return before[1]
        share = (frame - before[0]) / (after[0] - before[0])
        return min(after[1], before[1] + gap * share + _FRAME_TIME)
