# SPDX-License-Identifier: Apache-2.0
"""MISSION_CURRENT against the current item that we have set: which was sent before that?"""
from __future__ import annotations

from uav_task_alloc.mavlink.mission.position_history import MAX_MESSAGE_DELAY

_SETTLE = 3.0  # [s] in which a CURRENT sent before the last change may still come


class CurrentItemReports:
    """What MISSION_CURRENT told last, in which frames, and what we have set."""

    def __init__(self) -> None:
        self.reported: int | None = None  # the current item, as the vehicle said last
        self.last_frame: int | None = None  # that told the current item
        self.previous_frame: int | None = None  # the one before that
        self._back: tuple[int, float] | None = None  # it flies an item before ours since [s]
        self._set: tuple[int, float] | None = None  # by us at a time [s], not seen yet
        self._asked: int | None = None  # we are setting this

    @property
    def awaits_set(self) -> bool:
        """We have set the current item, and not seen it yet."""
        return self._set is not None

    def begin(self, start: int | None, now: float) -> None:
        """Another mission is on board, which starts at an item; None: not known."""
        self._set = None if start is None else (start, now)
        self._asked = self.reported = None

    def clear(self) -> None:
        """Nothing is known of what is on board."""
        self._set = self.last_frame = self.reported = None

    def begin_set(self, seq: int) -> None:
        """We are about to set the current item."""
        self._asked = seq

    def note_set(self, seq: int, now: float) -> None:
        """It is done."""
        self._set, self._asked = (seq, now), None

    def is_old(self, seq: int, now: float) -> bool:
        """It was sent before we set the current item, or tells what we are setting.

        One that was sent after ends the wait for what we have set.
        """
        if seq == self._asked:
            return True
        if self._set is not None:
            start, when = self._set
            if seq != start and (seq < start or now - when < _SETTLE):
                return True
            self._set = None
        return False

    def note(self, seq: int, frame: int | None) -> None:
        """One was taken in."""
        self.reported, self.last_frame = seq, frame

    def was_set_back(self, seq: int, now: float, before: int | None) -> bool:
        """Somebody has set the current item back, some time ago.

        Args:
            seq: told now.
            now: [s].
            before: the item that it is to be before; None: that would mean nothing.
        """
        if before is None or seq >= before or self._set is not None or seq == self._asked:
            self._back = None
        elif self._back is None or self._back[0] != seq:
            self._back = seq, now
        elif now - self._back[1] >= MAX_MESSAGE_DELAY:
            self._back = None
            return True
        return False
