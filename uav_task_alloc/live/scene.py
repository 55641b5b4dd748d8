# SPDX-License-Identifier: Apache-2.0
"""The content of the live page as JSON values, derived from the run's state; no clock, no I/O."""
from __future__ import annotations

import math
from typing import Any

from uav_task_alloc.piece_ids import split_piece
from uav_task_alloc.record.events import sentences
from uav_task_alloc.record.plan_diff import (
    RouteLists,
    changes_text,
    route_changes,
    route_lists,
    trigger_text,
)
from uav_task_alloc.record.record_file import Line
from uav_task_alloc.record.reported import Service
from uav_task_alloc.record.run_state import RunState
from uav_task_alloc.zone_codec import JSON_ZONE, encode_zone

_MOST_TIMES = 1000  # tasks flown that the page draws, the latest
_REST_MODES = ('STANDBY', 'HOLD')  # as in page/model.js
_LEAST_SPEED = 0.5  # [m/s]; the course of a slower UAV is noise
# by kind of a line: the part of the page that it changes
_PART_OF_KIND = {'announcement': 'tasks', 'statuses': 'statuses', 'zones': 'zones',
                 'state': 'uavs', 'uploads': 'uavs', 'origin': 'origin', 'proposal': 'orders',
                 'fence_area': 'fence_area'}
LogEntry = dict[str, Any]  # of a log: `wall` [unix s] and the values that the page shows


class Scene:
    """Changed parts of the page, and new entries of its two logs, since the last `updates`.

    Args:
        run: the state that `apply` updates.

    Arguments of methods:
        line: of a record, see RunState.
        uav: id.
        state: its newest `state` line.
    """

    def __init__(self, run: RunState) -> None:
        self.run = run
        self.dirty: set[str] = set()
        self.events: list[LogEntry] = []
        self.new_plans: list[Line] = []
        self.routes: RouteLists | None = None  # of the last plan
        self.silent: set[str] = set()
        self.last_authority: LogEntry = {}
        self.last_nodes: LogEntry = {'silent': None, 'bridges': {}, 'warnings': []}
        self.last_orders: dict[str, dict[str, str]] = {}  # by allocator
        self.waiting: Line | None = None  # the plan that waits for an operator
        self.last: LogEntry = {'times': {}, 'works': {}}  # these parts as last sent

    def apply(self, line: Line) -> None:
        """Record what a line changes, then apply it to the run."""
        self.events += [{'wall': line['wall'], 'kind': kind, 'text': text}
                        for kind, text in sentences(self.run, line)]
        kind = line['kind']
        if kind in _PART_OF_KIND:
            self.dirty.add(_PART_OF_KIND[kind])
            if kind in ('announcement', 'statuses'):
                self.dirty.add('times')
                self.dirty.add('works')
        elif kind == 'list':
            self.dirty.add(f'list {line["uav"]}')
            self.dirty.add('works')
            self.dirty.add('times')
        elif kind == 'allocation':
            self.new_plans.append(line)
        clocks = self.run.scale.speedup, self.run.allocators.lead.seconds
        self.run.apply(line)
        # arrivals and windows are other times then
        if (self.run.scale.speedup, self.run.allocators.lead.seconds) != clocks:
            self.dirty |= {'times', *(
                f'list {uav}' for uav, each in self.run.lists.newest.items() if each['tasks'])}

    def updates(self, now: float, ended: bool = False,
                ) -> tuple[dict[str, Any], list[LogEntry], list[LogEntry]]:
        """Changes since the last call.

        Plans are compared here and not on arrival: the statuses of the tasks completed meanwhile
        come on another topic and may arrive later.

        Args:
            now: [unix s].
            ended: the run is over; a UAV that rests and falls silent then is no event.

        Returns:
            Changed parts by name; new entries of the event log; of the plan log.
        """
        plans = [self.plan(line) for line in self.new_plans]
        self.log_silence(now, ended)
        if self.run.forget_silent(now):
            self.dirty.add('uavs')
        waiting = self.run.waiting_plan(now)
        if (self.run.allocators.orders, waiting) != (self.last_orders, self.waiting):
            self.last_orders, self.waiting = dict(self.run.allocators.orders), waiting
            self.dirty.add('orders')
        parts = {name: self.part(name) for name in self.dirty}
        for name, before in self.last.items():  # they rarely change
            if parts.get(name) == before:
                del parts[name]
        self.last.update((name, parts[name]) for name in self.last if name in parts)
        authority = self.part('authority')  # a part of its own: it rarely changes
        if authority != self.last_authority:
            self.last_authority = parts['authority'] = authority
        if (nodes := self.nodes(now, ended)) != self.last_nodes:
            self.last_nodes = parts['nodes'] = nodes
        events = sorted(self.events, key=lambda entry: entry['wall'])
        self.dirty, self.new_plans, self.events = set(), [], []
        return parts, events, plans

    def plan(self, line: Line) -> LogEntry:
        """The log entry of a plan: its changes to the plan before."""
        after = route_lists(line)
        is_first = self.routes is None
        rows = route_changes(self.routes or {}, after, self.run.statuses.completed())
        self.routes = after
        trigger = trigger_text(line['trigger'])
        if rows:
            self.events.append({'wall': line['wall'], 'kind': 'plan', 'text': (
                f'plan {line["revision"]} ({trigger}): {changes_text(rows)}')})
        return {'wall': line['wall'], 'revision': line['revision'], 'trigger': trigger,
                'ms': round(line['solve_ms'], 1), 'fit': line['fit'], 'first': is_first,
                'changes': rows}

    def log_silence(self, now: float, ended: bool) -> None:
        """Log each UAV once when its states stop, and once when they resume."""
        silent = {uav for uav, state in self.run.uavs.items()
                  if now - state['wall'] > self.run.silent_after
                  and not (ended and state['mode'] in _REST_MODES)}
        for names, text in ((silent - self.silent, '{} is silent'),
                            (self.silent - silent, '{} reports again')):
            self.events += [{'wall': now, 'kind': 'fault', 'text': text.format(uav)}
                            for uav in sorted(names)]
        self.silent = silent

    def part(self, name: str) -> Any:
        """One part as page/live.js reads it."""
        run = self.run
        if name == 'origin':  # [deg, deg, m]
            return run.origin and [run.origin.latitude, run.origin.longitude,
                                   run.origin.altitude_amsl]
        if name == 'fence_area':  # [east, north] [m] of its corners
            return [to_decimetres(corner) for corner in run.fence_area]
        if name == 'tasks':  # [east, north, up] [m] by id
            return {task: to_decimetres(row.position) for task, row in run.tasks.items()}
        if name == 'statuses':  # [state, UAV, reason] by id
            return {task: [row.state, row.uav, row.reason]
                    for task, row in run.statuses.known().items()}
        if name == 'times':
            return self.times()
        if name == 'works':
            return self.works()
        if name == 'zones':
            return [encode_zone(zone, JSON_ZONE) for zone in run.zones_now()]
        if name == 'uavs':
            return {uav: self.uav(uav, state) for uav, state in sorted(run.uavs.items())}
        if name == 'authority':
            return {uav: self.authority(uav, state) for uav, state in sorted(run.uavs.items())
                    if state.get('authority') or state.get('reason')}
        if name == 'orders':
            return self.orders()
        return self.list(name.removeprefix('list '))

    def uav(self, uav: str, state: Line) -> LogEntry:
        """One UAV; `wall`: [unix s] of its last state, `health`: what is wrong.

        `speed` [m/s] and `course` [deg from north] over ground, `course` only of a UAV that moves;
        `home`: [m], its height.
        """
        battery, home = state['battery'], state.get('home', (None,))[-1]
        return {'wall': round(state['wall'], 1), 'position': to_decimetres(state['position']),
                **motion(state['velocity']), 'home': home and round(home, 1),
                'mode': state['mode'], 'mission': state['mission_state'],
                'fence': state.get('fence', 'OFF'),
                'active': state['active'], 'revision': state['list_revision'],
                'battery': None if battery is None else round(battery, 3),
                'low': self.run.is_low(battery),
                'range': state['range_remaining'] and round(state['range_remaining']),
                'available': state['available'], 'health': self.run.trouble(uav)}

    def authority(self, uav: str, state: Line) -> LogEntry:
        """Authority over a UAV: `state`, `since` [unix s], `why`, and what gives it `back`.

        `reason`: why the UAV is not available.
        """
        name, reported = state.get('authority', ''), self.run.bridges.authority.get(uav)
        known = {'state': name, 'reason': state.get('reason', '')}
        if reported is None or reported.state != name:  # the diagnostics arrive later
            return {**known, 'why': '', 'since': None, 'back': ''}
        return {**known, 'why': reported.reason, 'back': reported.given_back_by,
                'since': None if reported.since is None else round(reported.since)}

    def nodes(self, now: float, ended: bool) -> LogEntry:
        """Since when no allocator (`silent`) or bridge reports [unix s], and warnings of no UAV.

        Args:
            now, ended: see `updates`.
        """
        run = self.run
        since = None if ended else run.allocators.silent_since(now, run.scale.second)
        return {'silent': since and round(since, 1),
                'bridges': {} if ended else run.bridges.silent(now, run.scale.second),
                'warnings': run.bridges.other_warnings(run.uavs, now, run.scale.second)}

    def orders(self) -> LogEntry:
        """Orders in force, [id, text]; and the plan that waits for an operator, None for none."""
        plan = self.waiting
        proposal = plan and {
            'revision': plan['revision'], 'trigger': plan['trigger'],
            'deadline': round(plan['deadline'] + self.run.allocators.lead.seconds),
            'accepted': plan['accepted'], 'changes': plan['changes']}
        orders = self.run.allocators.orders.values()
        return {'proposal': proposal,
                'orders': [[name, text] for each in orders for name, text in each.items()]}

    def list(self, uav: str) -> LogEntry:
        """The remaining tasks of a UAV; `at`: expected arrival [unix s].

        `waits`: points to where it waits for tasks.
        """
        line, speedup = self.run.lists.newest[uav], self.run.scale.speedup
        planned_at = self.run.planned_at(line)
        waits = [to_decimetres(point) for point in line.get('waits', ())]
        return {'revision': line['revision'], **({'waits': waits} if waits else {}), 'tasks': [
            {'id': row['id'], 'via': [to_decimetres(point) for point in row['via']],
             'at': round(planned_at + row['eta'] / speedup, 1) if 'eta' in row else None,
             **({'way': [to_decimetres(point) for point in row['way']]} if 'way' in row else {}),
             **_span('service', self.run.service(line, row))}
            for row in line['tasks']]}

    def works(self) -> LogEntry:
        """What is no point, by task: `kind`, `path`, `holes`, `radius` [m]; its pieces.

        `strips`: the ways of its completed pieces [m]; `done` of `pieces` are completed, so many
        `by` each UAV.
        """
        run, found = self.run, dict[str, LogEntry]()
        for name, task in run.tasks.items():
            if not task.work:
                continue
            status = run.statuses.last(name)
            found[name] = {
                'kind': task.work, 'path': [to_decimetres(point) for point in task.path],
                'holes': [[to_decimetres(point) for point in hole] for hole in task.holes],
                'radius': task.radius, 'done': status.done if status else 0,
                'pieces': status.pieces if status else 0, 'strips': [], 'by': {}}
        for piece, status in run.statuses.known_pieces().items():
            whole, _ = split_piece(piece)
            if status.state == 'COMPLETED' and whole in found:
                by = found[whole]['by']
                by[status.uav] = by.get(status.uav, 0) + 1
                way = run.lists.ways.get(piece)
                if way is not None:
                    found[whole]['strips'].append([to_decimetres(point) for point in way])
        return found

    def times(self) -> LogEntry:
        """By task: `window` and `planned` service [unix s], of completed ones also `flown`.

        `planned` and `flown` have the UAV before their two times.
        """
        run, times = self.run, {}
        flown = dict(list(run.flown.items())[-_MOST_TIMES:])
        for name, task in run.tasks.items():
            row = {**_span('planned', run.planned.get(name) if name in flown else None, uav=True),
                   **_span('flown', flown.get(name), uav=True)}
            if task.earliest is not None or task.latest is not None:
                row['window'] = [each and each + run.allocators.lead.seconds
                                 for each in (task.earliest, task.latest)]
            if row:
                times[name] = row
        return times


def _span(name: str, service: Service | None, uav: bool = False) -> LogEntry:
    """Begin and end of a service [unix s] under a name; nothing where it is not known."""
    if service is None:
        return {}
    return {name: [service.uav] * uav + [round(service.begin, 1), round(service.end, 1)]}


def motion(velocity: Any) -> dict[str, float | None]:
    """`speed` [m/s] and `course` [deg from north] over ground of a velocity [m/s] in ENU.

    Both are None where the velocity is not known; the course also of a UAV that stands still.
    """
    east, north, _ = velocity
    if east is None or north is None:
        return {'speed': None, 'course': None}
    speed = math.hypot(east, north)
    course = round(math.degrees(math.atan2(east, north))) % 360
    return {'speed': round(speed, 1), 'course': course if speed >= _LEAST_SPEED else None}


def to_decimetres(point: Any) -> list[float | None]:
    """A point rounded to decimetres [m]."""
    return [None if v is None else round(v, 1) for v in point]
