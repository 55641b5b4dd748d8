# SPDX-License-Identifier: Apache-2.0
"""Separates MISSION_CURRENT sent before our set-current command from those sent after it."""
from __future__ import annotations

import math

from uav_task_alloc.mavlink.mission.position_history import MAX_MESSAGE_DELAY

SETTLE_TIME = 3.0  # [s] in which a MISSION_CURRENT sent before a change may still arrive
_ID_LEADS = 0.5  # [s] by which PX4 may report the id of a mission before its current item


class CurrentItemReports:
    """The last reported current item, the frames that reported it, and what we have set.

    All `seq` are indices without home.
    """

    def __init__(self) -> None:
        self.reported: int | None = None  # the current item last reported by the vehicle
        self.went_back = False  # the current item was a later one of this epoch before
        self.last_frame: int | None = None  # number of the last MISSION_CURRENT
        self.previous_frame: int | None = None  # number of the one before
        self._earlier: tuple[int, float] | None = None  # an item before ours, reported since [s]
        self._set: tuple[int, float] | None = None  # by us at a time [s], not confirmed yet
        self._set_frame = math.inf  # frames after this number were sent after that
        self._setting: int | None = None  # set-current sent, not acknowledged yet

    @property
    def awaits_set(self) -> bool:
        """Whether our set-current is not confirmed by a MISSION_CURRENT yet."""
        return self._set is not None

    def begin(self, start: int | None, now: float) -> None:
        """Start a new epoch at an item that the vehicle will report; None: not known."""
        self._set, self._set_frame = None if start is None else (start, now), math.inf
        self._setting = self.reported = None
        self.went_back = False

    def note_read(self, current: int | None) -> None:
        """Note that the mission of this epoch was found on board.

        Args:
            current: the item reported for it; None: not known, or it is flown to the end.
        """
        self.reported, self.last_frame = current, None

    def clear(self) -> None:
        """Reset: the mission on board is unknown."""
        self._set = self.last_frame = self.reported = None
        self.went_back = False

    def begin_set(self, seq: int) -> None:
        """Note that a set-current command is about to be sent."""
        self._setting = seq

    def note_set(self, seq: int, now: float, frame: int) -> None:
        """Note that the set-current command was executed.

        Args:
            seq: index without home.
            now: [s].
            frame: number of the newest frame, which shows it or came later.
        """
        self._set, self._setting, self.went_back = (seq, now), None, False
        self._set_frame = frame

    def note_id(self, frame: int, now: float) -> None:
        """Note a report with PX4's id of the mission that it has taken: later ones are of it.

        Args:
            frame: its number.
            now: [s].
        """
        if self._set is not None and now - self._set[1] >= _ID_LEADS:
            self._set_frame = min(self._set_frame, frame - 1)

    def is_old(self, seq: int, now: float, frame: int | None) -> bool:
        """Whether a report is older than our set-current, or reports the item being set.

        A newer report ends the wait for the confirmation.

        Args:
            seq: the reported current item.
            now: [s].
            frame: number of its frame; None: not known.
        """
        if seq == self._setting:
            return True
        if self._set is not None:
            start, when = self._set
            later = frame is not None and frame > self._set_frame
            if seq != start and (seq < start or (now - when < SETTLE_TIME and not later)):
                return True
            self._set = None
        return False

    def note(self, seq: int, frame: int | None) -> None:
        """Store a report as the last one."""
        if self.reported is not None and seq != self.reported:
            self.went_back = seq < self.reported
        self.reported, self.last_frame = seq, frame

    def was_set_back(self, seq: int, now: float, before: int | None) -> bool:
        """Whether another station has set the current item back, MAX_MESSAGE_DELAY ago.

        Args:
            seq: the reported current item.
            now: [s].
            before: the item known as current; None: a lower `seq` has no meaning now.

        Returns:
            True once an item before `before` has been reported for MAX_MESSAGE_DELAY.
        """
        if before is None or seq >= before or self._set is not None or seq == self._setting:
            self._earlier = None
        elif self._earlier is None or self._earlier[0] != seq:
            self._earlier = seq, now
        elif now - self._earlier[1] >= MAX_MESSAGE_DELAY:
            self._earlier = None
            return True
        return False
