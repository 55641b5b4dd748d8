# SPDX-License-Identifier: Apache-2.0
"""Ended tasks and work are forgotten beyond a number, the oldest first; those in lists stay."""
from __future__ import annotations

from uav_task_alloc.allocator.state.published_lists import PublishedLists
from uav_task_alloc.allocator.state.tasks import TaskRegistry
from uav_task_alloc.allocator.state.works import Works


class EndedTasks:
    """Bounds what is kept of ended tasks.

    Args:
        tasks, works, lists: the present state, of which they are removed.
    """

    def __init__(self, tasks: TaskRegistry, works: Works, lists: PublishedLists) -> None:
        self._tasks, self._works, self._lists = tasks, works, lists
        self._applied = -1, -1  # `keep`, and how many had ended when it was applied

    def forget_oldest(self, keep: int) -> None:
        """Remove the oldest ended tasks, and ended work with its pieces.

        Args:
            keep: ended points that stay, and as many pieces of ended work.
        """
        count = len(self._tasks.ended)
        if count <= keep or (keep, count) == self._applied:
            return
        listed = self._lists.owners()
        gone = self._works.forget_ended(keep, listed)
        self._lists.forget_tasks(gone | self._tasks.forget_ended(
            keep, {*listed, *self._works.all_pieces()}))
        self._applied = keep, len(self._tasks.ended)
