# SPDX-License-Identifier: Apache-2.0
"""What arrives on a link: MAVLink messages, other bytes, as of a wrong baud rate, or nothing."""
from __future__ import annotations

_PATIENCE = 10.0  # [s] without a message; an autopilot sends a heartbeat each second
_LEAST = 100  # [B] in that time that are no message: more than noise


class LinkTraffic:
    """Counts what is received on one link."""

    def __init__(self) -> None:
        self._bytes = self._messages = 0  # since the last `step` with a message
        self._since = 0.0  # [s] of that step
        self._opened = 0  # open count of the link then
        self.warning = ''  # what is wrong with it; '' where messages come, or may still come

    def add(self, size: int, messages: int) -> None:
        """Count what was read.

        Args:
            size: [B].
            messages: valid ones in it.
        """
        self._bytes += size
        self._messages += messages

    def step(self, now: float, opened: int) -> None:
        """Update `warning`.

        Args:
            now: steady time [s].
            opened: open count of the link; 0: it is closed.
        """
        if self._messages or not opened or opened != self._opened:
            self._since, self._opened = now, opened
            self._bytes = self._messages = 0
            self.warning = ''
        elif now - self._since > _PATIENCE:
            if self._bytes >= _LEAST:
                self.warning = ('what is received is no MAVLink, or signed with another key: '
                                'expected the baud rate and the key of the vehicle')
            else:
                self.warning = f'no MAVLink message received for more than {_PATIENCE:g} s'

    @property
    def is_garbled(self) -> bool:
        """Whether the warning is of bytes that are no messages."""
        return bool(self.warning) and self._bytes >= _LEAST
