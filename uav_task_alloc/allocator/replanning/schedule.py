# SPDX-License-Identifier: Apache-2.0
"""When to solve: once for a burst of events, and periodically without events."""
from __future__ import annotations

import math

from uav_task_alloc.errors import first_of

_MAX_BURST = 5.0  # settle times that a burst of events waits at most
_MAX_TRIGGERS = 1000  # of a burst that are kept
_FIRST_RETRY = 1.0  # [s] after a failed solve; doubled with each failure
MAX_RETRY = 30.0  # [s]
_MIN_SHARE = 0.5  # of the budget that a solve gets before newer events end it


class Schedule:
    """Collects triggers, and says when a solve is due; times are [s] of a steady clock.

    Arguments of methods:
        trigger: text of the event.
        now: [s] steady clock.
        settle: [s] without an event that ends a burst.
        period: [s].
        budget: [s] of a solve.
        failed: the solve gave no plan.
    """

    def __init__(self) -> None:
        self.triggers: list[str] = []  # since the last solve began
        self._first = self._last = 0.0
        self._began = self._ended = 0.0
        self._solved: list[str] = []  # triggers of the running solve
        self._retry, self._not_before = _FIRST_RETRY, -math.inf
        self.busy = False

    def add_trigger(self, trigger: str, now: float) -> None:
        """Record an event that requires a plan."""
        if not self.triggers:
            self._first = now
        self._last, self._not_before = now, -math.inf
        if len(self.triggers) < _MAX_TRIGGERS:
            self.triggers.append(trigger)

    def settled(self, now: float, settle: float) -> bool:
        """Return whether there are triggers, and their burst is over or lasted long enough."""
        return bool(self.triggers) and now >= self._not_before and (
            now - self._last >= settle or now - self._first >= _MAX_BURST * settle)

    def rested(self, now: float, period: float) -> bool:
        """Return whether there is no trigger, no solve, and none ended within `period` [s]."""
        return not self.busy and not self.triggers and now - self._ended >= period

    def overdue(self, now: float, budget: float) -> bool:
        """Return whether the running solve had its share of `budget` [s]."""
        return self.busy and now - self._began >= _MIN_SHARE * budget

    def begin(self, now: float) -> str:
        """Begin a solve; returns a text of its triggers."""
        text = first_of(dict.fromkeys(self.triggers), most=3)
        self._solved, self.triggers = self.triggers, []
        self.busy, self._began = True, now
        return text

    def end(self, now: float, failed: bool = False) -> None:
        """End the solve; the triggers of a failed one are kept, and retried later each time.

        A newer trigger is not delayed by that.
        """
        self.busy, self._ended = False, now
        if not failed:
            self._retry = _FIRST_RETRY
        elif self._solved:
            if not self.triggers:
                self._first = self._last = now
                self._not_before = now + self._retry
                self._retry = min(2.0 * self._retry, MAX_RETRY)
            self.triggers = [*self._solved, *self.triggers][:_MAX_TRIGGERS]
        self._solved = []
