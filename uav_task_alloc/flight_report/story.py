# SPDX-License-Identifier: Apache-2.0
"""What a record tells of a flight, folded line by line: tracks, states, re-plans, gaps."""
from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from uav_task_alloc.geometry.polyline import polyline_length
from uav_task_alloc.model import Point
from uav_task_alloc.record import plan_diff as replans
from uav_task_alloc.record.events import sentences
from uav_task_alloc.record.ground_truth import TrueSample
from uav_task_alloc.record.progress import SILENT
from uav_task_alloc.record.run_state import Line, ReportedStatus, RunState

_EVERY = 0.2  # [s] between two samples of a track that are kept
MOST_EVENTS = 5000  # the first
ENDED = ('COMPLETED', 'FAILED', 'CANCELLED', 'REJECTED')


@dataclass(frozen=True, slots=True)
class Span:
    """A task was in one state from here to the next span."""

    since: float  # [unix s]
    state: str
    uav: str


@dataclass(frozen=True, slots=True)
class Replan:
    """A plan of the allocator against the one before it."""

    wall: float  # [unix s]
    revision: int
    trigger: str
    changed: str  # in words
    milliseconds: float
    fit: float | None
    distance: float | None  # [m]
    listed: int  # tasks in all lists


@dataclass(frozen=True, slots=True)
class Gap:
    """Nothing was heard of a UAV; of anybody where `uav` is empty."""

    uav: str
    since: float  # [unix s]
    until: float  # [unix s]


@dataclass
class Story:
    """A flight as it was told; `take` folds one more line into it, `close` ends it."""

    heard: RunState = field(default_factory=RunState)
    tracks: dict[str, list[TrueSample]] = field(default_factory=dict)
    last_state: dict[str, float] = field(default_factory=dict)  # [unix s] of each UAV
    planned: dict[str, list[list[Point]]] = field(default_factory=dict)  # legs as they began
    places: dict[str, Point] = field(default_factory=dict)  # of tasks, as planned [m]
    values: dict[str, float] = field(default_factory=dict)
    spans: dict[str, list[Span]] = field(default_factory=dict)
    replans: list[Replan] = field(default_factory=list)
    gaps: list[Gap] = field(default_factory=list)
    events: list[tuple[float, str, str]] = field(default_factory=list)  # [unix s], kind, words
    solved: Line | None = None  # the newest plan, not compared yet
    routes: dict[str, list[str]] = field(default_factory=dict)  # of the plan before it

    def take(self, line: Line) -> None:
        """Fold in one line."""
        if line['kind'] == 'run':
            self.heard.speedup = line['speedup']
            return
        if 0.0 < self.heard.last < line['wall'] - SILENT:
            self.gaps.append(Gap('', self.heard.last, line['wall']))
        if len(self.events) < MOST_EVENTS:
            self.events += [(line['wall'], *event) for event in sentences(self.heard, line)]
        tell = getattr(self, 'on_' + line['kind'], None)
        if tell is not None:
            tell(line)
        self.heard.take(line)

    def on_announcement(self, line: Line) -> None:
        """Values of tasks."""
        self.values.update((task['id'], task['value']) for task in line['tasks']
                           if task.get('value') is not None)

    def on_statuses(self, line: Line) -> None:
        """A span begins where a task is in another state, or on another UAV."""
        for row in line['statuses']:
            spans = self.spans.setdefault(row['task'], [])
            if not spans or (spans[-1].state, spans[-1].uav) != (row['state'], row['uav']):
                spans.append(Span(line['wall'], row['state'], row['uav']))

    def on_state(self, line: Line) -> None:
        """A sample of a track, or the end of a gap."""
        uav, wall = line['uav'], line['wall']
        if wall - self.last_state.get(uav, wall) > SILENT:
            self.gaps.append(Gap(uav, self.last_state[uav], wall))
        self.last_state[uav] = wall
        track = self.tracks.setdefault(uav, [])
        if None not in line['position'] and (not track or wall - track[-1].wall >= _EVERY):
            track.append(TrueSample(wall, tuple(line['position'])))

    def on_list(self, line: Line) -> None:
        """The leg to a task that has become the next counts as planned from where the UAV is."""
        uav, tasks = line['uav'], line['tasks']
        for row in tasks:
            if None not in row.get('position', (None,)):
                self.places[row['id']] = tuple(row['position'])
        before = self.heard.lists.get(uav)
        old = before['tasks'][0]['id'] if before and before['tasks'] else None
        if tasks and tasks[0]['id'] != old and self.tracks.get(uav):
            leg = [self.tracks[uav][-1].point, *self.way(tasks[:1])]
            self.planned.setdefault(uav, []).append(leg)

    def on_allocation(self, line: Line) -> None:
        """Compare the plan before this one: by now it is known what was flown meanwhile."""
        self.compare()
        self.solved = line

    def compare(self) -> None:
        """Hold the newest plan against the one before it."""
        line, self.solved = self.solved, None
        if line is None:
            return
        done = {task for task, status in self.heard.statuses.items()
                if status.state in replans.DONE}
        after = replans.routes(line)
        changed = replans.summary(replans.changes(self.routes, after, done))
        self.routes = after
        self.replans.append(Replan(
            line['wall'], line['revision'], replans.in_words(line['trigger']), changed,
            line['solve_ms'], line['fit'], line.get('distance'), sum(map(len, after.values()))))

    def close(self) -> None:
        """No line follows."""
        self.compare()
        end = self.heard.last
        self.gaps += [Gap(uav, wall, end) for uav, wall in sorted(self.last_state.items())
                      if end - wall > SILENT]

    def way(self, rows: Iterable[Mapping[str, Any]]) -> Iterator[Point]:
        """Detour points and tasks of some rows of a list [m]."""
        for row in rows:
            yield from (tuple(point) for point in row['via'])
            if row['id'] in self.places:
                yield self.places[row['id']]

    def rest(self, uav: str) -> list[Point]:
        """What a UAV had still to fly at the end [m], from where it was."""
        line, track = self.heard.lists.get(uav), self.tracks.get(uav)
        points = list(self.way(line['tasks'])) if line else []
        return [track[-1].point, *points] if track and points else points

    def tasks(self) -> dict[str, Point | None]:
        """Every task that was announced or told of, and where it is [m] as far as is known."""
        names = {**dict.fromkeys(self.heard.tasks), **dict.fromkeys(self.heard.statuses)}
        told = {name: task.position for name, task in self.heard.tasks.items()}
        return {name: self.places.get(name) or told.get(name) for name in names}

    def status(self, task: str) -> ReportedStatus:
        """How a task stands at the end."""
        return self.heard.statuses.get(task) or ReportedStatus('PENDING', '', 'no status was told')

    def metres(self, uav: str) -> float:
        """Length of a track [m]."""
        return polyline_length([sample.point for sample in self.tracks[uav]])

    def metres_planned(self, uav: str) -> float:
        """Length of the legs that were begun, as planned then [m]."""
        return math.fsum(map(polyline_length, self.planned.get(uav, ())))

    def clock(self, wall: float) -> float:
        """Mission time [s]: since the first task was announced."""
        return self.heard.clock(wall)


def fold(lines: Iterable[Line]) -> Story:
    """The story of a whole record."""
    story = Story()
    for line in lines:
        story.take(line)
    story.close()
    return story
