# SPDX-License-Identifier: Apache-2.0
"""When a node that works in steps may step: pauses leave time in which messages are read."""
from __future__ import annotations

_BLOCKED, _READS = 1.0, 0.5  # [s] without a step; in which it then reads what has come, once
# a step is followed by a pause, in which messages are taken: a multiple of its duration
_PAUSE_FACTOR, _LONGEST_PAUSE = 3.0, 0.2  # and at most [s]


class StepPacing:
    """Paces the steps of one executor, which takes messages between them.

    Args:
        now: [s] steady clock.

    Arguments of methods:
        now: [s] steady clock.
    """

    def __init__(self, now: float) -> None:
        self._pause_until = 0.0  # [s] steady clock, as are the others
        self._ticked_at = self._reads_until = now

    def is_due(self, now: float) -> bool:
        """Return whether a step may be done; to be asked with each tick of the timer.

        Where the executor was blocked between two ticks, what was sent meanwhile is read first.
        """
        ticked_at, self._ticked_at = self._ticked_at, now
        if now - ticked_at > _BLOCKED and ticked_at >= self._reads_until:
            self._pause_until = self._reads_until = now + _READS
        return now >= self._pause_until

    def pause_after(self, started: float, now: float) -> None:
        """Leave time for messages after work.

        Args:
            started: [s] when it began.
            now: [s] when it ended.
        """
        self._pause_until = now + min(_PAUSE_FACTOR * (now - started), _LONGEST_PAUSE)
