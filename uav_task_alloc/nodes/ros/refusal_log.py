# SPDX-License-Identifier: Apache-2.0
"""What was wrong with messages: logged once for each sender, however often it is repeated."""
from __future__ import annotations

from collections.abc import Callable

from uav_task_alloc.nodes.conversions.message_limits import cut

MOST_NAMES, MOST_REASONS = 1000, 20  # names, and reasons for each, remembered as logged


class RefusalLog:
    """Log what is wrong with a message, once until `name` sends a good one."""

    def __init__(self, log: Callable[[str], object]) -> None:
        self._log = log
        self._said: dict[tuple[str, str], set[str]] = {}  # (topic, name): reasons

    def say(self, topic: str, name: str, reason: str) -> None:
        """reason: what is wrong, '' for a good message."""
        name = cut(name)
        if not reason:
            self._said.pop((topic, name), None)
            return
        said = self._said.setdefault((topic, name), set())
        if reason not in said and len(said) < MOST_REASONS:
            said.add(reason)
            self._log(f'{topic}: {reason}: ignored; said once')
        while len(self._said) > MOST_NAMES:
            del self._said[next(iter(self._said))]
