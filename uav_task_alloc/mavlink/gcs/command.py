# SPDX-License-Identifier: Apache-2.0
"""One command, repeated a bounded number of times until the vehicle has executed it."""
from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.mavlink.transport.codec import Message

_PERIOD = 1.0  # [s] until a command is repeated
_ATTEMPTS = 5


def _always() -> bool:
    return True


class CommandResult(Enum):
    """Outcome of a command."""

    OPEN = 'open'
    DONE = 'done'
    FAILED = 'failed'
    DROPPED = 'dropped'  # not wanted any more


@dataclass(slots=True)
class Command:
    """A command that is sent every second until acknowledged or executed, with a fallback.

    `result` is OPEN until then; `reason` is that of a refused attempt.
    """

    name: str
    message: Message
    executed: Callable[[], bool]  # whether telemetry shows that the vehicle has executed it
    ack_suffices: bool = True
    attempts: int = _ATTEMPTS
    retry_refused: bool = False  # a refusal may be temporary: repeat
    wanted: Callable[[], bool] = _always  # False: dropped before the next attempt
    fallback: Command | None = None  # sent after the last attempt or a refusal
    result: CommandResult = CommandResult.OPEN
    reason: str = ''
    _due: float = float('-inf')
    _sent: int = 0

    def step(self, now: float, may_repeat: bool = True) -> list[Message]:
        """Return the message if it is due.

        Args:
            now: steady time [s].
            may_repeat: whether it may be sent once more.
        """
        if self.result is not CommandResult.OPEN:
            return []
        if not self.wanted():
            self.result = CommandResult.DROPPED
            return []
        if self._sent and self.executed():
            self.result = CommandResult.DONE
        elif now >= self._due and (may_repeat or not self._sent):
            if self._sent < self.attempts:
                self._sent += 1
                self._due = now + _PERIOD
                return [self.message]
            self._end(self.reason or f'no answer to {self.attempts} attempts')
            return self.step(now)
        return []

    def receive(self, message: Message) -> None:
        """Process a COMMAND_ACK addressed to this ground station; others are ignored."""
        if (self.result is not CommandResult.OPEN or message.get_type() != 'COMMAND_ACK'
                or message.command != getattr(self.message, 'command', None) or not self._sent):
            return
        if message.result == d.MAV_RESULT_ACCEPTED:
            if self.ack_suffices:
                self.result = CommandResult.DONE
        elif message.result != d.MAV_RESULT_IN_PROGRESS:
            self.reason = f'refused with MAV_RESULT {message.result}'
            if not self.retry_refused and message.result != d.MAV_RESULT_TEMPORARILY_REJECTED:
                self._end(self.reason)

    def _end(self, reason: str) -> None:
        other = self.fallback
        if other is None:
            self.result, self.reason = CommandResult.FAILED, reason
            return
        self.message, self.ack_suffices = other.message, other.ack_suffices
        self.attempts, self.fallback, self.reason = other.attempts, other.fallback, ''
        self._sent, self._due = 0, float('-inf')
