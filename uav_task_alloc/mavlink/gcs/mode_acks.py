# SPDX-License-Identifier: Apache-2.0
"""Which mode commands a vehicle has acknowledged: another mode after that is a mode change."""
from __future__ import annotations

from pymavlink.dialects.v20 import ardupilotmega as d

_ACK_TIMEOUT = 12.0  # [s] after which a command without a COMMAND_ACK counts as lost


class ModeAcks:
    """Counts COMMAND_ACKs of mode commands.

    While that of a command for another mode is missing no mode is concluded; a repetition of the
    same command changes nothing.
    """

    def __init__(self) -> None:
        self._entered: int | None = None  # custom_mode: accepted, and no other mode pending
        self._frame = 0  # number of the frame of the first such COMMAND_ACK
        # MAV_CMDs sent and not acknowledged, with the custom mode that each sets
        self._pending: list[tuple[int, int]] = []
        self._mixed = False  # different modes were pending at once: a COMMAND_ACK names none
        self._sent_at = 0.0  # [s] of the last command

    def command_sent(self, command: int, mode: int, now: float) -> None:
        """Add a command for a custom_mode that is about to be sent.

        Args:
            command: MAV_CMD.
            mode: custom_mode that it sets.
            now: steady time [s].
        """
        if now - self._sent_at > _ACK_TIMEOUT:
            self.clear()
        self._mixed = self._mixed or any(other != mode for _, other in self._pending)
        self._pending.append((command, mode))
        self._entered, self._sent_at = None, now

    def acknowledged(self, command: int, result: int, frame: int) -> int | None:
        """Process the MAV_RESULT of a MAV_CMD, and the number of its frame.

        Returns:
            The custom_mode that is refused, and that no command without a COMMAND_ACK may still
            set; None: none, or it is not known which.
        """
        mode = next((mode for sent, mode in reversed(self._pending) if sent == command), None)
        if mode is None or result == d.MAV_RESULT_IN_PROGRESS:
            return None
        self._pending.remove((command, mode))
        if self._pending and self._mixed:
            return None
        refused = result != d.MAV_RESULT_ACCEPTED and not (self._pending or self._mixed)
        accepted = result == d.MAV_RESULT_ACCEPTED and not self._mixed
        if accepted:
            self._frame = min(frame, self._frame) if self._entered == mode else frame
        self._entered, self._mixed = mode if accepted else None, False
        return mode if refused else None

    def mode_entered_by(self, frame: int) -> int | None:
        """The mode that our command had set before this frame was sent; None: not known."""
        return self._entered if frame > self._frame else None

    def clear(self) -> None:
        """Conclude nothing from the commands sent so far."""
        self._entered, self._mixed = None, False
        self._pending.clear()
