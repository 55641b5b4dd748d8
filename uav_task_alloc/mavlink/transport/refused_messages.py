# SPDX-License-Identifier: Apache-2.0
"""Counts what was refused, and tells each kind of it from each sender once."""
from __future__ import annotations

import traceback
from collections import deque
from pathlib import Path

from uav_task_alloc.mavlink.transport.notes import OperatorNote

MAX_LOGGED = 100  # kinds and senders with a line in the log: a flood of them gets no further
_LONGEST = 300  # characters of a reason


class RefusedMessages:
    """What was dropped so far; `notes` are for the log."""

    def __init__(self) -> None:
        self.count = 0
        self.last = ''  # which, and why; '': nothing was refused
        self.notes: deque[OperatorNote] = deque()
        self._told: set[tuple[str, str]] = set()

    def add(self, sender: str, kind: str, why: str, level: str = 'warning') -> None:
        """Count one.

        Args:
            sender: who sent it, or whom it is for.
            kind: message type or name of what was attempted.
            why: field, value and expectation, or the error.
            level: of the line in the log.
        """
        self.count += 1
        self.last = f'{kind} ({sender}): {why[:_LONGEST]}'
        if (sender, kind) in self._told or len(self._told) > MAX_LOGGED:
            return
        self._told.add((sender, kind))
        self.notes.append(OperatorNote(level, f'{self.last}: dropped; told once' if len(
            self._told) <= MAX_LOGGED else f'messages of more than {MAX_LOGGED} kinds and senders '
            'were dropped: more are only counted, see /diagnostics'))


def failure(error: Exception) -> str:
    """An error that nobody expected, in a line: its type, its text, and where it was raised."""
    frame = traceback.extract_tb(error.__traceback__)[-1]
    text = ' '.join(str(error).split())
    return f'{type(error).__name__}: {text} (at {Path(frame.filename).name}:{frame.lineno})'
