# SPDX-License-Identifier: Apache-2.0
"""The book of tasks: what is accepted, what is refused and why, and how each task ended."""
from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

from uav_task_alloc.allocator.records import TaskRecord, TaskState, Verdict
from uav_task_alloc.model import Task

MOST_REJECTED = 1000  # refusals remembered, the newest
UNCHANGED = 'duplicate: announced before, unchanged'


class TaskBook:
    """Accepted tasks by id, and the refusals that no accepted task stands behind."""

    def __init__(self, records: Iterable[TaskRecord] = ()) -> None:
        self.records = {record.task.id: record for record in records}
        self.rejected: dict[str, tuple[str, float]] = {}  # id -> reason, stamp [s]
        self.dirty: set[str] = set()  # not yet on disk

    def open(self) -> list[TaskRecord]:
        """Those still to be done."""
        return [record for record in self.records.values() if record.open]

    def add(self, task: Task, stamp: float) -> Verdict:
        """A new task. A replay of what is known changes nothing; a known id is no new task."""
        known = self.records.get(task.id)
        if known is None:
            self.rejected.pop(task.id, None)
            self._put(TaskRecord(task, task, stamp=stamp, reason='waits for the next plan'))
            return Verdict(task.id, True)
        ended = '' if known.open else f': it is {known.state.name}'
        if task in (known.task, known.announced):
            return Verdict(task.id, True, UNCHANGED + ended)
        return Verdict(task.id, False,
                       f'duplicate id: another task was announced under it{ended}')

    def update(self, task: Task, stamp: float) -> Verdict:
        """New content for an open task; a failed one gets another chance."""
        known = self.records.get(task.id)
        if known is None:
            return self.reject(task.id, 'unknown task: nothing to update', stamp)
        if known.state in (TaskState.COMPLETED, TaskState.CANCELLED):
            return Verdict(task.id, False, f'is {known.state.name}: nothing to update')
        if task == known.task and known.open:
            return Verdict(task.id, True, UNCHANGED)
        state = known.state if known.open else TaskState.PENDING
        self._put(replace(known, task=task, state=state, stamp=stamp, failed_on=()))
        return Verdict(task.id, True)

    def cancel(self, task_id: str, stamp: float) -> Verdict:
        """Withdraw an open task; once more is harmless."""
        known = self.records.get(task_id)
        if known is None:
            return self.reject(task_id, 'unknown task: nothing to cancel', stamp)
        if known.state is TaskState.COMPLETED:
            return Verdict(task_id, False, 'is COMPLETED: nothing to cancel')
        if known.state is TaskState.CANCELLED:
            return Verdict(task_id, True, UNCHANGED)
        self.change(task_id, stamp, state=TaskState.CANCELLED, uav='', reason='cancelled')
        return Verdict(task_id, True)

    def reject(self, task_id: str, reason: str, stamp: float) -> Verdict:
        """Refuse; the status says so unless an accepted task has that id."""
        if task_id not in self.records:
            self.rejected.pop(task_id, None)
            self.rejected[task_id] = (reason, stamp)
            while len(self.rejected) > MOST_REJECTED:
                del self.rejected[next(iter(self.rejected))]
        return Verdict(task_id, False, reason)

    def change(self, task_id: str, stamp: float, **changes: Any) -> bool:
        """Change fields of a record; the stamp moves only where something is different."""
        known = self.records[task_id]
        changed = replace(known, **changes)
        if changed == known:
            return False
        self._put(replace(changed, stamp=stamp))
        return True

    def fail(self, task_id: str, uav_id: str, reason: str, stamp: float) -> None:
        """A UAV could not do it: it waits for another one."""
        known = self.records[task_id]
        failed_on = known.failed_on + ((uav_id,) if uav_id not in known.failed_on else ())
        self.change(task_id, stamp, state=TaskState.PENDING, uav='', failed_on=failed_on,
                    reason=f'failed on {uav_id}: {reason or "no reason given"}')

    def _put(self, record: TaskRecord) -> None:
        self.records[record.task.id] = record
        self.dirty.add(record.task.id)
