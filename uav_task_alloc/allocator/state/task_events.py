# SPDX-License-Identifier: Apache-2.0
"""Progress that UAVs report of tasks: checked against the lists, then applied to the registry."""
from __future__ import annotations

from collections.abc import Callable

from uav_task_alloc.allocator.records import TaskEvent, TaskEventKind
from uav_task_alloc.allocator.state.callbacks import Note, RequestReplan
from uav_task_alloc.allocator.state.fleet import Fleet, may_fly
from uav_task_alloc.allocator.state.published_lists import PublishedLists
from uav_task_alloc.allocator.state.task_state_machine import TaskTransition
from uav_task_alloc.allocator.state.tasks import TaskRegistry

_RESEND_PERIOD = 1.0  # [s] between two lists resent for events of old revisions


class TaskEvents:
    """Applies task events. `resend(uav_id)` has the list in force published again."""

    def __init__(self, tasks: TaskRegistry, fleet: Fleet, lists: PublishedLists,
                 request_replan: RequestReplan, resend: Callable[[str], None],
                 note: Note) -> None:
        self._tasks, self._fleet, self._lists = tasks, fleet, lists
        self._request_replan, self._resend, self._note = request_replan, resend, note
        self._resent: dict[str, float] = {}  # UAV -> [s] when its list was resent for an event

    def apply(self, event: TaskEvent, stamp: float, now: float, max_attempts: int) -> str:
        """Apply an event.

        Args:
            event: as reported.
            stamp: [s] published clock.
            now: [s] steady clock.
            max_attempts: UAVs on which a task may fail before it is FAILED.

        Returns:
            Why it was refused; '' if it was applied.
        """
        before = self._tasks.records.get(event.task_id)
        refusal = self._check(event, now) or self._step(event, stamp, max_attempts)
        if refusal:
            return f'event {event.kind.name} of task {event.task_id!r}: {refusal}'
        if self._tasks.records[event.task_id] != before:  # a bridge repeats its events
            self._note_progress(event)
        self._fleet.confirmed.add(event.uav_id)
        if event.kind is TaskEventKind.STARTED:
            self._fleet.active[event.uav_id] = event.task_id
        elif event.task_id not in self._lists.get(event.uav_id).task_ids[:1]:
            self._request_replan(f'{event.task_id} {event.kind.name} out of turn', now)
        elif event.kind is TaskEventKind.FAILED:
            self._request_replan(f'{event.task_id} FAILED', now)
        return ''

    def forget(self, uav_id: str) -> None:
        """Drop what is kept of a UAV."""
        self._resent.pop(uav_id, None)

    def _note_progress(self, event: TaskEvent) -> None:
        task, uav = f'task {event.task_id!r}', event.uav_id
        if event.kind is TaskEventKind.STARTED:
            self._note(f'{task} started by {uav}', debug=True)
        elif event.kind is TaskEventKind.COMPLETED:
            self._note(f'{task} completed by {uav}')
        else:
            final = '' if self._tasks.is_open(event.task_id) else ': it is FAILED'
            self._note(f'{task} failed on {uav}: {event.reason or "no reason given"}{final}',
                       warning=True)

    def _check(self, event: TaskEvent, now: float) -> str:
        """Why an event cannot be; '' if it can."""
        if event.task_id not in self._tasks.records:
            return 'unknown task'
        if event.uav_id not in self._fleet.records and event.uav_id not in self._lists.lists:
            return f'unknown UAV {event.uav_id!r}'
        if not self._lists.contained(event.uav_id, event.task_id, event.revision):
            self._resend_for_old(event, now)
            return f'revision {event.revision} of the list of {event.uav_id} did not have it'
        return ''

    def _resend_for_old(self, event: TaskEvent, now: float) -> None:
        """Resend the list to a UAV that completed an earlier task of the same id.

        The bridge then knows that the listed task is another one.
        """
        published = self._lists.get(event.uav_id)
        if (event.kind is TaskEventKind.COMPLETED and event.revision < published.revision
                and event.task_id in published.task_ids
                and now - self._resent.get(event.uav_id, -_RESEND_PERIOD) >= _RESEND_PERIOD):
            self._resent[event.uav_id] = now
            self._resend(event.uav_id)

    def _step(self, event: TaskEvent, stamp: float, max_attempts: int) -> str:
        """Apply the event by the table of `task_state_machine`."""
        has_it = event.task_id in self._lists.get(event.uav_id).task_ids
        if event.kind is TaskEventKind.FAILED and has_it:
            return self._fail(event, stamp, max_attempts)
        transition = {
            TaskEventKind.STARTED: (TaskTransition.START_MOVED, TaskTransition.START),
            TaskEventKind.FAILED: (TaskTransition.FAIL_MOVED,),
            TaskEventKind.COMPLETED: (TaskTransition.COMPLETE_MOVED, TaskTransition.COMPLETE),
        }[event.kind][has_it]
        return self._tasks.step(event.task_id, transition, stamp, event.uav_id)

    def _fail(self, event: TaskEvent, stamp: float, max_attempts: int) -> str:
        """Leave the task to other UAVs until none is left or `max_attempts` have failed."""
        record, why = self._tasks.records[event.task_id], event.reason or 'no reason given'
        failed_on = tuple(dict.fromkeys((*record.failed_on, event.uav_id)))
        transition = TaskTransition.FAIL
        # an order may end: that it keeps the others from the task does not make it FAILED
        if not any(may_fly(record.task, failed_on, uav.report)
                   for uav in self._fleet.records.values()):
            transition, why = TaskTransition.FAIL_LAST, f'{why}; no other UAV can'
        elif len(failed_on) >= max_attempts:
            transition, why = TaskTransition.FAIL_LAST, f'{why}; tried often enough'
        return self._tasks.step(event.task_id, transition, stamp, event.uav_id, why,
                                failed_on=failed_on)
