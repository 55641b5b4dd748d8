# SPDX-License-Identifier: Apache-2.0
"""When texts of a vehicle last named a failsafe, a kill or a mission's end; its failing checks."""
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

def failing_checks(message: Message) -> str:
    """Failing prearm checks of a SYS_STATUS as a text with the unhealthy sensors; '': none.

    PX4 sets the health bit of the prearm check, and never its present and enabled bits.
    """
    prearm = d.MAV_SYS_STATUS_PREARM_CHECK
    if message.onboard_control_sensors_health & prearm:
        return ''
    failing = (message.onboard_control_sensors_present & message.onboard_control_sensors_enabled
               & ~message.onboard_control_sensors_health & ~prearm)
    names = [entry.name.removeprefix('MAV_SYS_STATUS_').removeprefix('SENSOR_').lower()
             for bit, entry in d.enums['MAV_SYS_STATUS_SENSOR'].items()
             if bit & failing and bit & (bit - 1) == 0]
    return 'preflight checks fail' + (f' ({", ".join(names)})' if names else '')
