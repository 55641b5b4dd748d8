# SPDX-License-Identifier: Apache-2.0
"""Log notes of STATUSTEXT messages, each text at most once a minute."""
from __future__ import annotations

import math
import re

from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.mavlink.transport.codec import Message
from uav_task_alloc.mavlink.transport.notes import OperatorNote

_REPEAT_AFTER = 60.0  # [s] in which the same text is logged once
_MAX_TEXTS = 200  # different texts in that time
_HARMLESS = re.compile(r'Auto mission changed, restarted command')  # CRITICAL, for each item


class StatusTextLog:
    """The texts of one vehicle; `last` is the latest one."""

    def __init__(self) -> None:
        self.last = ''
        self._logged_at: dict[str, float] = {}  # [s] by text

    def receive(self, message: Message, now: float) -> OperatorNote | None:
        """Process a STATUSTEXT; returns a note, None if it was logged lately."""
        text = self.last = str(message.text)
        logged_at = self._logged_at
        if len(logged_at) >= _MAX_TEXTS:
            logged_at = self._logged_at = {
                old: at for old, at in logged_at.items() if now - at < _REPEAT_AFTER}
        if now - logged_at.get(text, -math.inf) < _REPEAT_AFTER or len(logged_at) >= _MAX_TEXTS:
            return None
        logged_at[text] = now
        serious = message.severity < d.MAV_SEVERITY_WARNING and not _HARMLESS.search(text)
        return OperatorNote('error' if serious else 'info', text)
