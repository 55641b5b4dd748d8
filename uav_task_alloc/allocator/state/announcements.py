# SPDX-License-Identifier: Apache-2.0
"""Announcements: points go to the task registry, work of other kinds to the works; and the log."""
from __future__ import annotations

import math
from collections.abc import Iterable

from uav_task_alloc.allocator.records import (
    AnnouncementAction,
    TaskEvent,
    TaskEventKind,
    TaskRecord,
    TaskState,
    TaskVerdict,
)
from uav_task_alloc.allocator.state.callbacks import Note, RequestReplan
from uav_task_alloc.allocator.state.deadlines import Deadlines
from uav_task_alloc.allocator.state.ground import Ground
from uav_task_alloc.allocator.state.published_lists import PublishedLists
from uav_task_alloc.allocator.state.seen_tasks import SeenTasks
from uav_task_alloc.allocator.state.tasks import TaskRegistry, verdict_texts
from uav_task_alloc.allocator.state.works import Works
from uav_task_alloc.errors import InvalidValue, first_of
from uav_task_alloc.model import Task
from uav_task_alloc.terrain import TerrainError
from uav_task_alloc.work.pieces import Work

_REPEATED = 60.0  # [s] in which a line that is repeated is left out
_MOST_LINES = 1000  # that are remembered for it


class Announcements:
    """Applies announcements; each id is that of a point or of other work, never of both.

    `recut_why`: why all open work is to be cut again; '' for not. `seen`: where new tasks were
    announced.

    Args:
        tasks, works, deadlines: the present state.
        ground: below the tasks.
        note, request_replan: of the world.
        recut_why: at the start.
        seen: announcements of the previous run.

    Arguments of methods:
        action: ADD or UPDATE.
        items: as announced.
        verdicts: on announced tasks.
        task_id, task_ids: as announced.
        stamp: [s] clock of the node.
        now: [s] steady clock.
    """

    def __init__(self, tasks: TaskRegistry, works: Works, deadlines: Deadlines, ground: Ground,
                 note: Note, request_replan: RequestReplan, recut_why: str = '',
                 seen: SeenTasks | None = None) -> None:
        self._tasks, self._works, self._deadlines = tasks, works, deadlines
        self._ground = ground
        self._note, self._request_replan = note, request_replan
        self.recut_why, self.seen = recut_why, seen or SeenTasks()
        self._written: dict[str, float] = {}  # lines of what changed nothing, and their times [s]

    def apply(self, action: AnnouncementAction, items: Iterable[Task | Work], stamp: float,
              now: float) -> list[TaskVerdict]:
        """ADD or UPDATE; returns a verdict for each."""
        add = action is AnnouncementAction.ADD
        verdicts = []
        for given in items:
            try:
                item = self._ground.resolved(given)
            except (InvalidValue, TerrainError) as error:
                verdicts.append(self._rejected(given, str(error), stamp))
                continue
            if isinstance(item, Work):
                verdicts.append((self._works.add if add else self._works.update)(item, stamp))
            elif item.id in self._works.records:
                verdicts.append(self._works.refuse_point(item.id))
            else:
                verdicts.append(self._deadlines.refused(item, stamp) or (
                    self._tasks.add if add else self._tasks.update)(item, stamp))
            if add and verdicts[-1].accepted and not verdicts[-1].unchanged:
                self.seen.add(item, stamp)
        return self._logged(action, verdicts, stamp, now)

    def cancel(self, task_ids: Iterable[str], stamp: float, now: float) -> list[TaskVerdict]:
        """Withdraw tasks; returns a verdict for each."""
        return self._logged(AnnouncementAction.CANCEL, [
            (self._works if task_id in self._works.records else self._tasks).cancel(task_id, stamp)
            for task_id in task_ids], stamp, now)

    def refuse(self, task_id: str, reason: str, stamp: float) -> TaskVerdict:
        """Refuse an invalid task; its status is REJECTED unless an accepted task has that id."""
        self._note_once(f'task {task_id!r} REJECTED: {reason}', True, stamp)
        if task_id in self._works.records:
            return TaskVerdict(task_id, False, reason)
        return self._tasks.reject(task_id, reason, stamp)

    def change_statuses(self, verdicts: Iterable[TaskVerdict]) -> bool:
        """Return whether the statuses differ: a refusal of a task that is known is in none."""
        return any(not verdict.unchanged and (
            verdict.accepted or verdict.task_id in self._tasks.rejected) for verdict in verdicts)

    def _rejected(self, item: Task | Work, why: str, stamp: float) -> TaskVerdict:
        """Reject what has no place above the ground."""
        task_id = item.task.id if isinstance(item, Work) else item.id
        if task_id in self._works.records:
            return TaskVerdict(task_id, False, why)
        return self._tasks.reject(task_id, why, stamp)

    def cut_again(self, stamp: float) -> bool:
        """Cut all open work again where that is due; returns whether any has changed."""
        why, self.recut_why = self.recut_why, ''
        changed = self._works.recut_all(stamp, why) if why else []
        if changed:
            self._note(f'{first_of(changed)} cut again: {why}')
        return bool(changed)

    def flown_before_cut(self, event: TaskEvent, lists: PublishedLists, stamp: float,
                         now: float) -> bool:
        """Count a piece that was flown while it was cut into others; returns whether it is one.

        Args:
            event: as reported.
            lists: published for the UAVs.
        """
        if (event.kind is not TaskEventKind.COMPLETED or not self._works.is_replaced(event.task_id)
                or not lists.contained(event.uav_id, event.task_id, event.revision)):
            return False
        if self._works.flown_after_all(event.task_id, event.uav_id, stamp):
            self._note(f'task {event.task_id!r} completed by {event.uav_id} as it was cut before')
            self._request_replan(f'{event.task_id} COMPLETED', now)
        return True

    def known(self, task_id: str) -> TaskRecord | None:
        """Return an accepted task, or work as one; None where there is none of that id."""
        work = self._works.records.get(task_id)
        return self._works.whole_record(work)[0] if work else self._tasks.records.get(task_id)

    def why_ended(self, task_id: str) -> str:
        """Return why no UAV can get a task any more; '' for one that may be tried."""
        work = self._works.records.get(task_id)
        if work is None:
            return self._tasks.why_ended(task_id)
        state = self._works.state(work)
        return f'{task_id} is {state.name}' if state in (
            TaskState.COMPLETED, TaskState.CANCELLED) else ''

    def _note_once(self, text: str, warning: bool, stamp: float) -> None:
        """Log what changed nothing; an announcer may repeat it many times a second."""
        if 0.0 <= stamp - self._written.get(text, math.inf) < _REPEATED:
            return
        self._note(text, warning)
        self._written.pop(text, None)
        self._written[text] = stamp
        if len(self._written) > _MOST_LINES:
            del self._written[next(iter(self._written))]

    def _logged(self, action: AnnouncementAction, verdicts: list[TaskVerdict], stamp: float,
                now: float) -> list[TaskVerdict]:
        for text, warning, changed in verdict_texts(action, verdicts):
            if changed:
                self._note(text, warning)
            else:
                self._note_once(text, warning, stamp)
        for verdict in verdicts:
            if verdict.accepted and not verdict.unchanged:
                self._request_replan(f'{action.name} {verdict.task_id}', now)
        return verdicts
