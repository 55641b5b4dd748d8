# SPDX-License-Identifier: Apache-2.0
"""Follows the lists in force: predicted starts, late tasks, waits that have changed."""
from __future__ import annotations

from collections.abc import Mapping

from uav_task_alloc.allocator.list_records import UavList
from uav_task_alloc.allocator.state.deadlines import without_jitter
from uav_task_alloc.allocator.state.world import World

_PERIOD = 1.0  # [s] between two predictions
_STOPS_PER_SECOND = 2000  # predicted at most, so that a large fleet is predicted less often
_ALLOCATION_PERIOD = 5.0  # [s] between two allocations for predictions alone


class Predictions:
    """Predicts the lists of a world; times are [s], `now` steady, `stamp` published.

    `later`: expected starts of tasks on later trips, by task id, of the plan in force.

    Args:
        world: of the allocator.
        now: [s] steady clock.

    Arguments of methods:
        now: [s] steady clock.
        stamp: [s] published clock.
    """

    def __init__(self, world: World, now: float) -> None:
        self._world = world
        self.later: Mapping[str, float] = {}
        self._next, self._next_allocation = now, now  # [s] steady clock
        self._news = False  # since the last allocation

    def tick(self, now: float, stamp: float) -> bool:
        """Predict where a period is over; returns whether to publish the allocation again."""
        if now >= self._next:
            lists = self.lists(stamp)
            stops = sum(len(each.stops) for each in lists.values())
            self._next = now + max(_PERIOD, stops / _STOPS_PER_SECOND)
            self._predict(lists, now, stamp)
        if not self._news or now < self._next_allocation:
            return False
        self._news, self._next_allocation = False, now + _ALLOCATION_PERIOD
        return True

    def lists(self, stamp: float) -> dict[str, UavList]:
        """Return the lists in force with times from `stamp` [s], by UAV."""
        world = self._world
        return {uav_id: world.lists.restamped(
                    uav_id, stamp, world.flights.of(uav_id, stamp) if each.stops else None)
                for uav_id, each in world.lists_in_force().items()}

    def _predict(self, lists: Mapping[str, UavList], now: float, stamp: float) -> None:
        world = self._world
        known = {uav_id: each for uav_id, each in lists.items() if world.uav_record(uav_id)}
        first = not world.deadlines.expected
        news, reports = world.deadlines.update(known.values(), self.later, stamp)
        self._news |= news and not first
        world.outbox.statuses |= news
        for report in reports:
            world.request_replan(report, now)
        world.publish({uav_id: each for uav_id, each in known.items()
                       if not without_jitter(world.list_of(uav_id), each)}, stamp, resend=True)

    def planned(self, now: float, stamp: float) -> None:
        """Predict a plan that was just put in force, and log what is late in it."""
        self._predict(self.lists(stamp), now, stamp)
        self._news, self._next_allocation = False, now + _ALLOCATION_PERIOD
        for text, warning in self._world.deadlines.log_lines():
            self._world.note(text, warning)
