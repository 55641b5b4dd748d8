# SPDX-License-Identifier: Apache-2.0
"""When the STATUSTEXTs of a vehicle last named a failsafe, a kill or the end of a mission."""
from __future__ import annotations

import math
import re
from dataclasses import dataclass

from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.mavlink.transport.codec import Message

_TEXT_WINDOW = 6.0  # [s] around a mode change in which a text refers to it
_FAILSAFE = re.compile(r'failsafe|fence breach|breached|battery \d+ is (low|critical)|'
                       r'(low|critical|dangerous).{0,12}battery|data link lost|'
                       r'(rc|manual control|gcs).{0,20}lost', re.IGNORECASE)
_KILL = re.compile(r'emergency stop|flight terminat|terminating', re.IGNORECASE)
_KILL_SWITCH = re.compile(r'motorestop high|kill(.?switch)? engaged', re.IGNORECASE)
_FINISHED = re.compile(r'mission finished', re.IGNORECASE)  # PX4, at the end of its mission
_INFEASIBLE = re.compile(r'(mission|waypoint).*(reject|infeasible|invalid|not valid|too far|'
                         r'too close|failed)|too far', re.IGNORECASE)


@dataclass(slots=True)
class StatusTexts:
    """The time of the newest text of each meaning."""

    failsafe_at: float = -math.inf  # [s]
    infeasible_at: float = -math.inf  # [s]
    finished_at: float = -math.inf  # [s]

    def receive(self, message: Message, now: float) -> bool:
        """Process a STATUSTEXT.

        Args:
            message: the STATUSTEXT.
            now: steady time [s].

        Returns:
            Whether it reports that the motors were stopped, or the flight terminated.
        """
        text = str(message.text)
        urgent = message.severity <= d.MAV_SEVERITY_NOTICE
        if _FINISHED.search(text):
            self.finished_at = now
        if urgent and _FAILSAFE.search(text):
            self.failsafe_at = now
        if urgent and _INFEASIBLE.search(text):
            self.infeasible_at = now
        return bool(_KILL_SWITCH.search(text) or (urgent and _KILL.search(text)))

    def recent_failsafe(self, now: float) -> bool:
        """Whether a failsafe was named a moment ago."""
        return now - self.failsafe_at < _TEXT_WINDOW

    def mission_ended(self, now: float, since: float) -> bool:
        """Whether the mission was called finished since a time [s], or infeasible, just now."""
        finished_at = self.finished_at if self.finished_at >= since else -math.inf
        return max(finished_at, self.infeasible_at) > now - _TEXT_WINDOW
