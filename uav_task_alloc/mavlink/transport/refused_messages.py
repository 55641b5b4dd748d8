# SPDX-License-Identifier: Apache-2.0
"""Counts refused messages; logs each message type of each sender once."""
from __future__ import annotations

import traceback
from collections import deque
from pathlib import Path

from uav_task_alloc.mavlink.transport.notes import OperatorNote

MAX_LOGGED = 100  # message types and senders with a log line; more are only counted
_MAX_REASON = 300  # characters


class RefusedMessages:
    """Counters of dropped messages."""

    def __init__(self) -> None:
        self.count = 0
        self.last = ''  # the latest one and its reason; '': none was refused
        self.notes: deque[OperatorNote] = deque()  # to be logged
        self._logged: set[tuple[str, str]] = set()  # sender and message type

    def add(self, sender: str, kind: str, reason: str, level: str = 'warning') -> None:
        """Count a refused message.

        Args:
            sender: sender or addressee of the message.
            kind: message type, or the operation that failed.
            reason: field, value and expectation, or the error.
            level: of the log line.
        """
        self.count += 1
        self.last = f'{kind} ({sender}): {reason[:_MAX_REASON]}'
        if (sender, kind) in self._logged or len(self._logged) > MAX_LOGGED:
            return
        self._logged.add((sender, kind))
        self.notes.append(OperatorNote(level, f'{self.last}: dropped; logged once' if len(
            self._logged) <= MAX_LOGGED else f'messages of more than {MAX_LOGGED} types and '
            'senders were dropped: more are only counted, see /diagnostics'))


def failure(error: Exception) -> str:
    """Return an unexpected error on one line.

    Args:
        error: as caught, with its traceback.

    Returns:
        Type, text, and file and line where it was raised.
    """
    frame = traceback.extract_tb(error.__traceback__)[-1]
    text = ' '.join(str(error).split())
    return f'{type(error).__name__}: {text} (at {Path(frame.filename).name}:{frame.lineno})'
