# SPDX-License-Identifier: Apache-2.0
"""MISSION_CURRENT as received last: the current item, the state of the mission, and the mode.

https://mavlink.io/en/messages/common.html#MISSION_CURRENT
"""
from __future__ import annotations

import math

from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.mavlink.transport.codec import Message, plan_id

_IN_MISSION = 1  # MISSION_CURRENT.mission_mode; 0: not known
_NOT_FLOWN = {d.MISSION_STATE_NOT_STARTED, d.MISSION_STATE_PAUSED}  # ArduPilot sends the first


class MissionReport:
    """What a vehicle reports of its mission.

    Args:
        atomic: it takes a mission as a whole (PX4), and reports the end of a take-off as well.

    Attributes:
        current: seq on the wire of the current item; None: not known, as the next.
        current_at: [s] at which it was received.
        total: number of items.
        state: MISSION_STATE.
        plan_id: PX4's id of the mission; 0: none.
        restarted: the complete mission has begun again (ArduPilot).
        ended: the mission is complete since this report (ArduPilot).
        stopped: by two reports it is not flown, though in mission mode (ArduPilot).
        in_mission_frame: number of the latest frame that shows mission mode (ArduPilot); 0: none.
    """

    def __init__(self, atomic: bool) -> None:
        self._atomic = atomic
        self.current_at = -math.inf
        self.restarted = self.ended = self.stopped = self._was_stopped = False
        self.forget()

    def forget(self) -> None:
        """Forget the mission on board: the vehicle was restarted."""
        self.current: int | None = None
        self.total: int | None = None
        self.state = self.plan_id = self.in_mission_frame = 0

    def receive(self, message: Message, frame: int, now: float) -> None:
        """Take a MISSION_CURRENT.

        Args:
            message: newer than those before.
            frame: its number.
            now: steady time [s].
        """
        self.current, self.current_at = message.seq, now
        self.total = message.total if 0 < message.total < 65535 else None
        before, self.state = self.state, message.mission_state
        self.plan_id = plan_id(message)
        if self._atomic:
            return
        complete = d.MISSION_STATE_COMPLETE
        self.restarted = before == complete and self.state == d.MISSION_STATE_ACTIVE
        self.ended = self.state == complete and before not in (complete, d.MISSION_STATE_UNKNOWN)
        # one report may be of the moment at which the mission began
        stopped = self.state in _NOT_FLOWN and message.mission_mode == _IN_MISSION
        self.stopped, self._was_stopped = stopped and self._was_stopped, stopped
        if message.mission_mode == _IN_MISSION:
            self.in_mission_frame = frame
