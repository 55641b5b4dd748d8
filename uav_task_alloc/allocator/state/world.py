# SPDX-License-Identifier: Apache-2.0
"""The world as it is heard of: events in, refusals back, and what asks for a new plan noted.

`now` is [s] of a steady clock, for silence and settling; `stamp` is [s] of the clock that
people read, for what is published.
"""
from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from typing import TYPE_CHECKING

from uav_task_alloc.allocator.persistence.restore import Saved
from uav_task_alloc.allocator.records import (
    AnnouncementAction,
    LogNote,
    Outbox,
    TaskEvent,
    TaskEventKind,
    TaskState,
    TaskVerdict,
    UavReport,
)
from uav_task_alloc.allocator.replanning.schedule import Schedule
from uav_task_alloc.allocator.state import admission, zone_checks as zone_watch
from uav_task_alloc.allocator.state.fleet import Fleet, UavRecord, jump, may_fly, news_of
from uav_task_alloc.allocator.state.published_lists import PublishedLists
from uav_task_alloc.allocator.state.task_state_machine import TaskTransition as Life
from uav_task_alloc.allocator.state.tasks import UNCHANGED, TaskBook
from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.model import Point, Task, ThreatZone
from uav_task_alloc.params import AllocatorParams

if TYPE_CHECKING:  # it brings the compiler along, which a start must not wait for
    from uav_task_alloc.allocator.replanning.safe_paths import SafePaths

MOST_NOTES = 10_000  # lines that wait for the log
ANSWER = 1.0  # [s] between two lists told again for old events
_LOOK = 0.5  # [s] between two looks at the way ahead of a UAV


class World:
    """Tasks, UAVs, zones and published lists, and the schedule of what happened."""

    def __init__(self, params: AllocatorParams, saved: Saved) -> None:
        self.params = params
        self.tasks = TaskBook(saved.tasks)
        self.fleet = Fleet(saved.off, {
            record.uav: record.task.id for record in saved.tasks
            if record.state is TaskState.ACTIVE})
        self.lists = PublishedLists(saved.lists, (record.task.id for record in saved.tasks))
        self.zones = {zone.id: zone for zone in saved.zones}
        self.revision = saved.revision
        self.dirty: set[str] = set()  # rows that are not yet on disk: 'zones', 'off', ...
        self.schedule = Schedule()
        self.version = 0
        self.outbox = Outbox()
        self.again: set[str] = set()  # UAVs to be told their lists once more
        self.cautious = False  # shortly after a restart: tasks stay where they are
        self.awake = False  # the kernels are compiled: looking at zones is quick
        self._ways: SafePaths | None = None
        self.looked: dict[str, float] = {}
        self.answered: dict[str, float] = {}  # [s] when a list was told again for an old event
        # the zones and the home as they were when a UAV's list was laid
        self.laid: dict[str, tuple[SafePaths, Point]] = {}
        self.looked_at_all = True  # no zone is new
        self.stranded: dict[str, str] = {}  # why a UAV has no safe way home
        self.full = ''  # why no UAV is admitted
        self.began = self.next_look = 0.0  # [s] first look for UAVs to forget; the next one
        self._old = {each.uav: each for each in saved.lists if each.stops}

    def announce(self, action: AnnouncementAction, tasks: Iterable[Task], stamp: float,
                 now: float) -> list[TaskVerdict]:
        """ADD or UPDATE tasks."""
        take = self.tasks.add if action is AnnouncementAction.ADD else self.tasks.update
        return self._judged(action, [take(task, stamp) for task in tasks], now)

    def cancel(self, task_ids: Iterable[str], stamp: float, now: float) -> list[TaskVerdict]:
        """Withdraw tasks."""
        return self._judged(AnnouncementAction.CANCEL,
                            [self.tasks.cancel(task_id, stamp) for task_id in task_ids], now)

    def refuse(self, task_id: str, reason: str, stamp: float) -> TaskVerdict:
        """A task that is none: its status says so unless an accepted one has that id."""
        verdict = self.tasks.reject(task_id, reason, stamp)
        self.outbox.statuses = True
        self.note(f'task {task_id!r} REJECTED: {reason}', warning=True)
        return verdict

    def _judged(
        self, action: AnnouncementAction, verdicts: list[TaskVerdict], now: float
    ) -> list[TaskVerdict]:
        repeated = [v.task_id for v in verdicts if v.unchanged]
        if repeated:
            self.note(f'{action.name} of {_some(repeated)} ignored: {UNCHANGED}')
        for verdict in verdicts:
            if not verdict.accepted:
                self.note(f'{action.name} of task {verdict.task_id!r} REJECTED: '
                          f'{verdict.reason}', warning=True)
            elif not verdict.unchanged:
                self.touch(f'{action.name} {verdict.task_id}', now)
        self.outbox.statuses = True
        return verdicts

    def hear(self, report: UavReport, now: float, stamp: float) -> str:
        """A UAV says how it is; returns why that is refused, '' when it is not."""
        uav_id = report.uav_id
        if uav_id not in self.fleet.records and not admission.admit(self, uav_id):
            return (f'uav_id = {uav_id!r}: expected one of the {admission.MOST_UAVS} UAVs known '
                    'already')
        active = self.fleet.active.get(uav_id)
        before = self.fleet.hear(report, now, self.params.battery_reserve)
        self._catch_up(report, stamp)
        for news in news_of(before, self.fleet.records[uav_id]):
            self.note(f'{uav_id} {news}')
            self.touch(f'{uav_id} {news}', now)
        self._look_for_jumps(before, report, now)
        if before is None or active != self.fleet.active.get(uav_id):
            self.outbox.statuses = True
        admission.prove(self, report)
        if self.lists.learn(uav_id, report.list_revision):
            self.again.add(uav_id)
        if self.awake and now - self.looked.get(uav_id, -_LOOK) >= _LOOK:
            self.looked[uav_id] = now
            zone_watch.look_ahead(self, uav_id, now)
        return ''

    def _look_for_jumps(self, before: UavRecord | None, report: UavReport, now: float) -> None:
        """A position that cannot have been flown to is believed, told once, and planned for."""
        speed = report.cruise_speed or self.params.default_cruise_speed
        metres = jump(before, report, now, speed, self.params.position_jump)
        if before is None or not metres:
            return
        if now - before.jumped > self.params.uav_timeout:
            self.note(f'{report.uav_id} jumped by {metres:.0f} m', warning=True)
        self.fleet.set_jumped(report.uav_id, now)
        self.touch(f'{report.uav_id} jumped', now)

    def _catch_up(self, report: UavReport, stamp: float) -> None:
        """After a restart: what comes before the task it flies was flown while nobody heard."""
        old = self._old.pop(report.uav_id, None)
        # told again it has the next revision, which the UAV may know already
        if (old is None or report.list_revision - old.revision not in (0, 1)
                or report.active_task not in old.task_ids):
            return
        for task_id in old.task_ids[:old.task_ids.index(report.active_task)]:
            record = self.tasks.records.get(task_id)
            if record is not None and record.open:
                self.tasks.step(task_id, Life.COMPLETE, stamp, report.uav_id,
                                'passed while nobody listened')
                self.note(f'{task_id} COMPLETED while nobody listened: {report.uav_id} flies '
                          f'{report.active_task}')

    def event(self, event: TaskEvent, stamp: float, now: float) -> str:
        """What became of a task; returns why that is refused, '' when it is not."""
        place = f'event {event.kind.name} of task {event.task_id!r}'
        why = self._why_not(event, now) or self._take_event(event, stamp)
        if why:
            return f'{place}: {why}'
        self.fleet.proven.add(event.uav_id)
        if event.kind is TaskEventKind.STARTED:
            self.fleet.active[event.uav_id] = event.task_id
        elif event.task_id not in self.lists.get(event.uav_id).task_ids[:1]:
            self.touch(f'{event.task_id} {event.kind.name} out of turn', now)
        elif event.kind is TaskEventKind.FAILED:
            self.touch(f'{event.task_id} FAILED', now)
        self.outbox.statuses = True
        return ''

    def _answer(self, event: TaskEvent, now: float) -> None:
        """A UAV has flown an earlier task of that id: the list once more says that this is new."""
        held = self.lists.get(event.uav_id)
        if (event.kind is TaskEventKind.COMPLETED and event.revision < held.revision
                and event.task_id in held.task_ids
                and now - self.answered.get(event.uav_id, -ANSWER) >= ANSWER):
            self.answered[event.uav_id] = now
            self.again.add(event.uav_id)

    def _why_not(self, event: TaskEvent, now: float) -> str:
        if event.task_id not in self.tasks.records:
            return 'unknown task'
        if event.uav_id not in self.fleet.records and event.uav_id not in self.lists.lists:
            return f'unknown UAV {event.uav_id!r}'
        if not self.lists.carried(event.uav_id, event.task_id, event.revision):
            self._answer(event, now)
            return f'revision {event.revision} of the list of {event.uav_id} did not have it'
        return ''

    def _take_event(self, event: TaskEvent, stamp: float) -> str:
        """By the table of `life`."""
        has_it = event.task_id in self.lists.get(event.uav_id).task_ids
        if event.kind is TaskEventKind.FAILED and has_it:
            return self._failed(event, stamp)
        life = {
            TaskEventKind.STARTED: (Life.START_MOVED, Life.START),
            TaskEventKind.FAILED: (Life.FAIL_MOVED,),
            TaskEventKind.COMPLETED: (Life.COMPLETE_MOVED, Life.COMPLETE),
        }[event.kind][has_it]
        return self.tasks.step(event.task_id, life, stamp, event.uav_id)

    def _failed(self, event: TaskEvent, stamp: float) -> str:
        """Another UAV may try, until nobody is left or it was tried often enough."""
        record, why = self.tasks.records[event.task_id], event.reason or 'no reason given'
        failed_on = tuple(dict.fromkeys((*record.failed_on, event.uav_id)))
        if not any(may_fly(record.task, failed_on, known.report)
                   for known in self.fleet.records.values()):
            life, why = Life.FAIL_LAST, f'{why}; no other UAV can'
        elif len(failed_on) >= self.params.max_attempts:
            life, why = Life.FAIL_LAST, f'{why}; tried often enough'
        else:
            life = Life.FAIL
        return self.tasks.step(event.task_id, life, stamp, event.uav_id, why,
                               failed_on=failed_on)

    def set_zones(self, zones: Sequence[ThreatZone], bad: Collection[str], now: float) -> None:
        """The whole picture; a zone whose new form is bad stays as it was."""
        new = {zone_id: zone for zone_id, zone in self.zones.items() if zone_id in bad}
        new.update((zone.id, zone) for zone in zones)
        if new == self.zones:
            return
        changed = [i for i in {**self.zones, **new} if self.zones.get(i) != new.get(i)]
        self.zones, self._ways = new, None
        self.dirty.add('zones')
        self.looked_at_all = False
        self.note(f'zones changed: {_some(changed)}')
        self.touch(f'zones {_some(changed)}', now)

    def set_available(self, uav_id: str, available: bool, now: float) -> str:
        """An operator's word, which stands until he takes it back; '' or why not."""
        if uav_id not in self.fleet.records and uav_id not in self.lists.lists:
            return str(InvalidValue('uav_id', uav_id, 'a UAV that was heard'))
        if available == (uav_id not in self.fleet.off):
            return ''
        (self.fleet.off.discard if available else self.fleet.off.add)(uav_id)
        self.dirty.add('off')
        self.touch(f'{uav_id} {"available" if available else "not available"}', now)
        return ''

    def look_for_silence(self, now: float) -> None:
        """Those not heard for `uav_timeout` lose their tasks to the others."""
        for uav_id in self.fleet.fall_silent(now, self.params.uav_timeout):
            if self.fleet.records[uav_id].report.available:
                self.note(f'{uav_id} silent for {self.params.uav_timeout:g} s: '
                          'its tasks go to the others', warning=True)
                self.touch(f'{uav_id} silent', now)

    def touch(self, trigger: str, now: float) -> None:
        """The plan is not for this world any more."""
        self.version += 1
        self.schedule.touch(trigger, now)

    def note(self, text: str, warning: bool = False) -> None:
        """A line for the log."""
        if len(self.outbox.notes) >= MOST_NOTES:
            return
        self.outbox.notes.append(LogNote(warning, text))

    def ways(self) -> SafePaths:
        """The ways around the zones as they are now."""
        from uav_task_alloc.allocator.replanning.safe_paths import SafePaths
        if self._ways is None or self._ways.params is not self.params:
            self._ways = SafePaths(tuple(self.zones.values()), self.params)
        return self._ways

    def stands(self, uav_id: str, tasks: Sequence[Task]) -> bool:
        """The list in force is this route, and its ways are as good as when they were laid."""
        stops, ways = self.lists.get(uav_id).stops, self.ways()
        record = self.fleet.records[uav_id]
        return (bool(stops) and self.laid.get(uav_id) == (ways, record.home)
                and not record.caught
                and [stop.task for stop in stops] == tasks
                and ways.rest(record.report.position, stops[0].leg,
                              stops[0].task.position) is not None)

    def locked(self) -> dict[str, tuple[str, ...]]:
        """What is being flown, and what comes next as far as committed: it stays as it is."""
        owners, found = self.lists.owners(), dict[str, tuple[str, ...]]()
        seen: set[str] = set()
        for uav_id in filter(self.fleet.usable, self.fleet.records):
            first = self.fleet.active.get(uav_id, '')
            if first in seen or owners.get(first, uav_id) != uav_id:
                first = ''  # another one has it
            kept = tuple(t for t in self._committed(uav_id, first) if self._can(uav_id, t))
            seen.update(kept)
            found[uav_id] = kept
        return {uav_id: kept for uav_id, kept in found.items() if kept}

    def _committed(self, uav_id: str, first: str) -> tuple[str, ...]:
        """The tasks that stay with a UAV, the one it flies first; all shortly after a restart."""
        held = self.lists.get(uav_id).task_ids
        if self.cautious:
            return (*filter(None, (first,)), *(t for t in held if t != first))
        if not first or not self._can(uav_id, first):
            return ()
        after = held[held.index(first) + 1:] if first in held else ()
        return (first, *(t for t in after if self._can(uav_id, t)))[:self.params.locked_tasks]

    def _can(self, uav_id: str, task_id: str) -> bool:
        record = self.tasks.records.get(task_id)
        return record is not None and record.open and may_fly(
            record.task, record.failed_on, self.fleet.records[uav_id].report)


def _some(names: Sequence[str]) -> str:
    return ', '.join(names[:5]) + (f' and {len(names) - 5} more' if len(names) > 5 else '')
