# SPDX-License-Identifier: Apache-2.0
"""The state of a run as its nodes report it, from the lines of record.jsonl or live messages."""
from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path

from uav_task_alloc.geometry.fence_area import AreaCorners
from uav_task_alloc.geometry.frames import Origin
from uav_task_alloc.model import ThreatZone
from uav_task_alloc.record.allocator_reports import ALLOCATOR_SILENT, AllocatorReports
from uav_task_alloc.record.bridge_reports import BridgeReports
from uav_task_alloc.record.clock_comparison import MAX_STAMP_AGE
from uav_task_alloc.record.plan_diff import RouteLists, route_changes, route_lists
from uav_task_alloc.record.record_file import RECORD_FILE, Line, read_lines
from uav_task_alloc.record.reported import (
    END_STATES,
    AnnouncedTask,
    Service,
    SolveRecord,
    ZoneInterval,
    announced_task,
    is_refused,
)
from uav_task_alloc.record.reported_lists import ReportedLists
from uav_task_alloc.record.task_statuses import TaskStatuses
from uav_task_alloc.record.time_scale import TimeScale
from uav_task_alloc.zone_codec import decode_zone

SILENT_AFTER = 2.0  # [s] of real time without a state: the UAV is shown as silent


@dataclass
class RunState:
    """The state of a run after the lines given to `apply`.

    Arguments of methods:
        line: of a record.
        wall: [unix s].
        uav: id.
    """

    tasks: dict[str, AnnouncedTask] = field(default_factory=dict)  # announced, by id
    cancelled: set[str] = field(default_factory=set)  # ids of tasks
    statuses: TaskStatuses = field(default_factory=TaskStatuses)  # and those of pieces
    planned: dict[str, Service] = field(default_factory=dict)  # by task, of legs begun
    flown: dict[str, Service] = field(default_factory=dict)  # by task, of completed ones
    solves: list[SolveRecord] = field(default_factory=list)  # in the order of publication
    # those after the first that changed a list; the newest is judged by `replans`
    changing: list[SolveRecord] = field(default_factory=list)
    routes: tuple[RouteLists, RouteLists] = ({}, {})  # of the newest plan and that before it
    # with the times in which they were in force
    zones: list[ZoneInterval] = field(default_factory=list)
    lists: ReportedLists = field(default_factory=ReportedLists)  # of tasks, by UAV
    uavs: dict[str, Line] = field(default_factory=dict)  # the newest state of each
    verified: dict[str, set[int]] = field(default_factory=dict)  # list revisions on board, by UAV
    bridges: BridgeReports = field(default_factory=BridgeReports)  # what they report of UAVs
    # what they report of themselves
    allocators: AllocatorReports = field(default_factory=AllocatorReports)
    proposal: Line | None = None  # the last plan that waited for an operator
    alerts: dict[tuple[str, ...], Line] = field(default_factory=dict)  # in force, by pair
    scale: TimeScale = field(default_factory=TimeScale)  # of its clocks
    origin: Origin | None = None  # of the ENU frame; None: not known yet
    fence_area: AreaCorners = ()  # [m]; (): none
    begun: float = math.inf  # [unix s] of the first announced task
    first: float = math.inf  # [unix s] of the first line
    last: float = -math.inf  # [unix s] of the last line

    def apply(self, line: Line) -> None:
        """Update the state by one line of the record."""
        self.first, self.last = min(self.first, line['wall']), max(self.last, line['wall'])
        getattr(self, 'on_' + line['kind'])(line)

    def on_run(self, line: Line) -> None:
        """Parameters of the run; a speedup of 0 is to be measured."""
        self.scale.state(line['speedup'], bool(line.get('simulated')))

    @property
    def silent_after(self) -> float:
        """Seconds of `wall` without a state after which a UAV is silent."""
        return SILENT_AFTER * self.scale.second

    def on_origin(self, line: Line) -> None:
        """The origin of the ENU frame, as a node of the fleet published it."""
        self.origin = Origin(line['latitude'], line['longitude'], line['altitude_amsl'])

    def on_fence_area(self, line: Line) -> None:
        """The area that plans stay in."""
        self.fence_area = tuple((x, y) for x, y in line['corners'])

    def on_announcement(self, line: Line) -> None:
        """ADD, UPDATE or CANCEL of tasks."""
        for task in line['tasks']:
            if line['action'] == 'CANCEL':
                self.cancelled.add(task['id'])
            else:
                known = self.tasks.get(task['id'])
                status = self.statuses.tasks.get(task['id'])
                now = line['wall'] - self.allocators.lead.seconds
                if known and status and is_refused(known, status, task, line['action'], now):
                    continue
                if line['action'] == 'ADD':
                    self.cancelled.discard(task['id'])
                    if self.statuses.forget_former(task['id']):
                        known = None
                self.tasks[task['id']] = announced_task(
                    task, known.wall if known else self._announced_at(line))
                self.begun = min(self.begun, self.tasks[task['id']].wall)

    def _announced_at(self, line: Line) -> float:
        """When tasks were announced [unix s]: by the stamp, where that is before the record."""
        wall, stamp = line['wall'], line.get('stamp', line['wall'])
        is_earlier = self.silent_after < wall - stamp < MAX_STAMP_AGE
        return float(stamp if is_earlier and self._in_opening(line) else wall)

    def _in_opening(self, line: Line) -> bool:
        """Whether a line may be of a latched message from before the record."""
        return bool(line['wall'] - self.first <= self.silent_after)

    def ended_before(self, row: Line, line: Line) -> bool:
        """Return whether a task of which no end is known had ended before the record began.

        Args:
            row: its status.
            line: with all statuses, not yet applied.

        Returns:
            Whether it has ended in the first statuses of the record, and since then.
        """
        old = self.statuses.in_newest(row['task'])
        return row['state'] in END_STATES and (
            old.state == row['state'] if old
            else not self.statuses.tasks and self._in_opening(line))

    def on_statuses(self, line: Line) -> None:
        """The statuses of all tasks."""
        for row in line['statuses']:
            if row['state'] != 'COMPLETED':
                self.flown.pop(row['task'], None)  # forgotten, and announced again
            elif row['task'] not in self.flown and not self.ended_before(row, line):
                task = self.tasks.get(row['task'])
                service = task.service / self.scale.speedup if task else 0.0
                self.flown[row['task']] = Service(row['uav'], line['wall'] - service, line['wall'])
        self.statuses.apply(line)

    def on_allocation(self, line: Line) -> None:
        """A plan was published: by now the tasks completed before the one before it are known."""
        self.changing = self.replans()
        self.routes = route_lists(line), self.routes[0]
        self.solves.append(SolveRecord(line['wall'], line['solve_ms'], line['trigger']))

    def replans(self) -> list[SolveRecord]:
        """The plans after the first that changed a list; a completed task is no change."""
        newest, before = self.routes
        changed = self.solves[1:] and route_changes(
            before, newest, self.statuses.completed())
        return [*self.changing, *self.solves[-1:]] if changed else self.changing

    def on_proposal(self, line: Line) -> None:
        """A plan waits for an operator, or does no longer."""
        self.proposal = line

    def on_separation(self, line: Line) -> None:
        """Two UAVs would lose separation, or are apart again."""
        if line['horizontal'] is None:
            self.alerts.pop(tuple(line['uavs']), None)
        else:
            self.alerts[tuple(line['uavs'])] = line

    def on_zones(self, line: Line) -> None:
        """The set of all zones: a missing zone has ended, a new one begins.

        One that was invalid in the message stays as it was, as in the allocator.
        """
        valid = [decode_zone(row) for row in line['zones']]
        kept = {*line.get('kept', ())} - {zone.id for zone in valid}
        current = dict.fromkeys([*valid, *(zone for zone in self.zones_now() if zone.id in kept)])
        self.zones = [old if old.until < math.inf or old.zone in current
                      else ZoneInterval(old.zone, old.since, line['wall']) for old in self.zones]
        in_force = set(self.zones_now())
        self.zones += [ZoneInterval(zone, line['wall']) for zone in current
                       if zone not in in_force]

    def on_list(self, line: Line) -> None:
        """A task list; the service of a task is that of the list in which it became the first."""
        if self.lists.begins_leg(line):
            first = line['tasks'][0]
            service = self.service(line, first)
            if service is not None:
                self.planned[first['id']] = service
        self.lists.apply(line, self.uavs.get(line['uav'], {}).get('mode', ''))

    def service(self, line: Line, row: Line) -> Service | None:
        """Return the planned service of a task of a list.

        Args:
            line: a list.
            row: one of its tasks.

        Returns:
            None in recordings of earlier versions.
        """
        if 'finish' not in row:
            return None
        begin, end = (self.planned_at(line) + t / self.scale.speedup
                      for t in (row['eta'] + row['wait'], row['finish']))
        return Service(line['uav'], begin, end)

    def planned_at(self, line: Line) -> float:
        """When a list was planned [unix s]; on arrival where its stamp is of another clock."""
        wall, stamp = line['wall'], line.get('stamp', 0.0) + self.allocators.lead.seconds
        # two nodes read /clock up to a tick apart
        return stamp if -self.scale.second <= wall - stamp < MAX_STAMP_AGE else float(wall)

    def on_state(self, line: Line) -> None:
        """The state of one UAV."""
        self.uavs[line['uav']] = line
        if line['mission_state'] == 'VERIFIED' and line['list_revision']:
            self.verified.setdefault(line['uav'], set()).add(line['list_revision'])

    def on_uploads(self, line: Line) -> None:
        """Diagnostics of the bridge: uploads, health, authority and clocks of its UAVs."""
        self.scale.measure(line.get('clock_rates', {}))
        self.bridges.apply(line, self.scale.second)
        self.allocators.apply(line, self.scale.second)

    def forget_silent(self, wall: float) -> bool:
        """Forget orders and warnings of allocators that have ended; whether there were any."""
        return self.allocators.forget_silent(wall, self.scale.second)

    def waiting_plan(self, wall: float) -> Line | None:
        """The plan that waits; None after its deadline, or where its allocator has ended."""
        plan = self.proposal
        if plan is None or not plan['open'] or self.allocators.have_ended(wall, self.scale.second):
            return None
        overdue = wall - plan['deadline'] - self.allocators.lead.seconds
        return None if overdue > ALLOCATOR_SILENT * self.scale.second else plan

    def is_low(self, battery: float | None) -> bool:
        """Whether a battery is below the reserve of an allocator.

        Args:
            battery: remaining [0..1]; None: unknown.

        Returns:
            False where it is unknown.
        """
        return battery is not None and battery < self.allocators.battery_reserve

    def trouble(self, uav: str) -> str:
        """What is wrong with a UAV, by its bridge and the allocators; '' where all is well."""
        return '; '.join(self.bridges.warnings(uav) + self.allocators.warnings(uav))

    @property
    def uploads(self) -> int:
        """Uploads begun, by the bridges' counts; without one, the list revisions seen on board."""
        begun = self.bridges.uploads
        return sum(map(len, self.verified.values())) if begun is None else begun

    def start(self) -> float:
        """Time of the first announced task [unix s]; of the first line where there is none."""
        return self.begun if self.tasks else self.first

    def clock(self, wall: float) -> float:
        """Scenario time [s] at a wall time."""
        return (wall - self.start()) * self.scale.speedup

    def zones_now(self) -> list[ThreatZone]:
        """The zones in force after the last line."""
        return [interval.zone for interval in self.zones if interval.until == math.inf]


def read_record(out_dir: Path) -> RunState:
    """Read the record of a run; an unfinished last line is ignored.

    Args:
        out_dir: folder with record.jsonl.

    Returns:
        After the last line.

    Raises:
        OSError: the file cannot be read.
    """
    state = RunState()
    for line in read_lines(out_dir / RECORD_FILE):
        state.apply(line)
    return state
