# SPDX-License-Identifier: Apache-2.0
"""The task registry: accepted tasks with their states, and refused ones with the reason."""
from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Any

from uav_task_alloc.allocator.records import (
    AnnouncementAction,
    TaskRecord,
    TaskState,
    TaskVerdict,
)
from uav_task_alloc.allocator.state.task_state_machine import TaskTransition, rule_for
from uav_task_alloc.errors import first_of
from uav_task_alloc.model import Task

MAX_OPEN = 20_000  # open tasks; more are refused
_MAX_REJECTED = 1000  # refusals kept, the newest
UNCHANGED = 'duplicate: announced before, unchanged'
_HAS_UAV = frozenset({TaskState.ASSIGNED, TaskState.ACTIVE, TaskState.COMPLETED,
                      TaskState.FAILED})


class TaskRegistry:
    """Accepted tasks by id, and refused ids that no accepted task has.

    Args:
        records: restored from the journal.

    Arguments of methods:
        reason: of a refusal, for users.
        task: as announced.
        task_id, task_ids: as announced, or of pieces.
        stamp: [s] clock of the node.
        uav: id of a UAV.
    """

    def __init__(self, records: Iterable[TaskRecord] = ()) -> None:
        self.records = {record.task.id: record for record in records}
        self.rejected: dict[str, tuple[str, float]] = {}  # id -> reason, stamp [s]
        self.unsaved: set[str] = set()  # not yet on disk
        # in the order in which they ended; after a restart by the stamp of their state
        self.ended = {record.task.id: None for record in sorted(
            self.records.values(), key=lambda record: record.stamp) if not record.open}

    def is_open(self, task_id: str) -> bool:
        """Return whether a task is accepted and still to be done."""
        record = self.records.get(task_id)
        return record is not None and record.open

    def why_ended(self, task_id: str) -> str:
        """Return why no UAV can get a task any more: it ended; '' for one that may be tried."""
        record = self.records.get(task_id)
        if record is None:
            return f'{task_id} is forgotten'
        return f'{task_id} is {record.state.name}' if record.state in (
            TaskState.COMPLETED, TaskState.CANCELLED) else ''

    @property
    def open_count(self) -> int:
        """How many tasks are still to be done; O(1)."""
        return len(self.records) - len(self.ended)

    def open(self) -> list[TaskRecord]:
        """Return the tasks still to be done."""
        return [record for record in self.records.values() if record.open]

    def add(self, task: Task, stamp: float) -> TaskVerdict:
        """Accept a new task; a replay changes nothing, another task with a known id is refused."""
        known = self.records.get(task.id)
        if known is None and self.open_count >= MAX_OPEN:
            return self._no_room(task, stamp)
        if known is None:
            self.add_new(task, stamp)
            return TaskVerdict(task.id, True)
        ended = '' if known.open else f': it is {known.state.name}'
        if task in (known.task, known.announced):
            return TaskVerdict(task.id, True, UNCHANGED + ended)
        return TaskVerdict(task.id, False,
                       f'duplicate id: another task was announced under it{ended}')

    def add_new(self, task: Task, stamp: float) -> None:
        """Record a task of a new id, as a piece for which there is room."""
        rule = rule_for(TaskState.REJECTED, TaskTransition.ADD)
        self.rejected.pop(task.id, None)
        self._put(TaskRecord(task, task, stamp=stamp, reason=rule.reason, since=stamp))

    def _no_room(self, task: Task, stamp: float) -> TaskVerdict:
        return self.reject(task.id, f'open tasks = {MAX_OPEN}: expected fewer', stamp)

    def add_completed(self, task: Task, uav: str, stamp: float) -> None:
        """Record a new task that is completed already, by that UAV; also where no more is open."""
        self._put(TaskRecord(task, task, stamp=stamp, since=stamp))
        self.step(task.id, TaskTransition.COMPLETE, stamp, uav)

    def update(self, task: Task, stamp: float) -> TaskVerdict:
        """Replace the content of an open task, or of a failed one, which is tried again."""
        known = self.records.get(task.id)
        if known is not None and task == known.task and known.open:
            return TaskVerdict(task.id, True, UNCHANGED)
        if (known is not None and known.state is TaskState.FAILED
                and self.open_count >= MAX_OPEN):
            return self._no_room(task, stamp)
        why = self.step(task.id, TaskTransition.UPDATE, stamp, known.uav if known else '',
                        known.reason if known else '', task=task, failed_on=())
        return self._verdict(task.id, why, stamp)

    def cancel(self, task_id: str, stamp: float) -> TaskVerdict:
        """Withdraw an open task; a repeated withdrawal is accepted."""
        known = self.records.get(task_id)
        if known is not None and known.state is TaskState.CANCELLED:
            return TaskVerdict(task_id, True, UNCHANGED)
        return self._verdict(task_id, self.step(task_id, TaskTransition.CANCEL, stamp), stamp)

    def _verdict(self, task_id: str, why: str, stamp: float) -> TaskVerdict:
        return self.reject(task_id, why, stamp) if why else TaskVerdict(task_id, True)

    def step(self, task_id: str, event: TaskTransition, stamp: float, uav: str = '', why: str = '',
             **changes: Any) -> str:
        """Apply an event to a task by the table of `task_state_machine`.

        Args:
            task_id: of the task; an unknown one is REJECTED.
            event: what happened.
            stamp: [s]; stored if the record changes.
            uav: that the event is about.
            why: reason of the event.
            changes: more fields of the record.

        Returns:
            Why the event changes nothing; '' if it was applied.
        """
        known = self.records.get(task_id)
        rule = rule_for(known.state if known else TaskState.REJECTED, event, uav, why)
        if rule.state is None or known is None:
            return rule.reason
        changes |= {'state': rule.state, 'reason': rule.reason,
                    'uav': uav if rule.state in _HAS_UAV else ''}
        if any(getattr(known, name) != value for name, value in changes.items()):
            self._put(replace(known, stamp=stamp, **changes))
        return ''

    def clock_began(self, stamp: float) -> None:
        """Date tasks that were announced while the clock was 0 from its first time."""
        for record in list(self.records.values()):
            if record.since == 0.0:
                self._put(replace(record, since=stamp, stamp=max(record.stamp, stamp)))

    def reject(self, task_id: str, reason: str, stamp: float) -> TaskVerdict:
        """Refuse a task; its status is REJECTED unless an accepted task has that id."""
        if task_id not in self.records:
            self.rejected.pop(task_id, None)
            self.rejected[task_id] = (reason, stamp)
            while len(self.rejected) > _MAX_REJECTED:
                del self.rejected[next(iter(self.rejected))]
        return TaskVerdict(task_id, False, reason)

    def _put(self, record: TaskRecord) -> None:
        self.records[record.task.id] = record
        self.unsaved.add(record.task.id)
        self.ended.pop(record.task.id, None)
        if not record.open:
            self.ended[record.task.id] = None

    def forget(self, task_ids: Iterable[str]) -> None:
        """Remove tasks, known or not."""
        for task_id in set(task_ids) & self.records.keys():
            del self.records[task_id]
            self.ended.pop(task_id, None)
            self.unsaved.add(task_id)

    def forget_ended(self, keep: int, listed: Collection[str]) -> set[str]:
        """Remove the oldest ended tasks.

        Args:
            keep: ended tasks that stay, the newest.
            listed: tasks that are still in a list, which stay, too.

        Returns:
            The ids removed.
        """
        kept = set(listed)
        free = [task_id for task_id in self.ended if task_id not in kept]
        old = set(free[:max(0, len(free) - keep)])
        self.forget(old)
        return old


def without_failed(record: TaskRecord, usable: frozenset[str]) -> Task:
    """Return a task that the UAVs which failed at it may not fly.

    Args:
        record: of the task.
        usable: UAVs that are left where the task allows all.

    Returns:
        The task itself where none has failed at it.
    """
    if not record.failed_on:
        return record.task
    allowed = usable if record.task.allowed_uavs is None else record.task.allowed_uavs
    return replace(record.task, allowed_uavs=allowed - frozenset(record.failed_on))


def verdict_texts(action: AnnouncementAction,
                  verdicts: Sequence[TaskVerdict]) -> Iterator[tuple[str, bool, bool]]:
    """The lines of the log about an announcement.

    Args:
        action: of all its tasks.
        verdicts: one for each task.

    Yields:
        Text, whether it is a warning, and whether something has changed.
    """
    repeated = [verdict.task_id for verdict in verdicts if verdict.unchanged]
    if repeated:
        yield f'{action.name} of {first_of(repeated)} ignored: {UNCHANGED}', False, False
    done = {AnnouncementAction.ADD: 'accepted', AnnouncementAction.UPDATE: 'updated',
            AnnouncementAction.CANCEL: 'cancelled'}[action]
    for verdict in verdicts:
        if not verdict.accepted:
            yield (f'{action.name} of task {verdict.task_id!r} REJECTED: {verdict.reason}', True,
                   False)
        elif not verdict.unchanged:
            yield f'task {verdict.task_id!r} {done}', False, True
