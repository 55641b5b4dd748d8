# SPDX-License-Identifier: Apache-2.0
"""Which lists are published again without a new plan: shortened ones, and those to be resent."""
from __future__ import annotations

from uav_task_alloc.allocator.list_records import UavList
from uav_task_alloc.allocator.state.flights import Flights
from uav_task_alloc.allocator.state.published_lists import PublishedLists
from uav_task_alloc.allocator.state.tasks import TaskRegistry


class ListUpdates:
    """Follows the lists in force, as tasks of them end and UAVs report other lists.

    Args:
        tasks, lists, flights: the present state.

    Arguments of methods:
        stamp: [s] published clock.
    """

    def __init__(self, tasks: TaskRegistry, lists: PublishedLists, flights: Flights) -> None:
        self._tasks, self._lists, self._flights = tasks, lists, flights

    def shortened(self, stamp: float) -> dict[str, UavList]:
        """Return the lists of which only tasks at the front have ended, without those.

        Where a later one has, legs change: that is left to the next plan.
        """
        return {uav_id: self._without_ended(uav_id, stamp)
                for uav_id, each in self._lists.lists.items() if self._front_has_ended(each)}

    def to_resend(self, stamp: float) -> dict[str, UavList]:
        """Return the lists to publish again; one with a later ended task waits for a plan."""
        return {uav_id: self._lists.restamped(uav_id, stamp, self._flights.of(uav_id, stamp))
                for uav_id in sorted(self._lists.to_resend)
                if not any(map(self._ended, self._lists.get(uav_id).task_ids))}

    def of_previous_run(self, stamp: float) -> dict[str, UavList]:
        """Return all lists after a restart, without ended tasks, and before any plan.

        The bridges repeat how the tasks of their lists ended, for which a plan may come too
        late; and there is none for a UAV that may not be used.
        """
        return {uav_id: self._without_ended(uav_id, stamp)
                for uav_id in sorted(self._lists.to_resend)}

    def _front_has_ended(self, each: UavList) -> bool:
        """Whether tasks at the front of a list have ended, and no later ones."""
        ended = list(map(self._ended, each.task_ids))
        return ended[:1] == [True] and ended == sorted(ended, reverse=True)

    def _without_ended(self, uav_id: str, stamp: float) -> UavList:
        return self._lists.without_ended(uav_id, self._ended, stamp,
                                         self._flights.of(uav_id, stamp))

    def _ended(self, task_id: str) -> bool:
        return not self._tasks.is_open(task_id)
