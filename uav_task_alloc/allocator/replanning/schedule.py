# SPDX-License-Identifier: Apache-2.0
"""When to solve: once for a burst of events, and now and then when nothing happens."""
from __future__ import annotations

import math

BURST = 5.0  # a burst waits at most so many settle times
MOST_TRIGGERS = 1000  # of a burst are remembered
AGAIN, SELDOM = 1.0, 30.0  # [s] after a failed solve before the next try; doubled up to the latter
SHARE = 0.5  # of the budget: what a solve gets before newer events cut it short


class Schedule:
    """Times are [s] of a steady clock."""

    def __init__(self) -> None:
        self.triggers: list[str] = []  # what happened since the last solve began
        self._first = self._last = 0.0
        self._began = self._ended = 0.0
        self._solved: list[str] = []  # what asked for the solve that runs
        self._wait, self._not_before = AGAIN, -math.inf
        self.busy = False

    def touch(self, trigger: str, now: float) -> None:
        """Something happened that asks for a new plan."""
        if not self.triggers:
            self._first = now
        self._last, self._not_before = now, -math.inf
        if len(self.triggers) < MOST_TRIGGERS:
            self.triggers.append(trigger)

    def settled(self, now: float, settle: float) -> bool:
        """Something happened, and the burst of it is over or has lasted long enough."""
        return bool(self.triggers) and now >= self._not_before and (
            now - self._last >= settle or now - self._first >= BURST * settle)

    def rested(self, now: float, period: float) -> bool:
        """Nothing happened, nothing runs, and the last solve is `period` [s] ago."""
        return not self.busy and not self.triggers and now - self._ended >= period

    def overdue(self, now: float, budget: float) -> bool:
        """A running solve has had its share; newer events may cut it short."""
        return self.busy and now - self._began >= SHARE * budget

    def begin(self, now: float) -> str:
        """A solve begins; returns what triggered it."""
        counted = dict.fromkeys(self.triggers)
        text = ', '.join(list(counted)[:3])
        more = len(counted) - 3
        self._solved, self.triggers = self.triggers, []
        self.busy, self._began = True, now
        return text + (f' and {more} more' if more > 0 else '')

    def end(self, now: float, failed: bool = False) -> None:
        """The solve is over; what asked for one that failed asks again, later each time.

        Something that happens meanwhile is not kept waiting.
        """
        self.busy, self._ended = False, now
        if not failed:
            self._wait = AGAIN
        elif self._solved:
            if not self.triggers:
                self._first = self._last = now
                self._not_before, self._wait = now + self._wait, min(2.0 * self._wait, SELDOM)
            self.triggers = [*self._solved, *self.triggers][:MOST_TRIGGERS]
        self._solved = []
