# SPDX-License-Identifier: Apache-2.0
"""What a vehicle says in STATUSTEXT, as notes: the same words once a minute."""
from __future__ import annotations

import math
import re

from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.mavlink.transport.codec import Message
from uav_task_alloc.mavlink.transport.notes import OperatorNote

TEXT_AGAIN = 60.0  # [s] in which the same words of a vehicle are told once
_MOST_TEXTS = 200  # different words in that time
SAYS_NOTHING = re.compile(r'Auto mission changed, restarted command')  # once for each item


class StatusTextLog:
    """The words of one vehicle, and when they were told."""

    def __init__(self) -> None:
        self.last = ''
        self._told: dict[str, float] = {}  # when [s]

    def take(self, message: Message, now: float) -> OperatorNote | None:
        """A STATUSTEXT; returns what a human should read, None where it was told lately."""
        text = self.last = str(message.text)
        if len(self._told) >= _MOST_TEXTS:
            self._told = {old: at for old, at in self._told.items() if now - at < TEXT_AGAIN}
        if now - self._told.get(text, -math.inf) < TEXT_AGAIN or len(self._told) >= _MOST_TEXTS:
            return None
        self._told[text] = now
        serious = message.severity < d.MAV_SEVERITY_WARNING and not SAYS_NOTHING.search(text)
        return OperatorNote('error' if serious else 'info', text)
