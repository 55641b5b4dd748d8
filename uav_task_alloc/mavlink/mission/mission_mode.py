# SPDX-License-Identifier: Apache-2.0
"""When the vehicle was in mission mode, by its messages; it may have left that unseen."""
from __future__ import annotations

import math

from uav_task_alloc.mavlink.mission.flown_path import GAP
from uav_task_alloc.mavlink.mission.passed_items import Claim
from uav_task_alloc.mavlink.mission.position_history import PositionHistory
from uav_task_alloc.mavlink.transport.frame_log import FrameLog

_AT_ONCE = 1.0  # [s] after mission mode was left in which a report shows what it did until then
_NEXT = 0.3  # [s] until the next position, which may still be of mission mode


class MissionMode:
    """Vehicle times at which mission mode began, was shown and ended.

    Args:
        positions: of the vehicle.
        frames: numbers of the frames received.

    Attributes:
        in_mission: mission mode, by the newest heartbeat.
        entered_at: vehicle time [s] at which it was in mission mode first.
        shown_until: vehicle time [s] until which a frame has shown mission mode.
        left_seen: vehicle time [s] at which a message has shown that it was left.
    """

    def __init__(self, positions: PositionHistory, frames: FrameLog) -> None:
        self._positions, self._frames = positions, frames
        self.in_mission = False
        self.entered_at = self.shown_until = self.left_seen = -math.inf
        self._in_mission_at = -math.inf  # vehicle time [s] at which it was in mission mode last
        self._left_at = -math.inf  # vehicle time [s] at which it left mission mode
        self._left_frame = 0  # number of the newest frame when a message has shown that
        self._flew_until: int | None = None  # number of the latest frame sent before, with an item
        # vehicle times [s] between which it left mission mode while no position came
        self._left_unseen = math.inf, -math.inf

    def forget(self) -> None:
        """Forget until when it was shown, and that it was left unseen: the mission has ended."""
        self._left_unseen = math.inf, -math.inf
        self.shown_until = -math.inf

    def note_in_mission(self, frame: int | None = None) -> None:
        """Note that the vehicle is in mission mode.

        Args:
            frame: number of the frame that shows it; None: an earlier one does.
        """
        newest = self._positions.path.newest
        if not self.in_mission:
            self.entered_at = newest
        self.in_mission, self._in_mission_at = True, newest
        if frame is not None:
            self.shown_until = max(self.shown_until, self._positions.sent_between(frame)[0])

    @property
    def left_unseen(self) -> bool:
        """Whether it has left mission mode while no position came."""
        begin, end = self._left_unseen
        return not self.in_mission and begin <= end == self._left_at

    @property
    def may_have_left(self) -> bool:
        """Whether positions are missing since it was in mission mode by the last message."""
        path = self._positions.path
        return self.in_mission and path.newest > self._in_mission_at and (
            path.has_gap(self._in_mission_at, path.newest))

    def note_other_mode(self, now: float) -> None:
        """Note that the vehicle is not in mission mode, by whichever command."""
        if not self.in_mission:
            return
        path, left_at = self._positions.path, self._positions.vehicle_time(now)
        blind = left_at - path.newest > GAP
        self.in_mission, self._left_at = False, left_at if blind else path.newest
        self._left_frame, self.left_seen = self._frames.newest, max(left_at, path.newest)
        if blind or path.has_gap(self._in_mission_at, self._left_at):
            self._left_unseen = self._in_mission_at, self._left_at

    def note_flew(self, frame: int) -> None:
        """Note a report sent in mission mode, which the vehicle has left since.

        Args:
            frame: its number.
        """
        self._flew_until = frame

    @property
    def left_at(self) -> float:
        """Vehicle time [s] at which it left mission mode; inf while it is in it, or unknown."""
        return math.inf if self.in_mission or math.isinf(self._left_at) else self._left_at

    def left_unseen_since(self, claim: Claim) -> bool:
        """Whether it may have left mission mode unseen since it passed the items of a claim."""
        begin, end = self._left_unseen
        return claim.since < end and begin <= claim.until

    def flown_until(self, frame: int | None, reported: float) -> float:
        """Vehicle time [s] until which it may have flown what a report shows, in another mode.

        Args:
            frame: number of the report; None: not known.
            reported: vehicle time [s] of the report.
        """
        left_at = self._left_at
        if frame is not None and frame == self._flew_until:
            return max(left_at, self._positions.sent_between(frame)[1])
        if frame is not None and frame > self._left_frame and reported - left_at <= _AT_ONCE:
            # it passed the item before it left: the next position may be of that moment
            return max(left_at, min(
                self._positions.sent_between(self._left_frame)[1], left_at + _NEXT))
        return left_at
