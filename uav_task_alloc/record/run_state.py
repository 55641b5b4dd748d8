# SPDX-License-Identifier: Apache-2.0
"""What the nodes of a run said, folded line by line from record.jsonl or as it comes."""
from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from uav_task_alloc.model import Point, ThreatZone
from uav_task_alloc.zone_codec import decode_zone

FILE = 'record.jsonl'
FINAL = ('COMPLETED', 'FAILED', 'CANCELLED', 'REJECTED', 'UNASSIGNED')
ROUNDED = 3.0  # [s] by which a time since then may differ: whole seconds, and the way here
Line = Mapping[str, Any]  # wall [unix s], kind, and what Heard.on_<kind> reads


@dataclass(frozen=True, slots=True)
class Announced:
    """A task as it was announced."""

    position: Point  # [m]
    wall: float  # [unix s]


@dataclass(frozen=True, slots=True)
class ReportedStatus:
    """Where the allocator says a task stands."""

    state: str
    uav: str
    reason: str


@dataclass(frozen=True, slots=True)
class SolveRecord:
    """One solve of the allocator."""

    wall: float  # [unix s]
    milliseconds: float
    trigger: str


@dataclass(frozen=True, slots=True)
class SeenZone:
    """A zone and when it was there."""

    zone: ThreatZone
    since: float  # [unix s]
    until: float = math.inf  # [unix s]


@dataclass(frozen=True, slots=True)
class ReportedAuthority:
    """Who has a UAV, as its bridge says."""

    state: str
    why: str
    since: float | None  # [unix s]
    back: str  # what gives it back to the bridge; '': the bridge has it


@dataclass
class RunState:
    """The state of a run; `take` folds one more line into it."""

    tasks: dict[str, Announced] = field(default_factory=dict)
    cancelled: set[str] = field(default_factory=set)
    statuses: dict[str, ReportedStatus] = field(default_factory=dict)
    solves: list[SolveRecord] = field(default_factory=list)
    zones: list[SeenZone] = field(default_factory=list)
    lists: dict[str, Line] = field(default_factory=dict)  # the newest of each UAV
    legs: dict[tuple[str, str], float] = field(default_factory=dict)  # (UAV, task): see on_list
    uavs: dict[str, Line] = field(default_factory=dict)  # the newest state of each
    verified: dict[str, set[int]] = field(default_factory=dict)  # revisions seen on board
    counted: dict[str, int] = field(default_factory=dict)  # uploads as a bridge counts them
    health: dict[str, tuple[int, str]] = field(default_factory=dict)  # level, text of each UAV
    authority: dict[str, ReportedAuthority] = field(default_factory=dict)  # by UAV
    speedup: float = 1.0  # scenario seconds in one of the wall
    first: float = math.inf  # [unix s]
    last: float = -math.inf  # [unix s]

    def take(self, line: Line) -> None:
        """Fold in one line."""
        self.first, self.last = min(self.first, line['wall']), max(self.last, line['wall'])
        getattr(self, 'on_' + line['kind'])(line)

    def on_run(self, line: Line) -> None:
        """How the run was started."""
        self.speedup = line['speedup']

    def on_announcement(self, line: Line) -> None:
        """ADD, UPDATE or CANCEL of tasks."""
        for task in line['tasks']:
            if line['action'] == 'CANCEL':
                self.cancelled.add(task['id'])
            else:
                known = self.tasks.get(task['id'])
                self.tasks[task['id']] = Announced(
                    tuple(task['position']), known.wall if known else line['wall'])

    def on_statuses(self, line: Line) -> None:
        """The whole picture of tasks."""
        self.statuses = {row['task']: ReportedStatus(row['state'], row['uav'], row['reason'])
                         for row in line['statuses']}

    def on_allocation(self, line: Line) -> None:
        """A plan was made."""
        self.solves.append(SolveRecord(line['wall'], line['solve_ms'], line['trigger']))

    def on_zones(self, line: Line) -> None:
        """The whole picture of zones: what is missing from it has gone, what is new has come."""
        now = dict.fromkeys(decode_zone(row) for row in line['zones'])  # in order
        self.zones = [seen if seen.until < math.inf or seen.zone in now
                      else SeenZone(seen.zone, seen.since, line['wall']) for seen in self.zones]
        there = {seen.zone for seen in self.zones if seen.until == math.inf}
        self.zones += [SeenZone(zone, line['wall']) for zone in now if zone not in there]

    def on_list(self, line: Line) -> None:
        """A task list; the leg to its first task counts as planned when that became the first."""
        before = self.lists.get(line['uav'])
        old = before['tasks'][0]['id'] if before and before['tasks'] else None
        if line['tasks'] and line['tasks'][0]['id'] != old:
            head = line['tasks'][0]
            self.legs[line['uav'], head['id']] = head['leg_distance']
        self.lists[line['uav']] = line

    def on_state(self, line: Line) -> None:
        """The state of one UAV."""
        self.uavs[line['uav']] = line
        if line['mission_state'] == 'VERIFIED' and line['list_revision']:
            self.verified.setdefault(line['uav'], set()).add(line['list_revision'])

    def on_uploads(self, line: Line) -> None:
        """Counters of the bridge, and how its UAVs are."""
        self.counted.update(line['uploads'])
        self.health.update((uav, (level, text))
                           for uav, (level, text) in line.get('health', {}).items())
        for uav, said in line.get('authority', {}).items():
            since = None if said['for'] is None else line['wall'] - said['for']
            old = self.authority.get(uav)
            if (old and since is not None and old.since is not None and old.state == said['state']
                    and abs(since - old.since) < ROUNDED):
                since = old.since
            self.authority[uav] = ReportedAuthority(
                said['state'], said['why'], since, said['back']
            )

    @property
    def uploads(self) -> int:
        """Verified uploads: the bridge's count, or the revisions that were seen on board."""
        if self.counted:
            return sum(self.counted.values())
        return sum(len(revisions) for revisions in self.verified.values())

    def count(self, *states: str) -> int:
        """How many tasks are in one of these states."""
        return sum(status.state in states for status in self.statuses.values())

    def start(self) -> float:
        """When the first task was announced [unix s]; the first line of all where none was."""
        return min((task.wall for task in self.tasks.values()), default=self.first)

    def clock(self, wall: float) -> float:
        """Scenario time [s] at a wall time."""
        return (wall - self.start()) * self.speedup

    def zones_now(self) -> list[ThreatZone]:
        """The zones that are there after the last line."""
        return [seen.zone for seen in self.zones if seen.until == math.inf]


def read_record(out_dir: Path) -> RunState:
    """The record of a run; a last line cut short by the end of the recorder is left out."""
    heard = RunState()
    for line in read_lines(out_dir / FILE):
        heard.take(line)
    return heard


def read_lines(path: Path) -> Iterable[Line]:
    """The JSON objects of a file, one a line; OSError where there is none."""
    with path.open(encoding='utf-8') as file:
        for text in file:
            if text.endswith('\n'):
                yield json.loads(text)
