# SPDX-License-Identifier: Apache-2.0
"""The history of a flight from the lines of its record: tracks, states, re-plans, gaps."""
from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

from uav_task_alloc.geometry.polyline import polyline_length
from uav_task_alloc.model import Point
from uav_task_alloc.record.events import sentences
from uav_task_alloc.record.ground_truth import TrueSample
from uav_task_alloc.record.plan_diff import (
    changes_text,
    route_changes,
    route_lists,
    trigger_text,
)
from uav_task_alloc.record.record_file import Line
from uav_task_alloc.record.reported import END_STATES, ReportedStatus
from uav_task_alloc.record.run_state import RunState

_SAMPLE_PERIOD = 0.2  # [s] between the samples of a track, of height and battery
MAX_EVENTS = 5000  # the newest are kept, and of the faults before them as many
_ON_GROUND = frozenset({'', 'UNKNOWN', 'STANDBY'})  # modes
# a step of a track is flown where speed [m/s], acceleration [m/s2], delay [s of real time] and
# error [m] of its ends explain it; others are jumps of the estimate
_ACCELERATION, _DELAY, _ERROR = 3.0, 0.5, 2.0
_OPEN_STATES = ('PENDING', 'ASSIGNED', 'ACTIVE')


@dataclass(frozen=True, slots=True)
class StateSpan:
    """A task is in one state, until the next span of the task."""

    since: float  # [unix s]
    state: str
    uav: str


@dataclass(frozen=True, slots=True)
class ReplanRecord:
    """A plan of the allocator, and its changes to the one before."""

    wall: float  # [unix s]
    revision: int
    trigger: str
    changed: str  # as text
    milliseconds: float
    fit: float | None
    distance: float | None  # [m]
    listed: int  # tasks in all lists


@dataclass(frozen=True, slots=True)
class ReceptionGap:
    """No state of a UAV was received; no message of any node where `uav` is empty."""

    uav: str
    since: float  # [unix s]
    until: float  # [unix s]


@dataclass(frozen=True, slots=True)
class LevelSample:
    """Height and battery of a UAV at one time."""

    wall: float  # [unix s]
    up: float | None  # [m] above the origin
    battery: float | None  # share left


@dataclass
class FlightHistory:
    """A flight up to the last line given to `apply`; `close` ends it."""

    run: RunState = field(default_factory=RunState)
    tracks: dict[str, list[TrueSample]] = field(default_factory=dict)
    flown: dict[str, list[bool]] = field(default_factory=dict)  # steps of tracks, by UAV
    levels: dict[str, list[LevelSample]] = field(default_factory=dict)  # by UAV
    homes: dict[str, float] = field(default_factory=dict)  # [m] above the origin, by UAV
    last_state: dict[str, float] = field(default_factory=dict)  # [unix s] of each UAV
    planned: dict[str, list[list[Point]]] = field(default_factory=dict)  # legs as planned
    positions: dict[str, Point] = field(default_factory=dict)  # of tasks, as planned [m]
    values: dict[str, float] = field(default_factory=dict)
    strip_widths: dict[str, float] = field(default_factory=dict)  # [m] of areas
    listed: dict[str, list[str]] = field(default_factory=dict)  # UAVs in whose lists a piece was
    # [unix s], and place [m] from then on; None: no longer; by UAV that was sent to wait
    waits: dict[str, list[tuple[float, Point | None]]] = field(default_factory=dict)
    spans: dict[str, list[StateSpan]] = field(default_factory=dict)
    replans: list[ReplanRecord] = field(default_factory=list)
    gaps: list[ReceptionGap] = field(default_factory=list)
    events: list[tuple[float, str, str]] = field(default_factory=list)  # [unix s], kind, text
    dropped: int = 0  # events
    last_plan: Line | None = None  # not compared yet
    routes: dict[str, list[str]] = field(default_factory=dict)  # of the plan before it

    def apply(self, line: Line) -> None:
        """Add one line of the record."""
        if line['kind'] == 'run':
            self.run.on_run(line)
            return
        if 0.0 < self.run.last < line['wall'] - self.run.silent_after:
            self.gaps.append(ReceptionGap('', self.run.last, line['wall']))
        self.events += [(line['wall'], *event) for event in sentences(self.run, line)]
        if len(self.events) > 3 * MAX_EVENTS:
            self.drop_events()
        handler = getattr(self, 'on_' + line['kind'], None)
        if handler is not None:
            handler(line)
        self.run.apply(line)

    def drop_events(self) -> None:
        """Keep the newest events, and the newest faults before them."""
        before, newest = self.events[:-MAX_EVENTS], self.events[-MAX_EVENTS:]
        faults = [event for event in before if event[1] == 'fault'][-MAX_EVENTS:]
        self.dropped += len(before) - len(faults)
        self.events = [*faults, *newest]

    def on_announcement(self, line: Line) -> None:
        """Record the values of tasks, and the widths of strips."""
        self.values.update((task['id'], task['value']) for task in line['tasks']
                           if task.get('value') is not None)
        self.strip_widths.update((task['id'], task['strip_width']) for task in line['tasks']
                                 if task.get('strip_width'))

    def on_statuses(self, line: Line) -> None:
        """Begin a span where the state of a task or its UAV changes.

        When tasks ended that had before the recording is not known.
        """
        for row in line['statuses']:
            if row['task'] not in self.spans and self.run.ended_before(row, line):
                continue
            spans = self.spans.setdefault(row['task'], [])
            if not spans or (spans[-1].state, spans[-1].uav) != (row['state'], row['uav']):
                spans.append(StateSpan(line['wall'], row['state'], row['uav']))

    def on_state(self, line: Line) -> None:
        """Add a sample to the track, and a gap that has ended."""
        uav, wall = line['uav'], line['wall']
        if wall - self.last_state.get(uav, wall) > self.run.silent_after:
            self.gaps.append(ReceptionGap(uav, self.last_state[uav], wall))
        self.last_state[uav] = wall
        levels, up = self.levels.setdefault(uav, []), line['position'][-1]
        if not levels or wall - levels[-1].wall >= _SAMPLE_PERIOD:
            levels.append(LevelSample(wall, up, line['battery']))
        home = line.get('home', (None,))[-1]
        if home is not None:
            self.homes[uav] = home
        track = self.tracks.setdefault(uav, [])
        if None not in line['position'] and (not track or wall - track[-1].wall >= _SAMPLE_PERIOD):
            track.append(TrueSample(wall, tuple(line['position'])))
            if len(track) > 1:
                self.flown.setdefault(uav, []).append(self._is_flown(track[-2], track[-1], line))

    def _is_flown(self, before: TrueSample, after: TrueSample, line: Line) -> bool:
        """Whether a UAV flew from one sample to the next, whose state is `line`."""
        old = self.run.uavs[line['uav']]
        if old['mode'] in _ON_GROUND and line['mode'] in _ON_GROUND:
            return False
        if None in (*old['velocity'], *line['velocity']):
            return True
        speed = max(math.hypot(*state['velocity']) for state in (old, line))
        time = (after.wall - before.wall) * self.run.scale.speedup
        delay = _DELAY * self.run.scale.rate
        return math.dist(before.point, after.point) <= (
            speed * (time + delay) + 0.5 * _ACCELERATION * time * time + _ERROR)

    def on_list(self, line: Line) -> None:
        """Record the leg to a task that has become the next, from the position of the UAV."""
        uav, tasks = line['uav'], line['tasks']
        waits = line.get('waits')
        if waits or uav in self.waits:
            self.waits.setdefault(uav, []).append(
                (line['wall'], tuple(waits[-1]) if waits else None))
        for row in tasks:
            if None not in row.get('position', (None,)):
                self.positions[row['id']] = tuple(row['position'])
            owners = self.listed.setdefault(row['id'], [])
            if owners[-1:] != [uav]:
                owners.append(uav)
        if self.run.lists.begins_leg(line) and self.tracks.get(uav):
            leg = [self.tracks[uav][-1].point, *self.points(tasks[:1])]
            self.planned.setdefault(uav, []).append(leg)

    def on_allocation(self, line: Line) -> None:
        """Compare the plan before this one: by now its completed tasks are known."""
        self.compare()
        self.last_plan = line

    def compare(self) -> None:
        """Record the last plan with its changes to the one before."""
        line, self.last_plan = self.last_plan, None
        if line is None:
            return
        after = route_lists(line)
        changed = changes_text(route_changes(self.routes, after, self.run.statuses.completed()))
        self.routes = after
        self.replans.append(ReplanRecord(
            line['wall'], line['revision'], trigger_text(line['trigger']), changed,
            line['solve_ms'], line['fit'], line.get('distance'), sum(map(len, after.values()))))

    def close(self) -> None:
        """End the flight: compare the last plan, close the gaps."""
        self.compare()
        self.drop_events()
        end = self.run.last
        self.gaps += [ReceptionGap(uav, wall, end) for uav, wall in sorted(self.last_state.items())
                      if end - wall > self.run.silent_after]

    def points(self, rows: Iterable[Mapping[str, Any]]) -> Iterator[Point]:
        """Detour points, and positions or ways [m] of tasks, of rows of a list."""
        for row in rows:
            yield from (tuple(point) for point in row['via'])
            if row.get('way'):
                yield from (tuple(point) for point in row['way'])
            elif row['id'] in self.positions:
                yield self.positions[row['id']]

    def remaining(self, uav: str) -> list[Point]:
        """The route [m] that a UAV had left at the end, from its last position."""
        line, track = self.run.lists.newest.get(uav), self.tracks.get(uav)
        points = list(self.points(line['tasks'])) if line else []
        return [track[-1].point, *points] if track and points else points

    def tasks(self) -> dict[str, Point | None]:
        """All tasks announced or with a status, and their positions [m] where known."""
        names = {**dict.fromkeys(self.run.tasks), **dict.fromkeys(self.run.statuses.known())}
        announced = {name: task.position for name, task in self.run.tasks.items()}
        return {name: self.positions.get(name) or announced.get(name) for name in names}

    def status(self, task: str) -> ReportedStatus:
        """The last status of a task."""
        return self.run.statuses.last(task) or ReportedStatus('PENDING', '', 'no status received')

    def lost(self) -> dict[str, TrueSample]:
        """The last position of each UAV that fell silent in flight and stayed silent.

        Where the states of all UAVs end together, the recording of them ended; then only a UAV
        that was no longer available is lost.
        """
        newest = max(self.last_state.values(), default=0.0)
        found = {}
        for uav, wall in sorted(self.last_state.items()):
            state = self.run.uavs[uav]
            silent = self.run.last - wall > self.run.silent_after and state['mode'] != 'STANDBY'
            if silent and self.tracks[uav] and (
                    newest - wall > self.run.silent_after or not state['available']):
                found[uav] = TrueSample(wall, self.tracks[uav][-1].point)
        return found

    def mission_end(self) -> float:
        """When the last task ended [unix s]; the end of the recording while tasks are open."""
        statuses = self.run.statuses
        known = statuses.known().keys() | statuses.known_pieces().keys()  # not those cut again
        ends = [spans[-1] for name, spans in self.spans.items() if name in known]
        if not ends or any(span.state in _OPEN_STATES for span in ends):
            return self.run.last
        return max((span.since for span in ends if span.state in END_STATES),
                   default=self.run.last)

    def steps(self, uav: str) -> Iterator[tuple[TrueSample, TrueSample]]:
        """Steps of a track that were flown: neither on the ground nor jumps of the estimate."""
        steps = zip(pairwise(self.tracks.get(uav, ())), self.flown.get(uav, ()), strict=True)
        return (step for step, is_flown in steps if is_flown)

    def metres(self, uav: str) -> float:
        """Length of a track in flight [m]."""
        return math.fsum(math.dist(a.point, b.point) for a, b in self.steps(uav))

    def metres_planned(self, uav: str) -> float:
        """Length [m] of the legs that were begun, as planned at their begin."""
        return math.fsum(map(polyline_length, self.planned.get(uav, ())))

    def clock(self, wall: float) -> float:
        """Scenario time [s] since the first task was announced, of a wall time [unix s]."""
        return self.run.clock(wall)


def read_history(lines: Iterable[Line]) -> FlightHistory:
    """The history of a whole record."""
    history = FlightHistory()
    for line in lines:
        history.apply(line)
    history.close()
    return history
