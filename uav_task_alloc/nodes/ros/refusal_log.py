# SPDX-License-Identifier: Apache-2.0
"""Logs why messages are refused: once for each sender and reason, however often they repeat."""
from __future__ import annotations

import time
from collections.abc import Callable

from uav_task_alloc.nodes.conversions.message_limits import cut

_MOST_NAMES, _MOST_REASONS = 1000, 20  # names, and reasons for each, remembered as logged
_KEPT = 60.0  # [s] after its last message in which a name makes no room for another


class RefusalLog:
    """Logs each reason once until `name` sends a valid message. O(1) memory for any flood.

    A name that is refused while 1000 others are has no line of its own.

    Args:
        log: writes one line.
        clock: [s] steady.
    """

    def __init__(self, log: Callable[[str], object],
                 clock: Callable[[], float] = time.monotonic) -> None:
        self._log, self._clock = log, clock
        # (topic, name): reasons, and [s] of the last one; in the order of these times
        self._logged: dict[tuple[str, str], tuple[set[str], float]] = {}
        self._full = -_KEPT  # [s] when it was last logged that there are too many

    def report(self, topic: str, name: str, reason: str) -> None:
        """Log why a message was refused, or note that a valid one came.

        Args:
            topic: which the message came on.
            name: the id in it of a UAV, task or zone; '' where there is none.
            reason: why it is refused; '' for a valid message.
        """
        name = cut(name)
        known = self._logged.pop((topic, name), None)
        if not reason:
            return
        now = self._clock()
        if known is None and not self._has_room(now):
            if now - self._full >= _KEPT:
                self._full = now
                self._log(f'{topic}: {reason}: ignored; messages of more than {_MOST_NAMES} '
                          'names are: the other names are not logged')
            return
        logged = known[0] if known else set()
        self._logged[topic, name] = logged, now
        if reason not in logged and len(logged) < _MOST_REASONS:
            logged.add(reason)
            self._log(f'{topic}: {reason}: ignored; logged once')

    def _has_room(self, now: float) -> bool:
        """Whether there is room for a name, or the oldest one makes some."""
        if len(self._logged) < _MOST_NAMES:
            return True
        oldest, (_, last) = next(iter(self._logged.items()))
        if now - last < _KEPT:
            return False
        del self._logged[oldest]
        return True
