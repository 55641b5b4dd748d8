# SPDX-License-Identifier: Apache-2.0
"""The commands that were sent to a vehicle, and may still take effect."""
from __future__ import annotations

import math
from dataclasses import dataclass, field

from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.mavlink.gcs.authority import AuthorityRecord
from uav_task_alloc.mavlink.gcs.mode_acks import ModeAcks
from uav_task_alloc.mavlink.transport.codec import Message

IN_FLIGHT = 12.0  # [s] in which a command sent may still take effect, and be seen


@dataclass(slots=True)
class SentCommands:
    """What was sent to one vehicle, and what it has acknowledged."""

    modes: list[tuple[int, float]] = field(default_factory=list)  # not seen yet; until when [s]
    last: dict[int, float] = field(default_factory=dict)  # when [s], by mode
    arm_until: float = -math.inf  # [s]
    disarm_until: float = -math.inf  # [s]
    arming: bool = False  # what was asked last: to arm
    armed_frame: int | None = None  # in which the vehicle said that it had armed
    climb: float | None = None  # [m] above home, of our take-off
    acks: ModeAcks = field(default_factory=ModeAcks)

    @classmethod
    def before_restart(cls, record: AuthorityRecord, now: float) -> SentCommands:
        """What the bridge before this one had sent, as if it was sent now."""
        return cls([(mode, now + IN_FLIGHT) for mode in record.commanded],
                   dict.fromkeys(record.commanded, now), climb=record.climb)

    def mode(self, mode: int, now: float) -> None:
        """A custom_mode is to be entered."""
        self.modes.append((mode, now + IN_FLIGHT))
        self.last[mode] = now

    def arm(self, arms: bool, now: float) -> None:
        """It is to arm, or to disarm."""
        self.arming = arms
        if arms:
            self.arm_until = now + IN_FLIGHT
        else:
            self.disarm_until = now + IN_FLIGHT

    def answered(self, message: Message, frame: int) -> None:
        """Take a COMMAND_ACK that is addressed to us, and the number of its frame."""
        if message.command == d.MAV_CMD_DO_SET_MODE:
            self.acks.answered(message.result, frame)
        elif (message.command == d.MAV_CMD_COMPONENT_ARM_DISARM and self.arming
                and message.result == d.MAV_RESULT_ACCEPTED):
            self.armed_frame = frame

    def armed_before(self, frame: int) -> bool:
        """It has said that it had armed, before this frame was sent; asked once."""
        if self.armed_frame is None or frame <= self.armed_frame:
            return False
        self.armed_frame = None
        return True

    def expects(self, mode: int, now: float) -> bool:
        """Whether a mode seen now is one that was sent; what was sent before it is over."""
        self.modes = [each for each in self.modes if each[1] >= now]
        found = next((n for n, each in enumerate(self.modes) if each[0] == mode), None)
        if found is not None:
            del self.modes[:found + 1]
        return found is not None

    def under_way(self, now: float) -> list[int]:
        """Modes that were sent, and not seen yet."""
        return [mode for mode, until in self.modes if until >= now]

    def recently(self, mode: int, now: float) -> bool:
        """Whether a mode was sent a moment ago, seen or not."""
        return now - self.last.get(mode, -math.inf) < IN_FLIGHT

    def drop(self) -> None:
        """Nothing more is to be sent; what is under way stays in `last`."""
        self.modes.clear()
        self.climb = None
