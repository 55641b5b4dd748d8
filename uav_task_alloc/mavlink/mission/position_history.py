# SPDX-License-Identifier: Apache-2.0
"""The positions of one vehicle against the items of its mission: where it was, and when."""
from __future__ import annotations

import math
from collections import deque

from uav_task_alloc.mavlink.mission.flown_path import GAP, FlownPath, PositionSample, Visit
from uav_task_alloc.mavlink.mission.items import Item
from uav_task_alloc.model import Point

_REACH = 60.0  # [m] beyond its radius from which an item can be reached between two positions
FRESH = 3.0  # [s] a position tells where the vehicle is
_JUMP_RECOVERY = 60.0  # [s] after a jump of its position in which another brings it back
AT_ONCE = 2.0  # [s] in which a vehicle does not fly two legs
FRAME_TIME = 0.2  # [s] by which the time of a frame among others is known
STAMPS = 150  # positions: half a minute at 5 Hz
MAX_MESSAGE_DELAY = 6.0  # [s] in which REACHED and positions that were sent before may still come
LOOSE_RADIUS = 10.0  # [m] from which an autopilot may count an item as reached, and turn to the next


class PositionHistory:
    """The path flown, the newest place, and the vehicle's clock against ours."""

    def __init__(self) -> None:
        self.path = FlownPath()
        self.place: tuple[Point, float] | None = None  # the newest, when [s]
        self._adrift_until = -math.inf  # [s] its position has jumped, and says nothing
        self._stamps: deque[tuple[int, float]] = deque(maxlen=STAMPS)  # positions: frame, when
        self._clock = -math.inf  # [s] of the vehicle less ours, by the fastest message

    def add(
        self, sample: PositionSample, newest: bool, now: float, frame: int | None = None
    ) -> None:
        """A position of the vehicle, the newest or one that comes late."""
        self._clock = max(self._clock, sample.t - now)
        if frame is not None:
            self._stamps.append((frame, sample.t))
        if newest:
            if self.path.jumps(sample):
                back = now < self._adrift_until
                self._adrift_until = now + (FRESH if back else _JUMP_RECOVERY)
            self.place = sample.position, now
        self.path.add(sample)

    def clear(self) -> None:
        """The vehicle's clock has begun again."""
        self.path.clear()
        self._clock = -math.inf
        self._stamps.clear()

    def vehicle_time(self, now: float) -> float:
        """[s] of the vehicle's clock at a time [s] of ours."""
        return now + self._clock

    def recent(self, since: float) -> float:
        """[s] of the vehicle's clock: positions since then may be newer than the last message."""
        return max(since, self.path.newest - MAX_MESSAGE_DELAY)

    def was_at(self, item: Item, since: float, until: float = math.inf) -> bool:
        """Whether the vehicle's own positions show that it has reached an item."""
        return item.position is not None and self.path.visited(
            item.position, item.radius, item.params[0], since, until) is Visit.YES

    def not_seen_at(self, item: Item, since: float) -> bool:
        """It was not seen at an item, nor all the time elsewhere."""
        return item.position is not None and self.path.visited(
            item.position, item.radius, item.params[0], since) is Visit.UNOBSERVED

    def near_one(self, item: Item, other: Item | None, when: float) -> bool:
        """It was near one item, and not near another, just before a message came at `when` [s].

        PX4 may count an item as reached up to 10 m from it.
        """
        return self._came_near(item, when) and not (
            other is not None and self._came_near(other, when))

    def _came_near(self, item: Item, when: float) -> bool:
        until = self.vehicle_time(when)
        return item.position is not None and self.path.visited_at(
            item.position, item.radius + LOOSE_RADIUS, until - MAX_MESSAGE_DELAY, until) is not None

    def can_have_reached(self, item: Item, now: float) -> bool:
        """Its newest position does not speak against an item, or says nothing."""
        if self.place is None or now - self.place[1] > FRESH or now < self._adrift_until:
            return True
        distance = self.distance(item)
        return math.isinf(distance) or distance <= item.radius + _REACH

    def distance(self, item: Item) -> float:
        """[m] from the newest position; inf where either is not known."""
        if item.position is None or self.place is None:
            return math.inf
        return math.dist(item.position, self.place[0])

    def at_once(self, first: int | None, second: int | None) -> bool:
        """Two frames came within a moment, by their order among the positions."""
        if second is None or first is None:
            return False
        before = [t for f, t in self._stamps if f <= first]
        return bool(before) and max(
            t for f, t in self._stamps if f <= second) - max(before) < AT_ONCE

    def sent_before(self, frame: int, otherwise: float, earliest: bool) -> float:
        """Time by which a frame was sent, by its order among the positions.

        Args:
            frame: its number.
            otherwise: [s] of the vehicle's clock where no position came after it.
            earliest: the time of the position before it, where no gap is between.

        Returns:
            [s] of the vehicle's clock.
        """
        after = min(((f, t) for f, t in self._stamps if f > frame), default=None)
        before = max(((f, t) for f, t in self._stamps if f < frame), default=None)
        if after is None or before is None:
            return otherwise if after is None else after[1]
        gap = after[1] - before[1]
        if earliest and gap <= GAP:
            return before[1]
        share = (frame - before[0]) / (after[0] - before[0])
        return min(after[1], before[1] + gap * share + FRAME_TIME)
