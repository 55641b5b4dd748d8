# SPDX-License-Identifier: Apache-2.0
"""The book of tasks: what is accepted, what is refused and why, and how each task ended."""
from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import replace
from typing import Any

from uav_task_alloc.allocator.records import TaskRecord, TaskState, TaskVerdict
from uav_task_alloc.allocator.state.task_state_machine import TaskTransition, after
from uav_task_alloc.model import Task

MOST_OPEN = 20_000  # tasks still to be done; more are refused
MOST_REJECTED = 1000  # refusals remembered, the newest
UNCHANGED = 'duplicate: announced before, unchanged'
OWNED = frozenset({TaskState.ASSIGNED, TaskState.ACTIVE, TaskState.COMPLETED, TaskState.FAILED})


class TaskBook:
    """Accepted tasks by id, and the refusals that no accepted task stands behind."""

    def __init__(self, records: Iterable[TaskRecord] = ()) -> None:
        self.records = {record.task.id: record for record in records}
        self.rejected: dict[str, tuple[str, float]] = {}  # id -> reason, stamp [s]
        self.dirty: set[str] = set()  # not yet on disk
        # in the order in which they ended, as far as a journal tells
        self.ended = {record.task.id: None for record in sorted(
            self.records.values(), key=lambda record: record.stamp) if not record.open}

    def open(self) -> list[TaskRecord]:
        """Those still to be done."""
        return [record for record in self.records.values() if record.open]

    def add(self, task: Task, stamp: float) -> TaskVerdict:
        """A new task. A replay of what is known changes nothing; a known id is no new task."""
        known = self.records.get(task.id)
        if known is None and len(self.records) - len(self.ended) >= MOST_OPEN:
            return self.reject(task.id, f'open tasks = {MOST_OPEN}: expected fewer', stamp)
        if known is None:
            rule = after(TaskState.REJECTED, TaskTransition.ADD)
            self.rejected.pop(task.id, None)
            self._put(TaskRecord(task, task, stamp=stamp, reason=rule.reason))
            return TaskVerdict(task.id, True)
        ended = '' if known.open else f': it is {known.state.name}'
        if task in (known.task, known.announced):
            return TaskVerdict(task.id, True, UNCHANGED + ended)
        return TaskVerdict(task.id, False,
                       f'duplicate id: another task was announced under it{ended}')

    def update(self, task: Task, stamp: float) -> TaskVerdict:
        """New content for an open task; a failed one gets another chance."""
        known = self.records.get(task.id)
        if known is not None and task == known.task and known.open:
            return TaskVerdict(task.id, True, UNCHANGED)
        why = self.step(task.id, TaskTransition.UPDATE, stamp, known.uav if known else '',
                        known.reason if known else '', task=task, failed_on=())
        return self._verdict(task.id, why, stamp)

    def cancel(self, task_id: str, stamp: float) -> TaskVerdict:
        """Withdraw an open task; once more is harmless."""
        known = self.records.get(task_id)
        if known is not None and known.state is TaskState.CANCELLED:
            return TaskVerdict(task_id, True, UNCHANGED)
        return self._verdict(task_id, self.step(task_id, TaskTransition.CANCEL, stamp), stamp)

    def _verdict(self, task_id: str, why: str, stamp: float) -> TaskVerdict:
        return self.reject(task_id, why, stamp) if why else TaskVerdict(task_id, True)

    def step(self, task_id: str, event: TaskTransition, stamp: float, uav: str = '', why: str = '',
             **changes: Any) -> str:
        """What the event makes of a task, by the table; returns why nothing, '' if it counts.

        `changes` are more fields of its record. The stamp moves only where something is new.
        """
        known = self.records.get(task_id)
        rule = after(known.state if known else TaskState.REJECTED, event, uav, why)
        if rule.state is None or known is None:
            return rule.reason
        changes |= {'state': rule.state, 'reason': rule.reason,
                    'uav': uav if rule.state in OWNED else ''}
        if any(getattr(known, name) != value for name, value in changes.items()):
            self._put(replace(known, stamp=stamp, **changes))
        return ''

    def reject(self, task_id: str, reason: str, stamp: float) -> TaskVerdict:
        """Refuse; the status says so unless an accepted task has that id."""
        if task_id not in self.records:
            self.rejected.pop(task_id, None)
            self.rejected[task_id] = (reason, stamp)
            while len(self.rejected) > MOST_REJECTED:
                del self.rejected[next(iter(self.rejected))]
        return TaskVerdict(task_id, False, reason)

    def _put(self, record: TaskRecord) -> None:
        self.records[record.task.id] = record
        self.dirty.add(record.task.id)
        self.ended.pop(record.task.id, None)
        if not record.open:
            self.ended[record.task.id] = None

    def forget(self, keep: int, listed: Collection[str]) -> set[str]:
        """Of the ended tasks only the newest `keep` stay, and those that are in a list still."""
        old = set(list(self.ended)[:max(0, len(self.ended) - keep)]) - set(listed)
        for task_id in old:
            del self.records[task_id], self.ended[task_id]
        self.dirty |= old
        return old
