# SPDX-License-Identifier: Apache-2.0
"""Tasks that were flown while the allocator was down, as the task under way shows."""
from __future__ import annotations

from collections.abc import Iterable

from uav_task_alloc.allocator.list_records import UavList
from uav_task_alloc.allocator.records import UavReport
from uav_task_alloc.allocator.state.callbacks import Note
from uav_task_alloc.allocator.state.task_state_machine import TaskTransition
from uav_task_alloc.allocator.state.tasks import TaskRegistry


class MissedCompletions:
    """Compares the first report of each UAV with its list of the previous run."""

    def __init__(self, lists: Iterable[UavList], tasks: TaskRegistry, note: Note) -> None:
        self._lists = {each.uav: each for each in lists if each.stops}
        self._tasks, self._note = tasks, note

    def complete(self, report: UavReport, stamp: float) -> None:
        """Complete the tasks of a list before the one that the UAV is flying."""
        previous = self._lists.pop(report.uav_id, None)
        # the list was resent under the next revision, which the UAV may have received already
        if (previous is None or report.list_revision - previous.revision not in (0, 1)
                or report.active_task not in previous.task_ids):
            return
        for task_id in previous.task_ids[:previous.task_ids.index(report.active_task)]:
            if self._tasks.is_open(task_id):
                self._tasks.step(task_id, TaskTransition.COMPLETE, stamp, report.uav_id,
                                 'passed while the allocator was down')
                self._note(f'{task_id} COMPLETED while the allocator was down: {report.uav_id} '
                           f'flies {report.active_task}')
