# SPDX-License-Identifier: Apache-2.0
"""Tasks that were flown while the allocator was down, as the task under way shows."""
from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from uav_task_alloc.allocator.list_records import UavList
from uav_task_alloc.allocator.records import UavReport
from uav_task_alloc.allocator.state.callbacks import Note
from uav_task_alloc.allocator.state.task_state_machine import TaskTransition
from uav_task_alloc.allocator.state.tasks import TaskRegistry
from uav_task_alloc.model import Task


@dataclass(frozen=True, slots=True)
class _PassedTask:
    """A task of a list before the one that a UAV flies."""

    task: Task  # as it was then
    uav: str  # id
    flies: str  # id of the task under way
    stamp: float  # [s] of the report


class MissedCompletions:
    """Compares the first report of each UAV with its list of the previous run.

    A task that was passed may also have failed. The bridge repeats how the tasks of its list
    ended; one without such a report by the end of the hold after a restart was flown.

    Args:
        lists: of the previous run.
        tasks: the present state.
        note: of the world.
    """

    def __init__(self, lists: Iterable[UavList], tasks: TaskRegistry, note: Note) -> None:
        self._lists = {each.uav: each for each in lists if each.stops}
        self._tasks, self._note = tasks, note
        self._passed: list[_PassedTask] = []

    def observe(self, report: UavReport, stamp: float) -> None:
        """Note the tasks of a list before the one that its UAV is flying.

        Args:
            report: of a UAV; only its first one counts.
            stamp: [s] clock of the node.
        """
        previous = self._lists.pop(report.uav_id, None)
        # of another revision the order of the tasks is not known
        if (previous is None or report.list_revision != previous.revision
                or report.active_task not in previous.task_ids):
            return
        for task_id in previous.task_ids[:previous.task_ids.index(report.active_task)]:
            if self._tasks.is_open(task_id):
                self._passed.append(_PassedTask(self._tasks.records[task_id].task, report.uav_id,
                                                report.active_task, stamp))

    def complete(self, active: Mapping[str, str]) -> bool:
        """Complete the tasks that were passed; UAVs that report later are not compared.

        Args:
            active: by UAV id the task that it is known to fly.

        Returns:
            Whether there were any.
        """
        passed, self._passed = self._passed, []
        self._lists.clear()
        done = [each for each in passed if self._may_be_flown(each)
                and active.get(each.uav) != each.task.id]
        for each in done:
            self._tasks.step(each.task.id, TaskTransition.COMPLETE, each.stamp, each.uav,
                             'passed while the allocator was down')
            self._note(f'{each.task.id} COMPLETED while the allocator was down: {each.uav} '
                       f'flies {each.flies}')
        return bool(done)

    def _may_be_flown(self, each: _PassedTask) -> bool:
        record = self._tasks.records.get(each.task.id)
        return record is not None and record.open and record.task == each.task and (
            each.uav not in record.failed_on)
