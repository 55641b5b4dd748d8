# SPDX-License-Identifier: Apache-2.0
"""Which mode commands a vehicle has acknowledged: what its heartbeats show after that is news."""
from __future__ import annotations

from pymavlink.dialects.v20 import ardupilotmega as d

FORGOTTEN = 12.0  # [s] after which a command without an answer is lost


class ModeAcks:
    """Counts the answers to DO_SET_MODE; where one is missing nothing is concluded."""

    def __init__(self) -> None:
        self.done: int | None = None  # custom_mode: accepted, and no other command is under way
        self._frame = 0  # number of the frame that said so
        self._open: list[int] = []  # sent and not answered
        self._mixed = False  # different modes were under way at once: an answer names none
        self._at = 0.0  # [s] sent last

    def sent(self, mode: int, now: float) -> None:
        """A command for a custom_mode is about to be sent."""
        if now - self._at > FORGOTTEN:
            self.clear()
        self._mixed = self._mixed or any(other != mode for other in self._open)
        self._open.append(mode)
        self.done, self._at = None, now

    def answered(self, result: int, frame: int) -> None:
        """COMMAND_ACK of DO_SET_MODE, in a frame."""
        if not self._open or result == d.MAV_RESULT_IN_PROGRESS:
            return
        mode = self._open.pop()
        if self._open:
            return
        self.done = mode if result == d.MAV_RESULT_ACCEPTED and not self._mixed else None
        self._mixed, self._frame = False, frame

    def known_by(self, frame: int) -> int | None:
        """The mode that was entered by our command before this frame was sent; None: not known."""
        return self.done if frame > self._frame else None

    def clear(self) -> None:
        """Nothing is concluded from what was sent so far."""
        self.done, self._mixed = None, False
        self._open.clear()
