# SPDX-License-Identifier: Apache-2.0
"""The times of messages of one vehicle: whether its link is good, stale or lost."""
from __future__ import annotations

import math

STALE, LOST = 3.0, 10.0  # [s] without a message
# only heartbeats show every mode; 5 of them: a link that loses a fifth stays usable
NO_HEARTBEAT = 5.0  # [s]
_QUIET, _STEADY = 2.0, 10.0  # [s] a link is good with no gap of _QUIET for _STEADY


class LinkTimes:
    """The times of the messages of one vehicle.

    Args:
        now: steady time [s], as in all methods; counts as a message.
    """

    def __init__(self, now: float) -> None:
        self.received_at = self.heartbeat_at = now  # [s] of the latest message, and HEARTBEAT
        self._gap_at = -math.inf  # [s] end of the latest gap of _QUIET

    def receive(self, now: float) -> None:
        """Take a message."""
        if now - self.received_at > _QUIET:
            self._gap_at = now
        self.received_at = now

    def silent(self, now: float) -> bool:
        """Whether no message was received for STALE."""
        return now - self.received_at > STALE

    def stale(self, now: float) -> bool:
        """Whether it is silent, or no heartbeat was received for NO_HEARTBEAT."""
        return self.silent(now) or now - self.heartbeat_at > NO_HEARTBEAT

    def stale_text(self, now: float) -> str:
        """What was missing for how long on a stale link."""
        return (f'no message for {STALE:g} s' if self.silent(now)
                else f'no heartbeat for {NO_HEARTBEAT:g} s')

    def lost(self, now: float) -> bool:
        """Whether no message was received for LOST."""
        return now - self.received_at > LOST

    def good(self, now: float) -> bool:
        """Whether the last 10 s had no gap of more than 2 s."""
        return now - self.received_at <= _QUIET and now - self._gap_at >= _STEADY
