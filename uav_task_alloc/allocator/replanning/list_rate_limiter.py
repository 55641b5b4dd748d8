# SPDX-License-Identifier: Apache-2.0
"""Limits how often a UAV gets another list, unless it cannot fly the one it has."""
from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping

from uav_task_alloc.allocator.list_records import UavList
from uav_task_alloc.allocator.replanning.plan_acceptance import exchange_groups


class ListRateLimiter:
    """Records when each UAV got its last list; times are [s] of a steady clock.

    Arguments of methods:
        uav_ids: whose lists are published.
        now: [s] steady clock.
    """

    def __init__(self) -> None:
        self._published: dict[str, float] = {}
        self._due = math.inf  # when deferred lists are due

    def published(self, uav_ids: Iterable[str], now: float) -> None:
        """Record that these UAVs got lists."""
        self._published.update(dict.fromkeys(uav_ids, now))

    def permitted(self, old: Mapping[str, UavList], new: Mapping[str, UavList],
                  urgent: Callable[[str], bool], now: float,
                  interval: float) -> dict[str, UavList]:
        """Return the new lists that may be published now; the others are deferred.

        Args:
            old: lists in force, by UAV.
            new: lists of the plan, by UAV. Those that exchange tasks are deferred together.
            urgent: (uav_id) -> whether the list in force must be replaced at once.
            now: [s].
            interval: [s] since the last list of a UAV in which its next one is deferred.
        """
        permitted = dict(new)
        self._due = math.inf
        routes = ({uav_id: each.task_ids for uav_id, each in lists.items()}
                  for lists in (old, new))
        for group in exchange_groups(*routes):
            age = now - max(self._published.get(uav_id, -math.inf) for uav_id in group)
            if age < interval and not any(map(urgent, group)):
                self._due = min(self._due, now + interval - age)
                for uav_id in group:
                    permitted.pop(uav_id, None)
        return permitted

    def due(self, now: float) -> bool:
        """Return, once, whether deferred lists may be published now."""
        if now < self._due:
            return False
        self._due = math.inf
        return True
