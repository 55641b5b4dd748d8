# SPDX-License-Identifier: Apache-2.0
"""One command until the vehicle has done it, in a bounded number of tries."""
from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.mavlink.transport.codec import Message

_PERIOD = 1.0  # [s] until a command is repeated
_TRIES = 5


def _always() -> bool:
    return True


class CommandResult(Enum):
    """What has become of a command."""

    OPEN = 'open'
    DONE = 'done'
    FAILED = 'failed'
    DROPPED = 'dropped'  # no longer wanted


@dataclass(slots=True)
class Command:
    """Sent every second until acknowledged or seen to be done; then perhaps another way."""

    name: str
    message: Message
    seen: Callable[[], bool]  # whether the vehicle is seen to have done it
    ack_suffices: bool = True
    tries: int = _TRIES
    patient: bool = False  # a refusal may pass: go on trying
    wanted: Callable[[], bool] = _always  # no longer: it is dropped between two tries
    fallback: Command | None = None
    answer: CommandResult = CommandResult.OPEN
    reason: str = ''
    _due: float = float('-inf')
    _sent: int = 0

    def step(self, now: float) -> list[Message]:
        """Send what is due."""
        if self.answer is not CommandResult.OPEN:
            return []
        if not self.wanted():
            self.answer = CommandResult.DROPPED
            return []
        if self._sent and self.seen():
            self.answer = CommandResult.DONE
        elif now >= self._due:
            if self._sent < self.tries:
                self._sent += 1
                self._due = now + _PERIOD
                return [self.message]
            self._end(self.reason or f'no answer to {self.tries} tries')
            return self.step(now)
        return []

    def receive(self, message: Message) -> None:
        """Take a COMMAND_ACK that is addressed to us."""
        if (self.answer is not CommandResult.OPEN or message.get_type() != 'COMMAND_ACK'
                or message.command != getattr(self.message, 'command', None) or not self._sent):
            return
        if message.result == d.MAV_RESULT_ACCEPTED:
            if self.ack_suffices:
                self.answer = CommandResult.DONE
        elif message.result != d.MAV_RESULT_IN_PROGRESS:
            self.reason = f'refused with MAV_RESULT {message.result}'
            if not self.patient and message.result != d.MAV_RESULT_TEMPORARILY_REJECTED:
                self._end(self.reason)

    def _end(self, reason: str) -> None:
        other = self.fallback
        if other is None:
            self.answer, self.reason = CommandResult.FAILED, reason
            return
        self.message, self.ack_suffices = other.message, other.ack_suffices
        self.tries, self.fallback, self.reason = other.tries, other.fallback, ''
        self._sent, self._due = 0, float('-inf')
