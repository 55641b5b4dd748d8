# SPDX-License-Identifier: Apache-2.0
"""How often a UAV is given another list: not twice within an interval while the first is good."""
from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping

from uav_task_alloc.allocator.records import UavList
from uav_task_alloc.allocator.replanning.plan_acceptance import exchanges


class ListRateLimiter:
    """Remembers when each UAV got its last list; times are [s] of a steady clock."""

    def __init__(self) -> None:
        self._told: dict[str, float] = {}
        self.again = math.inf  # when what was held back is due

    def told(self, uav_ids: Iterable[str], now: float) -> None:
        """They got lists."""
        self._told.update(dict.fromkeys(uav_ids, now))

    def ripe(self, held: Mapping[str, UavList], new: Mapping[str, UavList],
             urgent: Callable[[str], bool], now: float, interval: float) -> dict[str, UavList]:
        """The new lists less those that have to wait, together with all they exchange with.

        A list waits where a UAV concerned got one less than `interval` ago, unless what one of
        them has is `urgent` to replace.
        """
        found = dict(new)
        self.again = math.inf
        routes = ({uav_id: each.task_ids for uav_id, each in lists.items()}
                  for lists in (held, new))
        for group in exchanges(*routes):
            age = now - max(self._told.get(uav_id, -math.inf) for uav_id in group)
            if age < interval and not any(map(urgent, group)):
                self.again = min(self.again, now + interval - age)
                for uav_id in group:
                    found.pop(uav_id, None)
        return found

    def due(self, now: float) -> bool:
        """What was held back may be told now; asked once."""
        if now < self.again:
            return False
        self.again = math.inf
        return True
