# SPDX-License-Identifier: Apache-2.0
"""Whether a report of a state is the newest of its type: links may deliver out of order."""
from __future__ import annotations

from uav_task_alloc.mavlink.gcs.telemetry_messages import STATE_REPORTS
from uav_task_alloc.mavlink.transport.codec import Message

_ORDERED = 5.0  # [s] in which the numbers of two frames order them


class NewestReports:
    """Numbers and times of the newest frames of each type of message, and of each battery."""

    def __init__(self) -> None:
        self._newest: dict[str, tuple[int, float]] = {}  # frame number and time [s] by type

    def forget(self) -> None:
        """Forget all: a restarted vehicle numbers its frames from 0 on."""
        self._newest.clear()

    def is_outdated(self, message: Message, frame: int, now: float) -> bool:
        """Whether a message reports a state, and a newer one of its type was received before.

        Not by its sequence number: hundreds of frames may come between two of a type.

        Args:
            message: as received.
            frame: its number.
            now: steady time [s].
        """
        if message.get_type() not in STATE_REPORTS:
            return False
        kind = message.get_type() + str(getattr(message, 'id', ''))
        newest, received_at = self._newest.get(kind, (frame, now))
        if now - received_at < _ORDERED and frame < newest:
            return True
        self._newest[kind] = frame, now
        return False
