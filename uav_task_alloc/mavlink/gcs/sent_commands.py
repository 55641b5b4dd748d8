# SPDX-License-Identifier: Apache-2.0
"""Commands that were sent to a vehicle and may still take effect."""
from __future__ import annotations

import math
from dataclasses import dataclass, field

from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.mavlink.gcs.authority_state import AuthorityRecord
from uav_task_alloc.mavlink.gcs.mode_acks import ModeAcks
from uav_task_alloc.mavlink.transport.codec import Message

COMMAND_LIFETIME = 12.0  # [s] in which a sent command may take effect and show in a heartbeat


@dataclass(slots=True)
class SentCommands:
    """What was sent to one vehicle, and what it has acknowledged."""

    # custom modes that no heartbeat has shown yet, and until when [s] one may
    modes: list[tuple[int, float]] = field(default_factory=list)
    sent_at: dict[int, float] = field(default_factory=dict)  # [s], by custom_mode
    arm_until: float = -math.inf  # [s]
    disarm_until: float = -math.inf  # [s]
    arming: bool = False  # whether the last command was to arm
    armed_frame: int | None = None  # frame of the COMMAND_ACK that accepted arming
    climb: float | None = None  # [m] above home, of our take-off
    acks: ModeAcks = field(default_factory=ModeAcks)

    @classmethod
    def from_record(cls, record: AuthorityRecord, now: float) -> SentCommands:
        """What the previous run of the bridge had sent, as if sent at `now` [s]."""
        return cls([(mode, now + COMMAND_LIFETIME) for mode in record.commanded],
                   dict.fromkeys(record.commanded, now), climb=record.climb)

    def add_mode(self, mode: int, now: float) -> None:
        """Add a command for a custom_mode."""
        self.modes.append((mode, now + COMMAND_LIFETIME))
        self.sent_at[mode] = now

    def add_arming(self, arm: bool, now: float) -> None:
        """Add a command to arm, or to disarm."""
        self.arming = arm
        if arm:
            self.arm_until = now + COMMAND_LIFETIME
        else:
            self.disarm_until = now + COMMAND_LIFETIME

    def receive_command_ack(self, message: Message, frame: int) -> None:
        """Process a COMMAND_ACK that is addressed to us, and the number of its frame."""
        refused = self.acks.acknowledged(message.command, message.result, frame)
        if refused is not None:
            self._remove_refused(refused)
        if (message.command == d.MAV_CMD_COMPONENT_ARM_DISARM and self.arming
                and message.result == d.MAV_RESULT_ACCEPTED):
            self.armed_frame = frame

    def _remove_refused(self, mode: int) -> None:
        """Remove one command for a mode that the vehicle does not enter by it."""
        index = next((n for n, each in enumerate(self.modes) if each[0] == mode), None)
        if index is not None:
            del self.modes[index]
        if all(each[0] != mode for each in self.modes):
            self.sent_at.pop(mode, None)

    def take_armed_before(self, frame: int) -> bool:
        """Whether arming was accepted before this frame was sent; True once."""
        if self.armed_frame is None or frame <= self.armed_frame:
            return False
        self.armed_frame = None
        return True

    def confirm_mode(self, mode: int, now: float) -> bool:
        """Whether a mode that a heartbeat shows was commanded; removes it and those before."""
        self.modes = [each for each in self.modes if each[1] >= now]
        index = next((n for n, each in enumerate(self.modes) if each[0] == mode), None)
        if index is not None:
            del self.modes[:index + 1]
        return index is not None

    def pending_modes(self, now: float) -> list[int]:
        """Custom modes that were sent and that no heartbeat has shown yet."""
        return [mode for mode, until in self.modes if until >= now]

    def was_recently_sent(self, mode: int, now: float) -> bool:
        """Whether a mode was sent within `COMMAND_LIFETIME`, shown by a heartbeat or not."""
        return now - self.sent_at.get(mode, -math.inf) < COMMAND_LIFETIME

    def clear_pending(self) -> None:
        """Expect no mode any more; `sent_at` keeps those that may still take effect."""
        self.modes.clear()
        self.climb = None
