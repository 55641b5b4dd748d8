# SPDX-License-Identifier: Apache-2.0
"""Logs why messages are refused: once for each sender and reason, however often they repeat."""
from __future__ import annotations

from collections.abc import Callable

from uav_task_alloc.nodes.conversions.message_limits import cut

_MOST_NAMES, _MOST_REASONS = 1000, 20  # names, and reasons for each, remembered as logged


class RefusalLog:
    """Logs each reason once until `name` sends a valid message. O(1) memory for any flood.

    Args:
        log: writes one line.
    """

    def __init__(self, log: Callable[[str], object]) -> None:
        self._log = log
        self._logged: dict[tuple[str, str], set[str]] = {}  # (topic, name): reasons

    def report(self, topic: str, name: str, reason: str) -> None:
        """Log why a message was refused, or note that a valid one came.

        Args:
            topic: which the message came on.
            name: the id in it of a UAV, task or zone; '' where there is none.
            reason: why it is refused; '' for a valid message.
        """
        name = cut(name)
        if not reason:
            self._logged.pop((topic, name), None)
            return
        logged = self._logged.setdefault((topic, name), set())
        if reason not in logged and len(logged) < _MOST_REASONS:
            logged.add(reason)
            self._log(f'{topic}: {reason}: ignored; logged once')
        while len(self._logged) > _MOST_NAMES:
            del self._logged[next(iter(self._logged))]
