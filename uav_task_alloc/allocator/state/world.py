# SPDX-License-Identifier: Apache-2.0
"""The state of the allocator: applies announcements, reports, events and zones; requests plans."""
from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence

from uav_task_alloc.allocator.list_records import LaterTrips, UavList
from uav_task_alloc.allocator.records import (
    AnnouncementAction,
    LogNote,
    Outbox,
    SavedState,
    TaskEvent,
    TaskEventKind,
    TaskRecord,
    TaskState,
    TaskVerdict,
    UavReport,
)
from uav_task_alloc.allocator.state.admission import Admission
from uav_task_alloc.allocator.state.airspace import Airspace
from uav_task_alloc.allocator.state.announcements import Announcements
from uav_task_alloc.allocator.state.callbacks import RequestReplan
from uav_task_alloc.allocator.state.deadlines import Deadlines
from uav_task_alloc.allocator.state.fleet import Fleet, UavRecord, replan_reasons
from uav_task_alloc.allocator.state.flights import Flights
from uav_task_alloc.allocator.state.ground import Ground
from uav_task_alloc.allocator.state.list_validity import ListValidity, ZonesWhenBuilt
from uav_task_alloc.allocator.state.locked_tasks import can_fly, locked_tasks
from uav_task_alloc.allocator.state.missed_completions import MissedCompletions
from uav_task_alloc.allocator.state.ordered_tasks import OrderedTasks
from uav_task_alloc.allocator.state.orders import Orders
from uav_task_alloc.allocator.state.position_jumps import PositionJumps
from uav_task_alloc.allocator.state.published_lists import PublishedLists
from uav_task_alloc.allocator.state.safe_paths import MakeSafePaths
from uav_task_alloc.allocator.state.seen_tasks import SeenTasks
from uav_task_alloc.allocator.state.task_events import TaskEvents
from uav_task_alloc.allocator.state.task_state_machine import TaskStep
from uav_task_alloc.allocator.state.tasks import TaskRegistry
from uav_task_alloc.allocator.state.works import Works
from uav_task_alloc.allocator.state.zone_checks import ZoneChecks
from uav_task_alloc.errors import InvalidValue, first_of
from uav_task_alloc.model import Point, Task, ThreatZone, Uav
from uav_task_alloc.params import AllocatorParams
from uav_task_alloc.terrain import Terrain
from uav_task_alloc.work.pieces import Work

_MAX_NOTES = 10_000  # log lines not yet collected


class World:
    """Tasks, UAVs, zones and published lists, and what is to be published or saved of them.

    Args:
        params: of the allocator.
        saved: what the journal restored.
        make_safe_paths: makes the paths around zones; called when they are first needed.
        on_change: called with (trigger, now) when a plan is required.
        terrain: the ground; None: none is known.

    Arguments of methods:
        action: ADD or UPDATE.
        tasks, task_id, task_ids: as announced; tasks of a list: in the order of flight.
        uav_id: of a UAV, known or not where the text does not say `known`.
        report, event: of a UAV.
        zones: the whole set.
        bad: ids of refused zones.
        lists: one a UAV, see `build_lists`.
        steps: events for tasks, see `task_steps`.
        now: [s] steady clock, for timeouts.
        stamp: [s] published clock of the node.
        reason, trigger, text: for the log.
        available: what an operator sets.
        warning, debug: its level in the log; otherwise information.
        kind: of a journal row.
        resend: publish unchanged lists, too.
    """

    def __init__(self, params: AllocatorParams, saved: SavedState,
                 make_safe_paths: MakeSafePaths, on_change: RequestReplan,
                 terrain: Terrain | None = None) -> None:
        self.params, self._on_change = params, on_change
        # of the allocation; and the first one with the lists in force
        self.revision = self.plan_revision = saved.revision
        self.version, self.outbox, self.proposal = 0, Outbox(), saved.proposal
        self.airspace = Airspace(saved.zones, lambda: self.params, make_safe_paths)
        paths = self.airspace.paths
        self.restart_hold = any(each.stops for each in saved.lists)  # no task changes its UAV
        self.kernels_ready = False  # compiled: checks of zones are fast
        self._unsaved: set[str] = set()  # rows not yet on disk: 'zones', 'off', ...
        self.later = LaterTrips()  # of the plan in force, after the lists
        self.stuck: frozenset[str] = frozenset()  # UAVs that wait for one that waits for them
        self.obstructed: dict[str, str] = {}  # why a task is put off, by its id
        self.tasks, self.orders = TaskRegistry(saved.tasks), Orders(saved.orders)
        self.fleet = Fleet(saved.switched_off, {
            record.uav: record.task.id for record in saved.tasks
            if record.state is TaskState.ACTIVE}, self.orders, saved.change_from)
        self.lists = PublishedLists(saved.lists, (record.task.id for record in saved.tasks))
        self.flights = Flights(self.fleet, self.lists, lambda: self.params)
        self.ordered = OrderedTasks(self.tasks, self.flights, self.fleet, self.lists, paths,
                                    self.uav)
        self.deadlines = Deadlines(self.tasks, self.fleet, self.flights)
        self.zone_checks = ZoneChecks(self.fleet, self.lists, paths, self.note,
                                      self.request_replan)
        self.validity = ListValidity(self.tasks, self.fleet, self.lists, paths, self.ordered,
                                     self.zone_checks.stranded)
        self.jumps = PositionJumps(lambda: self.params, self.note, self.request_replan)
        self.admission = Admission(self.fleet, self.lists, self.note, self.forget_uav)
        self.ground = Ground(terrain, self.airspace.no_fly_zones, lambda: self.params)
        self.works = Works(self.tasks, saved.works, self.ground.cut, self.deadlines.refusal)
        self.lists.forget_tasks({each.task.id for each in saved.tasks} - {*self.tasks.records})
        seen = SeenTasks(saved.seen_tasks.items(), lambda: self.params.anticipate != 'off')
        self.announced = Announcements(
            self.tasks, self.works, self.deadlines, self.ground, self.note, self.request_replan,
            'restart' if saved.works else '', seen)
        self._events = TaskEvents(self.tasks, self.fleet, self.lists, self.request_replan,
                                  self.lists.to_resend.add, self.note)
        self._missed = MissedCompletions(saved.lists, self.tasks, self.note)

    # inputs

    def announce(self, action: AnnouncementAction, tasks: Iterable[Task | Work], stamp: float,
                 now: float) -> list[TaskVerdict]:
        """ADD or UPDATE tasks; returns a verdict for each."""
        return self._answered(self.announced.apply(action, tasks, stamp, now))

    def cancel(self, task_ids: Iterable[str], stamp: float, now: float) -> list[TaskVerdict]:
        """Withdraw tasks; returns a verdict for each."""
        return self._answered(self.announced.cancel(task_ids, stamp, now))

    def _answered(self, verdicts: list[TaskVerdict]) -> list[TaskVerdict]:
        self.outbox.statuses |= self.announced.change_statuses(verdicts)
        return verdicts

    def refuse(self, task_id: str, reason: str, stamp: float) -> TaskVerdict:
        """Refuse an invalid task; its status is REJECTED unless an accepted task has that id."""
        return self._answered([self.announced.refuse(task_id, reason, stamp)])[0]

    def update_uav(self, report: UavReport, now: float, stamp: float) -> str:
        """Apply the report of a UAV; returns why the UAV is refused, '' if it is not.

        Raises:
            InvalidValue: it reports a list of a revision that is too great.
        """
        uav_id = report.uav_id
        self.lists.check_revision(uav_id, report.list_revision)
        if uav_id not in self.fleet.records and (refusal := self.admission.admit(uav_id)):
            return refusal
        active = self.fleet.active.get(uav_id)
        before = self.fleet.update(report, now, self.params.battery_reserve)
        self.flights.update(report, stamp)
        self._missed.observe(report, stamp)
        for reason in replan_reasons(before, self.fleet.records[uav_id], lambda: bool(
                {each.task.id for each in self.tasks.open()} - self.lists.owners().keys())):
            self.note(f'{uav_id} {reason}')
            self.request_replan(f'{uav_id} {reason}', now)
        self.jumps.check(before, report, now)
        if before is None or active != self.fleet.active.get(uav_id):
            self.outbox.statuses = True
        if before is None and (why := self.ground.differs(report)):
            self.note(why, warning=True)
        self.admission.confirm(report)
        self.lists.raise_revision(uav_id, report.list_revision)
        if self.kernels_ready:
            self.zone_checks.check_reported(uav_id, now)
        return ''

    def event(self, event: TaskEvent, stamp: float, now: float) -> str:
        """Apply the progress of a task; returns why it is refused, '' if it is not."""
        done = self.announced.flown_before_cut(event, self.lists, stamp, now)
        refusal = not done and self._events.apply(event, stamp, now, self.params.max_attempts)
        if not refusal and event.kind is TaskEventKind.COMPLETED:
            self.flights.completed(event.uav_id, event.task_id, stamp)
        self.outbox.statuses |= not refusal
        return refusal or ''

    def set_zones(self, zones: Sequence[ThreatZone], bad: Collection[str], now: float) -> None:
        """Replace all zones; those whose ids are in `bad` (refused) stay as they were."""
        changed = self.airspace.replace(zones, bad)
        if not changed:
            return
        self.mark_unsaved('zones')
        self.zone_checks.zones_changed()
        self.note(f'zones changed: {first_of(changed)}')
        self.announced.recut_why = 'zones changed'
        self.request_replan(f'zones {first_of(changed)}', now)

    def set_available(self, uav_id: str, available: bool, now: float) -> str:
        """Switch a UAV on or off; persists until changed. Returns an error text, '' on success."""
        if uav_id not in self.fleet.records and uav_id not in self.lists.lists:
            return str(InvalidValue('uav_id', uav_id, 'a known UAV'))
        off = self.fleet.switched_off
        if available == (uav_id not in off):
            return ''
        (off.discard if available else off.add)(uav_id)
        self.mark_unsaved('off')
        self.request_replan(f'{uav_id} {"available" if available else "not available"}', now)
        return ''

    def set_params(self, params: AllocatorParams, now: float) -> None:
        """Use other parameters."""
        if params is not self.params:
            self.params = params
            self.request_replan('parameters changed', now)

    def tick(self, now: float) -> None:
        """Apply what follows from time alone: UAVs become silent, or are forgotten."""
        for uav_id in self.fleet.mark_silent(now, self.params.uav_timeout):
            if self.fleet.records[uav_id].report.available:
                self.note(*self.flights.silence(uav_id))
                self.request_replan(f'{uav_id} silent', now)
        self.admission.forget_unconfirmed(now)
        if self.kernels_ready:
            self.zone_checks.check_all(now)

    def release_hold(self, now: float) -> None:
        """End the hold after a restart: tasks may go to other UAVs."""
        self.restart_hold = False
        self.outbox.statuses |= self._missed.complete(self.fleet.active)
        self.request_replan('some time after a restart', now)

    def request_replan(self, trigger: str, now: float) -> None:
        """Invalidate the present plan."""
        self.version += 1
        self._on_change(trigger, now)

    def note(self, text: str, warning: bool = False, debug: bool = False) -> None:
        """Put a line into the log."""
        if len(self.outbox.notes) < _MAX_NOTES:
            level = 'warning' if warning else 'debug' if debug else 'info'
            self.outbox.notes.append(LogNote(level, text))

    def forget_uav(self, uav_id: str) -> None:
        """Remove a UAV with its list, its row in the journal and its publishers."""
        self.outbox.lists.pop(uav_id, None)
        self.outbox.forgotten.add(uav_id)
        self.fleet.forget(uav_id)
        self.lists.forget_uav(uav_id)
        self.zone_checks.forget(uav_id)
        self._events.forget(uav_id)
        self.validity.forget(uav_id)
        self.flights.forget(uav_id)
        self.jumps.forget(uav_id)

    # questions of the planner

    def task_records(self) -> Mapping[str, TaskRecord]:
        """Return the accepted tasks, by id."""
        return self.tasks.records

    def uav_records(self) -> Mapping[str, UavRecord]:
        """Return the known UAVs, by id."""
        return self.fleet.records

    def lists_in_force(self) -> Mapping[str, UavList]:
        """Return the list published last for each UAV, known or not."""
        return self.lists.lists

    def list_of(self, uav_id: str) -> UavList:
        """Return the list in force of a UAV; one of revision 0 where none was published."""
        return self.lists.get(uav_id)

    def uav_record(self, uav_id: str) -> UavRecord | None:
        """Return what is known of a UAV; None where it is not known."""
        return self.fleet.records.get(uav_id)

    def usable(self, uav_id: str) -> bool:
        """Return whether a UAV may be given tasks."""
        return self.fleet.usable(uav_id)

    def uav(self, uav_id: str) -> Uav:
        """Return a known UAV for the solver."""
        return self.fleet.uav(uav_id, self.params)

    def tasks_to_plan(self) -> tuple[Task, ...]:
        """Return the open tasks as orders allow them, less those that stay with unusable UAVs.

        Those that are put off are left out, too.
        """
        return tuple(task for task in self.ordered.tasks_to_plan(
            self.restart_hold, self.params.route_end == 'home') if task.id not in self.obstructed)

    def locked_tasks(self) -> dict[str, tuple[str, ...]]:
        """Return the tasks of each UAV that a plan may not move, in the order flown."""
        locked = self.ordered.locked(
            locked_tasks(self.tasks, self.fleet, self.lists, self.params.locked_tasks,
                         self.restart_hold, self.flights.serving),
            self.params.route_end == 'home')
        if self.obstructed:
            locked = {uav_id: tuple(task_id for task_id in ids if task_id not in self.obstructed)
                      for uav_id, ids in locked.items()}
        return {uav_id: ids for uav_id, ids in locked.items() if ids}

    def can_fly(self, uav_id: str, task_id: str) -> bool:
        """Return whether a task is open and a known UAV may fly it."""
        return can_fly(self.tasks, self.fleet, uav_id, task_id)

    def must_change(self, uav_id: str) -> bool:
        """Return whether the list in force of a UAV cannot or may not be flown."""
        return self.validity.must_change(
            uav_id, self.params.route_end == 'home' or uav_id in self.later)

    # results of the planner

    def set_built(self, zones_when_built: ZonesWhenBuilt,
                  paths_home: Mapping[str, tuple[bool, Point]], later: LaterTrips) -> None:
        """Record what lists were built for.

        Args:
            zones_when_built: the paths, and the home [m], by UAV.
            paths_home: whether there is a safe path home, and from where [m], by UAV.
            later: trips of the plan, after the lists.
        """
        self.later = later
        self.validity.zones_when_built.update(zones_when_built)
        for uav_id, (exists, start) in paths_home.items():
            self.zone_checks.set_path_home(uav_id, exists, start)

    def step_tasks(self, steps: Iterable[TaskStep], stamp: float) -> None:
        """Apply what a plan makes of open tasks."""
        for step in steps:
            self.tasks.step(step.task_id, step.event, stamp, step.uav, step.why)

    def publish(self, lists: Mapping[str, UavList], stamp: float,
                resend: bool = False) -> list[str]:
        """Put lists in force; returns the UAVs whose lists changed, with `resend` all of them."""
        revised = [self.lists.publish(each, stamp, resend) for each in lists.values()]
        published = {each.uav: each for each in revised if each}
        self.outbox.lists.update(published)
        return list(published)

    def next_revision(self) -> int:
        """Return the revision of the next allocation."""
        self.revision += 1
        self.mark_unsaved('revision')
        return self.revision

    def mark_unsaved(self, kind: str) -> None:
        """Have a row without an id written: 'zones', 'off', 'revision' or 'learner'."""
        self._unsaved.add(kind)

    def unsaved(self) -> dict[str, set[str]]:
        """Return what is not on disk: ids of 'task' and 'list' rows, kinds of the rows of ''."""
        return {'task': self.tasks.unsaved, 'work': self.works.unsaved,
                'list': self.lists.unsaved, 'change': self.fleet.unsaved, '': self._unsaved,
                'demand': self.announced.seen.unsaved, **self.orders.unsaved}
